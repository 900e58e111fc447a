"""Odometry over real MAVLink packets, on a separate link and on the vehicle's."""

import math
import socket
from collections.abc import Mapping
from contextlib import closing

import pytest

from app.autopilots.dialects import ARDUPILOTMEGA, COMMON, PAPARAZZI, Dialect, FieldValue
from app.core.clock import ScaledClock
from app.vehicles.base import VehicleError
from app.vehicles.mavlink.addresses import Address
from app.vehicles.mavlink.link import Received
from app.vehicles.mavlink.transports import LinkError
from app.vehicles.mavlink_kind import open_source
from app.vehicles.mocap import odometry
from app.vehicles.mocap.addresses import StreamAddress
from app.vehicles.mocap.odometry import OdometrySource, StreamSource
from tests.ports import free_port
from tests.vehicles.mocap.motive import LOOPBACK, FakeMotive, news
from tests.waiting import eventually

CLOCK = ScaledClock()
FROM_ZERO = dict.fromkeys(("x", "y", "roll", "pitch", "yaw"), 0.0)
STILL = dict.fromkeys(("x", "y", "vx", "vy", "vz", "rollspeed", "pitchspeed", "yawspeed"), 0.0)
UNKNOWN: dict[str, FieldValue] = {"pose_covariance": [math.nan] * 21, "velocity_covariance": [math.nan] * 21}


def vision(z: float, usec: int) -> dict[str, FieldValue]:
    return {**FROM_ZERO, "usec": usec, "z": z}


def pose(z: float, usec: int, *, frame: int = 1, quality: int = 0) -> dict[str, FieldValue]:
    place: dict[str, FieldValue] = {"time_usec": usec, "frame_id": frame, "child_frame_id": 8, "z": z}
    return {**STILL, **UNKNOWN, **place, "q": [1.0, 0.0, 0.0, 0.0], "quality": quality}


def hear(source: OdometrySource, kind: str, fields: Mapping[str, FieldValue], dialect: Dialect = COMMON) -> None:
    """Through the wire's bytes."""
    frame = dialect.codec(system=1, component=1).pack(dialect.message(kind, fields))
    (message,) = dialect.codec(system=2, component=2).parse(frame)
    source.on_message(Received(message, CLOCK.now_s()))


@pytest.fixture
def own() -> OdometrySource:
    return OdometrySource("odometry on the vehicle's own link", CLOCK)


@pytest.mark.parametrize("dialect", [PAPARAZZI, ARDUPILOTMEGA, COMMON], ids=lambda dialect: dialect.name)
def test_every_dialect_carries_vision_estimates_on_the_vehicle_s_own_link(
    own: OdometrySource, dialect: Dialect
) -> None:
    for step in range(3):
        hear(own, "VISION_POSITION_ESTIMATE", vision(-1.5 - 0.01 * step, 10_000 * step), dialect)
    heard = own.take()
    assert [sample.altitude_m for sample in heard] == pytest.approx([1.5, 1.51, 1.52])
    assert all(sample.tracking_valid and sample.advances for sample in heard)


@pytest.mark.parametrize(("frame", "altitude_m"), [(1, -2.0), (20, -2.0), (4, 2.0), (21, 2.0)])
def test_odometry_is_up_or_down_by_its_frame(own: OdometrySource, frame: int, altitude_m: float) -> None:
    hear(own, "ODOMETRY", pose(2.0, 1000, frame=frame))
    assert own.take()[0].altitude_m == altitude_m


def test_odometry_that_has_failed_or_is_no_number_is_not_tracking(own: OdometrySource) -> None:
    hear(own, "ODOMETRY", pose(-1.0, 1000, quality=80))
    assert own.trouble == ""
    hear(own, "ODOMETRY", pose(-1.1, 2000, quality=-1))
    hear(own, "ODOMETRY", pose(math.nan, 3000))
    assert [sample.tracking_valid for sample in own.take()] == [True, False, False]
    assert own.trouble == "The odometry on the vehicle's own link has failed."


def test_the_first_kind_heard_is_the_one_taken_and_other_messages_are_passed_over(own: OdometrySource) -> None:
    hear(own, "STATUSTEXT", {"severity": 6, "text": "hello"})
    hear(own, "VISION_POSITION_ESTIMATE", vision(-1.0, 1000))
    hear(own, "ODOMETRY", pose(-7.0, 2000))
    hear(own, "VISION_POSITION_ESTIMATE", vision(-1.1, 3000))
    assert [sample.altitude_m for sample in own.take()] == pytest.approx([1.0, 1.1])


def test_a_link_without_odometry_is_troubled(monkeypatch: pytest.MonkeyPatch, own: OdometrySource) -> None:
    monkeypatch.setattr(odometry, "SILENT_S", 0.05)
    eventually(lambda: own.trouble.startswith("No odometry on the vehicle's own link was received for"))


def test_another_stream_is_heard_in_a_thread_of_its_own() -> None:
    port = free_port()
    with FakeMotive(StreamAddress(Address("udp", LOOPBACK, port))) as motive:
        motive.altitude_m = 1.2
        with closing(open_source(f"mavlink:udpin:{LOOPBACK}:{port}", CLOCK)) as source:
            eventually(lambda: any(sample.altitude_m > 1.1 for sample in source.take()))
            heard = news(source, 50)
            assert source.trouble == ""
            motive.cameras.blind = True
            failed = f"The odometry at mavlink:udpin:{LOOPBACK}:{port} has failed."
            eventually(lambda: source.trouble == failed)
    assert heard[-1].altitude_m == pytest.approx(1.2, abs=0.01)
    assert all(sample.advances for sample in heard)
    assert "has stopped" in source.trouble


def test_a_stranger_on_the_port_is_not_taken_for_the_motion_capture() -> None:
    port = free_port()
    with socket.socket(type=socket.SOCK_DGRAM) as stranger:
        chatter = COMMON.codec(system=9, component=9).pack(COMMON.message("STATUSTEXT", {"severity": 6, "text": "hi"}))
        with FakeMotive(StreamAddress(Address("udp", LOOPBACK, port))):
            stranger.sendto(chatter, (LOOPBACK, port))
            with closing(StreamSource(StreamAddress(Address("udpin", LOOPBACK, port)), CLOCK)) as source:
                stranger.sendto(b"\xff" * 40, (LOOPBACK, port))
                source.take()
                eventually(lambda: any(sample.advances for sample in source.take()))


def test_a_port_where_nothing_is_heard_or_that_is_taken_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(odometry, "RECEIVED_WITHIN_S", 0.2)
    port = free_port()
    with pytest.raises(VehicleError, match=rf"No ODOMETRY .* arrived at mavlink:udpin:{LOOPBACK}:{port} within 0.2 s"):
        open_source(f"mavlink:udpin:{LOOPBACK}:{port}", CLOCK)
    with socket.socket(type=socket.SOCK_DGRAM) as other:
        other.bind((LOOPBACK, port))
        with pytest.raises(LinkError, match="could not be opened"):
            open_source(f"mavlink:udpin:{LOOPBACK}:{port}", CLOCK)
