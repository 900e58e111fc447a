"""Gainline: tune a vehicle's controller gains in a handful of flights."""

__version__ = "0.1.0"
