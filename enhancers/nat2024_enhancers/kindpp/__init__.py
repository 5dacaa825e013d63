"""KinD++: restores the reflectance of a dark image and lights it up (IJCV 2021)."""
