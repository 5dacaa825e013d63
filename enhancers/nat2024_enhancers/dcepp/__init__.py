"""DCE++: lights an image up by curves whose parameters a small network estimates (TPAMI 2021)."""
