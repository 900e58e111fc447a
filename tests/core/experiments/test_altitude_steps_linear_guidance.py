"""The linear model of Paparazzi's loop about hover, and its margin."""

import numpy as np
import pytest

from app.core.analysis.margin import RINGING_DAMPING, damping_within_margin, gain_margin, least_damping
from app.core.experiments.altitude_steps import LinearGuidance
from bench.copters.paparazzi_simulation import SteppedVehicle
from bench.copters.paparazzi_simulation import least_damping as least_damping_in_steps

DEFAULT, LARGEST, MIDDLE = (283.0, 13.0, 82.0), (4000.0, 1073.0, 409.0), (1600.0, 1073.0, 127.0)


def model(lag_s: float, delay_s: float, share: float) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.array([0.6, 0.2, lag_s, 0.2, share, 0.0, delay_s, 0.0])


@pytest.mark.parametrize("gains", [LARGEST, MIDDLE])
@pytest.mark.parametrize(("lag_s", "delay_s", "share"), [(0.05, 0.02, 0.5), (0.1, 0.04, 1.0)])
@pytest.mark.parametrize(("factor", "late_s"), [(1.0, 0.0), (2.0, 0.03)])
def test_the_damping_is_that_of_the_loop_step_by_step(
    gains: tuple[float, float, float], lag_s: float, delay_s: float, share: float, factor: float, late_s: float
) -> None:
    """Against a model written apart, with every step of the dead time in its state; where both are well damped, their
    fast modes differ, which no margin asks for."""
    vehicle = SteppedVehicle(
        hover_throttle=0.6,
        quadratic=share,
        motor_lag_s=lag_s,
        second_lag_s=0.0,
        dead_time_s=delay_s,
        latency_s=0.2,
        drag_1_s=0.2,
        drag_1_m=0.0,
        sag=0.0,
        gust_m_s2=0.0,
        noise_m=0.0,
        noise_m_s=0.0,
    )
    named = dict(zip(("kp", "ki", "kd"), gains, strict=True))
    in_steps = least_damping_in_steps(vehicle, named, factor=factor, late_s=late_s)
    found = least_damping(
        LinearGuidance(np.array(gains)).with_fast_gains(factor), model(lag_s, delay_s, share), late_s=late_s
    )
    assert min(found, 0.3) == pytest.approx(min(in_steps, 0.3), abs=0.02)


def test_the_defaults_have_the_margin_everywhere_and_the_largest_gains_on_fast_motors_only() -> None:
    """The real firmware flew the largest gains in its own simulation, whose motors have no lag, without ringing."""
    fast, slow = model(0.0, 0.0, 0.0), model(0.1, 0.04, 1.0)
    assert all(gain_margin(LinearGuidance(np.array(DEFAULT)), each) > 4.0 for each in (fast, slow))
    assert gain_margin(LinearGuidance(np.array(LARGEST)), fast) > 2.0
    assert damping_within_margin(LinearGuidance(np.array(LARGEST)), slow) < RINGING_DAMPING
