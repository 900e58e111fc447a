"""Whether the parameter for the hover throttle suits the vehicle, and which value would."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from app.core.analysis.loop import AltitudeLoop

_LARGEST_DIFFERENCE: Final = 0.1
"""Of the parameter: what a battery does to the hover throttle is less."""
_NEAR_LIMIT: Final = 0.75
"""Share of the way from the parameter to a limit of what the loop finds in flight."""
_DECIMALS: Final = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class HoverAdvice:
    """A better value of the parameter for the hover throttle, and why. With the present one the loop assumes `found` in
    flight; `is_outside` if that is not the vehicle's, because the loop cannot find it."""

    parameter: str
    present: float
    proposed: float
    found: float
    is_outside: bool
    reason: str


def found_hover(loop: AltitudeLoop, hover_throttle: float) -> float:
    """The hover throttle that the loop assumes in flight, of a vehicle that hovers with this one."""
    limits = loop.hover_limits
    return loop.assumed_hover_throttle if limits is None else float(np.clip(hover_throttle, *limits))


def advise_hover(loop: AltitudeLoop, hover_throttle: float) -> HoverAdvice | None:
    """Advice for a vehicle that hovers with this throttle; None if the parameter is right to 10 %, and far from the
    limits of what the loop finds in flight, or if no other value is possible."""
    texts, present = loop.texts, loop.assumed_hover_throttle
    proposed = round(float(np.clip(hover_throttle, *texts.hover_range)), _DECIMALS)
    why, is_outside = _reason(loop, hover_throttle)
    if not why or proposed == round(present, _DECIMALS):
        return None
    return HoverAdvice(
        parameter=texts.hover_parameter,
        present=present,
        proposed=proposed,
        found=found_hover(loop, hover_throttle),
        is_outside=is_outside,
        reason=f"The vehicle hovers at a throttle of {hover_throttle:.3f}, {why}. Set {texts.hover_parameter} to "
        f"{proposed:g}.",
    )


def _reason(loop: AltitudeLoop, hover_throttle: float) -> tuple[str, bool]:
    """Why the parameter does not suit a vehicle that hovers so, empty if it does, and whether it is outside."""
    texts, present, limits = loop.texts, loop.assumed_hover_throttle, loop.hover_limits
    if limits is not None:
        low, high = limits
        within = f"{texts.hover_parameter} ± {texts.hover_deviation} ({low:.3f} … {high:.3f})"
        if not low <= hover_throttle <= high:
            stops = f"the estimate in flight stops at {found_hover(loop, hover_throttle):.3f}"
            return f"outside {within}: {stops}, and the integral has to make up for the rest", True
        limit = low if hover_throttle < present else high
        if abs(hover_throttle - present) > _NEAR_LIMIT * abs(limit - present):
            return (
                f"near the end of {within}: another load or battery may take it beyond, where the estimate stops",
                False,
            )
    if abs(hover_throttle - present) <= _LARGEST_DIFFERENCE * present:
        return "", False
    return f"and {texts.hover_parameter} is {present:.3f}: {texts.hover_use}", False
