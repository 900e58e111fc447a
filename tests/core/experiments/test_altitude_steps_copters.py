"""Altitude steps under ArduCopter and PX4: the schedule, the score against each autopilot's own reference."""

from collections.abc import Mapping
from typing import Final

import numpy as np
import pytest

from app.autopilots.ardupilot.experiments import ArduPilotSteps
from app.autopilots.px4.experiments import Px4Steps
from app.autopilots.registry import get_experiment
from app.core.definition import Definition, Flight, OptionValue, Start
from app.core.errors import InputError
from app.core.experiments.base import Check, Envelope, prior_distribution
from app.core.experiments.copter_steps import CopterSteps
from app.core.policy import Gains
from app.core.records.trajectory import Trajectory
from app.core.tuning.gate import check_policy
from tests.core.tuning.defined import evidence, problems_of
from tests.core.tuning.flying import compiled_only

NAMES: Final = ("altitude-steps-ardupilot", "altitude-steps-px4")
SHORT: Final = {"steps": 2, "step_window_s": 3.0}
BOTH: Final[tuple[CopterSteps, ...]] = (ArduPilotSteps().configured(SHORT), Px4Steps().configured(SHORT))


@pytest.mark.parametrize("name", NAMES)
def test_the_first_step_follows_15_s_after_the_command(name: str) -> None:
    steps = get_experiment(name)
    assert steps.set_points is not None
    assert steps.set_points.times_s == (0.0, 15.0, 20.0, 25.0, 30.0)
    assert steps.set_points.altitudes_m == (3.0, 2.0, 3.0, 2.0, 3.0)
    assert (steps.scored_from_s, steps.window_s, steps.grid_s[-1]) == (15.0, 35.0, 35.0)
    assert steps.configured({"steps": 4}) is steps
    assert steps.set_point(np.array([-1.0, 14.9, 15.0])).tolist() == [0.0, 3.0, 2.0]
    assert not steps.scatter.measured


PUSHED: Final = Px4Steps().configured({**SHORT, "push_m_s2": 2.0})


def test_a_push_follows_the_steps_under_px4_for_a_window_and_leaves_another() -> None:
    assert PUSHED.set_points.times_s == (0.0, 15.0, 18.0, 21.0, 24.0)
    assert PUSHED.set_points.altitudes_m == (3.0, 2.0, 3.0, 3.0, 3.0)
    assert PUSHED.set_points.acceleration_at(np.array([-1.0, 20.9, 21.0, 23.9, 24.0])).tolist() == [0, 0, -2, -2, 0]
    assert BOTH[1].set_points.acceleration_at(np.array([16.0])).tolist() == [0.0]
    assert PUSHED.window_s == 27.0
    assert PUSHED.measure == "2 steps of 1 m from 3 m, down first, 3 s each, then a push of 2 m/s², under PX4"
    assert "push_m_s2" not in {option.name for option in ArduPilotSteps().options}


@compiled_only
def test_a_push_moves_the_vehicle_down_and_back_and_gains_too_soft_for_it_are_refused() -> None:
    """2 m/s² against a P of 1 1/s · 4 1/s is half a metre at rest, which the integral makes up for."""
    default = PUSHED.space.mapping(PUSHED.space.default)
    flown = PUSHED.simulate(PUSHED.space.default, PUSHED.nominal_model)
    pushed, left = ((flown.time_s > begin_s) & (flown.time_s < begin_s + 3.0) for begin_s in (21.0, 24.0))
    assert flown["altitude_m"][pushed].min() == pytest.approx(2.7, abs=0.1)
    assert flown["altitude_m"][left].max() == pytest.approx(3.2, abs=0.1)
    assert all(check.passed for check in hazards(PUSHED, default).values())
    soft = {"MPC_Z_P": 0.1, "MPC_Z_VEL_P_ACC": 2.0, "MPC_Z_VEL_I_ACC": 0.2, "MPC_Z_VEL_D_ACC": 0.0}
    refused = hazards(PUSHED, soft)["lowest altitude"]
    assert (refused.passed, hazards(BOTH[1], soft)["lowest altitude"].passed) == (False, True)


def test_errors_of_different_autopilots_and_steps_are_different_quantities() -> None:
    measures = {
        get_experiment(name, {"steps": steps}).measure for name in (*NAMES, "altitude-steps") for steps in (2, 4)
    }
    assert len(measures) == 6


def test_an_integral_gain_below_what_the_arming_check_allows_is_out_of_bounds() -> None:
    space = get_experiment("altitude-steps-ardupilot").space
    assert dict(zip(space.names, space.lower.tolist(), strict=True))["PSC_ACCZ_I"] == 0.2
    assert space.mapping(space.default)["PSC_ACCZ_I"] == 1.0


