"""Recorded flights of the real autopilots, whose simulated vehicles are known: what each log must answer."""

import io
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache

import pytest

from app.autopilots.log_readers import reader_of
from app.core.analysis.analysis import analyze, is_alike
from app.core.analysis.loop import LoggedFlight
from app.core.analysis.prediction import FlightModel
from app.core.analysis.vehicle_fit import fit_copter
from app.core.errors import TrajectoryError
from app.log_library.content import analyze_content
from app.logs.base import HEAD_BYTES
from tests.core.tuning.flying import compiled_only
from tests.logs.recorded import recorded

pytestmark = compiled_only

SITL: Mapping[str, float] = {"hover_throttle": 0.365, "thrust_slope": 1.0, "motor_lag_s": 0.0, "drag_1_s": 0.295}
SIH: Mapping[str, float] = {"hover_throttle": 0.490, "thrust_slope": 1.0, "motor_lag_s": 0.05}
"""The vehicles of both simulations, by a regression of the acceleration in still air, and their own source. The drag of
PX4's is not linear."""
ROUNDING: Mapping[str, float] = {
    "hover_throttle": 0.0005,
    "thrust_slope": 0.01,
    "motor_lag_s": 0.0,
    "drag_1_s": 0.005,
}
"""Of the known values."""
SIDES_OF_90_PERCENT = 1.645


@dataclass(frozen=True)
class RecordedFlight:
    name: str
    vehicle: Mapping[str, float]
    gains: tuple[float, ...]
    error_mm: float


FLIGHTS = (
    RecordedFlight("arducopter_steps.bin", SITL, (1.0, 5.0, 0.5, 1.0), 23.4),
    RecordedFlight("arducopter_guided_wind.bin", SITL, (1.0, 5.0, 0.5, 1.0), 25.6),
    RecordedFlight("arducopter_guided_wind.tlog", SITL, (1.0, 5.0, 0.5, 1.0), 30.1),
    RecordedFlight("px4_steps.ulg", SIH, (1.0, 4.0, 2.0, 0.0), 204.9),
)


@cache
def read(name: str) -> LoggedFlight:
    content = recorded(name)
    reader = reader_of(content[:HEAD_BYTES])
    assert reader is not None
    flight = reader.flight(reader.read(io.BytesIO(content), None), name)
    assert flight is not None
    return flight


@pytest.mark.complete
@pytest.mark.parametrize("flown", FLIGHTS, ids=lambda each: each.name)
def test_the_vehicle_is_the_one_that_flew_and_flies_as_it_did(flown: RecordedFlight) -> None:
    flight = read(flown.name)
    assert tuple(flight.loop.gains.values()) == pytest.approx(flown.gains)
    assert 1e3 * flight.error_m == pytest.approx(flown.error_mm, abs=0.1)
    found = fit_copter(flight)
    for name, value in flown.vehicle.items():
        within = SIDES_OF_90_PERCENT * getattr(found.deviation, name) + ROUNDING[name]
        assert getattr(found.mean, name) == pytest.approx(value, abs=within), name
    modelled_m = FlightModel(flight, [found.mean]).predict(flight.loop).error_m
    assert modelled_m == pytest.approx(flight.error_m, rel=0.06)
    assert is_alike(flight.error_m, modelled_m)


@pytest.mark.parametrize("name", ["arducopter_guided_wind.bin", "arducopter_guided_wind.tlog"])
@pytest.mark.parametrize("factor", [2.0, pytest.param(0.6, marks=pytest.mark.complete)])
def test_other_gains_than_those_in_the_log_are_refused_in_wind(name: str, factor: float) -> None:
    flight = read(name)
    turned = flight.loop.with_gains({"PSC_ACCZ_P": 0.5 * factor, "PSC_ACCZ_I": factor})
    with pytest.raises(TrajectoryError, match="other gains"):
        analyze(replace(flight, loop=turned))


@pytest.mark.complete
@pytest.mark.parametrize("flown", FLIGHTS[1:3], ids=lambda each: each.name)
def test_a_flight_in_wind_gets_a_proposal(flown: RecordedFlight) -> None:
    """In still air the binary flew 4.2 mm with 3, 8, 0.5, 3, in wind 6.8 … 9.7 mm with such gains."""
    proposed = analyze(read(flown.name)).proposed
    assert proposed is not None
    assert proposed.gains["PSC_POSZ_P"] == pytest.approx(3.0)
    assert proposed.prediction.high_m < 0.5e-3 * flown.error_mm
    assert proposed.margin >= 2.0


@pytest.mark.complete
def test_steps_to_the_side_at_one_altitude_are_described_without_a_proposal() -> None:
    """The only altitude change is the end of the takeoff."""
    found = analyze_content(recorded("arducopter_lateral_steps.bin"), None, "lateral.bin").answer
    answer, texts = found.tuning, found.texts.tuning
    assert (answer.grade, answer.proposes) == ("partial", False)
    assert [each.code for each in answer.reasons] == ["no_whole_change"]
    assert texts.facts[0].values[:2] == ["70 s analysed", "reference moves by 2.0 m"]
    assert texts.facts[1].values[0] == "hover throttle 0.364"
    assert texts.parameter_file is None
