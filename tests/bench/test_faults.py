"""The checks of trials with faults, and what each fault must lead to."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Final

import pytest

from app.autopilots.dialects import FieldValue
from bench.hazards.cases import CELLS, FOR_GOOD_S, SAFE, TUNED, WILD_GAINS, Case, PlannedFault, draw
from bench.hazards.fault_checks import find_violations
from bench.hazards.fault_trial import TrialResult
from bench.hazards.intervals import covers, longest, merged, total
from bench.hazards.results import fly_case
from bench.hazards.rig import InjectedFault, MotorStop
from bench.hazards.trial_states import State, TrialStates
from bench.hazards.wire import DIALECTS, Command, read_command, stops_motors


def case(*faults: PlannedFault, autopilot: str = "paparazzi", staged_s: float = 0.0) -> Case:
    """A case that flies steps under Paparazzi alone."""
    return Case(
        seed=1 if autopilot == "paparazzi" else 12,
        autopilot=autopilot,
        faults=faults,
        gains=TUNED[autopilot],
        powered_s=15.0,
        staged_s=staged_s,
        pinned=True,
        window_s=18.0 if autopilot == "paparazzi" else 12.0,
    )


# ---- cases


def test_consecutive_seeds_cover_every_fault_in_every_state() -> None:
    firsts = [draw(seed).faults[0] for seed in range(1000, 1000 + len(CELLS))]
    drawn = {(each.kind, each.state) for each in firsts if each.kind != WILD_GAINS}
    assert drawn == {cell for cell in CELLS if cell[0] != WILD_GAINS}


def test_a_seed_always_gives_the_same_case_whose_gains_all_differ_from_the_safe_ones() -> None:
    for seed in range(50):
        drawn = draw(seed)
        assert drawn == draw(seed)
        assert all(drawn.gains[name] != value for name, value in SAFE[drawn.autopilot].items())


# ---- commands in packets

TO: Final = {"target_system": 31, "target_component": 0}
ARM_DISARM: Final = {"command": 400, "confirmation": 0, **{f"param{place}": 0.0 for place in range(1, 8)}}
SET_MODE: Final = ARM_DISARM | {"command": 176, "param1": 1.0}
SETTING: Final = {"param_type": 9, "param_value": 1.0}

PACKETS: Final[list[tuple[str, str, dict[str, FieldValue], Command, bool]]] = [
    ("paparazzi", "SCRIPT_ITEM", {**TO, "seq": 13, "name": ""}, Command.LAND, False),
    ("paparazzi", "SCRIPT_ITEM", {**TO, "seq": 4, "name": ""}, Command.TAKE_OFF, False),
    ("paparazzi", "SCRIPT_ITEM", {**TO, "seq": 2, "name": ""}, Command.PREPARE_ARMING, True),
    ("paparazzi", "PARAM_SET", {**TO, **SETTING, "param_id": "kil_thr"}, Command.MOTORS_OFF, True),
    ("paparazzi", "PARAM_SET", {**TO, **SETTING, "param_id": "gui_v_kp"}, Command.GAIN, False),
    ("paparazzi", "COMMAND_LONG", {**TO, **ARM_DISARM}, Command.MOTORS_OFF, True),
    ("paparazzi", "SET_MODE", {"target_system": 31, "base_mode": 1, "custom_mode": 0}, Command.MOTORS_OFF, True),
    ("px4", "COMMAND_LONG", {**TO, **ARM_DISARM, "param1": 1.0}, Command.ARM, False),
    ("px4", "COMMAND_LONG", {**TO, **ARM_DISARM, "param2": 21196.0}, Command.MOTORS_OFF, True),
    ("px4", "COMMAND_LONG", {**TO, **SET_MODE, "param2": 4.0, "param3": 6.0}, Command.LAND, False),
    ("px4", "COMMAND_LONG", {**TO, **SET_MODE, "param2": 4.0, "param3": 2.0}, Command.TAKE_OFF, False),
    ("px4", "COMMAND_LONG", {**TO, **SET_MODE, "param2": 6.0}, Command.FOLLOW, False),
    ("ardupilot", "COMMAND_LONG", {**TO, **SET_MODE, "param2": 9.0}, Command.LAND, False),
    ("ardupilot", "COMMAND_LONG", {**TO, **ARM_DISARM, "command": 22}, Command.TAKE_OFF, False),
]


@pytest.mark.parametrize(("autopilot", "kind", "fields", "told", "stops"), PACKETS)
def test_each_packet_is_read_as_the_command_that_the_vehicle_executes(
    autopilot: str, kind: str, fields: dict[str, FieldValue], told: Command, stops: bool
) -> None:
    message = DIALECTS[autopilot].message(kind, fields)
    assert (read_command(autopilot, message), stops_motors(autopilot, message)) == (told, stops)


def test_overlapping_spans_count_once() -> None:
    assert merged([(3.0, 4.0), (0.0, 1.0), (0.5, 2.0)]) == [(0.0, 2.0), (3.0, 4.0)]
    assert longest([(0.0, 2.0), (3.0, 7.0)], [(1.0, 4.0), (4.0, 5.0)]) == 2.0
    assert total([(0.0, 2.0), (1.0, 3.0)], [(1.5, 10.0)]) == 1.5
    assert covers([(0.0, 1.0), (1.0, 3.0)], (0.5, 2.5))


# ---- checks


def flown(*injected: InjectedFault, **changes: object) -> TrialResult:
    """Result of a normal trial with these faults; `changes` replaces some of its fields."""
    states = TrialStates()
    states.begin(4.0)
    for at_s, told in (
        (4.5, Command.REQUEST),
        (7.0, Command.GAIN),
        (9.0, Command.PREPARE_ARMING),
        (9.5, Command.ARM),
        (11.0, Command.TAKE_OFF),
        (44.1, Command.LAND),
        (51.0, Command.MOTORS_OFF),
        (51.4, Command.GAIN),
    ):
        states.receive(
            told, at_s, armed=9.5 < at_s < 51.2, height_m=3.0 if 12.0 < at_s < 46.0 else 0.0, silent_since_s=None
        )
        states.update_height(3.0 if at_s == 11.0 else 0.0, at_s + 0.6)
    states.ended_s = 51.6
    whole = TrialResult(
        outcome="completed",
        has_record=True,
        vehicle="safe",
        reason="",
        holds_safe=True,
        held=SAFE["paparazzi"],
        flew_on=TUNED["paparazzi"],
        armed=False,
        height_m=0.0,
        rose_m=3.0,
        impact_m_s=0.8,
        touched_down_s=47.0,
        packets=100,
        stops=(MotorStop(51.0, 0.0),),
        injected=injected,
        states=states,
    )
    return replace(whole, **changes)  # type: ignore[arg-type]  # by the test's own names


def test_the_commands_determine_the_states_of_a_trial() -> None:
    assert [state for state, _ in flown().states.entered] == [
        State.CONNECT,
        State.PREFLIGHT,
        State.SET_GAINS,
        State.ARM,
        State.TAKEOFF,
        State.RECORD,
        State.LAND,
        State.DISARM,
        State.RESTORE,
    ]
    assert find_violations(case(), flown()) == []


LINK_LOST: Final = InjectedFault("link-lost", State.RECORD, 20.0, 23.0)
ABORT: Final = InjectedFault("abort", State.RECORD, 20.0, float("inf"))


ARM_ABORT: Final = InjectedFault("abort", State.ARM, 10.0, float("inf"))
TAKE_OFF_ABORT: Final = InjectedFault("abort", State.TAKEOFF, 11.1, float("inf"))
MOTORLESS: Final = InjectedFault("no-lift-off", State.ARM, 10.0, float("inf"))


def stop_requested(at_s: float) -> InjectedFault:
    """Return the operator's motors off at that time."""
    return InjectedFault("motors-off", State.RECORD, at_s, float("inf"))


