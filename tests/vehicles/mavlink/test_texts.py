"""The texts of findings, with their numbers. What is done about a finding, other tests assert by its code."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from app.autopilots.commands import Action
from app.autopilots.measurements import Parameter, Position
from app.autopilots.registry import AUTOPILOTS
from app.vehicles.mavlink.events import ActionDone, ActionRefused, SetPointsPaused
from app.vehicles.mavlink.failures import Finding
from app.vehicles.mavlink.monitors.clock import OtherClock
from app.vehicles.mavlink.monitors.modes import ModeMonitor
from app.vehicles.mavlink.trial_state import State
from tests.vehicles.mavlink import test_trial_machine as befall
from tests.vehicles.mavlink.monitors.observing import watch_of
from tests.vehicles.mavlink.monitors.test_altitude import seen
from tests.vehicles.mavlink.monitors.test_commanded import reported
from tests.vehicles.mavlink.test_interventions import COPTER, PX4
from tests.vehicles.mavlink.test_set_point_schedule import STEPS, Stepping, climbing, hovering, unconfirmed
from tests.vehicles.mavlink.walking import GROUND_M, PLAN, TrialDriver

W, AT, GUIDED = watch_of(3.0), Position(10.0, 3.0, 0.0), frozenset({"guided"})
PAPARAZZI = replace(PLAN, autopilot=AUTOPILOTS["paparazzi"])


def limit(last: Position = AT, **changes: Any) -> Finding | None:
    return replace(W.envelope, **changes).find(PLAN, last, settling=True)


def clock(**changes: Any) -> Finding | None:
    return replace(W.clock, **changes).find_frozen(PLAN, AT, 10.0)


def in_mode(mode: str = "", block: str = "") -> ModeMonitor:
    return replace(W.modes, heartbeat_gap_s=0.5, armed=True, mode=mode, agreed=mode, block=block)


FOUND: dict[str, Finding | None] = {
    "F5 Nothing was received for more than 1 s.": W.link.find(PLAN, 10.0, 11.1),
    "F5 Three heartbeats were missed.": W.link.find(PLAN, 8.2, 10.0),
    "F6 It was 4.51 m above the ground; the limit is 4.5 m.": limit(Position(10.0, 4.61, 0.0)),
    "F6 Its climb rate was +4.1 m/s; the limit is ±4 m/s.": limit(Position(10.0, 3.0, 4.1)),
    "F6 Its climb rate was -4.1 m/s; the limit is ±4 m/s.": limit(Position(10.0, 3.0, -4.1)),
    "F6 It was 5.1 m from its start; the limit is 5 m.": limit(Position(10.0, 3.0, 0.0, 3.0, 4.1)),
    "F6 It crossed its set point 4 times by more than ±0.3 m.": limit(crossings=4),
    "F6 The vehicle's own fence was crossed: its greatest altitude.": limit(breached="its greatest altitude"),
    "F6 It was 4.30 m above the ground. Its flight plan entered the block “land”.": in_mode(
        block="land"
    ).find_own_landing(PAPARAZZI, Position(10.0, 4.4, 0.0), mode_known=True),
    "F7 No battery voltage was received for 10 s.": W.battery.find(20.1),
    "F7 The battery voltage was low: 10.0 V.": replace(W.battery, voltage_v=10.0, low_since_s=8.0).find(10.0),
    "F9a Its clock stood still for more than 0.25 s.": clock(stuck_s=0.26),
    "F9a Its clock jumped by +3.0 s.": clock(
        stuck_s=0.26, other=OtherClock(first_s=9.0, last_s=10.0, last=replace(AT, time_boot_s=13.0))
    ),
    "F9a Its clock jumped ahead by 1.0 s.": clock(stepped_s=1.0),
    "F9a The second source of altitude did not track it for more than 0.25 s.": replace(
        W.second, blind_s=0.26
    ).find_blind(PLAN, 10.3),
    "F9a Nothing was received from the second source of altitude for 1 s.": seen((10.0, 3.0)).find_blind(PLAN, 11.1),
    "F9b 4 samples were dropped.": replace(W.positions, glitches=4).find_glitches(),
    "F9c They were 0.35 m apart; more than 0.3 m for 0.3 s is not allowed.": seen(
        (10.0, 3.35), (10.31, 3.35)
    ).find_disagreement(),
    "F9c They were 1.00 m apart before the takeoff command.": seen((10.0, 1.1)).find_disagreement_on_ground(
        0.1, 0.0, 10.1
    ),
    "F9d According to its climb rate it rose 0.6 m more than its altitude shows.": replace(
        W.climb, behind_m=0.6
    ).find_behind(),
    "F9d Its altitude changed by +0.40 m before the takeoff command, and it may have moved.": replace(
        W.positions, last=replace(AT, altitude_m=0.5)
    ).find_departure(GROUND_M, stands=False),
    "F10a The vehicle entered mode Manual.": in_mode("64").find_taken_over(PAPARAZZI),
    "F10b The vehicle rebooted.": replace(W.identity, rebooted=True).find_reboot(),
    "F10b The vehicle disarmed itself in the air.": W.modes.find_disarming(),
    "F10b Its flight plan entered the block “Standby”.": in_mode(block="Standby").find_unexpected(
        PAPARAZZI, GUIDED, GUIDED
    ),
    "F10b The vehicle entered mode Home: it flies back by itself and ignores Land; fly it manually, or stop its "
    "motors.": in_mode("home").find_unexpected(PAPARAZZI, GUIDED, GUIDED),
    "F10b The vehicle entered mode hold before it had climbed.": replace(W.climb, highest_m=1.1).find_interrupted(
        "hold", PX4
    ),
    "F10b The vehicle entered mode home.": reported(*[Parameter("aut_mod", 2.0)] * 2)[1],
    "F10c gui_v_kp changed to 300 by a command that was not Gainline's.": reported(*[Parameter("gui_v_kp", 300.0)] * 2)[
        1
    ],
    "F10c One heartbeat reported mode 64.": in_mode("4").find_interruption(in_mode("64"), PLAN),
    "F11 It entered mode land.": in_mode("land").find_own_landing(COPTER, AT, mode_known=True),
    "F12 Two clocks.": replace(W.identity, duplicate_reason="Two clocks.").find_duplicate(),
    "F13 It hit the ground at 3.5 m/s.": replace(W.positions, last=Position(10.0, 0.2, -3.5)).find_fall(GROUND_M),
}


@pytest.mark.parametrize("text", FOUND)
def test_the_text_of_what_a_monitor_finds(text: str) -> None:
    found = FOUND[text]
    assert found is not None
    assert f"{found.failure} {found.why}" == text


def late() -> TrialDriver:
    walk = hovering(7.6, unheard=True)
    [sent_s] = walk.when(Action.FLY_TO)
    return walk.give(ActionDone(Action.FLY_TO, walk.now_s, (sent_s,), sent_s + 1.6))


FLOWN: dict[str, Callable[[], TrialDriver]] = {
    "F3 It refused to arm.": lambda: befall.arming().give(ActionRefused(Action.ARM, "It refused to arm.", 0.0)),
    "F5 Nothing was received for more than 1 s. The link stayed lost for 60 s.": lambda: befall.lost().pass_s(60.0),
    "F5 Nothing was received for more than 1 s. The vehicle entered mode 64.": lambda: befall.lost().does(
        2.1, mute=False, mode="64"
    ),
    "F6 It descended to the ground by itself.": lambda: befall.recording().climb(-2.0, for_s=1.44).pass_s(1.2),
    "F9e Its clock advanced by 32.6 s in 36.0 s.": lambda: (
        TrialDriver(replace(PLAN, record_s=33.0), tempo=0.905).lift_off().pass_s(33.5)
    ),
    "F14a It refused.": lambda: unconfirmed().give(ActionRefused(Action.FLY_TO, "It refused.", 0.0)),
    "F14a The set point of 6 s was not confirmed in time.": lambda: hovering(10.0, unheard=True),
    "F14a A set point took effect 1.6 s late.": late,
    "F14a The record ended without 1 set point.": lambda: (
        Stepping(replace(STEPS, record_s=11.0)).lift_off().through(State.RECORD)
    ),
    "F14b The vehicle had not reached half of 3 m before the first step, at 6 s.": lambda: climbing().until_s(6.1),
    "F14b The vehicle had not settled before the first step, at 6 s: it changed by 0.38 m in the 2 s before; "
    "0.2 m is allowed.": lambda: hovering(4.0).climb(0.2, for_s=2.1),
    "F14c Gainline stalled, and sent no set point for 0.8 s.": lambda: hovering(7.0).give(SetPointsPaused(0.8, 0.0)),
}


@pytest.mark.parametrize("text", FLOWN)
def test_the_text_of_what_ends_a_trial(text: str) -> None:
    trial = FLOWN[text]().trial
    assert f"{trial.failure} {trial.why}" == text
