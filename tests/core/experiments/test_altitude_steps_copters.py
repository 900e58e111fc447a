"""Altitude steps under ArduCopter and PX4: the schedule, the score against each autopilot's own reference."""

from collections.abc import Mapping
from typing import Final

import numpy as np
import pytest

from app.core.definition import Definition, OptionValue
from app.core.experiments import get_experiment
from app.core.records.trajectory import Trajectory
from app.core.tuning.definition_checks import problems_of

NAMES: Final = ("altitude-steps-ardupilot", "altitude-steps-px4")


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


def test_px4_is_scored_against_the_set_point_and_arducopter_against_the_target_that_it_shapes() -> None:
    """1 m within 1 m/s² and 5 m/s³ takes two seconds; until then the shaped target is 0.46 m away on average."""
    shaped, straight = (get_experiment(name) for name in NAMES)
    on_set_point = straight.set_point(straight.grid_s)[np.newaxis]
    assert straight.errors(on_set_point) == pytest.approx([0.0], abs=1e-9)
    assert shaped.errors(on_set_point) == pytest.approx([0.23], abs=0.02)


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"step_m": 2.0, "height_m": 5.0}, None),
        ({"step_m": 2.0, "order": "up first"}, None),
        ({"step_m": 1.5}, "must leave every set point above half of the highest, 1.5 m, got 1.5 m"),
        ({"step_m": 2.5}, "must be between 0.25 and 2 m, got 2.5"),
    ],
)
def test_steps_may_be_larger_but_stay_above_half_of_the_height(
    options: Mapping[str, OptionValue], reason: str | None
) -> None:
    asked = Definition(experiment=NAMES[0], experiment_options=dict(options), strategy="manual", ceiling_m=8.0)
    assert [problem.reason for problem in problems_of(asked)] == ([] if reason is None else [reason])
