"""A simulated drone that answers MAVLink as real autopilots do: what a ground station can be tried against.

It is an independent reading of how the autopilots behave, and shares nothing with the ground side but addresses,
transports, clocks and dialects.
"""
