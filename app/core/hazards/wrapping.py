"""Exact check whether a product of the vertical loop can wrap at 32 bits.

The loop multiplies each gain by a limited error: kp by the position error (±10 m), kd by the speed error (±10 m/s), ki
by the sum of position errors (±2 000 000). A gain is safe if its product with the limit fits into 32 signed bits.
Nothing after the products can wrap: after shifting, three 32-bit products sum to less than 2²⁴ + 2¹⁶, and the
feed-forward adds at most 8640.

A refused gain is simulated on the replica from starts that drive the errors to their limits, until its product wraps:
stuck on the ground, where the sum grows by 3 m per step, and with the estimate frozen at some time of the climb.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from app.core.checks import Check
from app.core.control.fixed_point import INT32_MAX
from app.core.control.vertical_loop import (
    ERROR_SUM_MAX,
    POSITION_ERROR_MAX,
    RATE_HZ,
    SPEED_ERROR_MAX,
    STATE_SIZE,
    STEP_S,
)
from app.core.hazards.kernels import find_wraps
from app.core.plants.vertical import MEASUREMENT_DELAY_S, Counts
from app.core.policy import Vector
from app.core.wording import percent

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


def check_wrapping(counts: Counts, model: Vector, target: int) -> tuple[Check, ...]:
    """Return a refusal for each gain that can wrap, or one passed check.

    `counts` are kp, ki, kd; `model` is the likely vehicle, on which refused gains are simulated; `target` is the
    altitude, 8 fractional bits.
    """
    gains = [int(count) for count in counts]
    refused = [place for place, product in enumerate(PRODUCTS) if abs(gains[place]) > product.largest_safe_gain]
    if refused:
        return tuple(_refusals(refused, gains, _first_wraps(counts, model, target)))
    worst, place = max((abs(gains[place]) * product.largest_error, place) for place, product in enumerate(PRODUCTS))
    product = PRODUCTS[place]
    sentence = (
        f"No product can wrap: the largest, {product.gain}·({product.error}) with its limiter at {product.limiter}, "
        f"is {percent(worst / INT32_MAX)} of what 32 bits hold."
    )
    return (Check("wrapping", True, sentence, worst=float(worst), limit=float(INT32_MAX)),)


def _first_wraps(counts: Counts, model: Vector, target: int) -> Counts:
    """Step and product at which each gain first wraps in each start, shape (starts, 3, 2); step −1 if it does not."""
    found = np.empty((len(_STARTS), len(PRODUCTS), 2), dtype=np.int64)
    instantly = model.copy()
    instantly[MEASUREMENT_DELAY_S] = 0.0
    steps, state = round(LONGEST_S * RATE_HZ), np.empty(STATE_SIZE, dtype=np.int64)
    for start, (_, frozen_after_s) in enumerate(_STARTS):
        find_wraps(counts, instantly, target, round(frozen_after_s * RATE_HZ), steps, state, found[start])
    return found


def _refusals(refused: list[int], gains: list[int], wraps: Counts) -> Iterator[Check]:
    for place in refused:
        product, offered = PRODUCTS[place], PRODUCTS[place].largest_safe_gain
        worst = abs(gains[place]) * product.largest_error
        case, told = _case(product, wraps[:, place])
        sentence = (
            f"{product.gain}·({product.error}) can reach {_grouped(worst)} and wrap: 32 bits hold "
            f"{_grouped(INT32_MAX)}, and full up turns into full down. {told} "
            f"The largest {product.gain} that cannot wrap is {offered}."
        )
        offer = {product.gain: offered if gains[place] > 0 else -offered}
        yield Check(
            "wrapping", False, sentence, float(worst), float(INT32_MAX), gain=product.gain, case=case, offer=offer
        )


def _case(product: Product, wraps: Counts) -> tuple[str, str]:
    """The first start in which the product wraps, in short; and a sentence that adds in how many others it wraps."""
    wrapped = [
        (name, step, value) for (name, _), (step, value) in zip(_STARTS, wraps.tolist(), strict=True) if step >= 0
    ]
    if not wrapped:
        case = f"{product.error} at its limiter, {product.limiter}"
        return case, f"It wraps with the {case}."
    name, step, value = wrapped[0]
    case = f"{name}, {step * STEP_S:.2f} s after the start: {product.gain}·({product.error}) = {_grouped(value)}"
    return case, f"Simulated {case}; so it does in {len(wrapped) - 1} of {len(_STARTS) - 1} other starts."


def _grouped(value: int) -> str:
    return f"{value:,}".replace(",", " ")
