"""Altitude from outside the vehicle: motion capture over NatNet, or MAVLink's odometry messages."""
