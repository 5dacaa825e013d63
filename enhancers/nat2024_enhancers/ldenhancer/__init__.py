"""LDEnhancer: lights an image up by suppressing its light distribution (IROS 2024)."""
