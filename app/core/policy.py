"""Policies: named gain vectors, and the space from which a campaign may choose them."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.core.errors import GainsError, InputError, Problem

Vector = NDArray[np.float64]
Gains = Mapping[str, float]

_ROUNDING: Final = 1e-9  # a step of exactly the allowed fraction is allowed
_HINT: Final = "Correct the gains listed; nothing was changed."


def is_finite(value: float) -> bool:
    """Whether the value is finite; False also for integers too large for a float."""
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


def shortened(value: object) -> str:
    """The value as text, at most 40 characters."""
    text = str(value)
    return text if len(text) <= 40 else f"{text[:37]}…"


@dataclass(frozen=True, slots=True)
class Gain:
    """One tunable gain, in the controller's own counts or units; `scale` is a step size with a significant effect."""

    name: str
    title: str
    unit: str
    lower: float
    upper: float
    scale: float
    default: float
    integer: bool

    @property
    def span(self) -> float:
        """Width of the range; zero for a gain pinned by its bounds."""
        return self.upper - self.lower

    def refusal_by_controller(self, value: object) -> str | None:
        """Why no controller can hold `value` as this gain, whatever the bounds; None if one can."""
        if isinstance(value, bool) or not isinstance(value, int | float):
            return "must be a number"
        if not is_finite(value):
            return f"must be a finite number, got {shortened(value)}"
        if self.integer and value != int(value):
            return f"must be a whole number of counts, got {value:g}"
        if self.integer and not -(2**31) <= value < 2**31:
            return f"must fit in 32 bits, got {shortened(value)}"
        return None

    def refusal_by_bounds(self, value: float) -> str | None:
        """Why the bounds refuse a number, or None if they do not."""
        if self.lower <= value <= self.upper:
            return None
        return f"must be between {self.lower:g} and {self.upper:g} {self.unit}, got {value:g}"


@dataclass(frozen=True, slots=True)
class Box:
    """Lowest and highest allowed gains, both of shape (n,)."""

    low: Vector
    high: Vector

    def nearest(self, gains: Vector) -> Vector:
        """The closest integer counts in the box."""
        return np.clip(np.rint(gains), self.low, self.high)


