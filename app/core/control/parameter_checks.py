"""Parameters of a replica by the firmware's names, and checks that they describe a loop."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Final, Self

from app.core.errors import InputError, Problem
from app.core.reasons import Reason, ReasonCode

PLAUSIBLE: Final = (0.0, 1e6)
"""No parameter of a vehicle's loop comes near the upper end; far beyond it, the replica's numbers overflow."""

_NOT_POSITIVE: Final = ReasonCode.PARAMETER_NOT_POSITIVE.key


@dataclass(frozen=True, slots=True)
class _Described:
    name: str
    factor: float
    positive: bool
    gain: bool


def parameter(name: str, default: float, *, factor: float = 1.0, positive: bool = False, gain: bool = False) -> float:
    """Return a field of `ReplicaParameters`: a parameter of the firmware by its name there, and the factor from the
    firmware's value to the field's. All are at least 0, some `positive`; a `gain` is tuned."""
    return field(default=default, metadata={"described": _Described(name, factor, positive, gain)})


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplicaParameters:
    """What the loop of a firmware depends on: each field is a `parameter`, whose default is the firmware's.

    Raises InputError naming every value that is negative or not finite, or is 0 although it must be positive.
    """

    def __post_init__(self) -> None:
        _require(
            Problem(each.name, f"must be {'positive' if each.positive else 'at least 0'}", code=_NOT_POSITIVE)
            for each, value in zip(self._described().values(), self.values, strict=True)
            if not (0.0 <= value < math.inf) or (each.positive and not value)
        )

    @classmethod
    def _described(cls) -> dict[str, _Described]:
        """Each field."""
        return {each.name: each.metadata["described"] for each in fields(cls)}

    @property
    def values(self) -> list[float]:
        """In the order of the fields, in their units."""
        return [getattr(self, each.name) for each in fields(self)]

    @property
    def named(self) -> dict[str, float]:
        """By the firmware's names, in its units."""
        described = self._described().values()
        return {each.name: value / each.factor for each, value in zip(described, self.values, strict=True)}

    @property
    def gains(self) -> dict[str, float]:
        """The tuned gains by the firmware's names."""
        named = self.named
        return {each.name: named[each.name] for each in self._described().values() if each.gain}

    def changed(self, named: Mapping[str, float]) -> Self:
        """These parameters with other values, by the firmware's names; names of no field are ignored."""
        described = self._described().items()
        return replace(self, **{key: named[each.name] * each.factor for key, each in described if each.name in named})


def require_within(values: Mapping[str, float], ranges: Mapping[str, tuple[float, float]]) -> None:
    """Raise InputError naming every value outside its range or not a number; those missing are not checked."""
    _require(
        Reason(
            code=ReasonCode.PARAMETER_OUT_OF_RANGE,
            field=name,
            numbers={"low": low, "high": high, "value": values[name]},
        ).problem
        for name, (low, high) in ranges.items()
        if name in values and not (low <= values[name] <= high)
    )


def _require(found: Iterable[Problem]) -> None:
    if problems := tuple(found):
        raise InputError(
            "The loop is not defined for these parameters.", hint="Give the vehicle's own.", problems=problems
        )
