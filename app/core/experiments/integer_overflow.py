"""The check of integer overflow: products of the loop that can wrap at 32 bits.

It is exact. The loop multiplies each gain by a limited error: kp by the position error (±10 m), kd by the speed error
(±10 m/s), ki by the sum of position errors (±2 000 000). A gain is safe if its product with the limit fits into 32
signed bits. Nothing after the products can wrap: after shifting, three 32-bit products sum to less than 2²⁴ + 2¹⁶, and
the feed-forward adds at most 8640.

A refused gain is simulated on the replica from starts that drive the errors to their limits, until its product wraps:
stuck on the ground, where the sum grows by 3 m per step, and with the estimate frozen at some time of the climb.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from app.core.control.vertical_guidance import (
    ERROR_SUM_MAX,
    INT32_MAX,
    POSITION_ERROR_MAX,
    RATE_HZ,
    SPEED_ERROR_MAX,
    STEP_S,
)
from app.core.experiments.base import Check
from app.core.formatting import grouped, percent
from app.core.models.set_points import SetPoints
from app.core.models.vertical import MEASUREMENT_DELAY_S, Counts
from app.core.models.vertical_hazards import find_wraps
from app.core.policy import Vector

LONGEST_S: Final = 32.6
_STARTS: Final = (
    ("stuck on the ground", 0.0),
    *((f"the estimate frozen {instant:g} s after the start", instant) for instant in (0.5, 1.0, 1.5, 2.0, 3.0, 5.0)),
)


@dataclass(frozen=True, slots=True)
class Product:
    """A product of the loop: its gain, the error that multiplies it, and the limit of that error."""

    gain: str
    error: str
    limiter: str
    largest_error: int

    @property
    def largest_safe_gain(self) -> int:
        """Largest absolute gain whose product cannot wrap."""
        return INT32_MAX // self.largest_error


PRODUCTS: Final = (
    Product("kp", "position error", "±10 m", POSITION_ERROR_MAX),
    Product("ki", "sum of errors", "±2 000 000", ERROR_SUM_MAX),
    Product("kd", "speed error", "±10 m/s", SPEED_ERROR_MAX),
)
"""In the order of the loop's gains."""


def check_wrapping(counts: Counts, model: Vector, set_points: SetPoints) -> tuple[Check, ...]:
    """Return a refusal for each gain that can wrap, or one passed check.

    `counts` are kp, ki, kd; `model` is the likely vehicle, on which refused gains are simulated to the
    `set_points`.
    """
    gains = counts.tolist()
    refused = [place for place, product in enumerate(PRODUCTS) if abs(gains[place]) > product.largest_safe_gain]
    if refused:
        return tuple(_refusals(refused, gains, _first_wraps(counts, model, set_points)))
    worst, place = max((abs(gains[place]) * product.largest_error, place) for place, product in enumerate(PRODUCTS))
    product = PRODUCTS[place]
    sentence = (
        f"No product can overflow: the largest, {product.gain}·({product.error}) with its limiter at "
        f"{product.limiter}, is {percent(worst / INT32_MAX)} of the 32-bit maximum."
    )
    return (Check("wrapping", True, sentence, worst=float(worst), limit=float(INT32_MAX)),)


def _first_wraps(counts: Counts, model: Vector, set_points: SetPoints) -> Counts:
    """Step and product at which each gain first wraps in each start, shape (starts, 3, 2); step −1 if it does not."""
    found = np.empty((len(_STARTS), len(PRODUCTS), 2), dtype=np.int64)
    instantly = model.copy()
    instantly[MEASUREMENT_DELAY_S] = 0.0
    steps = round(LONGEST_S * RATE_HZ)
    for start, (_, frozen_after_s) in enumerate(_STARTS):
        find_wraps(counts, instantly, set_points.targets, round(frozen_after_s * RATE_HZ), steps, found[start])
    return found


def _refusals(refused: list[int], gains: list[int], wraps: Counts) -> Iterator[Check]:
    for place in refused:
        product, offered = PRODUCTS[place], PRODUCTS[place].largest_safe_gain
        worst = abs(gains[place]) * product.largest_error
        case, explanation = _wrap_case(product, wraps[:, place])
        sentence = (
            f"{product.gain}·({product.error}) can reach {grouped(worst)} and overflow 32 bits "
            f"({grouped(INT32_MAX)}): full thrust becomes zero thrust, or the reverse. {explanation} "
            f"The largest {product.gain} that cannot overflow is {offered}."
        )
        offer = {product.gain: offered if gains[place] > 0 else -offered}
        yield Check(
            "wrapping", False, sentence, float(worst), float(INT32_MAX), gain=product.gain, case=case, offer=offer
        )


def _wrap_case(product: Product, wraps: Counts) -> tuple[str, str]:
    """The first start in which the product wraps, in short; and a sentence that adds in how many others it wraps."""
    wrapped = [
        (name, step, value) for (name, _), (step, value) in zip(_STARTS, wraps.tolist(), strict=True) if step >= 0
    ]
    if not wrapped:
        case = f"{product.error} at its limiter, {product.limiter}"
        return case, f"It overflows with the {case}."
    name, step, value = wrapped[0]
    case = f"{name}, {step * STEP_S:.2f} s after the start: {product.gain}·({product.error}) = {grouped(value)}"
    also = f" It also overflows in {len(wrapped) - 1} of {len(_STARTS) - 1} other starts." if len(wrapped) > 1 else ""
    return case, f"Simulated {case}.{also}"
