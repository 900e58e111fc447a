"""Live link between the worker, which flies, and the web process, which shows and aborts. It never waits for
storage."""
