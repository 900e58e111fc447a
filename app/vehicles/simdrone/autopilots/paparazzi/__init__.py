"""Paparazzi, as it answers on the wire: MAVLink 1, its settings, its flight plan, its telemetry."""
