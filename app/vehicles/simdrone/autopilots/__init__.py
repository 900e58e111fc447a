"""The autopilots a simulated drone can have."""
