"""What can go wrong in a takeoff: products that wrap (`wrapping`), and flights that go astray (`flights`)."""
