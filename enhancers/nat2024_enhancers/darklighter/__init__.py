"""DarkLighter: takes noise away and lights up, step by step, with estimated maps (IROS 2021)."""
