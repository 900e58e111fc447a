"""What the log of a flight tells about a vehicle's altitude control, and the gains that follow from it."""
