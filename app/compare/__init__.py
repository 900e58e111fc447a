"""Flights of any campaigns side by side."""
