"""HiFT of Cao et al., ICCV 2021, and the parts of it that LPAT shares."""
