"""Altitude from motion capture, over NatNet or as MAVLink odometry messages."""
