"""How the benchmarks take times: relative to other work on the same machine."""
