"""The tracking loop that all Siamese trackers of the pysot family share.

A tracker is a network, a decoder and constants; crop, enhance, network, decode, penalise and
update are separate steps without hidden state. `state` holds what is carried from frame to frame,
`crops` cuts out what the network sees, `selection` turns decoded maps into the next box, and
`tracker` strings them together.

Source: Li et al., "SiamRPN++: Evolution of Siamese Visual Tracking with Very Deep Networks",
CVPR 2019, and its code STVIR/pysot (Apache-2.0); SiamAPN, SiamAPN++, HiFT, LPAT and NanoTrack
keep the same loop.
"""
