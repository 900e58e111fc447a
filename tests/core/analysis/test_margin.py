"""Damping and margin, against vehicles that are known to ring, and against the decay of a simulated oscillation."""

from dataclasses import replace

import numpy as np
import pytest

from app.autopilots.ardupilot.experiments import ArduPilotLoop
from app.autopilots.ardupilot.replica import vertical as loop
from app.autopilots.ardupilot.replica.parameters import Parameters
from app.core.analysis.margin import (
    EXTRA_LAG_S,
    LARGEST_MARGIN,
    REQUIRED_MARGIN,
    RINGING_DAMPING,
    damping_within_margin,
    gain_margin,
    least_damping,
)
from app.core.models.copter import DISTURBANCES, FLOWN, REFERENCE, Copter, start_body
from app.core.records.trajectory import Samples
from bench.copters.simulation import loop_of
from tests.core.analysis.flights import with_gains_of
from tests.core.tuning.flying import compiled_only

pytestmark = compiled_only

RACER = Copter(hover_throttle=0.118, motor_lag_s=0.0, drag_1_s=0.18)
STOCK = Copter(hover_throttle=0.365, motor_lag_s=0.0, drag_1_s=0.3)
LIGHT = Copter(hover_throttle=0.19, motor_lag_s=0.0, drag_1_s=0.42)
OVERPOWERED = Copter(hover_throttle=0.14, motor_lag_s=0.04, drag_1_s=0.3)
SLOW = Copter(hover_throttle=0.28, motor_lag_s=0.13, drag_1_s=0.3)


def flown_with(copter: Copter, gains: tuple[float, float, float, float]) -> ArduPilotLoop:
    return loop_of(with_gains_of(Parameters(hover_throttle=copter.hover_throttle), *gains))


def damping(copter: Copter, gains: tuple[float, float, float, float]) -> float:
    return least_damping(flown_with(copter, gains), copter)


@pytest.mark.parametrize(
    ("copter", "gains"),
    [
        (RACER, (1.0, 5.0, 1.5, 3.0)),
        (RACER, (2.0, 7.0, 1.0, 2.0)),
        (RACER, (3.0, 8.0, 1.5, 3.0)),
        (LIGHT, (3.0, 8.0, 1.5, 3.0)),
        (OVERPOWERED, (1.0, 5.0, 1.5, 3.0)),
        (OVERPOWERED, (3.0, 8.0, 1.5, 3.0)),
        (SLOW, (3.0, 8.0, 0.5, 3.0)),
    ],
)
def test_what_rang_in_flight_rings(copter: Copter, gains: tuple[float, float, float, float]) -> None:
    """Flown with the real binary or its source: the racer at 322, 45 and 69 mm, the light vehicle with 30 times the
    throttle activity, the overpowered at 90 and 21 mm, the slow motors at 48 mm."""
    assert damping(copter, gains) < RINGING_DAMPING


@pytest.mark.parametrize(
    ("copter", "gains"),
    [
        (STOCK, (1.0, 5.0, 1.5, 3.0)),
        (STOCK, (3.0, 8.0, 1.5, 3.0)),
        (RACER, (1.0, 5.0, 0.5, 1.0)),
        (RACER, (3.0, 8.0, 0.5, 3.0)),
        (LIGHT, (2.0, 7.0, 1.0, 2.0)),
        (SLOW, (2.0, 7.0, 1.0, 2.0)),
        (SLOW, (3.0, 8.0, 1.5, 3.0)),
    ],
)
def test_what_flew_well_does_not(copter: Copter, gains: tuple[float, float, float, float]) -> None:
    assert damping(copter, gains) >= RINGING_DAMPING


def test_the_damping_is_that_of_an_oscillation_as_it_dies_away() -> None:
    """The racer with 1.3 times the default gains of the acceleration, pushed: peaks of its acceleration above 5 Hz."""
    gains = flown_with(RACER, (1.0, 5.0, 0.65, 1.3))
    packed = loop.packed(gains.parameters)
    copter = gains.packed(RACER)
    state, flown = np.empty(loop.STATE_SIZE), np.empty((800, len(FLOWN)))
    loop.start_hover(state, packed, RACER.hover_throttle, 0.0, 0.0, 0.0)
    body = start_body(RACER.hover_throttle, 0.0, 0.0, 0.0, copter)
    disturbances = np.zeros((800, len(DISTURBANCES)))
    disturbances[:5, 0] = 0.01
    loop.fly(state, body, packed, copter, np.zeros((800, len(REFERENCE))), disturbances, flown)
    fast = np.diff(flown[:, FLOWN.index("a_m_s2")])[40:400]
    peaks = np.flatnonzero((fast[1:-1] > fast[:-2]) & (fast[1:-1] > fast[2:]) & (fast[1:-1] > 1e-9)) + 1
    heights = fast[peaks][:6]
    decrement = np.log(heights[:-1] / heights[1:]).mean()
    seen = decrement / np.hypot(2.0 * np.pi, decrement)
    assert least_damping(gains, RACER) == pytest.approx(seen, rel=0.1)


class Alternating:
    """A loop whose state changes its sign from step to step."""

    texts = ArduPilotLoop.texts
    step_s = 0.02

    def with_fast_gains(self, factor: float) -> "Alternating":
        return self

    def transition(self, vehicle: Copter, *, late_s: float = 0.0) -> Samples:
        return np.diag([-0.5, 0.9])


def test_a_state_that_changes_its_sign_in_every_step_oscillates() -> None:
    """ln(−½) = −0.693 + π i: a damping ratio of 0.693/|…|."""
    assert least_damping(Alternating(), STOCK) == pytest.approx(0.2154, abs=1e-4)


def test_at_the_margin_the_loop_with_more_lag_just_begins_to_ring() -> None:
    gains = flown_with(STOCK, (2.0, 7.0, 1.0, 2.0))
    margin = gain_margin(gains, STOCK)
    assert 1.0 < margin < REQUIRED_MARGIN
    late = replace(STOCK, motor_lag_s=EXTRA_LAG_S)
    scaled = gains.with_gains({"PSC_ACCZ_P": margin * 1.0, "PSC_ACCZ_I": margin * 2.0})
    assert least_damping(scaled, late) == pytest.approx(RINGING_DAMPING, abs=0.005)


def test_a_loop_that_rings_with_more_lag_has_no_margin() -> None:
    gains = flown_with(RACER, (2.0, 7.0, 1.0, 2.0))
    assert gain_margin(gains, RACER) == 0.0


def test_a_margin_ends_at_the_largest() -> None:
    gains = flown_with(STOCK, (1.0, 5.0, 0.15, 0.2))
    assert gain_margin(gains, STOCK) == LARGEST_MARGIN


def test_less_gain_counts_too() -> None:
    """A slow heavy vehicle with six times as much integral as proportional gain: it swings more when the gain falls."""
    heavy = Copter(hover_throttle=0.58, motor_lag_s=0.05, drag_1_s=0.3)
    gains = flown_with(heavy, (3.0, 8.0, 0.5, 3.0))
    within = damping_within_margin(gains, heavy)
    late = replace(heavy, motor_lag_s=heavy.motor_lag_s + EXTRA_LAG_S)
    assert within < least_damping(gains, late)
