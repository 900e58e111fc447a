"""One check of a policy before its flight, and its answer."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from app.core.policy import Gains


@dataclass(frozen=True, slots=True)
class Check:
    """One check: its worst number, in the same measure as the limit it is held against, and the gain that has it.

    `case` names what was simulated when the worst number came about; `offer` holds the nearest value of each refused
    gain that would pass, where there is one; in the gate's answer one that passes all checks with such a limit.
    """

    name: str
    passed: bool
    sentence: str
    worst: float
    limit: float
    gain: str = ""
    case: str = ""
    offer: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Envelope:
    """What a model run may do: rise to `ceiling_m` (m), and be aborted at any instant to `safe_gains`."""

    ceiling_m: float
    safe_gains: Gains
