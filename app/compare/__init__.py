"""Comparison of flights of any campaigns."""
