"""Hazards of a takeoff: products that wrap (`wrapping`), and simulated flights that go wrong (`flights`)."""
