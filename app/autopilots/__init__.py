"""What the program knows of each autopilot, one folder each, and what any flight left behind as one `Recording`."""
