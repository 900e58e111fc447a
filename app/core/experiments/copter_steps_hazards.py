"""What the gate checks of altitude steps under ArduCopter and PX4, on a few copters that the flights allow."""

import math
from collections.abc import Sequence
from typing import Final, TypeVar

from app.core.analysis.hover import HoverAdvice
from app.core.analysis.loop import LinearLoop
from app.core.analysis.margin import EXTRA_LAG_S, REQUIRED_MARGIN, RINGING_DAMPING, robust_damping
from app.core.errors import Problem
from app.core.experiments.base import Check, Matrix
from app.core.formatting import number
from app.core.models.set_points import SetPoints

_V = TypeVar("_V")

COPTERS: Final = 5
"""Vehicles of a distribution that are checked, and for which gains are searched."""
_KNOWN_TO: Final = 0.03
"""Standard deviation of a hover throttle that flights have shown; the data sheet's is larger."""


def check_altitudes(altitudes: Matrix, set_points: SetPoints, ceiling_m: float) -> tuple[Check, Check]:
    """Highest and lowest altitude of simulated flights, shape (k, n): below the ceiling, and above half of the lowest
    set point."""
    highest_m, lowest_m = float(altitudes.max()), float(altitudes.min())
    floor_m = 0.5 * min(set_points.altitudes_m)
    rises = "rises to" if highest_m <= ceiling_m else "would rise to"
    falls = "falls to" if lowest_m >= floor_m else "would fall to"
    return (
        Check(
            "altitude",
            highest_m <= ceiling_m,
            f"The highest of {len(altitudes)} simulated flights {rises} {highest_m:.2f} m; {ceiling_m:g} m is allowed.",
            worst=highest_m,
            limit=ceiling_m,
        ),
        Check(
            "lowest altitude",
            lowest_m >= floor_m,
            f"The lowest of {len(altitudes)} simulated flights {falls} {number(lowest_m, 2)} m; "
            f"{floor_m:g} m is allowed.",
            worst=lowest_m,
            limit=floor_m,
        ),
    )


def refuse_parameters(problems: Sequence[Problem]) -> tuple[Check, ...]:
    """A refusal for each of the vehicle's parameters with which the model does not hold."""
    return tuple(
        Check(
            "parameters",
            False,
            f"The vehicle's {each.field} {each.reason}; otherwise the model of its loop does not hold. Set it on the "
            "vehicle, and mark the flights with the other value invalid.",
            worst=math.inf,
            limit=0.0,
        )
        for each in problems
    )


def check_hover(advice: HoverAdvice | None, hover_throttle: float, deviation: float) -> tuple[Check, ...]:
    """A check that passes, and says that the vehicle hovers outside what its autopilot finds in flight; none if it does
    not, or while flights have not shown the hover throttle. No refusal: only another flight can show that the parameter
    was set."""
    if advice is None or not advice.is_outside or deviation > _KNOWN_TO:
        return ()
    sentence = f"{advice.reason} Do this before the flight."
    return (Check("hover throttle", True, sentence, worst=hover_throttle, limit=advice.found),)


def check_margin(loop: LinearLoop[_V], vehicles: Sequence[_V]) -> Check:
    """Whether the loop rings with none of the vehicles (`robust_damping`), of which the first is the likeliest."""
    damping = robust_damping(loop, vehicles)
    passed = damping >= RINGING_DAMPING
    return Check(
        "margin",
        passed,
        f"With up to {REQUIRED_MARGIN:g} times the {loop.texts.fast_gains}, and {1e3 * EXTRA_LAG_S:.0f} ms more "
        f"{loop.texts.lateness} for the likeliest vehicle, the least damped of {len(vehicles)} likely vehicles has a "
        f"damping ratio of {damping:.2f}; {'at least ' if passed else ''}{RINGING_DAMPING:g} is needed.",
        worst=damping,
        limit=RINGING_DAMPING,
    )