WRONG: Final[list[tuple[TrialResult, str]]] = [
    (flown(stops=(MotorStop(20.0, 0.2),)), "motors off was sent at 0.20 m"),
    (flown(holds_safe=False), "reported as holding its safe gains, but"),
    (flown(armed=True), "is armed"),
    (flown(height_m=1.0), "off the ground"),
    (flown(vehicle="quarantined"), "unnecessary quarantine"),
    (
        flown(stop_requested(20.0), stops=(MotorStop(20.1, 3.0),), outcome="aborted"),
        "stopped at 3.00 m, but the vehicle",
    ),
    (
        flown(stop_requested(50.9), stops=(MotorStop(51.0, 0.0),), outcome="aborted", vehicle="quarantined"),
        "unnecessary quarantine",
    ),
    (flown(outcome="invalid"), "the trial is invalid, but nothing was expected"),
    (flown(LINK_LOST), "the trial is completed, but F5 invalid"),
    (flown(ABORT), "but F8 aborted was expected"),
    (flown(ABORT), "an abort took effect only after"),
    (flown(InjectedFault("reboot", State.RECORD, 20.0, 22.0), outcome="invalid"), "was not quarantined"),
    (flown(InjectedFault("jumping-position", State.RECORD, 20.0, 30.0)), "F9b invalid was expected"),
    (flown(InjectedFault("low-battery", State.ARM, 9.2, 99.0)), "F7 invalid"),
    (flown(flew_on=SAFE["paparazzi"]), "the vehicle lifted off with"),
    (flown(outcome="refused", has_record=False), "a trial that took off left no record"),
    (flown(TAKE_OFF_ABORT, outcome="refused", rose_m=0.003), "the vehicle rose to 0.003 m, but nothing"),
    (flown(TAKE_OFF_ABORT, outcome="refused", rose_m=0.003), "but F8 aborted was expected"),
    (flown(ARM_ABORT, outcome="aborted", rose_m=0.0), "the trial is aborted, but F8 refused was expected"),
    (flown(MOTORLESS, outcome="refused", rose_m=0.0), "the trial is refused, but F4/F6 aborted"),
]


