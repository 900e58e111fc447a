"""What the simulated counterparts of autopilots share: the body that they fly, and a copter of MAVLink 2."""
