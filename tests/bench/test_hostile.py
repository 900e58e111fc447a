"""What was seen on real links, flown again; and the judge of trials over hostile links is judged."""

import pytest

from bench.hazards.cases import SAFE, TUNED, Case, Mishap
from bench.hazards.hostile import HostileRig, carry_out, cases, judge
from bench.hazards.hostility import HOSTILITIES
from bench.hazards.rig import Stopping
from bench.hazards.stages import Stage


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
    ("paparazzi", "z nan", Stage.RECORD, "invalid", "stood still while it went on talking"),
    ("paparazzi", "companion as autopilot", Stage.RECORD, "completed", ""),
    ("paparazzi", "disarmed once", Stage.RECORD, "completed", ""),
    ("ardupilot", "reboot once", Stage.RECORD, "completed", ""),
    ("paparazzi", "twin 0.4 s older", Stage.LAND, "invalid", "Two vehicles speak under one system id"),
]
SEEN_ALIKE = [
    ("paparazzi", "vz nan", Stage.RECORD, "invalid", "stood still while it went on talking"),
    ("paparazzi", "x nan", Stage.RECORD, "invalid", "stood still while it went on talking"),
    ("ardupilot", "companion as autopilot", Stage.RECORD, "completed", ""),
    ("px4", "companion as autopilot", Stage.RECORD, "completed", ""),
    ("px4", "an hour ahead", Stage.RECORD, "completed", ""),
    ("ardupilot", "twin 3600 s older", Stage.RECORD, "invalid", "Two vehicles speak under one system id"),
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


def test_every_hostility_sets_in_in_every_state_under_every_autopilot_in_more_than_1500_runs() -> None:
    drawn = [(each.autopilot, each.mishaps[0].kind, each.mishaps[0].stage) for each in cases()]
    assert len(drawn) >= 1500
    assert set(drawn) == {(autopilot, kind, stage) for autopilot in SAFE for kind in HOSTILITIES for stage in Stage}
    assert len({each.seed for each in cases()}) == len(drawn)


def test_the_judge_sees_motors_stopped_in_the_air_a_vehicle_that_is_left_and_one_that_rises() -> None:
    rig = HostileRig(case("paparazzi", "disarmed once", Stage.RESTORE))
    rig.stages.begin(0.0)
    rig.stages.over_s = 1.0
    assert judge(rig, "completed", "quarantined", None) == ()
    rig.stops.append(Stopping(0.5, 2.08))
    rig.heights += [(0.5, 6.0), (2.0, 3.0)]
    rig.drone.body.altitude_m = 3.0
    rig.drone.autopilot._set_motors(on=True)  # type: ignore[attr-defined]
    assert judge(rig, "completed", "safe", None) == (
        "its motors were told to stop at 2.08 m",
        "it was left at 3.00 m",
        "it rose to 6.00 m",
        "it is said to be safe, and is armed",
        "it was left in the air without Land",
    )
