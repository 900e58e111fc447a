"""Statistics of flights: comparison of gain sets, and drift."""
