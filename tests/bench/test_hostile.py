"""Trials over hostile links with defects found earlier, and the checks of such trials."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from app.core.records.trajectory import Trajectory
from app.simdrone.fault_kinds import FAULTS
from bench.hazards.cases import ABORT, TUNED, Case, PlannedFault
from bench.hazards.hostile_checks import GroundTruth, ReportedOutcome, TrueState, find_violations
from bench.hazards.hostile_table import HAZARDS
from bench.hazards.hostile_trial import POWERED_S, cases, run_trial
from bench.hazards.rig import InjectedFault, MotorStop
from bench.hazards.trial_states import State, TrialStates
from bench.hazards.wire import Command


def case(autopilot: str, what: str, state: State, delay_s: float = 5.0, duration_s: float = float("inf")) -> Case:
    return Case(
        seed=1,
        autopilot=autopilot,
        faults=(PlannedFault(what, state, delay_s, duration_s),),
        gains=TUNED[autopilot],
        powered_s=POWERED_S,
        staged_s=0.0,
        pinned=True,
        window_s=12.0,
    )


SEEN = [
    # flights of real autopilots, and an attacker on the link
    ("paparazzi", "foreign kill", State.RECORD, "invalid", "F10b", "quarantined"),
    ("paparazzi", "process killed", State.RECORD, "lost", "", "quarantined"),
    ("ardupilot", "stuck altitude", State.SET_GAINS, "invalid", "F9a", "safe"),
    ("ardupilot", "copy from another port", State.RECORD, "completed", "", "safe"),
    ("paparazzi", "lean oscillation", State.RECORD, "aborted", "F6", "safe"),
]
SEEN_ALIKE = [
    ("paparazzi", "drifts by 0.5 m/s", State.LAND, "completed", "", "safe"),
    ("px4", "drifts by 0.5 m/s unwitnessed", State.LAND, "completed", "", "safe"),
    ("paparazzi", "no SCRIPT_CURRENT", State.RECORD, "completed", "", "quarantined"),
    ("px4", "left in OFFBOARD", State.SET_GAINS, "completed", "", "safe"),
    ("px4", "moves to another port", State.RECORD, "completed", "", "safe"),
    ("paparazzi", "one stamp +2 s", State.RECORD, "completed", "", "safe"),
    ("paparazzi", "copies of all after 3 s", State.RECORD, "completed", "", "safe"),
    ("px4", "clock wraps after 30 s", State.CONNECT, "completed", "", "safe"),
    ("paparazzi", "x inf for 0.3 s", State.RECORD, "completed", "", "safe"),
    ("paparazzi", "flies home", State.RECORD, "invalid", "F10b", "quarantined"),
    ("ardupilot", "foreign kill", State.LAND, "invalid", "F10b", "quarantined"),
    ("px4", "foreign kill", State.LAND, "invalid", "F10b", "quarantined"),
    ("ardupilot", "process killed", State.RECORD, "lost", "", "quarantined"),
    ("px4", "process killed", State.RECORD, "lost", "", "quarantined"),
    ("ardupilot", "companion as autopilot", State.CONNECT, "completed", "", "safe"),
    ("paparazzi", "30 % are lost", State.PREFLIGHT, "refused", "", "safe"),
    ("paparazzi", "twin 0.4 s older", State.LAND, "invalid", "F12", "quarantined"),
    ("ardupilot", "twin 3600 s older", State.RECORD, "invalid", "F12", "quarantined"),
    ("px4", "companion as autopilot", State.RECORD, "completed", "", "safe"),
    ("paparazzi", "carried away", State.RECORD, "aborted", "F6", "safe"),
    ("ardupilot", "deaf", State.RECORD, "invalid", "F11", "quarantined"),
    ("px4", "mocap nan", State.RECORD, "invalid", "F9a", "safe"),
    ("px4", "pilot for 1 s", State.RECORD, "invalid", "F10c", "safe"),
    # defects found before
    ("paparazzi", "z nan", State.RECORD, "invalid", "F9d", "quarantined"),
    ("paparazzi", "pilot", State.RECORD, "invalid", "F10a", "quarantined"),
]
"""Further ones, for the complete ring."""


@pytest.mark.parametrize(
    ("autopilot", "what", "state", "outcome", "failure", "vehicle"),
    [*SEEN, *(pytest.param(*one, marks=pytest.mark.complete) for one in SEEN_ALIKE)],
)
def test_a_hazard_has_its_required_outcome(
    autopilot: str, what: str, state: State, outcome: str, failure: str, vehicle: str
) -> None:
    ended = run_trial(case(autopilot, what, state, delay_s=2.0))
    assert ended.wrong == ()
    assert (ended.outcome, ended.failure, ended.vehicle) == (outcome, failure, vehicle)


@pytest.mark.complete
def test_a_flight_plan_that_another_station_hurries_sets_its_ground_reference_before_the_flight() -> None:
    """Seen: valid flights of 0.272 and 0.283 m in place of 0.325 m."""
    ended = run_trial(case("paparazzi", "geo init ended early", State.CONNECT, delay_s=0.1))
    assert (ended.outcome, ended.wrong) == ("completed", ())


@pytest.mark.complete
@pytest.mark.parametrize(
    ("autopilot", "what", "state", "delay_s"),
    [
        ("paparazzi", "later and later, to 2 s", State.ARM, 1.2),
        ("px4", "replaced after 1.3 s", State.RECORD, 6.0),
        ("paparazzi", "commands 1.2 s late", State.ARM, 0.9),
        ("paparazzi", "on the ground after 0.6 s", State.RECORD, 6.0),
    ],
)
def test_what_once_stopped_motors_in_the_air_does_not_any_more(
    autopilot: str, what: str, state: State, delay_s: float
) -> None:
    """Seen: told to stop at 0.7 to 2.3 m, several of them then reported safe."""
    assert run_trial(case(autopilot, what, state, delay_s=delay_s)).wrong == ()


@pytest.mark.complete
@pytest.mark.parametrize(
    ("what", "state", "delay_s", "abort_s", "outcome"),
    [
        ("on the ground after 0 s", State.SET_GAINS, 0.46, 0.51, "refused"),
        ("on the ground after 0.3 s", State.TAKEOFF, 0.42, 0.50, "aborted"),
    ],
)
def test_a_drone_whose_position_stays_on_the_ground_is_not_flown_or_has_flown(
    what: str, state: State, delay_s: float, abort_s: float, outcome: str
) -> None:
    """Seen: it rose to 0.1 to 0.4 m, was aborted, landed as its flight plan reported, and had not flown."""
    lies = case("paparazzi", what, state, delay_s)
    abort = PlannedFault(ABORT, State.TAKEOFF, abort_s)
    assert run_trial(replace(lies, faults=(*lies.faults, abort))).outcome == outcome


@pytest.mark.parametrize(
    "autopilot", ["paparazzi", *(pytest.param(each, marks=pytest.mark.complete) for each in ("ardupilot", "px4"))]
)
def test_nothing_is_written_while_another_vehicle_with_its_ids_flies(autopilot: str) -> None:
    """Seen: the safe gains, and then the trial's, went to the one that flew."""
    ended = run_trial(case(autopilot, "flying twin", State.CONNECT, delay_s=0.0))
    assert ended.wrong == ()
    assert ended.outcome == "refused"