@pytest.mark.parametrize("name", NAMES)
def test_the_score_is_the_mean_distance_from_the_recorded_reference(name: str) -> None:
    steps = get_experiment(name)
    time_s = np.arange(0.0, 36.0, 0.02)
    reference = 2.5 + 0.4 * np.sin(time_s)
    channels = {"altitude_m": reference + 0.1, "reference_m": reference}
    channels["altitude_m"] = np.where(time_s < 15.0, 3.0, channels["altitude_m"])
    assert steps.error(Trajectory(time_s, channels, "ardupilot", "vehicle")) == pytest.approx(0.1, abs=1e-3)


@compiled_only
def test_px4_is_scored_against_the_set_point_and_arducopter_against_the_target_that_it_shapes() -> None:
    """1 m within 1 m/s² and 5 m/s³ takes two and a half seconds."""
    shaped, straight = (get_experiment(name) for name in NAMES)
    on_set_point = straight.set_point(straight.grid_s)[np.newaxis]
    assert straight.errors(on_set_point) == pytest.approx([0.0], abs=1e-9)
    assert shaped.errors(on_set_point) == pytest.approx([0.23], abs=0.02)


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"step_m": 2.0, "height_m": 5.0}, None),
        ({"step_m": 2.0, "order": "up first"}, None),
        ({"step_m": 1.5}, "must be below 1.5 m, half of the highest set point, got 1.5 m"),
        ({"step_m": 2.5}, "must be between 0.25 and 2 m, got 2.5"),
    ],
)
def test_steps_may_be_larger_but_stay_above_half_of_the_height(
    options: Mapping[str, OptionValue], reason: str | None
) -> None:
    asked = Definition(experiment=NAMES[0], experiment_options=dict(options), strategy="manual", ceiling_m=8.0)
    assert [problem.reason for problem in problems_of(asked)] == ([] if reason is None else [reason])


def test_only_what_allows_for_the_throttle_and_the_margin_searches_for_gains() -> None:
    """A search on the model in still air alone would end at the largest gains."""
    asked = Definition(experiment=NAMES[1], strategy="gradient", start=Start(kind="simplex"))
    assert [(problem.field, problem.reason) for problem in problems_of(asked)] == [
        ("strategy", "'gradient' works only with takeoff, altitude-steps, pitch-tracking"),
        ("start.kind", "'simplex' works only with takeoff, altitude-steps, pitch-tracking"),
    ]


@compiled_only
@pytest.mark.parametrize("steps", BOTH, ids=NAMES)
def test_many_runs_score_as_single_ones_and_follow_the_reference_until_the_first_step(steps: CopterSteps) -> None:
    gains = np.stack((steps.space.default, 1.2 * steps.space.default))
    outputs = steps.outputs(gains, steps.nominal_model)
    singles = [steps.simulate(each, steps.nominal_model) for each in gains]
    assert steps.errors(outputs) == pytest.approx([steps.error(each) for each in singles], rel=1e-6)
    assert steps.errors(outputs)[1] < steps.errors(outputs)[0]
    assert np.array_equal(steps.disturbed_outputs(gains, steps.nominal_model, outputs), outputs)
    assert steps.disturbances(singles[0], gains[0], steps.nominal_model) is None
    before = steps.grid_s < 13.0
    assert np.array_equal(outputs[0, before], singles[0]["reference_m"][before])
    assert outputs[0, 0] == pytest.approx(3.0)


def hazards(steps: CopterSteps, gains: Gains, ceiling_m: float = 4.5) -> dict[str, Check]:
    envelope = Envelope(ceiling_m=ceiling_m, safe_gains=steps.space.mapping(steps.space.default))
    return {
        check.name: check for check in steps.hazards(steps.space.vector(gains), prior_distribution(steps), envelope)
    }


@compiled_only
@pytest.mark.parametrize("steps", BOTH, ids=NAMES)
def test_the_gate_allows_the_firmwares_gains_on_likely_vehicles(steps: CopterSteps) -> None:
    checks = hazards(steps, steps.space.mapping(steps.space.default))
    assert list(checks) == ["altitude", "lowest altitude", "margin"]
    assert all(check.passed for check in checks.values())
    assert checks["altitude"].worst == pytest.approx(3.05, abs=0.1)
    assert checks["lowest altitude"].worst == pytest.approx(1.95, abs=0.1)


@compiled_only
def test_the_gate_refuses_gains_that_ring_with_more_lag_and_flights_above_the_ceiling() -> None:
    steps = BOTH[0]
    wild = hazards(steps, {**steps.space.mapping(steps.space.default), "PSC_ACCZ_P": 2.0, "PSC_ACCZ_I": 4.0})
    assert [name for name, check in wild.items() if not check.passed] == ["margin"]
    assert wild["margin"].worst < 0.0
    assert "would rise to" in hazards(steps, steps.space.mapping(steps.space.default), 2.9)["altitude"].sentence