@pytest.mark.parametrize(("wrong", "complaint"), WRONG, ids=[complaint for _, complaint in WRONG])
def test_every_violation_is_found(wrong: TrialResult, complaint: str) -> None:
    assert any(complaint in each for each in find_violations(case(), wrong))


# ---- whole trials


def befallen(
    kind: str,
    state: State,
    delay_s: float = 0.0,
    duration_s: float = FOR_GOOD_S,
    *,
    autopilot: str = "paparazzi",
    staged_s: float = 0.0,
) -> Case:
    return case(PlannedFault(kind, state, delay_s, duration_s), autopilot=autopilot, staged_s=staged_s)


Row = tuple[Case, str, str]
EVERYDAY: Final[Sequence[Row]] = [
    (befallen("arm-refused", State.CONNECT), "refused", "safe"),
    (befallen("param-unconfirmed", State.CONNECT), "refused", "unopened"),
    (befallen("link-lost", State.RECORD, 2.0, 3.0), "invalid", "safe"),
    (befallen("no-lift-off", State.CONNECT), "aborted", "safe"),
    (befallen("other-landing", State.RECORD, 5.0), "invalid", "safe"),
    (befallen("abort", State.ARM, 0.4), "refused", "safe"),
    (befallen("abort", State.RECORD, 2.0), "aborted", "safe"),
    # a vehicle whose motors were stopped at 3 m passed for safe
    (befallen("motors-off", State.RECORD, 5.0, autopilot="ardupilot"), "aborted", "quarantined"),
]
FURTHER: Final[Sequence[Row]] = [
    (befallen("link-lost", State.RECORD, 2.0), "invalid", "quarantined"),
    (befallen("link-lost", State.RECORD, 10.5, 3.0), "invalid", "safe"),  # in the first step
    (befallen("frozen-position", State.RECORD, 2.0, 2.0), "invalid", "safe"),
    (befallen("jumping-position", State.RECORD, 2.0, 1.2), "completed", "safe"),
    (befallen("duplicated-packets", State.CONNECT), "completed", "safe"),
    (befallen("reordered-packets", State.CONNECT), "completed", "safe"),
    (befallen("reboot", State.RECORD, 2.0), "invalid", "quarantined"),
    (befallen("abort", State.RECORD, 2.0, autopilot="ardupilot"), "aborted", "safe"),
    (befallen("abort", State.RECORD, 2.0, autopilot="px4"), "aborted", "safe"),
    (befallen("mocap-lost", State.RECORD, 2.0), "invalid", "safe"),
    (befallen("mocap-frozen", State.RECORD, 2.0), "invalid", "safe"),
    (befallen("mocap-drift", State.RECORD, 2.0), "invalid", "quarantined"),
    # seed 20261148: each lone sample restarted the two seconds of rest on the ground, until quarantine
    (befallen("jumping-position", State.LAND, 4.4), "completed", "safe"),
    # seed 20261209: a stop before arming left the gains of the trial on the vehicle
    (befallen("abort", State.SET_GAINS, 2.0), "refused", "safe"),
    # a restart while the gains were staged: the trial flew on the autopilot's own; Paparazzi forgets what was set
    (befallen("reboot", State.SET_GAINS, 18.0, staged_s=8.0), "refused", "safe"),
    # PX4 keeps it, but is no longer staged either
    (befallen("reboot", State.SET_GAINS, 3.0, autopilot="px4", staged_s=8.0), "refused", "safe"),
    # seed 20261388: a lift-off that could not be seen, for the link was lost, passed for none
    (befallen("link-lost", State.TAKEOFF, 0.53, 1.34), "invalid", "safe"),
    # seed 20262209: gains that overshoot to the flight plan's own ceiling passed for a landing of its own
    (replace(befallen("wild-gains", State.CONNECT), gains={"kp": 100, "ki": 300, "kd": 10}), "aborted", "safe"),
    # seed 20261168: over a gap in the climb its altitude seemed not to follow its climb rate
    (befallen("link-lost", State.TAKEOFF, 0.295, 0.446), "completed", "safe"),
    # seed 20261610: a PX4 that stood on the ground said that it holds its height there
    (befallen("no-lift-off", State.SET_GAINS, 0.1, autopilot="px4"), "aborted", "safe"),
    # seed 20261320: switched back to its previous mode before a heartbeat could tell, it did not lift off
    (befallen("other-mode", State.TAKEOFF, 0.27, autopilot="px4"), "aborted", "safe"),
    # an abort before the lift-off passed for an aborted flight
    *(
        (befallen(act, state, delay_s, autopilot=autopilot), outcome, "safe")
        for state, delay_s, outcome in ((State.ARM, 0.6, "refused"), (State.TAKEOFF, 0.1, "aborted"))
        for act, autopilot in product(("abort", "motors-off"), SAFE)
    ),
    # seed 7024: the landing is still flown with the trial's gains, so that its limits count against them
    (befallen("lean-oscillation", State.LAND, 2.0, autopilot="px4"), "aborted", "safe"),
    # a program that stood still between listening and looking at the time took its own silence for the vehicle's
    (befallen("stall", State.RECORD, 2.0, 1.2), "completed", "safe"),
]
"""For the complete ring; with a seed, or a defect in words, where a run once found it."""


def named(row: Row) -> str:
    fault = row[0].faults[0]
    return f"{row[0].autopilot}-{fault.kind}-{fault.state}-{fault.delay_s:g} s-for {fault.duration_s:g} s"


@pytest.mark.parametrize(
    ("flown_with", "outcome", "vehicle"),
    [
        *(pytest.param(*row, id=named(row)) for row in EVERYDAY),
        *(pytest.param(*row, id=named(row), marks=pytest.mark.complete) for row in FURTHER),
    ],
)
def test_whatever_befalls_a_trial_it_has_its_required_outcome_and_violates_nothing(
    flown_with: Case, outcome: str, vehicle: str
) -> None:
    line = fly_case(flown_with)
    assert line["wrong"] == []
    assert (line["outcome"], line["vehicle"]) == (outcome, vehicle)