@pytest.mark.complete
def test_every_hazard_sets_in_in_every_state_and_under_every_autopilot_that_it_concerns() -> None:
    drawn = {(each.autopilot, each.faults[0].kind, each.faults[0].state) for each in cases()}
    assert drawn == {
        (autopilot, kind, state)
        for kind, hazard in HAZARDS.items()
        for autopilot in hazard.autopilots
        for state in hazard.states
    }
    assert len({each.seed for each in cases()}) == len(cases()) >= 3500


def test_every_hazard_has_one_cause_and_uses_faults_that_exist() -> None:
    for hazard in HAZARDS.values():
        causes = (hazard.link, hazard.faults, hazard.late_s, hazard.act)
        assert sum(bool(cause) for cause in causes) == 1
        assert set(hazard.faults) <= set(FAULTS)


# ---- checks

OVER_S = 50.0
ON_GROUND = tuple(TrueState(at_s, 0.0, 0.0, armed=False, heard=True) for at_s in np.arange(0.0, 70.0, 0.5))
"""Never off the ground: the trial is over at 50 s, and the vehicle attended to for 20 s more."""
UP = tuple(replace(each, height_m=3.0, armed=True) if each.time_s >= 10.0 else each for each in ON_GROUND)
"""Left hovering."""
DOWN = tuple(replace(each, height_m=0.0, armed=False) if each.time_s > 48.0 else each for each in UP)
WHOLE = Trajectory(np.arange(0.0, 33.5, 0.5), {"altitude_m": np.full(67, 3.0)}, "mavlink", "vehicle")
SAFE_AND_SOUND = ReportedOutcome("completed", "safe", "", record=WHOLE)
QUARANTINED = ReportedOutcome(
    "invalid", "quarantined", "A pilot took manual control.", "It flies.", "It flies.", failure="F10a"
)
LANDED_ON = tuple((at_s, Command.LAND) for at_s in np.arange(45.0, 70.0, 6.0))


