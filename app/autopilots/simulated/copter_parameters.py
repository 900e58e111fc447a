"""Parameters of ArduPilot and PX4: named, typed values and their two encodings in a float; and the data in which the
two differ: modes, rates, texts.
"""

import csv
import math
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum, IntEnum
from pathlib import Path

from app.autopilots.dialects import Dialect


class Kind(IntEnum):
    """MAV_PARAM_TYPE."""

    INT8 = 2
    INT16 = 4
    INT32 = 6
    REAL32 = 9


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter with its default."""

    name: str
    kind: Kind
    default: float


def real(name: str, default: float) -> Parameter:
    return Parameter(name, Kind.REAL32, default)


def read_parameters(file: Path) -> tuple[Parameter, ...]:
    """Read parameters from a table with the columns `name`, `kind` and `default`."""
    with file.open(encoding="ascii", newline="") as rows:
        return tuple(Parameter(row["name"], Kind[row["kind"]], float(row["default"])) for row in csv.DictReader(rows))


def read_periods(file: Path) -> Mapping[str, float]:
    """Read the periods of messages, s, from a table with the columns `message` and `period_s`."""
    with file.open(encoding="ascii", newline="") as rows:
        return {row["message"]: float(row["period_s"]) for row in csv.DictReader(rows)}


class Parameters:
    """Parameter values by name, the first of that name, and by place."""

    def __init__(self, known: Sequence[Parameter], *, longest_name: int = 16) -> None:
        """Parameters with longer names are only found by their place."""
        self._known = tuple(known)
        places = reversed([(each.name, place) for place, each in enumerate(known)])
        self._places = {name: place for name, place in places if len(name) <= longest_name}
        self._values = [parameter.default for parameter in known]

    def __len__(self) -> int:
        return len(self._known)

    def __getitem__(self, name: str) -> float:
        return self._values[self._places[name]]

    def __setitem__(self, name: str, value: float) -> None:
        self._values[self._places[name]] = value

    def place(self, name: str) -> int | None:
        """Return the place of a parameter, by its case-sensitive name."""
        return self._places.get(name)

    def values(self) -> dict[str, float]:
        """Return all values by name."""
        return {parameter.name: value for parameter, value in zip(self._known, self._values, strict=True)}

    def at(self, place: int) -> tuple[Parameter, float]:
        return self._known[place], self._values[place]


def encoded(value: float, kind: Kind, *, bytewise: bool) -> float:
    """Return the float that carries a value: the number itself, or `bytewise` the four bytes of an integer."""
    if kind is Kind.REAL32 or not bytewise:
        return value
    (carried,) = struct.unpack("<f", struct.pack("<i", int(value)))
    return float(carried)


def decoded(carried: float, kind: Kind, *, bytewise: bool) -> float | None:
    """Return the value that a float carries, or None if it is invalid; integers sent as numbers are rounded."""
    if bytewise and kind is not Kind.REAL32:
        (value,) = struct.unpack("<i", struct.pack("<f", carried))
        return float(value)
    if not math.isfinite(carried):
        return None
    return carried if kind is Kind.REAL32 else float(round(carried))


class Behaviour(Enum):
    """Behaviour of the vehicle in a flight mode."""

    STAY = "where it is"
    TAKE_OFF = "to the height of takeoff, once armed"
    LAND = "down"
    FOLLOW = "to streamed set points"


class Reaction(Enum):
    """Reactions of a failsafe."""

    NONE = "nothing"
    WARN = "say so"
    HOLD = "stay where it is"
    LAND = "come down"


@dataclass(frozen=True, slots=True)
class FlightMode:
    """A flight mode with its HEARTBEAT.custom_mode and base_mode, and its behaviour."""

    name: str
    custom_mode: int
    base_mode: int
    behaviour: Behaviour = Behaviour.STAY
    may_arm: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class FirmwareProfile:
    """Data of an autopilot. `modes` contains all modes, of which the first is that after the start; `land`, `home`,
    `hold`, `by_hand` and `automatic` are names of modes; `refused` is the result of a refusal, and the texts from
    `no_estimate` on are those sent with it or with a failsafe."""

    dialect: Dialect
    autopilot: int
    version: int
    parameters: tuple[Parameter, ...]
    is_bytewise: bool = False
    """Whether an integer is sent as its four bytes, and a message with a wrong type changes nothing, as in PX4; else it
    is sent as a number, and the type of the message is ignored."""
    periods_s: Mapping[str, float]
    """Periods of the messages that it sends unrequested."""
    streams: tuple[str, ...]
    """Messages that REQUEST_DATA_STREAM requests; none if it is ignored."""
    modes: tuple[FlightMode, ...]
    land: str
    home: str
    hold: str
    by_hand: str
    """Mode in which a pilot flies."""
    automatic: str
    """Mode that a pilot switches back to."""
    refused: int
    unready: str
    """Prefix of the regular status text on why it cannot be armed."""
    no_estimate: str
    not_armable: str
    not_landed: str
    link_lost: str
    fence_breached: str
    idle_limit: str
    """Parameter of the time for which it stays armed on the ground, s."""
    ground_m: float
    """Height of the place of takeoff in the local frame."""
    lacks: frozenset[str] = frozenset()
    """Messages of `copter_telemetry.REPORTS` that it does not know."""
