"""Addresses of second sources of altitude, written as one text.

natnet:HOST?body=ID[&up=y|z][&local=ADDRESS][&multicast=GROUP|no]   a rigid body of Motive at HOST
odometry                    ODOMETRY or VISION_POSITION_ESTIMATE on the vehicle's own link
mavlink:ADDRESS             the same messages on another link, ADDRESS as for vehicles
"""

import ipaddress
from contextlib import suppress
from dataclasses import dataclass
from typing import Final, Literal
from urllib.parse import parse_qsl

from app.core.errors import InputError, Problem
from app.vehicles.mavlink import addresses as links

FORMS: Final = "natnet:HOST?body=ID, odometry or mavlink:ADDRESS"
MULTICAST: Final = "239.255.42.99"
COMMAND_PORT: Final = 1510
DATA_PORT: Final = 1511
_UNICAST: Final = "no"
_KEYS: Final = ("body", "up", "local", "multicast", "command_port", "data_port")
_UP: Final[dict[str, Literal["y", "z"]]] = {"y": "y", "z": "z"}


@dataclass(frozen=True, slots=True, kw_only=True)
class NatNetAddress:
    """A rigid body of Motive. `up` is the axis that Motive streams as up, `local` the address of our network interface
    (empty: the one with the route to Motive), `multicast` the group that it streams to, empty for unicast."""

    host: str
    body: int
    up: Literal["y", "z"] = "y"
    local: str = ""
    multicast: str = MULTICAST
    command_port: int = COMMAND_PORT
    data_port: int = DATA_PORT

    def __str__(self) -> str:
        return f"natnet:{self.host}?body={self.body}&up={self.up}"


@dataclass(frozen=True, slots=True)
class OdometryAddress:
    """Odometry on the vehicle's own link."""

    def __str__(self) -> str:
        return "odometry"


@dataclass(frozen=True, slots=True)
class StreamAddress:
    """Odometry on another MAVLink link."""

    link: links.Address

    def __str__(self) -> str:
        return f"mavlink:{self.link}"


SourceAddress = NatNetAddress | OdometryAddress | StreamAddress


def parse(text: str) -> SourceAddress:
    """Parse an address. Raises InputError with the reason if it is invalid."""
    kind, colon, rest = text.strip().partition(":")
    if kind == "natnet" and rest:
        return _natnet(text, rest)
    if kind == "odometry" and not colon:
        return OdometryAddress()
    if kind == "mavlink" and rest:
        return StreamAddress(links.parse(rest))
    raise _error(text, f"must be {FORMS}")


def _natnet(text: str, rest: str) -> NatNetAddress:
    host, _, query = rest.partition("?")
    pairs = parse_qsl(query, keep_blank_values=True)
    settings = dict(pairs)
    if not set(settings) <= set(_KEYS) or len(settings) < len(pairs):
        raise _error(text, f"takes {', '.join(_KEYS)}, each once, got {query!r}")
    if not host or "body" not in settings:
        raise _error(text, "needs Motive's host and the streaming id of the rigid body: natnet:HOST?body=ID")
    if settings.get("up", "y") not in _UP:
        raise _error(text, f"up must be y or z, as in Motive's streaming pane, got {settings['up']!r}")
    multicast = settings.get("multicast", MULTICAST)
    return NatNetAddress(
        host=host,
        body=_whole(text, "body", settings["body"]),
        up=_UP[settings.get("up", "y")],
        local=_ip(text, "local", settings["local"]) if "local" in settings else "",
        multicast="" if multicast == _UNICAST else _group(text, multicast),
        command_port=_port(text, "command_port", settings.get("command_port", str(COMMAND_PORT))),
        data_port=_port(text, "data_port", settings.get("data_port", str(DATA_PORT))),
    )


def _whole(text: str, key: str, digits: str) -> int:
    if not (digits.isascii() and digits.isdigit()):
        raise _error(text, f"{key} must be a whole number, 0 or more, got {digits!r}")
    return int(digits)


def _port(text: str, key: str, digits: str) -> int:
    port = _whole(text, key, digits)
    if not 0 < port <= links.LARGEST_PORT:
        raise _error(text, f"{key} must be between 1 and {links.LARGEST_PORT}, got {port}")
    return port


def _ip(text: str, key: str, address: str) -> str:
    try:
        return str(ipaddress.IPv4Address(address))
    except ValueError as error:
        raise _error(text, f"{key} must be an IPv4 address of this computer, got {address!r}") from error


def _group(text: str, address: str) -> str:
    with suppress(ValueError):
        if (group := ipaddress.IPv4Address(address)).is_multicast:
            return str(group)
    raise _error(text, f"multicast must be a group such as {MULTICAST}, or no, got {address!r}")


def _error(text: str, reason: str) -> InputError:
    return InputError(
        f"{text!r} is not a second source of altitude.",
        problems=(Problem("second_source", reason),),
        hint="Examples: natnet:192.168.1.10?body=3&up=y, odometry, mavlink:udpin:0.0.0.0:14600.",
    )
