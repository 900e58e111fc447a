"""The landscape of a model's error, held against the model flown by hand."""

from collections.abc import Sequence

import numpy as np
import pytest

from app.autopilots.registry import evidence_of
from app.core.definition import Definition, Donor, Flight, Start
from app.core.experiments.pitch_tracking import PitchTracking
from app.core.experiments.takeoff import WINDOW_S, Takeoff
from app.core.policy import Gains
from app.core.tuning.calibration import calibrate
from app.core.tuning.landscape import Landscape, plan_grid
from app.core.tuning.predictions import predict_flight
from tests.core.tuning.defined import next_proposal
from tests.core.tuning.flying import compiled_only

START: Gains = {"kp": 283, "ki": 13, "kd": 82}


def flight(number: int = 1, gains: Gains = START, hover: float = 0.6) -> Flight:
    """A takeoff of a vehicle that is not what the data sheet says."""
    takeoff = Takeoff()
    vehicle = takeoff.nominal_model.copy()
    vehicle[:4] = (hover, 0.25, 0.05, 0.15)
    flown = takeoff.simulate(takeoff.space.vector(gains), vehicle)
    return Flight(number=number, gains=gains, trajectory=flown, error=takeoff.error(flown), outcome="valid")


def surveyed(definition: Definition, flights: Sequence[Flight], centre: Gains, *marks: Gains) -> Landscape:
    survey = plan_grid(evidence_of(definition, flights), centre, marks)
    assert survey is not None
    return survey.landscape(survey.predict_errors(survey.points()))


def error_by_hand(gains: Gains, by: Flight) -> float:
    """Mean of |3 m − (model + what the flight did beyond its model)| over 32.6 s, as the paper has it."""
    takeoff = Takeoff()
    times = takeoff.grid_s
    model, flown = (
        takeoff.simulate(takeoff.space.vector(each), takeoff.nominal_model)["altitude_m"] for each in (gains, by.gains)
    )
    measured = np.interp(times, by.trajectory.time_s, by.trajectory["altitude_m"].astype(np.float32).astype(float))
    off = np.abs(3.0 - (model + measured - flown))
    end = np.interp(WINDOW_S, times, off)
    inside = times < WINDOW_S
    return float(np.trapezoid([*off[inside], end], [*times[inside], WINDOW_S]) / WINDOW_S)


@pytest.mark.complete
@compiled_only
def test_the_grid_holds_what_the_model_corrected_by_the_best_flight_predicts() -> None:
    first = flight()
    land = surveyed(Definition(strategy="gradient"), [first], START, {"kp": 518, "ki": 438, "kd": 82})
    assert [(one.x, one.y) for one in land.slices] == [("kp", "ki"), ("kp", "kd"), ("ki", "kd")]
    for one, i, j in ((land.slices[0], 3, 11), (land.slices[1], 16, 0), (land.slices[2], 8, 5)):
        gains = {**START, one.x: one.x_values[j], one.y: one.y_values[i]}
        assert one.errors[i][j] == pytest.approx(error_by_hand(gains, first), abs=1e-6)


@compiled_only
def test_a_slice_holds_every_flown_and_proposed_gain_set_and_stays_within_the_bounds() -> None:
    proposed: Gains = {"kp": 518, "ki": 438, "kd": 82}
    land = surveyed(Definition(strategy="gradient", bounds={"ki": (0, 450)}), [flight()], START, START, proposed)
    for one in land.slices:
        for name, values in ((one.x, one.x_values), (one.y, one.y_values)):
            assert values[0] <= START[name] <= values[-1]
            assert values[0] <= proposed[name] <= values[-1]
            assert all(value == int(value) for value in values)
            if name == "ki":
                assert (values[0], values[-1]) == (0, 450)


@pytest.mark.complete
@compiled_only
def test_the_grid_holds_the_errors_that_the_calibrated_model_predicts() -> None:
    flights = [flight(), flight(2, {"kp": 900, "ki": 300, "kd": 120})]
    definition = Definition(strategy="calibrated", bounds={"kd": (120, 120)})
    centre = flights[1].gains
    land = surveyed(definition, flights, centre)
    [one] = land.slices
    assert (one.x, one.y, land.still) == ("kp", "ki", ("kd",))
    fitted = calibrate(Takeoff(), flights)
    for i, j in ((2, 13), (15, 4)):
        gains = Takeoff().space.vector({**centre, "kp": one.x_values[j], "ki": one.y_values[i]})
        assert one.errors[i][j] == pytest.approx(predict_flight(fitted, flights[1], gains).error, abs=1e-9)


@compiled_only
def test_before_the_first_flight_the_landscape_is_the_nominal_models() -> None:
    proposal = next_proposal(Definition(), ())
    land = surveyed(Definition(), [], proposal.gains)
    one = land.slices[0]
    gains = {**proposal.gains, one.x: one.x_values[4], one.y: one.y_values[9]}
    takeoff = Takeoff()
    flown = takeoff.simulate(takeoff.space.vector(gains), takeoff.nominal_model)
    assert one.errors[9][4] == pytest.approx(takeoff.error(flown), abs=1e-9)


@compiled_only
def test_a_warm_start_s_landscape_is_that_of_the_vehicle_it_starts_from() -> None:
    tuned: Gains = {"kp": 1600, "ki": 900, "kd": 150}
    donor = flight(5, tuned)
    definition = Definition(
        start=Start(kind="campaign", gains=dict(tuned), donor=Donor(campaign_id=1, trial_number=5, checksum="0"))
    )
    survey = plan_grid(evidence_of(definition, (), donor=donor), tuned, ())
    assert survey is not None
    assert survey.predict_errors(survey.centre[np.newaxis])[0] == pytest.approx(donor.error, abs=1e-6)


@compiled_only
def test_of_six_gains_those_are_varied_that_the_error_hangs_on() -> None:
    definition = Definition(experiment="pitch-tracking")
    experiment = PitchTracking()
    default = experiment.space.mapping(experiment.space.default)
    land = surveyed(definition, [], default)
    assert len(land.slices) == 3
    error = experiment.errors(experiment.outputs(experiment.space.default[np.newaxis], experiment.nominal_model))[0]

    def change(name: str) -> float:
        """By how much the error moves over a tenth of the gain's scale, upwards."""
        place = experiment.space.names.index(name)
        moved = experiment.space.default.copy()
        moved[place] += 0.1 * experiment.space.scale[place]
        there = experiment.errors(experiment.outputs(moved[np.newaxis], experiment.nominal_model))[0]
        return float(abs(there - error))

    shown = {name for one in land.slices for name in (one.x, one.y)}
    assert max(experiment.space.names, key=change) in shown
    assert set(land.still) == set(experiment.space.names) - shown


def test_without_a_model_there_is_no_landscape() -> None:
    assert plan_grid(evidence_of(Definition(experiment="takeoff-px4"), ()), {}, ()) is None
