"""What was seen on real links, flown again; and the judge of trials over hostile links is judged."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from app.core.records.trajectory import Trajectory
from app.simdrone.faults import FAULTS
from bench.hazards.cases import SAFE, TUNED, Case, Mishap
from bench.hazards.expectations import EXPECTED
from bench.hazards.hostile import carry_out, cases
from bench.hazards.hostility import HAZARDS, MISFORTUNES
from bench.hazards.rig import Stopping, Struck
from bench.hazards.stages import Stage, Stages
from bench.hazards.truth import Moment, ReportedOutcome, Truth, judge
from bench.hazards.wire import Order


def case(autopilot: str, what: str, stage: Stage, delay_s: float = 5.0, duration_s: float = float("inf")) -> Case:
    return Case(
        seed=1,
        autopilot=autopilot,
        mishaps=(Mishap(what, stage, delay_s, duration_s),),
        gains=TUNED[autopilot],
        warm_s=5.0,
        waits_s=0.0,
        pinned=True,
    )


SEEN = [
    ("paparazzi", "z nan", Stage.RECORD, "invalid", "froze while packets still arrived"),
    ("paparazzi", "companion as autopilot", Stage.RECORD, "completed", ""),
    ("paparazzi", "disarmed once", Stage.RECORD, "completed", ""),
    ("ardupilot", "reboot once", Stage.RECORD, "completed", ""),
    ("paparazzi", "twin 0.4 s older", Stage.LAND, "invalid", "Two vehicles use the same system id"),
    ("paparazzi", "pilot", Stage.RECORD, "invalid", "A pilot took over manual control"),
    ("paparazzi", "carried away", Stage.RECORD, "aborted", "away from its start"),
]
SEEN_ALIKE = [
    ("paparazzi", "vz nan", Stage.RECORD, "invalid", "froze while packets still arrived"),
    ("paparazzi", "x nan", Stage.RECORD, "invalid", "froze while packets still arrived"),
    ("ardupilot", "companion as autopilot", Stage.RECORD, "completed", ""),
    ("px4", "companion as autopilot", Stage.RECORD, "completed", ""),
    ("px4", "an hour ahead", Stage.RECORD, "completed", ""),
    ("ardupilot", "deaf", Stage.RECORD, "invalid", "The vehicle began to land by itself"),
    ("px4", "mocap nan", Stage.RECORD, "invalid", "The second source of altitude did not track it"),
    ("px4", "pilot for 1 s", Stage.RECORD, "invalid", "A pilot may have flown the vehicle"),
    ("ardupilot", "twin 3600 s older", Stage.RECORD, "invalid", "Two vehicles use the same system id"),
]
"""Further ones, for the complete ring."""


@pytest.mark.parametrize(
    ("autopilot", "what", "stage", "outcome", "reason"),
    [*SEEN, *(pytest.param(*one, marks=pytest.mark.complete) for one in SEEN_ALIKE)],
)
def test_what_was_seen_is_met_as_it_must_be(autopilot: str, what: str, stage: Stage, outcome: str, reason: str) -> None:
    ended = carry_out(case(autopilot, what, stage, delay_s=2.0))
    assert ended.wrong == ()
    assert (ended.outcome, reason in ended.reason) == (outcome, True)


DROPPED = [
    ("paparazzi", "later and later, to 1 s", Stage.ARM, 0.8),
    ("paparazzi", "later and later, to 2 s", Stage.ARM, 1.2),
    ("paparazzi", "commands 1.2 s late", Stage.ARM, 0.9),
    ("paparazzi", "commands 2 s late", Stage.ARM, 0.9),
    ("paparazzi", "on the ground after 0 s", Stage.ARM, 0.5),
    ("paparazzi", "on the ground after 0.6 s", Stage.RECORD, 6.0),
    ("paparazzi", "on the ground after 1 s", Stage.RECORD, 6.0),
    ("paparazzi", "replaced after 1.3 s", Stage.RECORD, 6.0),
    ("px4", "replaced after 1.3 s", Stage.RECORD, 6.0),
    ("ardupilot", "replaced after 1.3 s", Stage.TAKEOFF, 0.5),
]


@pytest.mark.parametrize(("autopilot", "what", "stage", "delay_s"), DROPPED)
def test_what_once_stopped_motors_in_the_air_does_not_any_more(
    autopilot: str, what: str, stage: Stage, delay_s: float
) -> None:
    """Seen: told to stop at 0.7 to 2.3 m, several of them then reported safe."""
    assert carry_out(case(autopilot, what, stage, delay_s=delay_s)).wrong == ()


@pytest.mark.parametrize("autopilot", SAFE)
def test_nothing_is_written_while_another_vehicle_with_its_ids_flies(autopilot: str) -> None:
    """Seen: the safe gains, and then the trial's, went to the one that flew."""
    ended = carry_out(case(autopilot, "flying twin", Stage.CONNECT, delay_s=0.0))
    assert ended.wrong == ()
    assert ended.outcome == "refused"


