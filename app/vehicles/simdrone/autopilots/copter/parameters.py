"""Parameters of the MAVLink 2 autopilots: named, typed values, and the two ways of carrying them in a float."""

import math
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum


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


class Parameters:
    """The values held, by name and by place."""

    def __init__(self, known: Sequence[Parameter]) -> None:
        self._known = tuple(known)
        self._places = {parameter.name: place for place, parameter in enumerate(known)}
        self._values = [parameter.default for parameter in known]

    def __len__(self) -> int:
        return len(self._known)

    def __getitem__(self, name: str) -> float:
        return self._values[self._places[name]]

    def __setitem__(self, name: str, value: float) -> None:
        self._values[self._places[name]] = value

    def place(self, name: str) -> int | None:
        """Case matters."""
        return self._places.get(name)

    def at(self, place: int) -> tuple[Parameter, float]:
        return self._known[place], self._values[place]


@dataclass(frozen=True, slots=True)
class Coding:
    """How a value travels: `encode(value, kind)` gives the float of the message, `decode(float, kind)` the value,
    None where it is none. `is_strict`: a wrong type changes nothing."""

    encode: Callable[[float, Kind], float]
    decode: Callable[[float, Kind], float | None]
    is_strict: bool


def _as_number(value: float, _kind: Kind) -> float:
    return value


def _from_number(carried: float, kind: Kind) -> float | None:
    """Integers are rounded."""
    if not math.isfinite(carried):
        return None
    return carried if kind is Kind.REAL32 else float(round(carried))


def _as_bytes(value: float, kind: Kind) -> float:
    if kind is Kind.REAL32:
        return value
    (carried,) = struct.unpack("<f", struct.pack("<i", int(value)))
    return float(carried)


def _from_bytes(carried: float, kind: Kind) -> float | None:
    if kind is Kind.REAL32:
        return carried if math.isfinite(carried) else None
    (value,) = struct.unpack("<i", struct.pack("<f", carried))
    return float(value)


BY_VALUE = Coding(_as_number, _from_number, is_strict=False)
"""ArduPilot: the number itself, whatever its type; the type of the message does not matter."""

BYTEWISE = Coding(_as_bytes, _from_bytes, is_strict=True)
"""PX4: the four bytes of an integer, read as a float."""
