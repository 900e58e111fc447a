"""Steps of the altitude set point: the schedule, the score, when a record counts, the gate and the tuning."""

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from scipy import signal

from app.autopilots.registry import get_experiment
from app.core.definition import Definition, Flight, OptionValue
from app.core.errors import TrajectoryError
from app.core.experiments.altitude_steps import AltitudeSteps
from app.core.experiments.base import Check, Envelope, ParameterDistribution, prior_distribution
from app.core.experiments.takeoff import Takeoff
from app.core.experiments.vertical_loop_hazards import MODELS, Manoeuvre, abort_steps
from app.core.policy import Gains
from app.core.records.trajectory import Samples, Trajectory
from app.vehicles.base import FlightOptions
from app.vehicles.registry import open_vehicle
from tests.core.tuning.defined import next_proposal, problems_of
from tests.core.tuning.flying import compiled_only

STEPS = AltitudeSteps()
DEFAULT: Gains = {"kp": 283, "ki": 13, "kd": 82}
GOOD: Gains = {"kp": 1600, "ki": 1023, "kd": 127}
SLOW_GAIN = (1 / 512) / (1 / 512 + 1 / (2 * np.pi * 2.0))
"""Of a 2 Hz low-pass, in a step."""
TWIN = np.array([0.61, 0.3, 0.05, 0.0, 0.0, 0.0, 0.0, 0.0])


def chosen(**options: OptionValue) -> AltitudeSteps:
    found = get_experiment("altitude-steps", options)
    assert isinstance(found, AltitudeSteps)
    return found


@lru_cache
def flown(kind: str, kp: int, ki: int, kd: int, **options: float) -> Trajectory:
    """The stored record of a flight of a simulated vehicle."""
    with open_vehicle(kind, options, safe_gains=DEFAULT) as vehicle:
        vehicle.stage({"kp": kp, "ki": ki, "kd": kd})
        order = FlightOptions(seed=1, window_s=STEPS.window_s, set_points=STEPS.set_points)
        return vehicle.fly(order, on_sample=lambda _: None, should_stop=lambda: None).trajectory.as_stored()


def as_flight(number: int, gains: Gains, **options: float) -> Flight:
    record = flown("twin", *(int(gains[name]) for name in ("kp", "ki", "kd")), **options)
    return Flight(number=number, gains=dict(gains), trajectory=record, error=STEPS.error(record), outcome="valid")


def refusal(trajectory: Trajectory, experiment: AltitudeSteps = STEPS) -> tuple[str, str]:
    with pytest.raises(TrajectoryError) as refused:
        experiment.error(trajectory)
    (problem,) = refused.value.problems
    return problem.field, problem.reason


def test_it_climbs_to_3_m_then_steps_down_and_up_every_5_s() -> None:
    assert STEPS.set_points.times_s == (0.0, 10.0, 15.0, 20.0, 25.0)
    assert STEPS.set_points.altitudes_m == (3.0, 2.0, 3.0, 2.0, 3.0)
    assert (STEPS.scored_from_s, STEPS.window_s) == (10.0, 30.0)
    assert STEPS.measure == "4 steps of 1 m from 3 m, down first, 5 s each"


def test_number_height_order_and_window_of_the_steps_are_options() -> None:
    other = chosen(height_m=2.5, step_m=0.5, steps=3, order="up first", step_window_s=3.3)
    assert other.set_points.altitudes_m == (2.5, 3.0, 2.5, 3.0)
    assert other.set_points.times_s == pytest.approx((0.0, 10.0, 13.3, 16.6), abs=0.5 / 512)
    assert other.window_s == pytest.approx(19.9, abs=0.5 / 512)
    assert other.measure != STEPS.measure
    assert STEPS.configured({"steps": 4}) is STEPS
    assert other.configured({}).measure == STEPS.measure