@dataclass(frozen=True, slots=True)
class PolicySpace:
    """The gains of an experiment in a fixed order, with their bounds."""

    gains: tuple[Gain, ...]

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(gain.name for gain in self.gains)

    @property
    def lower(self) -> Vector:
        return np.array([gain.lower for gain in self.gains])

    @property
    def upper(self) -> Vector:
        return np.array([gain.upper for gain in self.gains])

    @property
    def scale(self) -> Vector:
        return np.array([gain.scale for gain in self.gains])

    @property
    def default(self) -> Vector:
        return np.array([gain.default for gain in self.gains])

    def check(self, gains: Mapping[str, object], *, field: str = "gains") -> dict[str, float]:
        """Validate gains against the bounds and return them complete and in order.

        Raises GainsError naming every missing, unknown, non-finite, fractional or out-of-bounds gain.
        """
        complete = self.complete(gains, field=field)
        refused = [
            Problem(f"{field}.{gain.name}", reason)
            for gain in self.gains
            if (reason := gain.refusal_by_bounds(complete[gain.name])) is not None
        ]
        if refused:
            raise GainsError("Invalid gains.", hint=_HINT, problems=tuple(refused))
        return complete

    def complete(self, gains: Mapping[str, object], *, field: str = "gains") -> dict[str, float]:
        """Return the gains in order, without checking the bounds.

        Raises GainsError naming every missing or unknown gain, and every value that no controller can hold.
        """
        unknown = [
            Problem(f"{field}.{name}", f"is not a gain of this experiment ({', '.join(self.names)})")
            for name in gains
            if name not in self.names
        ]
        missing = [Problem(f"{field}.{name}", "is missing") for name in self.names if name not in gains]
        refused = [
            Problem(f"{field}.{gain.name}", reason)
            for gain in self.gains
            if gain.name in gains and (reason := gain.refusal_by_controller(gains[gain.name])) is not None
        ]
        if problems := (*unknown, *missing, *refused):
            raise GainsError("Invalid gains.", hint=_HINT, problems=problems)
        return self.mapping(np.array([gains[name] for name in self.names], dtype=np.float64))

    def vector(self, gains: Gains) -> Vector:
        """The gains as a vector, shape (n,), in the order of `names`."""
        return np.array([gains[name] for name in self.names], dtype=np.float64)

    def by_name(self, values: Vector) -> dict[str, float]:
        """A value for each gain, shape (n,), by the gain's name."""
        return dict(zip(self.names, values.tolist(), strict=True))

    def names_where(self, chosen: NDArray[np.bool_]) -> tuple[str, ...]:
        """Names of the gains that are chosen, shape (n,)."""
        return tuple(name for name, is_chosen in zip(self.names, chosen, strict=True) if is_chosen)

    def mapping(self, vector: Vector) -> dict[str, float]:
        """Named gains; integer gains are returned as int."""
        return {
            gain.name: int(value) if gain.integer else float(value)
            for gain, value in zip(self.gains, vector, strict=True)
        }

    def nearest(self, vector: Vector) -> Vector:
        """The closest flyable vector: clipped to the bounds, integer gains rounded half to even."""
        rounded = np.where([gain.integer for gain in self.gains], np.rint(vector), vector)
        return np.clip(rounded, self.lower, self.upper)

    def reachable(self, base: Vector, fraction: float) -> tuple[Vector, Vector]:
        """Lowest and highest flyable vectors within `fraction` of each range around `base`, inside the bounds.

        If `base` lies outside the bounds, they are taken around the nearest point inside.
        """
        base = np.clip(base, self.lower, self.upper)
        reach = fraction * (self.upper - self.lower) + _ROUNDING
        integer = [gain.integer for gain in self.gains]
        low = np.where(integer, np.ceil(base - reach), base - reach)
        high = np.where(integer, np.floor(base + reach), base + reach)
        return np.maximum(low, self.lower), np.minimum(high, self.upper)

    def change(self, one: Gains, other: Gains) -> dict[str, float]:
        """Difference of two gain sets, each gain as a share of its range.

        For a gain pinned by its bounds, as a share of the bound's magnitude, at least 1.
        """
        return {
            gain.name: abs(one[gain.name] - other[gain.name]) / (gain.span or max(abs(gain.upper), 1.0))
            for gain in self.gains
        }

    def slopes(self, values_of: Callable[[Vector], Vector], at: Vector, steps: Vector) -> Vector:
        """Derivatives of a quantity with respect to each gain, shape (n,): central differences within the bounds, zero
        where these pin a gain. `at` lies within the bounds; `values_of` takes gains of shape (2n, n), returns (2n,).
        """
        above, below = np.minimum(at + np.diag(steps), self.upper), np.maximum(at - np.diag(steps), self.lower)
        values = values_of(np.concatenate((above, below)))
        rise, run = values[: len(at)] - values[len(at) :], np.diag(above - below)
        return np.asarray(np.divide(rise, run, out=np.zeros_like(rise), where=run != 0.0))

    def narrowed(self, bounds: Mapping[str, tuple[float, float]]) -> "PolicySpace":
        """The same space with tighter bounds. Raises InputError if they are reversed or extend outside."""
        problems = [
            Problem(f"bounds.{name}", f"is not a gain of this experiment ({', '.join(self.names)})")
            for name in bounds
            if name not in self.names
        ]
        for gain in self.gains:
            low, high = bounds.get(gain.name, (gain.lower, gain.upper))
            if gain.integer and not (float(low).is_integer() and float(high).is_integer()):
                problems.append(Problem(f"bounds.{gain.name}", f"must be whole numbers, got {low:g} … {high:g}"))
            elif not (gain.lower <= low <= high <= gain.upper):
                problems.append(
                    Problem(
                        f"bounds.{gain.name}",
                        f"must be two numbers, the lower first, inside {gain.lower:g} … {gain.upper:g}, "
                        f"got {low:g} … {high:g}",
                    )
                )
        if problems:
            raise InputError(
                "Invalid bounds.",
                hint="Choose bounds inside those of the experiment.",
                problems=tuple(problems),
            )
        return PolicySpace(
            tuple(
                replace(gain, lower=bounds[gain.name][0], upper=bounds[gain.name][1]) if gain.name in bounds else gain
                for gain in self.gains
            )
        )
