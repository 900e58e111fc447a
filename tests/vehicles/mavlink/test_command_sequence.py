"""Steps in progress: which replies count, and when the mode that follows set points is requested."""

from typing import cast

from app.autopilots.commands import Action, Target
from app.autopilots.measurements import CommandReply, Heartbeat, Measurement
from app.autopilots.registry import AUTOPILOTS
from app.vehicles.mavlink.events import ActionDone, ActionRefused, PacketReceived
from app.vehicles.mavlink.link import Link
from app.vehicles.mavlink.radio import AutopilotLink
from app.vehicles.mavlink.sent_commands import CommandSequence
from tests.clocks import SimulatedClock
from tests.vehicles.mavlink.test_repeated_command import Sent

HOLD, POSITION, OFFBOARD = "4.3", "3.0", "6.0"


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
