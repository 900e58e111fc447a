"""Random multicopters under ArduCopter's loop, with more physics than the model that is fitted to their logs."""
