"""The results of PX4's own checks, by the events and the metadata of a recorded log."""

import io
import json
import lzma
import struct
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import pytest
from pyulog import ULog

from app.autopilots.dialects import COMMON
from app.autopilots.measurements import VehicleEvent
from app.autopilots.px4.arming_checks import (
    ARMING_CHECK_SUMMARY,
    COMPONENTS,
    HEALTH_SUMMARY,
    MODE_GROUPS,
    Px4ArmingChecks,
)
from app.autopilots.registry import AUTOPILOTS
from tests.logs.recorded import recorded

HOLD, TAKE_OFF, MISSION, POSITION = "4.3", "4.2", "4.4", "3.0"
GPS, SYSTEM = 3, 20


@cache
def log() -> ULog:
    return ULog(io.BytesIO(recorded("px4_takeoff.ulg")))


@cache
def metadata() -> Any:
    packed = b"".join(log().msg_info_multiple_dict["metadata_events"][0])
    return json.loads(lzma.decompress(packed))["components"]["1"]


def recorded_events() -> list[VehicleEvent]:
    data = log().get_dataset("event").data
    places = [name for name in data if name.startswith("arguments[")]
    return [
        VehicleEvent(
            int(data["id"][at]), int(data["event_sequence"][at]), bytes(int(data[place][at]) for place in places)
        )
        for at in range(len(data["id"]))
    ]


def block(sequence: int, *, errors: int, checks: Sequence[tuple[int, int]], chunk: int = 0) -> list[VehicleEvent]:
    """As a PX4 sends it that may not arm in any mode."""
    arguments = [struct.pack("<BIIII", chunk, errors, 0, 0, 0), *(struct.pack("<IB", *check) for check in checks)]
    numbers = [ARMING_CHECK_SUMMARY, *(1 << 24 | 7 for _ in checks), HEALTH_SUMMARY]
    return [
        VehicleEvent(number, sequence + place, said.ljust(40, b"\0"))
        for place, (number, said) in enumerate(zip(numbers, [*arguments, bytes([chunk])], strict=True))
    ]


def heard(events: Sequence[VehicleEvent]) -> Px4ArmingChecks:
    checks = Px4ArmingChecks()
    for event in events:
        checks.take(event)
    return checks


def test_numbers_names_and_modes_are_those_of_the_metadata() -> None:
    summaries = {
        1 << 24 | int(number): [(one["name"], one["type"]) for one in event["arguments"]]
        for group in ("arming_check", "health")
        for number, event in metadata()["event_groups"][group]["events"].items()
        if event.get("type") == "summary"
    }
    assert [name for name, _ in summaries[ARMING_CHECK_SUMMARY]] == [
        "chunk_idx",
        "error",
        "warning",
        "can_arm",
        "can_run",
    ]
    assert summaries[HEALTH_SUMMARY][0] == ("chunk_idx", "uint8_t")
    enums = metadata()["enums"]
    components, modes = enums["health_component_t"], enums["navigation_mode_group_t"]
    assert {components["type"], modes["type"]} == {"uint32_t"}
    assert {1 << bit: name for bit, name in enumerate(COMPONENTS)} == {
        int(bit): entry["description"] for bit, entry in components["entries"].items()
    }
    groups = metadata()["navigation_mode_groups"]["groups"]
    named = {f"{mode >> 16 & 0xFF}.{mode >> 24}": int(group) for group, [mode] in groups.items()}
    assert MODE_GROUPS.items() <= named.items()


def test_a_recorded_vehicle_arms_in_some_modes_and_names_what_keeps_it_from_others() -> None:
    """It has no mission and no remote control, and took off."""
    checks = heard(recorded_events())
    assert {HOLD, TAKE_OFF} <= checks.arming_modes
    assert not {MISSION, POSITION} & checks.arming_modes
    assert (checks.failing(HOLD), checks.failing(MISSION)) == ((), ("System",))


def test_what_has_told_nothing_names_nothing() -> None:
    assert (heard([]).failing(HOLD), heard([]).arming_modes) == ((), frozenset())


FAILING = block(65533, errors=1 << GPS | 1 << SYSTEM, checks=[(0xFFFFFFFF, GPS), (1 << 3, SYSTEM)])


def test_what_fails_in_other_modes_is_not_named() -> None:
    """By numbers that begin anew at 65536."""
    events = [replace(event, sequence=event.sequence % 65536) for event in FAILING]
    assert heard(events).failing(HOLD) == ("GPS",)
    assert heard(events).failing(MISSION) == heard(events).failing("9.9") == ("GPS", "System")


@pytest.mark.parametrize("lost", [1, 2, 3])
def test_where_an_event_was_lost_everything_that_fails_is_named(lost: int) -> None:
    later = VehicleEvent(1 << 24 | 9, 10, bytes(40))
    assert heard([*FAILING[:lost], *FAILING[lost + 1 :], later]).failing(HOLD) == ("GPS", "System")


def test_a_lost_summary_leaves_the_results_before_it() -> None:
    whole = block(1, errors=1 << GPS, checks=[(0xFFFFFFFF, GPS)])
    assert heard([*whole, *block(4, errors=0, checks=[])[1:]]).failing(HOLD) == ("GPS",)


def test_results_in_several_chunks_are_joined_and_each_is_replaced_by_its_own() -> None:
    first = block(1, errors=1 << GPS, checks=[(0xFFFFFFFF, GPS)])
    second = block(4, errors=1 << SYSTEM, checks=[(0xFFFFFFFF, SYSTEM)], chunk=1)
    assert heard([*first, *second]).failing(HOLD) == ("GPS", "System")
    assert heard([*first, *second, *block(7, errors=0, checks=[])]).failing(HOLD) == ("System",)


def test_events_that_come_twice_count_once_and_a_reboot_begins_anew() -> None:
    whole = block(500, errors=1 << GPS, checks=[(0xFFFFFFFF, GPS)])
    assert heard([whole[0], whole[1], whole[1], whole[2]]).failing(HOLD) == ("GPS",)
    assert heard([*whole, *block(1, errors=1 << SYSTEM, checks=[(0xFFFFFFFF, SYSTEM)])]).failing(HOLD) == ("System",)


def test_results_without_an_end_are_given_up() -> None:
    checks = heard([FAILING[0], *(replace(FAILING[1], sequence=65534 + more) for more in range(300))])
    assert checks.failing(HOLD) == ("GPS", "System")


def test_an_event_is_read_from_the_wire() -> None:
    """A frame as the standard has it (message 410, CRC_EXTRA 160), packed here field by field."""
    payload = struct.pack("<IIHBBB40s", 0x01A893E0, 91_032, 17, 0, 0, 0x88, FAILING[0].arguments).rstrip(b"\0")
    header = struct.pack("<BBBBBB", len(payload), 0, 0, 5, 1, 1) + (410).to_bytes(3, "little")
    crc = 0xFFFF
    for byte in header + payload + bytes([160]):
        mixed = (byte ^ crc) & 0xFF
        mixed = (mixed ^ mixed << 4) & 0xFF
        crc = crc >> 8 ^ mixed << 8 ^ mixed << 3 ^ mixed >> 4
    frame = b"\xfd" + header + payload + struct.pack("<H", crc)
    [message] = COMMON.codec(system=255, component=190).parse(frame)
    assert AUTOPILOTS["px4"].measure(message) == VehicleEvent(ARMING_CHECK_SUMMARY, 17, FAILING[0].arguments)
    [noise] = COMMON.codec(system=255, component=190).parse(frame[:-1] + bytes([frame[-1] ^ 1]))
    assert noise.get_type() == "BAD_DATA"
