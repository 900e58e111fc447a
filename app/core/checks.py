"""One check of a policy before its flight, and its result."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from app.core.policy import Gains


@dataclass(frozen=True, slots=True)
class Check:
    """Result of one check: the worst value, in the same measure as the limit, and the gain that caused it.

    `case` names the simulated case of the worst value. `offer` holds the nearest value of each refused gain that would
    pass, if there is one; in the gate's result, a value that passes all checks with such a limit.
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
    """Limits of a model run: it may rise to `ceiling_m` (m), and may be aborted to `safe_gains` at any instant."""

    ceiling_m: float
    safe_gains: Gains