@pytest.mark.parametrize(
    ("options", "ceiling_m", "field"),
    [
        ({"step_m": 1.25}, 4.5, "experiment_options.step_m"),
        ({"height_m": 2.0}, 4.5, "experiment_options.height_m"),
        ({"steps": 1}, 4.5, "experiment_options.steps"),
        ({"steps": 2.5}, 4.5, "experiment_options.steps"),
        ({"order": "sideways"}, 4.5, "experiment_options.order"),
        ({"step_window_s": 2.0}, 4.5, "experiment_options.step_window_s"),
        ({"height_m": 3.5, "order": "up first"}, 4.5, "ceiling_m"),
        ({"height_m": 3.5, "order": "up first"}, 4.7, None),
        ({"height_m": 3.5}, 4.5, None),
    ],
)
def test_what_cannot_be_flown_is_refused_by_its_field(
    options: Mapping[str, OptionValue], ceiling_m: float, field: str | None
) -> None:
    """A ceiling must leave 0.2 m above the highest set point."""
    asked = Definition(
        experiment="altitude-steps", experiment_options=dict(options), strategy="calibrated", ceiling_m=ceiling_m
    )
    assert [problem.field for problem in problems_of(asked)] == ([] if field is None else [field])


@compiled_only
@pytest.mark.parametrize("kind", ["jsbsim", "twin"])
def test_the_score_is_the_mean_distance_from_the_recorded_reference_after_the_steps(kind: str) -> None:
    record = flown(kind, 283, 13, 82)
    scored = (record.time_s >= 10.0) & (record.time_s <= 30.0)
    distance = np.abs(record["reference_m"][scored] - record["altitude_m"][scored])
    windows = [distance[512 * 5 * step : 512 * 5 * (step + 1) + 1] for step in range(4)]
    assert [len(window) for window in windows] == [2561] * 4
    means = [np.trapezoid(window, dx=1 / 512) / 5.0 for window in windows]
    assert STEPS.error(record) == pytest.approx(np.mean(means), abs=1e-7)


@compiled_only
def test_the_models_reference_is_the_one_that_the_simulated_autopilot_records() -> None:
    """Within a count of 1/256 m, although the flight starts its climb 0.3 s later than the model."""
    record, run = flown("twin", 283, 13, 82), STEPS.simulate(STEPS.space.vector(DEFAULT), TWIN)
    after = slice(512 * 10, 512 * 30)
    np.testing.assert_allclose(record["reference_m"][after], run["reference_m"][after], atol=1.01 / 256)


@compiled_only
def test_the_model_scores_what_the_simulated_vehicles_do() -> None:
    """On the default gains, whose offset decays for 20 s; the twin's model is exact but for the later start."""
    gains = STEPS.space.default
    nominal, twin = (STEPS.error(STEPS.simulate(gains, model)) for model in (STEPS.nominal_model, TWIN))
    assert nominal == pytest.approx(STEPS.error(flown("jsbsim", 283, 13, 82)), abs=0.002)
    assert twin == pytest.approx(STEPS.error(flown("twin", 283, 13, 82, scatter=0.0)), abs=0.006)


def test_many_runs_score_as_single_ones() -> None:
    gains = np.array([[283.0, 13, 82], [1600, 1023, 127]])
    short = chosen(steps=2, step_window_s=3.0)
    batch = short.errors(short.outputs(gains, TWIN))
    assert batch.tolist() == [short.error(short.simulate(each, TWIN)) for each in gains]


def test_the_command_that_a_link_does_not_record_is_the_replicas() -> None:
    """The loop senses what is recorded: in single precision a few commands differ by a few counts of 9600. A flight
    with its own disturbances is itself, with the throttle activity of its record."""
    short, gains = chosen(steps=2, step_window_s=3.0), np.array([1600.0, 1023, 127])
    run = short.simulate(gains, TWIN).as_stored()
    bare = replace(run, channels={name: run[name] for name in run.channels if name != "thrust"})
    known, found = (short.disturbances(each, gains, TWIN) for each in (run, bare))
    settled = slice(512 * 8, None)
    assert np.abs(found[settled, 1] - known[settled, 1]).max() < 9.81 / 0.61 * 10 / 9600 / 512
    error, activity = short.flown(gains, TWIN[np.newaxis], TWIN, known)
    assert error == pytest.approx(short.error(run), abs=1e-3)
    slow = signal.lfilter([SLOW_GAIN], [1.0, SLOW_GAIN - 1.0], run["thrust"])
    assert activity == pytest.approx(float(np.std((run["thrust"] - slow)[512 * 10 :])), rel=0.02)