def test_every_hazard_sets_in_in_every_state_under_every_autopilot_in_more_than_2000_runs() -> None:
    drawn = [(each.autopilot, each.mishaps[0].kind, each.mishaps[0].stage) for each in cases()]
    assert len(drawn) >= 2000
    assert set(drawn) == {(autopilot, kind, stage) for autopilot in SAFE for kind in HAZARDS for stage in Stage}
    assert len({each.seed for each in cases()}) == len(drawn)


def test_it_is_written_down_what_every_hazard_may_do() -> None:
    assert set(EXPECTED) == set(HAZARDS)
    assert {fault for fault, _ in MISFORTUNES.values()} <= set(FAULTS)


# ---- the judge

OVER_S = 50.0
ON_GROUND = tuple(Moment(at_s, 0.0, 0.0, armed=False, heard=True) for at_s in np.arange(0.0, 70.0, 0.5))
"""Never off the ground: the trial is over at 50 s, and the vehicle attended to for 20 s more."""
UP = tuple(replace(each, height_m=3.0, armed=True) if each.time_s >= 10.0 else each for each in ON_GROUND)
"""Left hovering."""
DOWN = tuple(replace(each, height_m=0.0, armed=False) if each.time_s > 48.0 else each for each in UP)
WHOLE = Trajectory(np.arange(0.0, 33.5, 0.5), {"altitude_m": np.full(67, 3.0)}, "mavlink", "vehicle")
SAFE_AND_SOUND = ReportedOutcome("completed", "safe", "", record=WHOLE)
QUARANTINED = ReportedOutcome("invalid", "quarantined", "A pilot took over manual control.", "It flies.", "It flies.")
LANDED_ON = tuple((at_s, Order.LAND) for at_s in np.arange(45.0, 70.0, 6.0))


def happened(moments: Sequence[Moment] = DOWN, kind: str = "disarmed once", **more: Any) -> Truth:
    """A trial with a hazard that set in as it hovered."""
    stages = Stages([(Stage.CONNECT, 1.0), (Stage.TAKEOFF, 10.0), (Stage.RECORD, 11.0)], over_s=OVER_S)
    known = {
        "case": case("paparazzi", kind, Stage.RECORD),
        "struck": [Struck(kind, Stage.RECORD, 16.0, float("inf"))],
        "sent": [(10.0, Order.TAKE_OFF)],
        "stops": [],
        "holds_safe": True,
    }
    return Truth(stages=stages, moments=moments, armed=moments[-1].armed, **{**known, **more})


def test_a_trial_that_is_told_as_it_was_is_right() -> None:
    assert judge(happened(), SAFE_AND_SOUND) == ()
    assert judge(happened(UP, "pilot", pilot_told_s=[16.5, 17.0]), QUARANTINED) == ()
    assert (
        judge(happened(kind="deaf"), ReportedOutcome("invalid", "quarantined", "It did not confirm.", "Look at it."))
        == ()
    )


def test_after_its_trial_a_vehicle_in_the_air_is_told_to_land_again_and_again() -> None:
    """Land within the trial is no excuse."""
    left = replace(QUARANTINED, reason="It did not confirm.")
    assert judge(happened(UP, "deaf", sent=LANDED_ON), left) == ("it was left at 3.00 m",)
    assert judge(happened(UP, "deaf", sent=LANDED_ON[:1]), left) == (
        "it was left at 3.00 m",
        "it was left in the air for 19 s without Land",
    )
    unheard = tuple(replace(each, heard=each.time_s < 52.0) for each in UP)
    assert judge(happened(unheard, "deaf"), left) == ("it was left at 3.00 m",)


