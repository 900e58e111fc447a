"""Detection of wear: drift of a vehicle's fitted model since it was tuned.

Two calibrations from different flights give a parameter as p₁ ± s₁ and p₂ ± s₂ (standard errors). It has drifted if

    |p₂ − p₁| > z · √(s₁² + s₂²),    z = Φ⁻¹(1 − 0.05/(2 m)),

where m is the number of parameters compared. Together they raise a false alarm in at most one of twenty cases
(Bonferroni). A re-tune is due once any parameter has drifted.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import floor, hypot, log10
from types import MappingProxyType
from typing import Final

from app.core.experiments.base import Fitted

FALSE_ALARMS: Final = 0.05
MONITORED_PARAMETERS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "hover_throttle": "propellers, weight",
        "start_latency_s": "link",
        "motor_lag_s": "motors",
        "drag_1_s": "frame",
    }
)
"""Parameters that show wear, and where to look for its cause."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Drift:
    """Whether a re-tune is due, which parameters have drifted, and why in a sentence."""

    due: bool
    drifted: tuple[str, ...]
    sentence: str


def drift(before: Mapping[str, Fitted], now: Mapping[str, Fitted]) -> Drift:
    """Compare the fit with which the vehicle was last tuned (`before`) with the newest (`now`), by parameter name."""
    from scipy.special import ndtri

    names = [name for name in MONITORED_PARAMETERS if name in before and name in now]
    reach = float(ndtri(1.0 - FALSE_ALARMS / (2.0 * max(len(names), 1))))
    moved = {name: now[name].value - before[name].value for name in names}
    allowed = {name: reach * hypot(before[name].standard_error, now[name].standard_error) for name in names}
    drifted = tuple(name for name in names if abs(moved[name]) > allowed[name])
    if not names:
        sentence = "The newest calibration and the one from the last tuning have no parameter in common."
        return Drift(due=False, drifted=(), sentence=sentence)
    if not drifted:
        titles = [now[name].title.lower() for name in names]
        compared = " or ".join(filter(None, (", ".join(titles[:-1]), titles[-1])))
        sentence = f"No significant change of {compared} since the vehicle was last tuned."
        return Drift(due=False, drifted=(), sentence=sentence)
    changes = "; ".join(
        f"{now[name].title.lower()} from {_measured(before[name])} to {_measured(now[name])} {now[name].unit}"
        for name in drifted
    )
    sentence = (
        f"The vehicle has changed significantly since it was last tuned: {changes}. Find the cause "
        f"({', '.join(MONITORED_PARAMETERS[name] for name in drifted)}), then tune it again."
    )
    return Drift(due=True, drifted=drifted, sentence=sentence)


def _measured(fitted: Fitted) -> str:
    """`0.6000 ± 0.0030`: with two significant digits of the standard error."""
    if fitted.standard_error <= 0.0:
        return f"{fitted.value:.3g}"
    digits = max(0, 1 - floor(log10(fitted.standard_error)))
    return f"{fitted.value:.{digits}f} ± {fitted.standard_error:.{digits}f}"
