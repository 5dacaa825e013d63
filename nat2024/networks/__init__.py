"""What networks of all kinds share at inference: sizes, bands of rows, folded layers.

Modules here import torch when they are imported; plugins import them from their `model.py`, which
is imported when a network is built.
"""
