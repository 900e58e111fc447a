"""The live link between the worker, which flies, and the web process, which shows and aborts: it never waits for
storage."""
