"""LPAT of Fu et al., IROS 2022."""