def happened(true_states: Sequence[TrueState] = DOWN, kind: str = "disarmed once", **more: Any) -> GroundTruth:
    """A trial with a hazard that set in as it hovered."""
    states = TrialStates([(State.CONNECT, 1.0), (State.TAKEOFF, 10.0), (State.RECORD, 11.0)], ended_s=OVER_S)
    known = {
        "case": case("paparazzi", kind, State.RECORD),
        "injected": [InjectedFault(kind, State.RECORD, 16.0, float("inf"))],
        "sent": [(10.0, Command.TAKE_OFF)],
        "stops": [],
        "holds_safe": True,
    }
    return GroundTruth(states=states, true_states=true_states, armed=true_states[-1].armed, **{**known, **more})


def test_a_trial_reported_as_it_happened_has_no_violations() -> None:
    assert find_violations(happened(), SAFE_AND_SOUND) == ()
    assert find_violations(happened(UP, "pilot", pilot_seen_s=[16.5, 17.0]), QUARANTINED) == ()
    assert (
        find_violations(
            happened(kind="deaf"), ReportedOutcome("invalid", "quarantined", "It did not confirm.", "Look at it.")
        )
        == ()
    )


def test_land_must_be_repeated_to_a_vehicle_that_stays_in_the_air() -> None:
    left = replace(QUARANTINED, failure="")
    assert find_violations(happened(UP, "deaf", sent=LANDED_ON), left) == ("the vehicle was left at 3.00 m",)
    assert find_violations(happened(UP, "deaf", sent=LANDED_ON[:1]), left) == (
        "the vehicle was left at 3.00 m",
        "the vehicle was left in the air for 24 s without Land",
    )
    unheard = tuple(replace(each, heard=each.time_s < 52.0) for each in UP)
    assert find_violations(happened(unheard, "deaf"), left) == ("the vehicle was left at 3.00 m",)


@pytest.mark.parametrize("command", [Command.GAIN, Command.ARM, Command.TAKE_OFF])
def test_only_land_may_be_sent_to_a_vehicle_in_the_air_after_its_trial(command: Command) -> None:
    truth = happened(UP, "deaf", sent=[*LANDED_ON, (55.0, command)])
    assert f"{command} was sent in the air after the trial" in find_violations(truth, QUARANTINED)


def test_nothing_may_be_sent_to_a_vehicle_that_a_pilot_flies() -> None:
    told: Mapping[str, Any] = {"pilot_seen_s": [16.5, 17.0]}
    assert find_violations(happened(UP, "pilot", sent=[(17.0, Command.LAND)], **told), QUARANTINED) == ()
    assert find_violations(happened(UP, "pilot", sent=[(19.0, Command.LAND)], **told), QUARANTINED) == (
        "land was sent while a pilot flew the vehicle",
    )
    assert find_violations(happened(DOWN, "pilot", overruled_s=17.0, **told), QUARANTINED) == (
        "the vehicle was taken from a pilot whom a heartbeat had shown",
    )


def test_one_heartbeat_of_a_pilot_does_not_justify_leaving_the_vehicle_in_the_air() -> None:
    assert find_violations(happened(UP, "pilot for 1 s", pilot_seen_s=[16.5]), QUARANTINED) == (
        "the vehicle was left at 3.00 m",
        "the vehicle was left in the air for 19 s without Land",
    )


def test_motors_stopped_in_the_air_and_excess_height_are_found() -> None:
    risen = (replace(DOWN[30], height_m=6.0), *DOWN)
    assert find_violations(happened(risen, stops=[MotorStop(15.0, 2.08)]), SAFE_AND_SOUND)[:2] == (
        "motors off was sent at 2.08 m",
        "the vehicle rose to 6.00 m",
    )


