"""LIME: divides an image by its refined and gamma-corrected illumination (TIP 2017)."""
