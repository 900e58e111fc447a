"""What was said to the real Paparazzi in two recorded trials, said to the simulated one: it answers and flies alike.

In process and in the drone's own time, so that the comparison depends on nothing else.
"""

from dataclasses import dataclass, field

import numpy as np
import pytest
from pymavlink.dialects.v10 import paparazzi as mavlink

from app.simdrone.catalogue import get_autopilot, new_body
from app.simdrone.drone import Drone
from tests.simdrone.ground import Heard
from tests.simdrone.paparazzi import ARMED, LANDED, START_ENGINE, SYSTEM, TAKEOFF, from_vehicle, recorded

BETWEEN_MESSAGES_S = 0.04
"""The recording's simulation stood still while several were sent: here they come one by one."""
ANSWERS = {
    "PARAM_VALUE": ("param_id", "param_index", "param_type", "param_count"),
    "SCRIPT_COUNT": ("count", "target_system", "target_component"),
    "SCRIPT_ITEM": ("seq", "name", "target_system", "target_component"),
    "MISSION_ACK": ("type", "target_system", "target_component"),
}
MEASURED = ("gui_v_z_sp", "gui_h_sp_pos_x", "gui_h_sp_pos_y", "nav_hea", "air_dat_qnh")


@dataclass
class Session:
    """Everything a drone said, each message with the vehicle time at which it left as `received_s`."""

    drone: Drone
    said: list[Heard] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._parser = mavlink.MAVLink(None)

    def run_until(self, time_s: float) -> None:
        while self.drone.time_s < time_s:
            for frame in self.drone.tick():
                (message,) = self._parser.parse_buffer(frame)
                message.received_s = self.drone.time_s
                self.said.append(message)


def replayed(recording: str) -> list[Heard]:
    kind = get_autopilot("paparazzi")
    session = Session(Drone(new_body("jsbsim", {}, seed=1), lambda body: kind.make(body, kind.system)))
    real = recorded(recording)
    for message in [each for each in real if each.get_srcSystem() != SYSTEM]:
        at_s = message.received_s - real[0].received_s
        session.run_until(max(at_s, session.drone.time_s + BETWEEN_MESSAGES_S))
        session.drone.receive(bytes(message.get_msgbuf()))
    session.run_until(real[-1].received_s - real[0].received_s)
    return session.said


def answers(messages: list[Heard]) -> list[tuple[object, ...]]:
    """What was said because something was asked, in order; of what the vehicle measures only the name."""
    return [
        (each.get_type(), *(getattr(each, name) for name in ANSWERS[each.get_type()]), setting(each))
        for each in from_vehicle(messages)
        if each.get_type() in ANSWERS
    ]


def setting(message: Heard) -> float | None:
    is_setting = message.get_type() == "PARAM_VALUE" and message.param_id not in MEASURED
    return round(message.param_value, 4) if is_setting else None


def heights(messages: list[Heard]) -> tuple[np.ndarray[tuple[int], np.dtype[np.float64]], ...]:
    """Times since the takeoff command was obeyed, and heights."""
    start_s = next(each.received_s for each in from_vehicle(messages, "SCRIPT_CURRENT") if each.seq == TAKEOFF)
    positions = from_vehicle(messages, "LOCAL_POSITION_NED")
    return np.array([each.received_s - start_s for each in positions]), np.array([-each.z for each in positions])


@pytest.mark.parametrize(
    "recording",
    ["paparazzi_1624_1356_195.tlog", pytest.param("paparazzi_283_13_82.tlog", marks=pytest.mark.complete)],
)
def test_a_replayed_recorded_trial_gets_the_same_answers_and_flight(recording: str) -> None:
    real = recorded(recording)
    ours = replayed(recording)
    assert answers(ours) == answers(real)
    blocks = [[each.seq for each in from_vehicle(messages, "SCRIPT_CURRENT")] for messages in (ours, real)]
    kept = [[seq for seq in told if seq in (START_ENGINE, TAKEOFF, LANDED)] for told in blocks]
    assert kept[0] == kept[1] == [START_ENGINE, TAKEOFF, LANDED]
    modes = [[each.base_mode & ARMED for each in from_vehicle(messages, "HEARTBEAT")] for messages in (ours, real)]
    assert modes[0].count(ARMED) == pytest.approx(modes[1].count(ARMED), abs=2)
    (our_s, our_m), (real_s, real_m) = heights(ours), heights(real)
    grid_s = np.arange(-1.0, 55.0, 0.05)
    difference_m = np.interp(grid_s, our_s, our_m) - np.interp(grid_s, real_s, real_m)
    assert float(np.sqrt(np.mean(difference_m**2))) < 0.06
    assert float(np.abs(difference_m).max()) < 0.35
