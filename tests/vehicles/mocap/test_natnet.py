"""A rigid body over real NatNet packets."""

import socket
import struct
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace

import pytest

from app.core.clock import ScaledClock
from app.simdrone.motion_capture import MocapFrame, NatNetServer, frame_packet
from app.vehicles.base import VehicleError
from app.vehicles.mocap import natnet
from app.vehicles.mocap.addresses import NatNetAddress
from app.vehicles.mocap.natnet import NatNetSource
from tests.ports import free_port
from tests.vehicles.mocap.motive import LOOPBACK, FakeMotive, news
from tests.waiting import eventually

CLOCK = ScaledClock()


@pytest.fixture(params=["multicast", "unicast"])
def address(request: pytest.FixtureRequest) -> NatNetAddress:
    group = "239.255.42.99" if request.param == "multicast" else ""
    return NatNetAddress(
        host=LOOPBACK, body=3, local=LOOPBACK, multicast=group, command_port=free_port(), data_port=free_port()
    )


@pytest.fixture
def unicast() -> NatNetAddress:
    return NatNetAddress(host=LOOPBACK, body=3, multicast="", command_port=free_port())


@pytest.fixture
def motive(unicast: NatNetAddress) -> Iterator[FakeMotive]:
    with FakeMotive(unicast) as running:
        yield running


def test_the_body_s_altitude_is_heard_and_dated(address: NatNetAddress) -> None:
    with FakeMotive(address) as motive, closing(NatNetSource(address, CLOCK)) as source:
        motive.altitude_m = 1.5
        eventually(lambda: any(sample.altitude_m > 1.4 for sample in source.take()))
        begun_s = CLOCK.now_s()
        heard = news(source, 50)
        assert [sample.altitude_m for sample in heard] == pytest.approx([1.5] * len(heard), abs=0.01)
        assert all(sample.tracking_valid and sample.advances for sample in heard)
        dates_s = [sample.measured_s for sample in heard]
        assert dates_s == sorted(dates_s)
        assert begun_s - 0.2 < dates_s[0] < dates_s[-1] < CLOCK.now_s()
        assert source.trouble == ""


def test_the_axis_that_is_up_is_as_motive_streams_it(unicast: NatNetAddress) -> None:
    z_up = replace(unicast, up="z")
    with FakeMotive(z_up) as motive, closing(NatNetSource(z_up, CLOCK)) as right:
        motive.altitude_m = 2.0
        eventually(lambda: any(sample.altitude_m > 1.9 for sample in right.take()))
        with closing(NatNetSource(unicast, CLOCK)) as wrong:
            assert max(abs(sample.altitude_m) for sample in news(wrong)) < 0.1


def test_lost_tracking_is_told(unicast: NatNetAddress, motive: FakeMotive) -> None:
    with closing(NatNetSource(unicast, CLOCK)) as source:
        motive.cameras.blind = True
        eventually(lambda: "do not see rigid body 3" in source.trouble)
        assert not any(sample.tracking_valid or sample.advances for sample in news(source))
        motive.cameras.blind = False
        eventually(lambda: source.trouble == "")
        assert all(sample.tracking_valid for sample in news(source))


def test_frames_that_are_sent_again_do_not_advance(unicast: NatNetAddress, motive: FakeMotive) -> None:
    with closing(NatNetSource(unicast, CLOCK)) as source:
        motive.cameras.stuck = True
        eventually(lambda: any(not sample.advances for sample in source.take()))
        assert not any(sample.advances for sample in news(source))


def test_a_body_that_is_not_streamed_is_named_with_those_that_are(unicast: NatNetAddress, motive: FakeMotive) -> None:
    with pytest.raises(VehicleError, match=r"streams no rigid body 4; it streams these ids: 3\. Use the streaming id"):
        NatNetSource(replace(unicast, body=4), CLOCK)


@pytest.mark.complete
def test_frames_on_another_group_than_the_one_listened_to_are_missed_in_words(unicast: NatNetAddress) -> None:
    streamed = replace(unicast, multicast="239.255.42.99", data_port=free_port())
    listened = replace(streamed, multicast="239.255.42.98")
    with FakeMotive(streamed), pytest.raises(VehicleError, match=r"answers, but sent no frames .* &multicast=GROUP"):
        NatNetSource(listened, CLOCK)


def test_nobody_there_is_said_with_address_and_port(monkeypatch: pytest.MonkeyPatch, unicast: NatNetAddress) -> None:
    monkeypatch.setattr(natnet, "ANSWERED_WITHIN_S", 0.1)
    with pytest.raises(VehicleError, match=rf"{LOOPBACK} \(NatNet, port {unicast.command_port}\) is not available"):
        NatNetSource(unicast, CLOCK)


def test_a_server_too_old_to_report_tracking_is_refused(unicast: NatNetAddress) -> None:
    old = NatNetServer(unicast, (2, 5, 0, 0))
    with (
        FakeMotive(unicast, old),
        pytest.raises(VehicleError, match=r"NatNet 2\.5\.0\.0, which does not report whether"),
    ):
        NatNetSource(unicast, CLOCK)


def test_a_system_that_was_switched_off_is_troubled_and_heard_again_when_it_is_back(
    monkeypatch: pytest.MonkeyPatch, unicast: NatNetAddress
) -> None:
    monkeypatch.setattr(natnet, "SILENT_S", 0.2)
    with FakeMotive(unicast, clock_s=900.0):
        source = NatNetSource(unicast, CLOCK)
    with closing(source):
        eventually(lambda: "Nothing was received for rigid body 3" in source.trouble)
        with FakeMotive(unicast):
            eventually(lambda: source.trouble == "")
            assert all(sample.advances for sample in news(source))
    assert "has stopped" in source.trouble


@pytest.mark.filterwarnings("error::pytest.PytestUnhandledThreadExceptionWarning")
def test_rubbish_on_its_port_does_not_end_it(capfd: pytest.CaptureFixture[str], unicast: NatNetAddress) -> None:
    group = replace(unicast, multicast="239.255.42.99", local=LOOPBACK, data_port=free_port())
    whole = frame_packet(MocapFrame(7, 1.0, (0.0, 0.0, 0.5), tracked=True), 3, up="y")
    endless = struct.pack("<HHIII", 7, 12, 7, 0xFFFFFFFF, 0)
    with (
        FakeMotive(group) as motive,
        closing(NatNetSource(group, CLOCK)) as source,
        socket.socket(type=socket.SOCK_DGRAM) as radio,
    ):
        radio.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton(LOOPBACK))
        for rubbish in (b"\x07", whole[:60], whole[:-20], endless, b"\xff" * 200):
            radio.sendto(rubbish, (group.multicast, group.data_port))
        motive.altitude_m = 1.0
        eventually(lambda: any(sample.altitude_m > 0.9 for sample in source.take()))  # it was sent after the rubbish
        assert all(sample.advances for sample in news(source))
        assert source.trouble == ""


def test_a_second_server_on_its_port_is_refused(unicast: NatNetAddress, motive: FakeMotive) -> None:
    with pytest.raises(VehicleError, match="could not be opened"):
        NatNetServer(unicast)
