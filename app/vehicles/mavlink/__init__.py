"""Vehicles that speak MAVLink: the ground side."""
