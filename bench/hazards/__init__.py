"""Trials with injected faults or a hostile link: the cases, the test rig, and the checks of what happened."""