@pytest.mark.parametrize(("row_s", "expected_m"), [(1 / 512, 0.00115), (0.02, 0.0026)])
def test_a_prediction_allows_for_what_the_record_resolves(row_s: float, expected_m: float) -> None:
    """1/256 m, uniformly distributed: 1.13 mm; and a row of a reference that moves 4 m in 20 s."""
    time_s = np.arange(0.0, 30.4, row_s)
    reference = np.interp(time_s, STEPS.grid_s, STEPS.reference)
    record = Trajectory(time_s, {"reference_m": reference}, "mavlink", "vehicle")
    assert STEPS.least_model_error(record) == pytest.approx(expected_m, rel=0.05)


def record_of(altitude_m: Samples, *, end_s: float = 30.4) -> Trajectory:
    """A record whose reference is the set point; the altitude is given at its time stamps."""
    time_s = np.arange(0.0, end_s, 0.02)
    reference = STEPS.set_point(time_s)
    return Trajectory(time_s, {"altitude_m": altitude_m[: len(time_s)], "reference_m": reference}, "twin", "simulation")


TIME_S = np.arange(0.0, 30.4, 0.02)
ON_TIME = STEPS.set_point(TIME_S)


def test_a_vehicle_that_hovers_beside_its_set_point_has_settled() -> None:
    assert STEPS.error(record_of(ON_TIME + 0.4)) == pytest.approx(0.4, abs=1e-9)


def test_noise_of_the_measurement_is_no_motion() -> None:
    noise = np.random.default_rng(1).normal(0.0, 0.05, len(TIME_S))
    assert STEPS.error(record_of(ON_TIME + noise)) == pytest.approx(np.abs(noise[500:]).mean(), rel=0.02)


@pytest.mark.parametrize(
    ("altitude_m", "reason"),
    [
        (ON_TIME + 0.15 * np.sin(2.0 * TIME_S), "had not settled before the first step, at 10 s: it changed by"),
        (ON_TIME - 0.15 * np.maximum(10.0 - TIME_S, 0.0), "had not settled before the first step, at 10 s: it changed"),
        (np.zeros_like(TIME_S), "had not reached half of 3 m before the first step, at 10 s"),
    ],
)
def test_a_vehicle_that_had_not_settled_before_the_first_step_is_not_scored(altitude_m: Samples, reason: str) -> None:
    field, why = refusal(record_of(altitude_m))
    assert (field, why[: len(reason)]) == ("altitude_m", reason)


def test_a_record_without_the_autopilots_reference_or_without_the_last_step_is_not_scored() -> None:
    whole = record_of(ON_TIME)
    bare = replace(whole, channels={"altitude_m": whole["altitude_m"]})
    assert refusal(bare) == ("reference_m", "is not among the recorded channels (altitude_m)")
    short = record_of(ON_TIME, end_s=28.0)
    assert refusal(short) == ("time_s", "covers 0 … 27.98 s; 8 … 30 s after the command are needed")


def hazards(experiment: AltitudeSteps, gains: Gains, ceiling_m: float = 4.5) -> dict[str, Check]:
    checks = experiment.hazards(
        experiment.space.vector(gains),
        prior_distribution(experiment),
        Envelope(ceiling_m=ceiling_m, safe_gains=DEFAULT),
    )
    return {check.name: check for check in checks}


@compiled_only
def test_the_gate_allows_good_gains_and_judges_the_ceiling_by_the_highest_step() -> None:
    """The steps themselves are no oscillation, and the model overshoots 3 m and 4 m alike."""
    down, up = hazards(STEPS, GOOD), hazards(chosen(order="up first"), GOOD)
    assert all(check.passed for check in (*down.values(), *up.values()))
    assert up["altitude"].worst == pytest.approx(down["altitude"].worst + 0.95, abs=0.1)
    assert not hazards(chosen(order="up first"), GOOD, ceiling_m=4.0)["altitude"].passed
    assert "simulated flights rises to" in up["altitude"].sentence


