"""ArduCopter's altitude control, replicated: pure numerics, which import the core alone."""
