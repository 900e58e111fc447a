"""Signed links: MAVLink 2 with a key that both ends hold."""

from contextlib import closing
from pathlib import Path

import pytest

from app.autopilots.dialects import (
    ARDUPILOTMEGA,
    BAD_DATA,
    PAPARAZZI,
    Codec,
    FieldValue,
    number,
    read_key,
    signing_time,
)
from app.core.clock import ScaledClock
from app.core.errors import InputError
from app.vehicles.mavlink.link import Link
from tests.vehicles.mavlink.speaking import FakeVehicleEndpoint, collect, position
from tests.waiting import eventually

KEY = bytes(range(32))
WRONG_KEY = bytes(32)
SIGNATURE_BYTES = 13
CLOCK = ScaledClock()
LAND: dict[str, FieldValue] = {
    "target_system": 1,
    "target_component": 1,
    "command": 21,
    "confirmation": 0,
    **{f"param{index}": 0.0 for index in range(1, 8)},
}


def ends() -> tuple[Codec, Codec]:
    """A vehicle's and a ground station's end of one signed link."""
    return (
        ARDUPILOTMEGA.codec(system=1, component=1, signing_key=KEY),
        ARDUPILOTMEGA.codec(system=255, component=190, signing_key=KEY),
    )


def telemetry(vehicle: Codec, time_boot_ms: int) -> bytearray:
    return bytearray(vehicle.pack(ARDUPILOTMEGA.message("LOCAL_POSITION_NED", position(time_boot_ms))))


def test_a_signed_link_carries_commands_and_telemetry() -> None:
    with (
        FakeVehicleEndpoint(ARDUPILOTMEGA, system=1, key=KEY) as vehicle,
        closing(Link(vehicle.address, ARDUPILOTMEGA, clock=CLOCK, target_system=1, signing_key=KEY)) as link,
    ):
        vehicle.say("LOCAL_POSITION_NED", **position(20))
        assert [number(each.message, "time_boot_ms") for each in collect(link, 1)] == [20]
        link.send("COMMAND_LONG", **LAND)
        heard = [message.get_type() for message in vehicle.hear() + vehicle.hear()]
        assert sorted(heard) == ["COMMAND_LONG", "HEARTBEAT"]
        assert all(frame[2] == 1 for frame in vehicle.frames)  # the flag of a signed frame


@pytest.mark.parametrize("key", [None, WRONG_KEY], ids=["unsigned", "wrong key"])
def test_what_is_not_signed_with_the_key_is_noise(key: bytes | None) -> None:
    with (
        FakeVehicleEndpoint(ARDUPILOTMEGA, system=1, key=key) as vehicle,
        closing(Link(vehicle.ground_address, ARDUPILOTMEGA, clock=CLOCK, target_system=1, signing_key=KEY)) as link,
    ):
        vehicle.say("LOCAL_POSITION_NED", **position(20))
        eventually(lambda: link.health.foreign == 1)  # nor does it make itself the vehicle
        assert link.receive(0.0) == []
        assert link.health.last_packet_s is None


def test_a_frame_that_is_played_back_is_noise() -> None:
    vehicle, ground = ends()
    frame = bytes(telemetry(vehicle, 20))
    assert [message.get_type() for message in ground.parse(frame + frame)] == ["LOCAL_POSITION_NED", BAD_DATA]


def test_one_damaged_time_stamp_does_not_make_all_that_follows_too_old() -> None:
    vehicle, ground = ends()
    assert len(ground.parse(bytes(telemetry(vehicle, 20)))) == 1
    damaged = telemetry(vehicle, 40)
    damaged[-7] ^= 0x40  # the highest byte of the time stamp: years ahead
    assert [message.get_type() for message in ground.parse(bytes(damaged))] == [BAD_DATA]
    (message,) = ground.parse(bytes(telemetry(vehicle, 60)))
    assert number(message, "time_boot_ms") == 60


def test_time_stamps_keep_up_with_time() -> None:
    """The library counts frames; a vehicle that starts again would find such a time stamp a minute behind its own."""
    vehicle, _ = ends()
    stamps = []
    for _ in range(3):
        before = signing_time()
        frame = telemetry(vehicle, 20)
        stamps.append(int.from_bytes(frame[-12:-6], "little"))
        assert before <= stamps[-1] <= signing_time() + len(stamps)
    assert stamps == sorted(set(stamps))


def test_paparazzi_cannot_be_signed() -> None:
    with (
        FakeVehicleEndpoint(PAPARAZZI) as vehicle,
        pytest.raises(InputError, match="The dialect paparazzi cannot be signed") as refusal,
    ):
        Link(vehicle.address, PAPARAZZI, clock=CLOCK, signing_key=KEY)
    assert refusal.value.problems[0].reason == "needs MAVLink 2"


def test_a_key_is_64_hexadecimal_digits(tmp_path: Path) -> None:
    file = tmp_path / "key"
    file.write_text(KEY.hex() + "\n")
    assert read_key(file) == KEY


@pytest.mark.parametrize("text", ["", "secret", "00" * 31, "00" * 33, "zz" * 32])
def test_what_is_no_key_is_refused_and_not_repeated(tmp_path: Path, text: str) -> None:
    file = tmp_path / "key"
    file.write_text(text)
    with pytest.raises(InputError) as refusal:
        read_key(file)
    assert "64 hexadecimal digits" in refusal.value.problems[0].reason
    assert not text or text not in str(refusal.value)
