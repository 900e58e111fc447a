"""Gains on board: their names, ranges and values there, and the check of what may be written."""

import math
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from app.core.errors import GainsError, Problem
from app.core.policy import Gain, Gains, shortened


@dataclass(frozen=True, slots=True)
class GainParameter:
    """A gain by its name here and on the vehicle, the range of values that may be written (autopilots accept any), and
    the `factor` from the gain to the vehicle's value. `whole`: the vehicle keeps only the integer part. `integrates`:
    writing it may clear an integrator, so it is sent last in flight."""

    gain: str
    parameter: str
    lower: float
    upper: float
    factor: float = 1.0
    whole: bool = False
    integrates: bool = False

    def sent(self, value: float) -> float:
        """Return the value to send, in single precision."""
        return _single(value * self.factor)

    def read(self, wire: float, requested: float | None = None) -> float:
        """Return the gain for a value of the vehicle, to the seven digits of single precision; exactly `requested` if
        the value is the one sent for it."""
        if self.whole:
            return int(wire)
        return (
            requested if requested is not None and wire == self.sent(requested) else float(f"{wire / self.factor:.7g}")
        )

    def logged(self, value: float) -> float:
        """Return the gain for a value in a log: as it is there, or if it has a factor to seven digits."""
        return value if self.factor == 1.0 else self.read(value)

    def refusal(self, value: float) -> str | None:
        """Return why this value may not be written, or None if it may."""
        if not self.lower <= value <= self.upper:
            return f"must be between {self.lower:g} and {self.upper:g}, got {shortened(value)}"
        return f"must be a whole number of counts, got {value:g}" if self.whole and value != int(value) else None


GainSet = tuple[GainParameter, ...]

_SAME: Final[Mapping[str, tuple[str, float]]] = MappingProxyType({})


def on_board(gains: Sequence[Gain], *, integrating: str, names: Mapping[str, tuple[str, float]] = _SAME) -> GainSet:
    """Return the gains of an experiment, with its ranges, as parameters of a release. `names`: those that have another
    name on board, and the factor to their value there. `integrating`: the one that clears an integrator."""
    return tuple(
        GainParameter(
            gain.name, parameter, gain.lower, gain.upper, factor, gain.integer, integrates=gain.name == integrating
        )
        for gain in gains
        for parameter, factor in (names.get(gain.name, (gain.name, 1.0)),)
    )


def check_gains(gains: Gains, gain_set: GainSet) -> dict[str, float]:
    """Return the gains, complete and in order. Raises GainsError for those that may not be written, because autopilots
    do not check."""
    refusals = {gain.gain: gain.refusal for gain in gain_set}
    require_accepted(gains, refusals, "These gains may not be written to the vehicle.", ", each within its range")
    return {gain.gain: int(gains[gain.gain]) if gain.whole else float(gains[gain.gain]) for gain in gain_set}


def require_accepted(
    gains: Gains, refusals: Mapping[str, Callable[[float], str | None]], happened: str, needed: str
) -> None:
    """Raise GainsError that names every unknown or missing gain, and each whose value has a refusal by its name;
    `needed` ends the sentence that asks for accepted values."""
    problems = [Problem(f"gains.{name}", "is not a gain of this vehicle") for name in gains if name not in refusals]
    for name, refusal in refusals.items():
        reason = refusal(gains[name]) if name in gains else "is missing"
        if reason is not None:
            problems.append(Problem(f"gains.{name}", reason))
    if problems:
        raise GainsError(happened, problems=tuple(problems), hint=f"Send {', '.join(refusals)}{needed}.")


def _single(value: float) -> float:
    return float(struct.unpack("<f", struct.pack("<f", value))[0]) if math.isfinite(value) else value
