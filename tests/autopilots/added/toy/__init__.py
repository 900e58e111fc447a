"""An autopilot that only the tests have: docs say that it takes one folder and one line."""
