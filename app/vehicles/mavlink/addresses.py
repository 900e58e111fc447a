"""Addresses of vehicles, written as one text.

udp:HOST:PORT[@LOCALPORT]  send to the vehicle there, from LOCALPORT (Paparazzi sends to a port fixed in its firmware)
udpin:HOST:PORT            wait at our own address until a vehicle sends
tcp:HOST:PORT              connect to the vehicle
serial:DEVICE:BAUD         a telemetry radio or cable
"""

import ipaddress
from dataclasses import dataclass
from typing import Final

from app.core.errors import InputError, Problem

LARGEST_PORT: Final = 65535
FORMS: Final = "udp:HOST:PORT[@LOCALPORT], udpin:HOST:PORT, tcp:HOST:PORT or serial:DEVICE:BAUD"


@dataclass(frozen=True, slots=True)
class UdpAddress:
    """A vehicle that receives at `host`:`port`; `local_port` is ours, None for any free one."""

    host: str
    port: int
    local_port: int | None = None

    def __str__(self) -> str:
        return f"udp:{self.host}:{self.port}" + (f"@{self.local_port}" if self.local_port is not None else "")


@dataclass(frozen=True, slots=True)
class UdpInAddress:
    """Our own address, to which the vehicle sends first; 0.0.0.0 means every interface."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"udpin:{self.host}:{self.port}"


@dataclass(frozen=True, slots=True)
class TcpAddress:
    """A vehicle, or a bridge to it, that accepts connections at `host`:`port`."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"tcp:{self.host}:{self.port}"


@dataclass(frozen=True, slots=True)
class SerialAddress:
    """A serial device, such as /dev/ttyUSB0, and its baud rate."""

    device: str
    baud: int

    def __str__(self) -> str:
        return f"serial:{self.device}:{self.baud}"


Address = UdpAddress | UdpInAddress | TcpAddress | SerialAddress


def parse(text: str) -> Address:
    """Parse an address; str() of the result is the text again. Raises InputError with the reason if it is invalid."""
    kind, _, rest = text.strip().partition(":")
    place, _, number = rest.rpartition(":")
    match kind:
        case "udp" if place:
            port, at, local = number.partition("@")
            return UdpAddress(place, _port(text, port), _port(text, local) if at else None)
        case "udpin" if place:
            return UdpInAddress(place, _port(text, number))
        case "tcp" if place:
            return TcpAddress(place, _port(text, number))
        case "serial" if place:
            return SerialAddress(place, _positive(text, number, "the baud rate"))
    raise _error(text, f"must be {FORMS}")


def is_loopback(address: Address) -> bool:
    """Whether the address is on this computer, and so of a simulation, not a vehicle."""
    return not isinstance(address, SerialAddress) and is_loopback_host(address.host)


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
