"""Whether a vehicle is still the one that it was tuned as: wear shows as drift of the fitted model.

Two calibrations from different flights give a parameter as p₁ ± s₁ and p₂ ± s₂ (standard errors). It has drifted where

    |p₂ − p₁| > z · √(s₁² + s₂²),    z = Φ⁻¹(1 − 0.05/(2 m)),

m being the number of parameters compared: so all of them together raise a false alarm in at most one of twenty cases
(Bonferroni). A re-tune is due once any of them has.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import hypot
from typing import Final

from scipy.special import ndtri

FALSE_ALARMS: Final = 0.05
WATCHED: Final = ("hover_throttle", "start_latency_s", "motor_lag_s", "drag_1_s")
"""What wears: propellers and weight, the link, the motors, the frame."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fitted:
    """A parameter as the flights have it, with its standard error, in its unit."""

    title: str
    unit: str
    value: float
    standard_error: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Drift:
    """Whether a re-tune is due, which parameters have drifted, and why in a sentence."""

    due: bool
    drifted: tuple[str, ...]
    sentence: str


def drift(before: Mapping[str, Fitted], now: Mapping[str, Fitted]) -> Drift:
    """`before` is the fit with which the vehicle was tuned last, `now` the newest, both by the parameters' names."""
    names = [name for name in WATCHED if name in before and name in now]
    reach = float(ndtri(1.0 - FALSE_ALARMS / (2.0 * max(len(names), 1))))
    moved = {name: now[name].value - before[name].value for name in names}
    allowed = {name: reach * hypot(before[name].standard_error, now[name].standard_error) for name in names}
    drifted = tuple(name for name in names if abs(moved[name]) > allowed[name])
    if not drifted:
        sentence = "No parameter of the model has moved further than its uncertainty since the vehicle was tuned last."
        return Drift(due=False, drifted=(), sentence=sentence)
    told = "; ".join(
        f"{now[name].title.lower()} was {before[name].value:.3g} and is {now[name].value:.3g} {now[name].unit}, "
        f"{abs(moved[name]):.2g} apart where {allowed[name]:.2g} is within the 95 % interval"
        for name in drifted
    )
    sentence = f"Since the vehicle was tuned last it has changed: {told}. Tune it again, or look for the cause first."
    return Drift(due=True, drifted=drifted, sentence=sentence)
