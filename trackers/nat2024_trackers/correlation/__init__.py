"""Correlation filters: trackers without weights, learned while they track, the same on every run.

`windows` says what part of a frame is looked at, `samples` cuts it out, `fhog` and `features`
describe it, `fourier` holds the transforms, `scale` the one-dimensional filter that finds changes
of size, `tracker` the loop; `mosse`, `kcf` and `fdsst` are the filters themselves.

Sources: Bolme et al., CVPR 2010 (MOSSE); Henriques et al., PAMI 2015 (KCF); Danelljan et al., PAMI
2017 (DSST and fDSST); written from the papers.
"""
