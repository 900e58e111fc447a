"""Limits on gains: what a controller can hold, the campaign's bounds, and its step limit."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from app.core.checks import Check
from app.core.policy import Gain, Gains, PolicySpace
from app.core.wording import percent

NUMBERS: Final = "numbers"
"""Name of the check that cannot be overruled."""


def check_numbers(space: PolicySpace, gains: Gains) -> tuple[Check, ...]:
    """Return a refusal for each gain that is not finite, or not a 32-bit integer where the controller needs one."""
    return tuple(
        Check(
            NUMBERS, False, f"{gain.name} {reason}.", worst=_outside(gain, gains[gain.name]), limit=0.0, gain=gain.name
        )
        for gain in space.gains
        if (reason := gain.refusal_by_controller(gains[gain.name])) is not None
    )


def check_bounds(space: PolicySpace, gains: Gains) -> tuple[Check, ...]:
    """Return a refusal for each gain outside its bounds, or one passed check."""
    refused = tuple(
        Check(
            "bounds",
            False,
            f"{gain.name} {reason}.",
            worst=_outside(gain, gains[gain.name]),
            limit=0.0,
            gain=gain.name,
            offer={gain.name: min(max(gains[gain.name], gain.lower), gain.upper)},
        )
        for gain in space.gains
        if (reason := gain.refusal_by_bounds(gains[gain.name])) is not None
    )
    return refused or (Check("bounds", True, "Every gain lies within its bounds.", worst=0.0, limit=0.0),)


def check_step(space: PolicySpace, gains: Gains, references: Sequence[Gains], fraction: float, origin: str) -> Check:
    """Check the largest change of a gain from the nearest of `references`, a share of its range, against `fraction`."""
    nearest = min(references, key=lambda reference: max(space.change(gains, reference).values()))
    name, worst = max(space.change(gains, nearest).items(), key=lambda item: item[1])
    base = space.vector(nearest)
    low, high = space.reachable(base, fraction)
    vector = space.vector(gains)
    passed = worst <= fraction or bool(((low <= vector) & (vector <= high)).all())
    sentence = (
        f"The largest change, of {name}, is {percent(worst, 1)} of its range; "
        f"{'at most' if passed else 'only'} {percent(fraction)} is allowed from {origin}."
    )
    beyond = {} if passed else space.mapping(space.nearest(vector.clip(low, high)))
    offer = {gain: value for gain, value in beyond.items() if value != gains[gain]}
    return Check("step", passed, sentence, worst=worst, limit=fraction, gain="" if passed else name, offer=offer)


def jointly_offered(gains: Gains, checks: Sequence[Check]) -> tuple[Check, ...]:
    """The same checks, with each offer replaced by one that passes all of them together.

    Every offer is the requested value clipped to a limit; the one furthest from the request satisfies all limits.
    """
    offers: dict[str, float] = {}
    for name, value in (item for check in checks for item in check.offer.items()):
        offers[name] = max(offers.get(name, gains[name]), value, key=lambda offer: abs(offer - gains[name]))
    return tuple(replace(check, offer={name: offers[name] for name in check.offer}) for check in checks)


def _outside(gain: Gain, value: float) -> float:
    """How far a gain lies outside its bounds, as a share of its range; infinite if it is pinned or not finite."""
    beyond = max(gain.lower - value, value - gain.upper, 0.0)
    if beyond == 0.0:
        return 0.0
    return beyond / gain.span if gain.span and math.isfinite(value) else math.inf
