"""Two logs of one vehicle: whose gains are better, on simulated vehicles whose further flights are the truth."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from app.autopilots.ardupilot.experiments import ArduPilotLoop
from app.autopilots.px4.experiments import Px4Loop
from app.core.analysis.loop import LoggedFlight
from app.core.analysis.vehicle_fit import fit_copter
from app.core.experiments.takeoff import Takeoff
from app.core.reasons import Reason, ReasonCode
from app.core.statistics.comparisons import Comparison
from app.core.statistics.gain_change import (
    Basis,
    FlownLog,
    GainChange,
    ScoredTakeoff,
    compare_logs,
    compare_takeoffs,
    has_same_gains,
)
from bench.copters.simulation import SimulatedCopter
from tests.core.analysis.flights import GUSTY, simulated_flight
from tests.core.analysis.px4_flights import simulated_px4
from tests.core.tuning.flying import compiled_only

WINDY = replace(GUSTY, gust_m_s2=0.5)
BETTER = {"acceleration_p": 0.8, "acceleration_i_1_s": 1.6, "position_p_1_s": 2.0}


def log_of(flight: LoggedFlight) -> FlownLog:
    return FlownLog(error_m=flight.error_m, flight=flight, copters=fit_copter(flight).draws)


@cache
def flown(copter: SimulatedCopter = GUSTY, *, seed: int = 1, **gains: float) -> FlownLog:
    return log_of(simulated_flight(copter, seed=seed, **gains))


@compiled_only
def test_better_gains_of_a_windy_noon_are_better() -> None:
    """Although they deviated more than the gains of the calm morning; the difference is that of further flights."""
    change = compare_logs(flown(seed=1), flown(WINDY, seed=2, **BETTER))
    assert change.comparison is not None
    assert (change.basis, change.verdict) == (Basis.MODELS, "better")
    both = [
        [simulated_flight(copter, seed=seed, **gains).error_m for copter in (GUSTY, WINDY) for seed in range(10, 18)]
        for gains in ({}, BETTER)
    ]
    assert change.by_gains_m == pytest.approx(np.mean(both[1]) - np.mean(both[0]), rel=0.15)
    assert change.by_weather_m is not None
    assert change.by_weather_m > 0.0
    assert change.by_manoeuvre_m == pytest.approx(0.0, abs=0.003)


@compiled_only
def test_the_other_order_is_the_opposite() -> None:
    earlier, later = flown(seed=1), flown(WINDY, seed=2, **BETTER)
    one, other = compare_logs(earlier, later), compare_logs(later, earlier)
    assert other.verdict == "worse"
    assert one.comparison is not None
    assert other.comparison is not None
    assert other.comparison.difference == pytest.approx(-one.comparison.difference)
    assert other.comparison.confidence == pytest.approx(one.comparison.confidence)


@compiled_only
def test_gains_that_hardly_differ_are_unresolved_in_any_weather() -> None:
    assert compare_logs(flown(seed=1), flown(WINDY, seed=2, acceleration_p=0.51)).verdict == "unresolved"


@compiled_only
def test_another_manoeuvre_is_no_gain() -> None:
    """Steps of offboard control deviate by far more than the smooth changes of an auto mode."""
    smooth, steps = (
        log_of(simulated_px4(manoeuvre="auto")),
        log_of(simulated_px4(manoeuvre="offboard", seed=2, position_p_1_s=1.3)),
    )
    change = compare_logs(smooth, steps)
    assert change.verdict == "better"
    assert change.measured_m is not None
    assert change.measured_m > 0.05
    assert change.by_manoeuvre_m == pytest.approx(change.measured_m, rel=0.4)
    assert not change.is_contradicted


@compiled_only
def test_the_same_gains_have_no_verdict() -> None:
    change = compare_logs(flown(seed=1), flown(WINDY, seed=2))
    assert (change.basis, change.verdict, change.comparison) == (Basis.SAME_GAINS, None, None)
    assert change.measured_m is not None
    assert change.measured_m > 0.0
    assert (change.by_gains_m, change.by_weather_m, change.is_contradicted) == (None, None, False)


def test_another_hover_throttle_is_not_another_gain_but_a_filter_is() -> None:
    loop = simulated_flight().loop
    assert has_same_gains(loop, loop.with_hover(0.5))
    assert not has_same_gains(loop, loop.with_gains({"PSC_ACCZ_FLTE": 10.0}))


def test_an_update_of_the_firmware_is_not_another_gain() -> None:
    """Release 4.7 has other names for the gains, and those of the acceleration in another unit."""
    loop = simulated_flight().loop
    assert isinstance(loop, ArduPilotLoop)
    newer = replace(loop, names={"PSC_ACCZ_P": ("PSC_D_ACC_P", 0.1)})
    assert has_same_gains(loop, newer)
    assert not has_same_gains(loop, newer.with_gains({"PSC_ACCZ_P": 0.6}))


@compiled_only
def test_gains_of_thrusts_are_the_same_whatever_the_vehicle_weighed() -> None:
    loop = simulated_px4().loop
    assert isinstance(loop, Px4Loop)
    light = replace(loop, thrust_gains_at=0.4)
    heavy = replace(light.with_gains({"MPC_Z_VEL_P_ACC": 3.2, "MPC_Z_VEL_I_ACC": 1.6}), thrust_gains_at=0.5)
    assert has_same_gains(light, heavy)
    assert not has_same_gains(light, replace(light, thrust_gains_at=0.5))


@compiled_only
def test_without_both_models_only_the_errors_are_known() -> None:
    known = flown(seed=1)
    assert known.flight is not None
    lacks = replace(known.flight, lacks=Reason(code=ReasonCode.FEED_FORWARD_UNKNOWN))
    faster = lacks.loop.with_gains({"PSC_POSZ_P": 2.0})
    for other in (
        FlownLog(error_m=0.5),
        replace(known, error_m=0.5, flight=simulated_px4()),
        replace(known, error_m=0.5, flight=replace(lacks, loop=faster)),
    ):
        change = compare_logs(known, other)
        assert (change.basis, change.verdict) == (Basis.NOT_COMPARABLE, "not known yet")
        assert change.measured_m == pytest.approx(0.5 - known.flight.error_m)
    assert compare_logs(known, FlownLog(error_m=None)).measured_m is None


@pytest.mark.parametrize(
    ("measured_m", "is_contradicted"), [(-0.02, False), (-0.001, False), (0.001, False), (0.02, True)]
)
def test_flights_that_went_the_other_way_beyond_their_scatter_contradict(
    measured_m: float, is_contradicted: bool
) -> None:
    better = Comparison(verdict="better", confidence=0.95, difference=-0.01, standard_error=0.008, further=None)
    change = GainChange(basis=Basis.MODELS, comparison=better, measured_m=measured_m, by_manoeuvre_m=0.0)
    assert change.is_contradicted == is_contradicted
    assert not replace(change, by_manoeuvre_m=0.02).is_contradicted
    assert not replace(change, comparison=replace(better, verdict="unresolved")).is_contradicted


SLOW, FAST = {"kp": 283.0, "ki": 13.0, "kd": 82.0}, {"kp": 1624.0, "ki": 1356.0, "kd": 195.0}


def takeoffs(*flown: tuple[dict[str, float], float]) -> list[ScoredTakeoff]:
    return [ScoredTakeoff(gains=gains, error_m=error_m) for gains, error_m in flown]


def test_takeoffs_with_the_same_gains_are_repeats() -> None:
    earlier = takeoffs((SLOW, 0.31), (SLOW, 0.29))
    change = compare_takeoffs(earlier, takeoffs((FAST, 0.1)))
    assert (change.basis, change.verdict) == (Basis.TAKEOFFS, "better")
    assert change.comparison is not None
    assert change.comparison.difference == pytest.approx(-0.2)
    assert change.measured_m == pytest.approx(0.1 - 0.29)
    prior = Takeoff(window_s=10.0).scatter
    sigma = np.sqrt((prior.degrees_of_freedom * prior.sd**2 + 2 * 0.01**2) / (prior.degrees_of_freedom + 1))
    assert change.comparison.standard_error == pytest.approx(sigma * np.sqrt(1.5))
    assert (change.by_gains_m, change.is_contradicted) == (None, False)


def test_takeoffs_that_end_with_the_same_gains_have_no_verdict() -> None:
    change = compare_takeoffs(takeoffs((FAST, 0.1), (SLOW, 0.3)), takeoffs((SLOW, 0.35)))
    assert (change.basis, change.verdict) == (Basis.SAME_GAINS, None)
    assert change.measured_m == pytest.approx(0.05)
