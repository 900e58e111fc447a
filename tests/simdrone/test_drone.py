"""The loop around a simulated drone: links, clocks, and ground stations that send rubbish."""

import math
from collections.abc import Iterator
from contextlib import closing
from itertools import pairwise
from random import Random
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from app.autopilots.simulated.body import MOTORS_OFF, TICK_S, TICK_STEPS, throttle_command
from app.autopilots.simulated_kinds import SIMULATED
from app.core.control.vertical_guidance import RATE_HZ
from app.core.errors import InputError
from app.simdrone.catalogue import get_autopilot, new_body
from app.simdrone.drone import CATCH_UP_S
from app.vehicles.mavlink.transports import LinkError
from tests.clocks import ManualClock
from tests.ports import free_port
from tests.simdrone.ground import Ground, UdpWire, dialect_of, flying, served, switched_on
from tests.simdrone.paparazzi import Pilot
from tests.waiting import eventually

EXTREMES = {
    "float": (math.nan, math.inf, -math.inf, 3.4e38, -1.0, 0.0),
    "char": (b"", b"gui_v_kp", b"MPC_Z_P", b"\xff" * 16, b"x" * 16),
    "uint8_t": (0, 1, 31, 255),
    "int8_t": (-128, 0, 127),
    "uint16_t": (0, 16, 176, 400, 511, 65535),
    "int16_t": (-32768, -1, 0, 75, 76, 32767),
    "uint32_t": (0, 4294967295),
    "int32_t": (-2147483648, 2147483647),
    "uint64_t": (0, 2**64 - 1),
    "int64_t": (-(2**63), 2**63 - 1),
    "double": (math.nan, 1e300),
}
HEEDED = frozenset(
    (
        *("HEARTBEAT", "SET_MODE", "PARAM_SET", "PARAM_REQUEST_READ", "PARAM_REQUEST_LIST", "COMMAND_LONG"),
        *("REQUEST_DATA_STREAM", "MISSION_ITEM", "MISSION_ACK"),
        *("SCRIPT_ITEM", "SCRIPT_REQUEST", "SCRIPT_REQUEST_LIST"),
    )
)


def extreme_messages(mavlink: Any, system: int, random: Random) -> Iterator[bytes]:
    """Messages that the autopilot heeds, with whatever their fields can carry."""
    sender = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
    known = [each for each in mavlink.mavlink_map.values() if each.msgname in HEEDED]
    for _ in range(400):
        message = random.choice(known)
        fields = {
            name: random.choice(EXTREMES[kind])
            for name, kind in zip(message.fieldnames, message.fieldtypes, strict=True)
        }
        if "target_system" in fields:
            fields["target_system"] = system
        yield message(**fields).pack(sender)


@pytest.mark.parametrize(
    "autopilot",
    [pytest.param(each, marks=pytest.mark.complete) if each == "ardupilot-4.7" else each for each in SIMULATED],
)
def test_nothing_that_a_ground_station_can_say_ends_it(autopilot: str) -> None:
    kind = get_autopilot(autopilot)
    drone = switched_on(autopilot)
    random = Random(1)
    answers = 0
    for data in extreme_messages(dialect_of(autopilot), kind.system, random):
        drone.receive(data)
        drone.receive(random.randbytes(20))
        for _ in range(10):
            answers += len(drone.tick())
    assert answers > 300


def test_its_time_follows_the_clock_and_never_overtakes_it() -> None:
    clock = ManualClock()
    with served("paparazzi", f"udp:127.0.0.1:{free_port()}@{free_port()}", clock=clock) as drone:
        for clock.time_s in (0.0, 0.5, 1.75):
            eventually(lambda: drone.time_s > clock.time_s - TICK_S)
            assert drone.time_s <= clock.time_s


@pytest.mark.parametrize("catch_up_s", [CATCH_UP_S, 0.1])
def test_what_a_drone_cannot_catch_up_with_is_lost(catch_up_s: float) -> None:
    clock, link = ManualClock(), f"udp:127.0.0.1:{free_port()}@{free_port()}"
    with served("paparazzi", link, clock=clock, catch_up_s=catch_up_s) as drone:
        clock.time_s = 60.0
        eventually(lambda: drone.time_s > catch_up_s - TICK_S)
        assert drone.time_s <= catch_up_s


def heights_of_two_flights(seed: int) -> list[float]:
    """After three seconds of the same thrust each, with a fall in between."""
    body = new_body("twin", {"scatter": 1.0}, seed=seed)
    heights = []
    for _ in range(2):
        body.advance(3 * RATE_HZ, throttle_command(0.7))
        heights.append(body.altitude_m)
        while not body.is_resting:
            body.advance(TICK_STEPS, MOTORS_OFF)
    return heights


def test_each_flight_has_a_seed_of_its_own_and_the_first_one_decides_them_all() -> None:
    first, second = heights_of_two_flights(3)
    assert first != second
    assert heights_of_two_flights(3) == [first, second]
    assert heights_of_two_flights(4)[0] == second


@pytest.mark.parametrize("vehicle", ["twin", "jsbsim"])
def test_a_body_flies_whatever_the_memory_held_that_its_rows_are_written_to(
    monkeypatch: pytest.MonkeyPatch, vehicle: str
) -> None:
    body = new_body(vehicle, {}, seed=3)

    def found(shape: int | tuple[int, ...], dtype: type = np.float64) -> NDArray[Any]:
        return np.full(shape, np.nan if dtype is np.float64 else -1, dtype)

    monkeypatch.setattr(np, "empty", found)
    body.advance(3 * RATE_HZ, throttle_command(0.9))
    assert body.altitude_m > 1.0


def test_two_drones_do_not_share_a_port() -> None:
    link = f"udp:127.0.0.1:{free_port()}@{free_port()}"
    with served("px4", link), pytest.raises(LinkError), served("px4", link):
        pass


def test_a_drone_may_wait_for_its_ground_station_to_speak_first() -> None:
    port = free_port()
    with served("paparazzi", f"udpin:127.0.0.1:{port}"), closing(UdpWire(("127.0.0.1", port))) as wire:
        ground = Ground(dialect_of("paparazzi"), wire)
        Pilot(ground).send_setting("gui_v_kp", 411.0)
        answer = ground.expect("PARAM_VALUE", lambda message: message.param_value == 411.0)
    assert answer.param_id == "gui_v_kp"


def test_an_unknown_autopilot_or_body_is_refused_by_its_name() -> None:
    with pytest.raises(InputError) as refusal:
        get_autopilot("betaflight")
    assert refusal.value.problems[0].field == "autopilot"
    with pytest.raises(InputError) as refusal:
        new_body("lti", {}, seed=1)
    assert refusal.value.problems[0].field == "vehicle"


def test_packets_of_a_drone_are_numbered_through() -> None:
    ground = flying("ardupilot")
    numbers = [each.get_seq() for each in ground.listen(5.0)]
    assert {(b - a) % 256 for a, b in pairwise(numbers)} == {1}
