"""Parts of bench/flights_to_target.py: the vehicles' flights, the methods compared, and the report."""
