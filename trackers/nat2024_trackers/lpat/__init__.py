"""LPAT of Fu et al., arXiv 2208.00662 (2022)."""
