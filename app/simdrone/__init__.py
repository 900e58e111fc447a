"""Simulated drones that behave like real autopilots over MAVLink, for tests of ground stations.

They are an independent implementation of the autopilots' behaviour, and share with the ground side only addresses,
transports, clocks and dialects.
"""
