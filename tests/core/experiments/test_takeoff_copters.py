"""Takeoffs under ArduCopter and PX4: the paper's manoeuvre and score, gains of their own, and no model of them."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
import pytest

from app.autopilots.registry import get_experiment
from app.core.definition import Definition, Donor, Flight, Start, StopRule
from app.core.experiments.takeoff import Takeoff
from app.core.policy import Gains
from app.core.records.trajectory import Trajectory
from app.core.tuning.campaign_models import known_distribution
from app.core.tuning.gate import check_policy
from app.core.tuning.proposals import advise
from app.core.tuning.stop_rules import evaluate_stop_rule
from app.core.tuning.strategies import STRATEGIES
from app.core.tuning.strategy import Proposal
from tests.core.tuning.defined import evidence, next_proposal, problems_of

PX4 = get_experiment("takeoff-px4")
BY_HAND: Final = Definition(experiment="takeoff-px4", strategy="manual", stop=StopRule(kind="budget", max_flights=5))
DEFAULT: Final[Gains] = {
    "MPC_Z_P": 1.0,
    "MPC_Z_VEL_P_ACC": 4.0,
    "MPC_Z_VEL_I_ACC": 2.0,
    "MPC_Z_VEL_D_ACC": 0.0,
}
FIRMER: Final[Gains] = {**DEFAULT, "MPC_Z_P": 1.3}


def climb(short_m: float) -> Trajectory:
    """A record that stays this far below 3 m from the command on."""
    time_s = np.arange(0.0, 33.0, 0.02)
    return Trajectory(time_s, {"altitude_m": np.full_like(time_s, 3.0 - short_m)}, "vehicle", "simulation")


def fly(number: int, gains: Gains, short_m: float) -> Flight:
    record = climb(short_m).as_stored()
    return Flight(number=number, gains=dict(gains), trajectory=record, error=PX4.error(record), outcome="valid")


FLOWN: Final = (fly(1, DEFAULT, 0.3), fly(2, FIRMER, 0.2))


@pytest.mark.parametrize("name", ["takeoff-ardupilot", "takeoff-px4"])
def test_the_manoeuvre_and_its_score_are_the_papers(name: str) -> None:
    experiment, paper = get_experiment(name), Takeoff()
    assert experiment.configured({}) is experiment
    assert experiment.error(climb(0.25)) == paper.error(climb(0.25)) == pytest.approx(0.25)
    assert np.array_equal(experiment.grid_s, paper.grid_s)
    assert experiment.set_point(np.array([-1.0, 0.0, 9.0])).tolist() == [0.0, 3.0, 3.0]
    outputs = np.full((2, len(paper.grid_s)), 2.5)
    assert experiment.errors(outputs) == pytest.approx([0.5, 0.5])


@pytest.mark.parametrize("name", ["takeoff-ardupilot", "takeoff-px4"])
def test_the_window_is_an_option_as_of_the_papers_takeoff(name: str) -> None:
    experiment = get_experiment(name, {"window_s": 10.0})
    assert (experiment.name, experiment.window_s) == (name, 10.0)
    assert experiment.space == get_experiment(name).space
    assert np.array_equal(experiment.grid_s, Takeoff(window_s=10.0).grid_s)
    assert not experiment.scatter.measured
    assert experiment.error(climb(0.25)) == pytest.approx(0.25)


def test_the_gains_are_the_autopilots_own_with_its_defaults() -> None:
    space = get_experiment("takeoff-ardupilot").space
    assert space.mapping(space.default) == {
        "PSC_POSZ_P": 1.0,
        "PSC_VELZ_P": 5.0,
        "PSC_ACCZ_P": 0.5,
        "PSC_ACCZ_I": 1.0,
        "PSC_ACCZ_D": 0.0,
    }
    assert PX4.space.mapping(PX4.space.default) == DEFAULT
    assert (PX4.space.lower.tolist(), PX4.space.upper.tolist()) == ([0.1, 2.0, 0.2, 0.0], [1.5, 15.0, 3.0, 2.0])


@pytest.mark.parametrize("strategy", sorted(STRATEGIES))
def test_only_gains_by_hand_can_be_flown_without_a_model(strategy: str) -> None:
    problems = problems_of(replace(BY_HAND, strategy=strategy))
    if strategy == "manual":
        assert problems == ()
        return
    lacks = "there is no model for the gains of 'takeoff-px4'"
    reason = f"{strategy!r} needs a model, and {lacks}: choose 'manual'"
    assert [(problem.field, problem.reason) for problem in problems] == [("strategy", reason)]


def test_strategies_say_themselves_what_they_work_with() -> None:
    names = ("takeoff", "takeoff-px4", "pitch-tracking")
    found = {
        name: [one for one in names if strategy.works_with(get_experiment(one))]
        for name, strategy in STRATEGIES.items()
    }
    assert found == {
        "calibrated": ["takeoff"],
        "gradient": ["takeoff", "pitch-tracking"],
        "identified": ["pitch-tracking"],
        "simplex": ["takeoff", "pitch-tracking"],
        "manual": ["takeoff", "takeoff-px4", "pitch-tracking"],
    }


def test_a_start_that_is_searched_on_a_model_is_refused_where_there_is_none() -> None:
    assert problems_of(replace(BY_HAND, start=Start(kind="given", gains=dict(FIRMER)))) == ()
    (problem,) = problems_of(replace(BY_HAND, start=Start(kind="simplex")))
    assert problem.field == "start.kind"
    assert "there is no model for the gains of 'takeoff-px4': choose 'default' or 'given'" in problem.reason


def said(proposal: Proposal) -> tuple[str, Gains]:
    """Kind and gains of a proposal without a prediction."""
    assert (proposal.predicted, proposal.predicted_error, proposal.interval) == (None, None, None)
    return proposal.kind, proposal.gains


def test_a_campaign_by_hand_proposes_the_start_and_then_the_best_flown_and_predicts_nothing() -> None:
    first = next_proposal(BY_HAND, ())
    assert said(first) == ("start", DEFAULT)
    assert "there is no model of this vehicle's controller, so there is no prediction" in first.explanation.summary
    then = next_proposal(BY_HAND, FLOWN)
    assert said(then) == ("manual", FIRMER)
    assert "The best gains so far are those of flight 2" in then.explanation.summary
    known = evidence(BY_HAND, PX4, FLOWN)
    assert advise(known, then, evaluate_stop_rule(known, then)).kind == "step"


def test_a_warm_start_takes_the_others_gains_and_nothing_else() -> None:
    start = Start(kind="campaign", gains=dict(FIRMER), donor=Donor(campaign_id=1, trial_number=2, checksum=64 * "0"))
    definition = replace(BY_HAND, start=start)
    assert problems_of(definition) == ()
    assert said(next_proposal(definition, (), donor=FLOWN[1])) == ("start", FIRMER)


def test_the_rule_that_tells_from_noise_flies_the_winner_again_with_what_its_flights_said() -> None:
    definition = replace(BY_HAND, stop=StopRule(kind="noise", max_flights=4))
    again = next_proposal(definition, FLOWN)
    assert (again.kind, again.gains) == ("repeat", FIRMER)
    assert again.predicted_error == pytest.approx(0.2)
    assert again.interval is None, "nobody knows yet how much flights scatter"
    assert "scatter under this autopilot is unknown" in again.explanation.summary


def test_once_a_set_was_flown_twice_its_own_repeats_say_what_to_expect_of_a_third_flight() -> None:
    definition = replace(BY_HAND, stop=StopRule(kind="noise", max_flights=6))
    again = next_proposal(definition, (*FLOWN, fly(4, FIRMER, 0.264)))
    assert again.interval is not None
    assert again.interval.upper - again.interval.lower > 0.2, (
        "one repeat knows little: Student's t, one degree of freedom"
    )


def refusals(gains: Gains, flights: Sequence[Flight] = ()) -> list[tuple[str, str]]:
    definition = replace(BY_HAND, step_fraction=0.25)
    gate = check_policy(evidence(definition, PX4, flights), gains)
    assert {check.name for check in gate.checks} <= {"numbers", "bounds", "step"}
    return [(check.name, check.gain) for check in gate.refusals]


def test_the_gate_holds_gains_to_bounds_and_steps_and_simulates_nothing() -> None:
    assert refusals(FIRMER) == []
    assert refusals({**DEFAULT, "MPC_Z_P": 1.6}) == [("bounds", "MPC_Z_P"), ("step", "MPC_Z_P")]
    assert refusals({**DEFAULT, "MPC_Z_VEL_P_ACC": 9.0}) == [("step", "MPC_Z_VEL_P_ACC")]
    assert refusals({**DEFAULT, "MPC_Z_VEL_P_ACC": 9.0}, [fly(1, {**DEFAULT, "MPC_Z_VEL_P_ACC": 6.0}, 0.1)]) == []
    assert refusals({**DEFAULT, "MPC_Z_P": float("nan")}) == [("numbers", "MPC_Z_P")]


def test_of_a_vehicle_without_a_model_nothing_is_known_however_often_it_flew() -> None:
    assert known_distribution(evidence(Definition(), PX4, FLOWN)).mean == ()
    assert known_distribution(evidence(Definition(), PX4, ())).origin == "none: there is no model"
