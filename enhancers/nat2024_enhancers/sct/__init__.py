"""SCT: curves from a spatial-channel transformer (RA-L 2022)."""
