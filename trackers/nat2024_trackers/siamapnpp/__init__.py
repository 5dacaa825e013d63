"""SiamAPN++ of Cao et al., IROS 2021."""
