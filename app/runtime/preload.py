"""Imports for the fork server (`app.processes`): what a flight and a proposal need."""

import app.flights.flight_process  # noqa: F401
import app.flights.vehicle_process
from app.campaigns.computation import warm_up

warm_up()
