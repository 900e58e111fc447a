import pytest

from app.core.errors import InputError
from app.vehicles.mavlink.addresses import Address
from app.vehicles.mocap.addresses import NatNetAddress, OdometryAddress, SourceAddress, StreamAddress, parse


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("natnet:192.168.1.10?body=3", NatNetAddress(host="192.168.1.10", body=3)),
        ("natnet:motive?body=3&up=z", NatNetAddress(host="motive", body=3, up="z")),
        ("natnet:10.0.0.2?body=1&multicast=no", NatNetAddress(host="10.0.0.2", body=1, multicast="")),
        (
            "natnet:10.0.0.2?body=1&local=10.0.0.5&multicast=239.1.2.3&command_port=1610&data_port=1611",
            NatNetAddress(
                host="10.0.0.2", body=1, local="10.0.0.5", multicast="239.1.2.3", command_port=1610, data_port=1611
            ),
        ),
        ("odometry", OdometryAddress()),
        ("mavlink:udpin:0.0.0.0:14600", StreamAddress(Address("udpin", "0.0.0.0", 14600))),
    ],
)
def test_a_source_is_written_as_one_text(text: str, address: SourceAddress) -> None:
    assert parse(text) == address


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("vicon:10.0.0.2", "must be natnet:HOST"),
        ("odometry:1", "must be natnet:HOST"),
        ("natnet:10.0.0.2", "needs Motive's host and the streaming id"),
        ("natnet:?body=1", "needs Motive's host"),
        ("natnet:10.0.0.2?body=bebop", "body must be a whole number"),
        ("natnet:10.0.0.2?body=1&up=x", "up must be y or z"),
        ("natnet:10.0.0.2?body=1&speed=2", "takes body, up, local"),
        ("natnet:10.0.0.2?body=1&body=2", "each once"),
        ("natnet:10.0.0.2?body=1&local=eth0", "local must be an IPv4 address"),
        ("natnet:10.0.0.2?body=1&multicast=10.0.0.9", "multicast must be a group"),
        ("natnet:10.0.0.2?body=1&multicast=maybe", "multicast must be a group"),
        ("natnet:10.0.0.2?body=1&data_port=0", "data_port must be between 1"),
        ("mavlink:udpin:0.0.0.0", "must be udp:HOST:PORT"),
    ],
)
def test_what_is_wrong_with_a_text_is_said(text: str, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        parse(text)
