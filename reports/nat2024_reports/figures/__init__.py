"""Figures: tables and arrays in, figures out; nothing is computed, and saving is apart."""
