"""The two programs, web process and worker, and what starts and serves them."""
