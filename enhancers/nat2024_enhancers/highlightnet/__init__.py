"""HighlightNet: raises the brightness of each pixel to an estimated power (IROS 2022)."""
