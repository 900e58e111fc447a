"""Campaigns flown on the simple model with other parameters as the true vehicle."""

from collections.abc import Sequence

import numpy as np
import pytest
from numba import config

from app.core.definition import Definition, Flight
from app.core.experiments.takeoff import Takeoff
from app.core.policy import Gains
from app.core.tuning.stop_rules import decide_stop
from app.core.tuning.strategy import Proposal
from tests.core.tuning.defined import next_proposal

TAKEOFF = Takeoff()

compiled_only = pytest.mark.skipif(
    bool(vars(config)["DISABLE_JIT"]), reason="flies for minutes; the kernels have their own tests uncompiled"
)
ARDRONE = (0.6315, 0.0, 0.0, 0.02, 0.0, 0.0, 0.0, 0.0)
"""Model close to the simulated AR.Drone: its errors are within 4 % at every gain set of the paper's Table 1."""
TWIN = (0.61, 0.3, 0.05, 0.0, 0.0, 0.0, 0.0, 0.0)
"""The twin of the paper's real flights, without scatter."""


def fly(number: int, gains: Gains, model: Sequence[float] = TWIN) -> Flight:
    """A flight of the simple model with `model` as its parameters, as the database keeps it."""
    trajectory = TAKEOFF.simulate(TAKEOFF.space.vector(gains), np.array(model)).as_stored()
    return Flight(
        number=number, gains=dict(gains), trajectory=trajectory, error=TAKEOFF.error(trajectory), outcome="valid"
    )


def campaign(definition: Definition, model: Sequence[float] = TWIN) -> tuple[list[Flight], list[Proposal]]:
    """Fly every proposal until the stop rule ends it; the last proposal is the one that was not flown."""
    flights: list[Flight] = []
    proposals = [next_proposal(definition, flights)]
    while not decide_stop(definition.stop, [flight.error for flight in flights], proposals[-1].kind).stop:
        flights.append(fly(len(flights) + 1, proposals[-1].gains, model))
        proposals.append(next_proposal(definition, flights))
    return flights, proposals


def errors(flights: Sequence[Flight]) -> list[float]:
    return [flight.error for flight in flights if flight.error is not None]
