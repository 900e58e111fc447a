"""ArduPilot and PX4: the autopilots of MAVLink 2, which share its services and differ in data and manners."""
