import numpy as np
import pytest

from app.core.definition import Definition
from app.core.records.trajectory import Trajectory
from app.core.tuning.corrected_model import correct_in_loop
from app.core.tuning.strategies.gradient import propose
from tests.core.tuning.defined import evidence
from tests.core.tuning.flying import TAKEOFF, TWIN, compiled_only, fly

DEFAULT = {"kp": 283, "ki": 13, "kd": 82}
LATE = (*TWIN[:1], 0.25, *TWIN[2:])
"""The twin with a latency of a whole number of steps, so that no step is split."""


def test_the_model_with_a_flights_disturbances_inside_flies_that_flight_again() -> None:
    """The flight's hover throttle, motor lag and late start are not in the model; single precision leaves 0.1 mm."""
    flight = fly(1, DEFAULT, LATE)
    inside = correct_in_loop(TAKEOFF, flight)
    assert inside is not None
    gains = TAKEOFF.space.vector(DEFAULT)[np.newaxis]
    assert inside.outputs(gains)[0] == pytest.approx(flight.trajectory["altitude_m"], abs=1e-3)
    assert inside.errors(gains)[0] == pytest.approx(flight.error, abs=1e-4)


def test_until_the_flights_first_thrust_nothing_moves() -> None:
    inside = correct_in_loop(TAKEOFF, fly(1, DEFAULT, LATE))
    assert inside is not None
    outputs = inside.outputs(np.array([[1600.0, 1023.0, 127.0]]))[0]
    assert not outputs[:128].any()
    assert outputs[512] > 0.0


@compiled_only
def test_the_gradient_corrects_inside_where_it_is_asked_to_and_can() -> None:
    flight = fly(1, DEFAULT)
    proposal = propose(evidence(Definition(options={"bias": "inside"}), TAKEOFF, [flight]))
    assert proposal.kind == "step"
    assert any("inside the control loop" in note for note in proposal.explanation.notes)


@compiled_only
def test_without_the_thrust_command_the_correction_stays_outside_and_says_so() -> None:
    flight = fly(1, DEFAULT)
    bare = Trajectory(flight.trajectory.time_s, {"altitude_m": flight.trajectory["altitude_m"]}, "csv", "vehicle")
    recorded = type(flight)(number=1, gains=flight.gains, trajectory=bare, error=flight.error, outcome="valid")
    inside = propose(evidence(Definition(options={"bias": "inside"}), TAKEOFF, [recorded]))
    outside = propose(evidence(Definition(), TAKEOFF, [recorded]))
    assert inside.gains == outside.gains
    assert any("inside is impossible because flight 1 was recorded without" in n for n in inside.explanation.notes)
