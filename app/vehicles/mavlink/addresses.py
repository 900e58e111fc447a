"""Addresses of vehicles, written as one text.

udp:HOST:PORT[@LOCALPORT]  send to the vehicle there, from LOCALPORT (Paparazzi sends to a port fixed in its firmware)
udpin:HOST:PORT            wait at our own address until a vehicle sends; 0.0.0.0 means every interface
tcp:HOST:PORT              connect to the vehicle, or a bridge to it
serial:DEVICE:BAUD         a telemetry radio or cable
"""

import ipaddress
from dataclasses import dataclass
from typing import Final, Literal

from app.core.errors import InputError, Problem

LARGEST_PORT: Final = 65535
FORMS: Final = "udp:HOST:PORT[@LOCALPORT], udpin:HOST:PORT, tcp:HOST:PORT or serial:DEVICE:BAUD"


@dataclass(frozen=True, slots=True)
class Address:
    """An address in one of these forms. `place` is the host, ours for udpin, or the serial device; `number` the port or
    the baud rate; `local_port` ours for udp, None for any free one."""

    kind: Literal["udp", "udpin", "tcp", "serial"]
    place: str
    number: int
    local_port: int | None = None

    def __str__(self) -> str:
        local = "" if self.local_port is None else f"@{self.local_port}"
        return f"{self.kind}:{self.place}:{self.number}{local}"


def parse(text: str) -> Address:
    """Parse an address; str() of the result is the text again. Raises InputError with the reason if it is invalid."""
    kind, _, rest = text.strip().partition(":")
    place, _, number = rest.rpartition(":")
    match kind:
        case "udp" if place:
            port, at, local = number.partition("@")
            return Address(kind, place, _port(text, port), _port(text, local) if at else None)
        case "udpin" | "tcp" if place:
            return Address(kind, place, _port(text, number))
        case "serial" if place:
            return Address(kind, place, _positive(text, number, "the baud rate"))
    raise _error(text, f"must be {FORMS}")


def is_loopback(address: Address) -> bool:
    """Whether the address is on this computer, and so of a simulation, not a vehicle."""
    return address.kind != "serial" and is_loopback_host(address.place)


def is_loopback_host(host: str) -> bool:
    """Whether `host` is this computer, by its text alone, without name resolution."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _port(text: str, digits: str) -> int:
    port = _positive(text, digits, "the port")
    if port > LARGEST_PORT:
        raise _error(text, f"the port must be at most {LARGEST_PORT}, got {port}")
    return port


def _positive(text: str, digits: str, what: str) -> int:
    if not (digits.isascii() and digits.isdigit() and int(digits) > 0):
        raise _error(text, f"{what} must be a whole number above 0, got {digits!r}")
    return int(digits)


def _error(text: str, reason: str) -> InputError:
    return InputError(
        f"{text!r} is not the address of a vehicle.",
        problems=(Problem("address", reason),),
        hint="Examples: udp:127.0.0.1:4245@4244, udpin:0.0.0.0:14550, tcp:127.0.0.1:5760, serial:/dev/ttyUSB0:57600.",
    )