@pytest.mark.parametrize("order", [Order.GAIN, Order.ARM, Order.TAKE_OFF])
def test_nothing_but_land_is_sent_to_one_in_the_air_after_its_trial(order: Order) -> None:
    truth = happened(UP, "deaf", sent=[*LANDED_ON, (55.0, order)])
    assert f"{order} was sent to it in the air after its trial" in judge(truth, QUARANTINED)


def test_nothing_is_sent_to_one_that_a_pilot_flies() -> None:
    told: Mapping[str, Any] = {"pilot_told_s": [16.5, 17.0]}
    assert judge(happened(UP, "pilot", sent=[(17.0, Order.LAND)], **told), QUARANTINED) == ()
    assert judge(happened(UP, "pilot", sent=[(19.0, Order.LAND)], **told), QUARANTINED) == (
        "land was sent while a pilot flew it",
    )
    assert judge(happened(DOWN, "pilot", overruled_s=17.0, **told), QUARANTINED) == (
        "it was taken from a pilot whom a heartbeat had told of",
    )


def test_one_heartbeat_of_a_pilot_is_no_reason_to_leave_it_in_the_air() -> None:
    assert judge(happened(UP, "pilot for 1 s", pilot_told_s=[16.5]), QUARANTINED) == (
        "it was left at 3.00 m",
        "it was left in the air for 19 s without Land",
    )


def test_the_judge_sees_motors_stopped_in_the_air_and_one_that_rises() -> None:
    risen = (replace(DOWN[30], height_m=6.0), *DOWN)
    assert judge(happened(risen, stops=[Stopping(15.0, 2.08)]), SAFE_AND_SOUND)[:2] == (
        "its motors were told to stop at 2.08 m",
        "it rose to 6.00 m",
    )


@pytest.mark.parametrize(
    ("kind", "moments", "reported", "wrong"),
    [
        ("disarmed once", UP, SAFE_AND_SOUND, "it is said to be safe, and is armed"),
        ("disarmed once", UP, SAFE_AND_SOUND, "at last nothing is said of one that is armed or flies"),
        ("disarmed once", UP, SAFE_AND_SOUND, "its trial is over, and nothing is said of one that is armed or flies"),
        ("z nan", DOWN, SAFE_AND_SOUND, "its trial counts as completed, though z nan set in"),
        ("disarmed once", DOWN, ReportedOutcome("refused", "safe", ""), "it is said not to have flown, and did ()"),
        ("z nan", DOWN, ReportedOutcome("invalid", "safe", "Low."), "it is invalid for what did not happen (Low.)"),
        (
            "z nan",
            DOWN,
            ReportedOutcome("aborted", "safe", "It stood still."),
            "its gains are blamed for z nan (It stood still.)",
        ),
        (
            "disarmed once",
            DOWN,
            ReportedOutcome("completed", "quarantined", "", "?"),
            "it was quarantined without need (?)",
        ),
        ("disarmed once", ON_GROUND, SAFE_AND_SOUND, "a record of a flight that never was"),
    ],
)
def test_a_verdict_that_is_not_what_happened_is_wrong(
    kind: str, moments: Sequence[Moment], reported: ReportedOutcome, wrong: str
) -> None:
    assert wrong in judge(happened(moments, kind), reported)


def test_a_hazard_that_never_set_in_is_no_reason() -> None:
    reported = ReportedOutcome("invalid", "safe", "Its position was lost.")
    assert judge(happened(kind="z nan", struck=[]), reported) == (
        "it is invalid for what did not happen (Its position was lost.)",
    )


def test_a_record_that_counts_is_whole_and_where_the_vehicle_was() -> None:
    lower = Trajectory(WHOLE.time_s, {"altitude_m": np.where(WHOLE.time_s < 15.0, 3.0, 2.5)}, "mavlink", "vehicle")
    assert judge(happened(), replace(SAFE_AND_SOUND, record=lower)) == (
        "its record counts, and is 0.50 m from where it was",
    )
    short = Trajectory(WHOLE.time_s[:50], {"altitude_m": np.full(50, 3.0)}, "mavlink", "vehicle")
    assert judge(happened(), replace(SAFE_AND_SOUND, record=short)) == ("its record counts, and ends after 24.5 s",)
    sunk = tuple(replace(each, height_m=1.0) if 30.0 < each.time_s < 31.0 else each for each in DOWN)
    assert "its record counts, and it was at 1.00 m" in judge(happened(sunk), SAFE_AND_SOUND)
