"""The copter under PX4's loop: what the loop makes of its physics, step by step."""

import numpy as np
import pytest

from app.autopilots.px4.experiments import Px4Loop
from app.autopilots.px4.replica.parameters import STEP_S, Parameters
from app.core.analysis.loop import Run
from app.core.models.copter import DISTURBANCES, FLOWN, GRAVITY_M_S2, REFERENCE, Copter
from app.core.records.trajectory import Samples

COPTER = Copter(hover_throttle=0.4, thrust_slope=1.2, motor_lag_s=0.05, drag_1_s=0.3)
LOOP = Px4Loop(parameters=Parameters(), step_s=STEP_S, row_s=12 * STEP_S, descent_m_s=1.5)


def flown(
    seconds: float, *, push_m_s2: float = 0.0, altitude_m: float = 0.0, feed_forward_m_s2: float = 0.0
) -> Samples:
    """Flight from hover at 0 m with a set-point at `altitude_m`, shape (n, 6)."""
    steps = round(seconds / STEP_S)
    reference, disturbances = np.zeros((steps, len(REFERENCE))), np.zeros((steps, len(DISTURBANCES)))
    reference[:] = altitude_m, 0.0, feed_forward_m_s2, COPTER.hover_throttle
    disturbances[:, 0] = push_m_s2
    return LOOP.fly(
        Run(
            copter=LOOP.packed(COPTER),
            reference=reference,
            disturbances=disturbances,
            start=(COPTER.hover_throttle, 0.0, 0.0, 0.0),
        )
    )


def column(found: Samples, name: str) -> Samples:
    return np.asarray(found[:, FLOWN.index(name)])


def test_it_rests_in_hover() -> None:
    found = flown(2.0)
    assert np.abs(found[:, :3]).max() < 1e-6
    assert column(found, "throttle") == pytest.approx(0.4)


def test_a_lasting_disturbance_is_compensated_by_the_throttle_that_it_takes() -> None:
    found = flown(20.0, push_m_s2=-1.0)
    assert column(found, "z_m")[-1] == pytest.approx(0.0, abs=1e-3)
    needed = 0.4 * (1.0 + 1.0 / GRAVITY_M_S2) ** (1.0 / 1.2)
    assert column(found, "throttle_filtered")[-1] == pytest.approx(needed, rel=1e-3)


def test_a_step_downward_is_limited_to_the_modes_speed() -> None:
    descent = column(flown(2.0, altitude_m=-5.0), "v_m_s")
    assert descent.min() == pytest.approx(-1.5, abs=0.1)
    assert descent[-1] == pytest.approx(-1.5, abs=0.05)


def test_a_fed_forward_acceleration_pushes_as_a_force_would() -> None:
    """The altitude is held after the integral has taken it over, 1 m/s² of the throttle all the time."""
    found = flown(12.0, feed_forward_m_s2=1.0)
    assert column(found, "z_m").max() > 0.05
    assert column(found, "z_m")[-1] == pytest.approx(0.0, abs=5e-3)


def test_what_the_reference_alone_commands_is_no_activity() -> None:
    """The kick of a step upward is none, what a push makes of the throttle is some."""
    quiet, pushed = flown(3.0, altitude_m=1.0), flown(3.0, push_m_s2=-1.0, altitude_m=1.0)
    activity = [np.std(column(found, "throttle") - column(found, "throttle_slow")) for found in (quiet, pushed)]
    assert activity[0] < 1e-9
    assert activity[1] > 1e-3
