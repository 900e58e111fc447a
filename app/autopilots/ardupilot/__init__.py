"""ArduCopter."""
