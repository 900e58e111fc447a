"""Imported by the server that processes are forked from (`app.processes`): what a flight and a proposal need, loaded
and, as far as it is compiled, compiled."""

import app.fleet.seat
import app.studies.reproductions
import app.trials.cockpit  # noqa: F401
from app.campaigns.tasks import prepare

prepare()
