"""The parts of bench/faults.py: what befalls a trial, the wire between both sides, what is asked for then."""
