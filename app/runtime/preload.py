"""Imports for the fork server (`app.processes`): what a flight and a proposal need."""

import app.flights.flight_loop  # noqa: F401
from app.campaigns.computation import warm_up

warm_up()
