"""RUAS: retinex-inspired unrolling with a searched architecture (CVPR 2021)."""
