"""The panel below a flight's output: its deviation from a set point that is a step."""

from typing import Final

import numpy as np

from app.figures import theme
from app.figures.data import Curve
from app.figures.theme import Palette

LIMIT: Final = 0.2
"""Largest deviation in the panel, as a share of the set point: the climb begins at a deviation of all of it."""


def is_step(set_point: Curve) -> bool:
    """Whether the deviation is another curve than the output itself."""
    return float(set_point.values.max()) > 0.0


def deviation_of(curve: Curve, set_point: Curve) -> Curve:
    """Output − set point, from the command on."""
    flown = curve.time_s >= 0.0
    time_s = curve.time_s[flown]
    return Curve(time_s, curve.values[flown] - np.interp(time_s, set_point.time_s, set_point.values))


def deviation_axis(palette: Palette, set_point: Curve, unit: str, **more: object) -> dict[str, object]:
    """The ordinate of the panel, ± 20 % of the set point."""
    limit = LIMIT * float(set_point.values.max())
    return theme.titled(
        palette,
        f"Deviation ({unit})",
        range=[-limit, limit],
        nticks=5,
        zeroline=True,
        zerolinecolor=palette.dim,
        **more,
    )
