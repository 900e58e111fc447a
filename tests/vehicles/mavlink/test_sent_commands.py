"""Steps in progress: which replies count, and when the mode that follows set points is requested; Land and motors off
outside of a trial: for how long they are sent, by what the vehicle says of itself.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, cast

import pytest

from app.autopilots.commands import Action, Target
from app.autopilots.measurements import BlockEntered, CommandReply, Heartbeat, Measurement, Position
from app.autopilots.registry import AUTOPILOTS
from app.vehicles.mavlink.events import ActionDone, ActionRefused, PacketReceived
from app.vehicles.mavlink.link import Link
from app.vehicles.mavlink.radio import AutopilotLink
from app.vehicles.mavlink.sent_commands import CommandSequence, RepeatedCommand
from tests.clocks import SimulatedClock

HOLD, POSITION, OFFBOARD = "4.3", "3.0", "6.0"
GUIDED, STABILIZE, LAND, BRAKE = "4", "0", "9", "17"
HEARTBEAT = Heartbeat(autopilot=3, armed=True, mode=GUIDED, system=1, component=1)
LANDED_BLOCK, TAKE_OFF_BLOCK, STANDBY_BLOCK = 14, 4, 5


class Sent(list[str]):
    """In place of a link: the kinds of message that went out."""

    def send(self, kind: str, **_fields: object) -> None:
        self.append(kind)


class Commanded:
    """A vehicle with an action in progress; each `second` it reports this mode, if any."""

    def __init__(self, autopilot: str, action: Action) -> None:
        self.clock, self.sent = SimulatedClock(), Sent()
        link = cast("Link", self.sent)
        self.radio = AutopilotLink(link, AUTOPILOTS[autopilot], self.clock, Target(system=1, aircraft=1))
        self.clock.wait_s(10.0)
        self.sequence = CommandSequence(action, self.radio.profile.steps(action, self.radio.target), self.radio)

    @property
    def requests(self) -> int:
        return self.sent.count("COMMAND_LONG")

    def hear(self, measurement: Measurement, age_s: float = 0.0) -> ActionDone | None:
        self.radio.seen.note(measurement, self.clock.now_s() - age_s)
        ended = self.sequence.proceed([PacketReceived(measurement, self.clock.now_s() - age_s)])
        assert ended is None or isinstance(ended, ActionDone)
        return ended

    def second(self, mode: str = "") -> int:
        """How many requests for a mode are sent in it."""
        before = self.requests
        if mode:
            self.hear(Heartbeat(12, armed=True, mode=mode))
        for _ in range(10):
            self.clock.wait_s(0.1)
            self.sequence.proceed([])
        return self.requests - before


def test_a_reply_received_before_the_message_was_sent_confirms_nothing() -> None:
    commanded = Commanded("paparazzi", Action.FLY_TO)
    reply = CommandReply(AUTOPILOTS["paparazzi"].steps(Action.FLY_TO, commanded.radio.target)[0].awaits, accepted=True)
    assert commanded.hear(reply, age_s=0.1) is None
    assert commanded.hear(reply) is not None


def test_offboard_is_requested_only_right_after_a_heartbeat_that_reports_hold() -> None:
    """Set points must have arrived for a second then; the request that follows is at most 0.1 s later."""
    commanded = Commanded("px4", Action.HOLD)
    assert [commanded.second(HOLD), commanded.second(HOLD)] == [0, 0], "the newest heartbeat is 0.2 s old"
    assert [commanded.second(POSITION), commanded.second(POSITION)] == [0, 0]
    assert [commanded.second(HOLD), commanded.second(), commanded.second(HOLD)] == [1, 0, 1]
    assert [commanded.second(OFFBOARD), commanded.second(OFFBOARD)] == [0, 0], "though the reply was lost"
    assert commanded.sent[-1] == "SET_POSITION_TARGET_LOCAL_NED"


def test_the_texts_of_a_refusal_and_of_no_reply() -> None:
    armed, ignored = Commanded("ardupilot", Action.ARM), Commanded("paparazzi", Action.FLY_TO)
    reply = CommandReply("command 176", accepted=False, why="result 4, failed")
    refused = armed.sequence.proceed([PacketReceived(reply, armed.clock.now_s())])
    while (unanswered := ignored.sequence.proceed([])) is None:
        ignored.clock.wait_s(0.1)
    assert [each.why for each in (refused, unanswered) if isinstance(each, ActionRefused)] == [
        "The vehicle refused to arm (result 4, failed).",
        "The vehicle did not reply to the command to fly to its next set point.",
    ]


class Ordered:
    """A vehicle in the air at whose own link a person has ordered something; each `second` it says this."""

    def __init__(
        self, action: Action = Action.LAND, autopilot: str = "ardupilot", *, is_withheld: bool = False
    ) -> None:
        self.clock, self.sent = SimulatedClock(), Sent()
        blocks = {"land here": 13, "land": LANDED_BLOCK, "Takeoff": 4}
        self.radio = AutopilotLink(
            cast("Link", self.sent), AUTOPILOTS[autopilot], self.clock, Target(system=1, aircraft=1, blocks=blocks)
        )
        self.told(HEARTBEAT)
        self.clock.wait_s(0.1)
        self.order = RepeatedCommand(self.radio, action, is_withheld=is_withheld)
        self.first = len(self.sent) or 1

    def told(self, *measurements: Measurement) -> list[PacketReceived]:
        for measurement in measurements:
            self.radio.seen.note(measurement, self.clock.now_s())
        return [PacketReceived(measurement, self.clock.now_s()) for measurement in measurements]

    def second(self, *said: Measurement, climb_rate_m_s: float = 0.0) -> int:
        """How many orders go out in it: four looks, a position at each, and at the first what else it says."""
        before = len(self.sent)
        for look in range(4):
            self.clock.wait_s(0.25)
            place = Position(self.clock.now_s(), 2.0, climb_rate_m_s)
            self.order.proceed(self.told(*(said if look == 0 else ()), place))
        return (len(self.sent) - before) // self.first

    def seconds(self, count: int, *said: Measurement, **moves: float) -> Sequence[int]:
        return [self.second(*said, **moves) for _ in range(count)]


def flying(**differently: Any) -> Heartbeat:
    return replace(HEARTBEAT, **differently)


def test_land_goes_on_after_a_moment_of_sinking_that_was_no_landing() -> None:
    ordered = Ordered()
    ordered.clock.wait_s(0.1)
    ordered.order.proceed(ordered.told(HEARTBEAT, Position(0.2, 2.0, -0.5)))
    assert sum(ordered.seconds(10, HEARTBEAT)) >= 9


def test_land_is_not_sent_again_while_the_vehicle_sinks_and_again_once_it_does_not() -> None:
    ordered = Ordered()
    ordered.seconds(2, HEARTBEAT, climb_rate_m_s=-0.5)
    assert ordered.seconds(5, HEARTBEAT, climb_rate_m_s=-0.5) == [0, 0, 0, 0, 0]
    assert sum(ordered.seconds(5, HEARTBEAT)) >= 4


def test_land_is_not_sent_again_while_the_mode_says_so_and_again_once_it_is_another() -> None:
    ordered = Ordered()
    ordered.second(flying(mode=LAND))
    assert ordered.seconds(5, flying(mode=LAND)) == [0, 0, 0, 0, 0]
    assert sum(ordered.seconds(5, HEARTBEAT)) >= 4


def test_a_block_reported_before_the_command_does_not_confirm_it() -> None:
    ordered = Ordered(autopilot="paparazzi")
    ordered.radio.seen.block, ordered.radio.seen.block_s = LANDED_BLOCK, 0.0
    assert sum(ordered.seconds(5, flying(mode="4"))) >= 4
    ordered.told(BlockEntered(LANDED_BLOCK))
    assert sum(ordered.seconds(15, flying(mode="4"))) == 0


def test_a_person_who_takes_the_vehicle_over_is_not_disturbed_and_one_heartbeat_is_nobody() -> None:
    ordered = Ordered()
    assert sum(ordered.seconds(3, flying(mode=STABILIZE), HEARTBEAT)) >= 2
    ordered.seconds(3, flying(mode=STABILIZE))
    assert ordered.seconds(5, flying(mode=STABILIZE)) == [0, 0, 0, 0, 0]
    assert ordered.seconds(5, HEARTBEAT) == [0, 0, 0, 0, 0]


def test_a_pilots_mode_in_one_heartbeat_is_not_overruled_before_the_next_one_has_told() -> None:
    """Land would take the vehicle out of a hand that has just taken it."""
    ordered = Ordered()
    by_turns = [ordered.second(each) for each in (HEARTBEAT, flying(mode=STABILIZE)) * 5]
    assert sum(by_turns[0::2]) >= 4
    assert sum(by_turns[1::2]) == 0


def test_a_pilots_mode_in_the_last_heartbeat_of_all_holds_land_up_for_a_moment_only() -> None:
    ordered = Ordered()
    ordered.second(flying(mode=STABILIZE))
    assert sum(ordered.seconds(5)) >= 3


def test_land_that_is_given_without_a_person_waits_for_the_second_heartbeat_of_a_pilot() -> None:
    ordered = Ordered()
    ordered.told(flying(mode=STABILIZE))
    ordered.sent.clear()
    ordered.order = RepeatedCommand(ordered.radio, Action.LAND, by_person=False)
    assert not ordered.sent
    assert sum(ordered.seconds(4, HEARTBEAT)) >= 3


@pytest.mark.parametrize(
    ("autopilot", "mode", "block", "is_landed"),
    [
        ("ardupilot", GUIDED, None, True),
        ("ardupilot", LAND, None, True),
        ("ardupilot", BRAKE, None, False),
        ("ardupilot", STABILIZE, None, False),
        ("px4", "4.2", None, True),
        ("px4", "6.0", None, True),
        ("px4", "4.5", None, False),
        ("paparazzi", "4", None, True),
        ("paparazzi", "4", TAKE_OFF_BLOCK, True),
        ("paparazzi", "4", STANDBY_BLOCK, False),
        ("paparazzi", "home", None, False),
    ],
)
def test_land_that_is_withheld_begins_once_two_heartbeats_agree_that_the_vehicle_flies_as_in_a_trial(
    autopilot: str, mode: str, block: int | None, is_landed: bool
) -> None:
    """Paparazzi tells its block when it changes only, so that of a flight before is not known."""
    ordered = Ordered(autopilot=autopilot, is_withheld=True)
    ordered.radio.seen.block = block
    assert (ordered.order.is_withheld, ordered.sent) == (True, [])
    assert ordered.seconds(2, flying(mode=mode), flying(mode="4.3"))[0] == 0, "one packet decides nothing"
    assert (sum(ordered.seconds(5, flying(mode=mode))) > 0) == is_landed
    assert (ordered.order.is_withheld, ordered.order.trouble != "") == (not is_landed, False)


def test_land_that_is_withheld_is_over_for_good_with_a_pilot_or_with_the_motors() -> None:
    for heartbeat in (flying(mode=STABILIZE), flying(armed=False)):
        ordered = Ordered(is_withheld=True)
        ordered.seconds(3, heartbeat)
        assert (ordered.order.is_over, sum(ordered.seconds(5, HEARTBEAT))) == (True, 0)


def test_a_vehicle_that_flies_again_long_after_it_was_landing_is_somebody_elses() -> None:
    ordered = Ordered()
    ordered.seconds(25, flying(mode=LAND))
    assert ordered.seconds(5, HEARTBEAT, climb_rate_m_s=1.0) == [0, 0, 0, 0, 0]


@pytest.mark.parametrize("action", [Action.LAND, Action.KILL])
def test_nothing_is_sent_any_more_once_the_motors_stand(action: Action) -> None:
    ordered = Ordered(action)
    ordered.seconds(3, flying(armed=False))
    assert ordered.seconds(3, flying(armed=False)) == [0, 0, 0]


def test_motors_off_is_sent_for_five_seconds_whatever_flies() -> None:
    ordered = Ordered(Action.KILL)
    assert sum(ordered.seconds(5, HEARTBEAT, climb_rate_m_s=-2.0)) >= 4
    assert ordered.seconds(5, HEARTBEAT, climb_rate_m_s=-2.0) == [0, 0, 0, 0, 0]
