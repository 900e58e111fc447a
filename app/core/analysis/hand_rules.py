"""Gains on the usual copter, where a log tells the hover throttle of its vehicle and not the rest."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from app.core.analysis.loop import AltitudeLoop
from app.core.analysis.margin import gain_margin
from app.core.analysis.vehicle_fit import USUAL_DRAG_1_S, USUAL_LAG_S
from app.core.models.copter import Copter


@dataclass(frozen=True, slots=True, kw_only=True)
class UsualGains:
    """A gain set by the names of the vehicle's release, and its margin; 0 if it rings."""

    name: str
    gains: Mapping[str, float]
    margin: float


@dataclass(frozen=True, slots=True, kw_only=True)
class UsualMargins:
    """The gains flown, then those of rules, on a copter with this hover throttle and what is usual."""

    loop: AltitudeLoop
    copter: Copter
    sets: Sequence[UsualGains]


def usual_margins(loop: AltitudeLoop, hover_throttle: float) -> UsualMargins:
    """The margins on the copter that is usual under this autopilot, with this hover throttle."""
    copter = Copter(
        hover_throttle=hover_throttle,
        thrust_slope=loop.usual_slope[0],
        motor_lag_s=USUAL_LAG_S[0],
        drag_1_s=USUAL_DRAG_1_S[0],
    )
    sets = {"As flown": loop.gains, **loop.rules(hover_throttle)}
    return UsualMargins(
        loop=loop,
        copter=copter,
        sets=[
            UsualGains(name=name, gains=loop.named(gains), margin=gain_margin(loop.with_gains(gains), copter))
            for name, gains in sets.items()
        ],
    )
