"""LLVE (StableLLVE): a U-Net trained to be steady over time (CVPR 2021)."""
