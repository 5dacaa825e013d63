"""SiamAPN of Fu et al., ICRA 2021."""
