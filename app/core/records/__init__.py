"""Flight records: the trajectory, its alignment, its glitches, and errors computed from it."""
