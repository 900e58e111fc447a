"""Experiments: a manoeuvre with its gains, its score, and the model of its vehicle if there is one."""
