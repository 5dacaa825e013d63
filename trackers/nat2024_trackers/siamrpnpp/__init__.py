"""SiamRPN++ of Li et al., CVPR 2019."""
