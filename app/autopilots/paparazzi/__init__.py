"""Paparazzi."""