@compiled_only
@pytest.mark.parametrize(
    ("gains", "refused"),
    [
        ({"kp": 283, "ki": 400, "kd": 0}, {"altitude", "divergence", "oscillation", "abort altitude"}),
        ({"kp": 4000, "ki": 0, "kd": 0}, {"altitude", "oscillation"}),
        ({"kp": 1600, "ki": 1356, "kd": 127}, {"wrapping"}),
    ],
)
def test_the_gate_refuses_gains_that_swing_or_wrap(gains: Gains, refused: set[str]) -> None:
    checks = hazards(STEPS, gains)
    assert refused <= {name for name, check in checks.items() if not check.passed}


@compiled_only
def test_the_gate_asks_for_the_margin_on_the_likely_vehicles() -> None:
    """100 ms of motor lag, 40 ms of delay and a quadratic thrust: with twice the largest gains and 30 ms more delay the
    altitude rings, with a quarter of them it does not."""
    slow = np.array([0.6, 0.2, 0.1, 0.2, 1.0, 0.0, 0.04, 0.0])
    spread = ParameterDistribution(mean=tuple(slow.tolist()), covariance=tuple(map(tuple, np.zeros((8, 8)))), origin="")
    envelope = Envelope(ceiling_m=4.5, safe_gains=DEFAULT)
    found = {
        gains: next(check for check in STEPS.hazards(np.array(gains), spread, envelope) if check.name == "margin")
        for gains in ((4000.0, 1073.0, 409.0), (1000.0, 268.0, 102.0))
    }
    assert [check.passed for check in found.values()] == [False, True]
    assert (
        "With up to 2 times the gains, and 30 ms more delay for the likeliest vehicle"
        in found[4000, 1073, 409].sentence
    )


def test_every_vehicle_of_the_gate_aborts_once_between_each_two_steps() -> None:
    steps = abort_steps(MODELS, Manoeuvre(STEPS.set_points, 30 * 512 + 1))
    assert steps.shape == (MODELS, 10)
    for first_s, last_s in ((10, 15), (15, 20), (20, 25), (25, 30)):
        assert (((first_s * 512 <= steps) & (steps <= last_s * 512)).sum(axis=1) == 1).all()


@compiled_only
def test_the_second_flight_of_the_calibrated_strategy_is_where_it_was_predicted() -> None:
    definition = Definition(experiment="altitude-steps", strategy="calibrated")
    first = as_flight(1, next_proposal(definition, []).gains)
    proposal = next_proposal(definition, [first])
    second = as_flight(2, proposal.gains)
    assert proposal.interval is not None
    assert second.error is not None
    assert first.error is not None
    assert second.error in proposal.interval
    assert proposal.predicted_error is not None
    assert (
        proposal.interval.upper - proposal.predicted_error > 1.64 * STEPS.least_model_error(first.trajectory) > 0.0018
    )
    assert second.error < 0.006 < 0.02 * first.error
    activity, margin = proposal.explanation.notes[:2]
    assert activity.endswith("times as much as with the gains of the first flight; 1.5 times is allowed.")
    assert margin.endswith("times the gains; 2 times is required.")
    assert proposal.predicted is not None
    assert {"altitude_m_lower", "altitude_m_upper"} <= proposal.predicted.channels.keys()


@compiled_only
def test_the_gradient_strategy_steps_down_the_model_that_the_flight_corrects() -> None:
    definition = Definition(experiment="altitude-steps", strategy="gradient")
    first = as_flight(1, DEFAULT, scatter=0.0)
    proposal = next_proposal(definition, [first])
    second = as_flight(2, proposal.gains, scatter=0.0)
    assert first.error is not None
    assert second.error is not None
    assert second.error < 0.5 * first.error


def test_it_knows_no_measured_scatter_and_differs_from_a_takeoff() -> None:
    assert not STEPS.scatter.measured
    assert STEPS.measure != Takeoff().measure


def test_another_vehicles_fitted_model_keeps_the_steps() -> None:
    """Its own parameters replace the data sheet's, as in a warm start."""
    short = chosen(steps=2, step_window_s=3.0)
    informed = short.informed(TWIN, np.full(8, 0.01))
    assert informed.nominal_model.tolist() == TWIN.tolist()
    assert (informed.measure, informed.set_points) == (short.measure, short.set_points)
