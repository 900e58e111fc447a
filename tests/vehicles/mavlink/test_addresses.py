"""How a vehicle's address is written."""

import pytest

from app.core.errors import InputError
from app.vehicles.mavlink.addresses import Address, is_loopback, parse

WRITTEN: dict[str, Address] = {
    "udp:192.168.1.1:4245@4244": Address("udp", "192.168.1.1", 4245, 4244),
    "udp:drone.local:14550": Address("udp", "drone.local", 14550, None),
    "udpin:0.0.0.0:14550": Address("udpin", "0.0.0.0", 14550),
    "tcp:127.0.0.1:5760": Address("tcp", "127.0.0.1", 5760),
    "serial:/dev/ttyUSB0:57600": Address("serial", "/dev/ttyUSB0", 57600),
    "serial:/dev/serial/by-path/pci-0000:00:14.0-usb-0:2:115200": Address(
        "serial", "/dev/serial/by-path/pci-0000:00:14.0-usb-0:2", 115200
    ),
}


@pytest.mark.parametrize("text", WRITTEN)
def test_an_address_is_read_and_written_alike(text: str) -> None:
    assert parse(text) == WRITTEN[text]
    assert str(parse(text)) == text


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "must be udp:HOST:PORT"),
        ("127.0.0.1:4245", "must be udp:HOST:PORT"),
        ("udp:127.0.0.1", "must be udp:HOST:PORT"),
        ("udp::4245", "must be udp:HOST:PORT"),
        ("bluetooth:host:1", "must be udp:HOST:PORT"),
        ("udp:host:70000", "at most 65535, got 70000"),
        ("udp:host:0", "above 0, got '0'"),
        ("udp:host:4245@", "above 0, got ''"),
        ("udp:host:4245@-1", "above 0, got '-1'"),
        ("tcp:host:5760@1", "above 0, got '5760@1'"),
        ("udpin:host:²", "above 0, got '²'"),
        ("serial:/dev/ttyUSB0:fast", "the baud rate must be a whole number above 0, got 'fast'"),
    ],
)
def test_what_is_no_address_is_refused_with_the_reason(text: str, reason: str) -> None:
    with pytest.raises(InputError) as refusal:
        parse(text)
    assert reason in refusal.value.problems[0].reason
    assert "udp:127.0.0.1:4245@4244" in refusal.value.hint


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("udp:127.0.0.1:4245", True),
        ("udp:127.1.2.3:4245", True),
        ("tcp:localhost:5760", True),
        ("udpin:127.0.0.1:14550", True),
        ("udpin:0.0.0.0:14550", False),
        ("udp:192.168.1.1:4245", False),
        ("tcp:localhost.example.org:5760", False),
        ("serial:/dev/ttyUSB0:57600", False),
    ],
)
def test_only_what_stays_on_this_computer_is_loopback(text: str, expected: bool) -> None:
    assert is_loopback(parse(text)) is expected
