"""Ground side of vehicles with MAVLink autopilots."""
