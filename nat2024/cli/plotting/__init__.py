"""Figures of `nat-bench plot`: which there are, and from which tables each is drawn."""