@pytest.mark.parametrize(
    ("kind", "true_states", "reported", "wrong"),
    [
        ("disarmed once", UP, SAFE_AND_SOUND, "reported as safe, but is armed"),
        ("disarmed once", UP, SAFE_AND_SOUND, "armed or in the air at the end, but no concern was reported"),
        ("disarmed once", UP, SAFE_AND_SOUND, "armed or in the air after its trial, but no concern was reported"),
        ("z nan", DOWN, SAFE_AND_SOUND, "reported as completed, although z nan set in"),
        ("disarmed once", DOWN, ReportedOutcome("refused", "safe", ""), "reported as not flown, but it flew ()"),
        (
            "z nan",
            DOWN,
            ReportedOutcome("invalid", "safe", "Low.", failure="F7"),
            "invalid as F7, which did not occur (Low.)",
        ),
        (
            "z nan",
            DOWN,
            ReportedOutcome("invalid", "safe", "Not landed."),
            "invalid as no failure, which did not occur (Not landed.)",
        ),
        (
            "z nan",
            DOWN,
            ReportedOutcome("aborted", "safe", "It stood still.", failure="F9d"),
            "counted against the gains, but the cause was z nan (It stood still.)",
        ),
        ("disarmed once", ON_GROUND, ReportedOutcome("refused", "safe", "Why."), "refused for a reason that did not"),
        (
            "disarmed once",
            DOWN,
            ReportedOutcome("completed", "quarantined", "", "?"),
            "unnecessary quarantine (?)",
        ),
        ("disarmed once", ON_GROUND, SAFE_AND_SOUND, "a valid record without a flight"),
    ],
)
def test_a_report_that_differs_from_what_happened_is_found(
    kind: str, true_states: Sequence[TrueState], reported: ReportedOutcome, wrong: str
) -> None:
    assert any(each.startswith(wrong) for each in find_violations(happened(true_states, kind), reported))


def test_a_hazard_that_never_began_is_not_a_valid_reason() -> None:
    reported = ReportedOutcome("invalid", "safe", "Its position was lost.", failure="F9d")
    assert find_violations(happened(kind="z nan", injected=[]), reported) == (
        "invalid as F9d, which did not occur (Its position was lost.)",
    )


def test_a_vehicle_that_fell_is_not_safe() -> None:
    reported = ReportedOutcome("invalid", "safe", "", failure="F10b")
    assert find_violations(happened(kind="foreign kill", impact_m_s=6.5), reported) == (
        "reported as safe, but it hit the ground at 6.5 m/s",
    )


def test_after_the_death_of_the_process_a_vehicle_may_wait_fifteen_seconds_for_land() -> None:
    left = ReportedOutcome("lost", "quarantined", "It is armed.", "It is armed.", "It is armed.")
    waiting = happened(UP, "process killed", sent=[(64.5, Command.LAND)])
    assert find_violations(waiting, left) == ("the vehicle was left at 3.00 m",)
    assert find_violations(happened(UP, "process killed"), left) == (
        "the vehicle was left at 3.00 m",
        "the vehicle was left in the air for 19 s without Land",
    )


def test_a_valid_record_is_complete_and_agrees_with_the_true_height() -> None:
    lower = Trajectory(WHOLE.time_s, {"altitude_m": np.where(WHOLE.time_s < 15.0, 3.0, 2.5)}, "mavlink", "vehicle")
    assert find_violations(happened(), replace(SAFE_AND_SOUND, record=lower)) == (
        "a valid record differs by 0.50 m from the true height",
    )
    short = Trajectory(WHOLE.time_s[:50], {"altitude_m": np.full(50, 3.0)}, "mavlink", "vehicle")
    assert find_violations(happened(), replace(SAFE_AND_SOUND, record=short)) == ("a valid record ends after 24.5 s",)
    low = tuple(replace(each, height_m=min(each.height_m, 2.1)) for each in DOWN)
    shifted = Trajectory(WHOLE.time_s, {"altitude_m": np.full(67, 2.1)}, "mavlink", "vehicle")
    assert find_violations(happened(low), replace(SAFE_AND_SOUND, record=shifted)) == (
        "a valid record, but the vehicle hovered at 2.10 m: its altitude has another zero",
    )
    sunk = tuple(replace(each, height_m=1.0) if 30.0 < each.time_s < 31.0 else each for each in DOWN)
    assert "a valid record, but the vehicle was at 1.00 m" in find_violations(happened(sunk), SAFE_AND_SOUND)
