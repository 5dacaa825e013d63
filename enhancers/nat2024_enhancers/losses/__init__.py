"""Losses that low-light enhancers are trained with, each a function of its own in float tensors.

Images are (N, 3, H, W) in RGB, 0..1. All functions are differentiable, give a scalar, and carry no
outer weight unless they say so. Import them from their modules; these need PyTorch.
"""
