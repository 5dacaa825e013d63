"""NanoTrack of HonglinChu (SiamTrackers), versions 1, 2 and 3."""