@compiled_only
def test_the_vehicles_own_filters_and_limits_count() -> None:
    steps = BOTH[0]
    default = steps.space.mapping(steps.space.default)
    slow = steps.under({"PSC_ACCZ_FLTE": 2.0, "WP_ACC_Z": 0.5})
    assert hazards(slow, default)["margin"].worst < hazards(steps, default)["margin"].worst - 0.05
    assert (
        slow.references(np.arange(13.0, 16.0, 0.0025))[-1, 0] > steps.references(np.arange(13.0, 16.0, 0.0025))[-1, 0]
    )


@pytest.mark.parametrize(
    ("steps", "parameters", "sentence"),
    [
        (BOTH[0], {"PSC_D_VEL_PDMX": 1.0}, "PSC_VELZ_PDMX must be 0 (PSC_D_VEL_PDMX since release 4.7);"),
        (BOTH[0], {"SCHED_LOOP_RATE": 0.0}, "SCHED_LOOP_RATE must be 50 to 2000, got 0;"),
        (BOTH[1], {"MPC_VEL_NF_FRQ": 10.0}, "MPC_VEL_NF_FRQ must be 0;"),
    ],
)
def test_the_gate_names_the_parameter_with_which_the_model_does_not_hold(
    steps: CopterSteps, parameters: Mapping[str, float], sentence: str
) -> None:
    """Also after a later flight whose record has settings of the link alone."""
    flights = [_flight(steps, 1, parameters), _flight(steps, 2, {"telemetry_hz": 50.0})]
    gate = check_policy(evidence(Definition(experiment=steps.name), steps, flights), flights[0].gains)
    assert [(check.name, sentence in check.sentence) for check in gate.refusals] == [("parameters", True)]


def _flight(steps: CopterSteps, number: int, parameters: Mapping[str, float]) -> Flight:
    gains = steps.space.mapping(steps.space.default)
    nothing = Trajectory(np.empty(0), {}, "none", "none")
    return Flight(number=number, gains=gains, trajectory=nothing, error=None, outcome="valid", parameters=parameters)


def test_another_vehicles_fitted_model_keeps_the_steps() -> None:
    steps = BOTH[1]
    informed = steps.informed(np.array([0.4, 1.1, 0.1, 0.2]), np.full(4, 0.01))
    assert informed.nominal_model.tolist() == [0.4, 1.1, 0.1, 0.2]
    assert informed.measure == steps.measure
    assert informed.title == "Altitude steps under PX4"


@pytest.mark.parametrize(
    ("steps", "parameters", "problem"),
    [
        (BOTH[0], {"SCHED_LOOP_RATE": 0.0}, "SCHED_LOOP_RATE: must be 50 to 2000, got 0"),
        (BOTH[0], {"SCHED_LOOP_RATE": -400.0}, "SCHED_LOOP_RATE: must be 50 to 2000, got -400"),
        (BOTH[0], {"SCHED_LOOP_RATE": 1.0}, "SCHED_LOOP_RATE: must be 50 to 2000, got 1"),
        (BOTH[0], {"SCHED_LOOP_RATE": 1e9}, "SCHED_LOOP_RATE: must be 50 to 2000, got 1e+09"),
        (BOTH[0], {"SCHED_LOOP_RATE": np.nan}, "SCHED_LOOP_RATE: must be 50 to 2000, got nan"),
        (BOTH[0], {"INS_ACCEL_FILTER": np.inf}, "INS_ACCEL_FILTER: must be 0 to 2000, got inf"),
        (BOTH[0], {"PSC_VELZ_P": 1e30}, "PSC_VELZ_P: must be 0 to 1e+06, got 1e+30"),
        (BOTH[1], {"IMU_INTEG_RATE": 1e9, "EKF2_PREDICT_US": 0.0}, "IMU_INTEG_RATE: must be 0 to 1000, got 1e+09"),
        (BOTH[1], {"EKF2_PREDICT_US": np.nan}, "EKF2_PREDICT_US: must be 0 to 1e+06, got nan"),
        (BOTH[1], {"MPC_VEL_NF_FRQ": np.nan}, "MPC_VEL_NF_FRQ: must be 0"),
    ],
)
def test_parameters_with_which_no_loop_runs_are_refused_by_name(
    steps: CopterSteps, parameters: Mapping[str, float], problem: str
) -> None:
    with pytest.raises(InputError) as refused:
        steps.exactly_under(parameters)
    assert problem in str(refused.value)
