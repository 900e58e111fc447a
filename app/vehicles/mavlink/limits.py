"""The limits that a trial is held to."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final

MAX_WITNESS_GAP: Final = 1.05
"""Periods of its heartbeat that lie between two of them which agree: one that said otherwise would come between."""
HEARTBEATS_MISSED: Final = 3.5
"""Periods of its heartbeat after which a vehicle that has sent none is lost."""
GROUND_M: Final = 0.15
"""Nearer to the ground than this a vehicle may stand on it."""
REPEAT_S: Final = 1.0
"""How often an order is repeated that a vehicle has not obeyed."""
_LAND_REPEATED_S: Final = 5.0
"""For so long Land is repeated as often as any other order."""
UNHEEDED_S: Final = 5.0
"""A vehicle that has not begun to land so long after it was told does not obey."""
DESCENDING_M_S: Final = -0.2
"""A vehicle that sinks faster than this is landing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """`set_point_m` is on the vehicle's own datum, as altitudes are; `ceiling_m` counts from the ground under it. Modes
    are as `Heartbeat` names them: `flying_modes` and `landing_modes` are empty where any will do, `hovering_modes`
    follow upon the climb, in `manual_modes` a person flies, `mode_names` is what people call them. Heartbeats come
    every `heartbeat_s`. `blocks` are a flight plan's by number, `arming_blocks` and so on the names of those that the
    vehicle may be in, empty where it has none."""

    set_point_m: float
    heartbeat_s: float
    min_battery_v: float
    silent_s: float = 1.0
    stuck_s: float = 0.25
    lost_s: float = 0.5
    slow_s: float = 3.0
    ceiling_m: float = 4.5
    radius_m: float = 5.0
    climb_rate_m_s: float = 4.0
    impact_m_s: float = 2.0
    crossing_m: float = 0.3
    crossings: int = 4
    flying_modes: frozenset[str] = frozenset()
    hovering_modes: frozenset[str] = frozenset()
    landing_modes: frozenset[str] = frozenset()
    manual_modes: frozenset[str] = frozenset()
    mode_names: Mapping[str, str] = field(default_factory=dict)
    blocks: Mapping[int, str] = field(default_factory=dict)
    arming_blocks: frozenset[str] = frozenset()
    flying_blocks: frozenset[str] = frozenset()
    landing_blocks: frozenset[str] = frozenset()

    @property
    def confirmation_s(self) -> float:
        """How far apart two heartbeats are that agree without another between them having said otherwise."""
        return MAX_WITNESS_GAP * self.heartbeat_s

    def stretched(self, patience: float) -> "Limits":
        """The same with so many times the patience for packets that do not come."""
        return replace(
            self,
            heartbeat_s=self.heartbeat_s * patience,
            silent_s=self.silent_s * patience,
            stuck_s=self.stuck_s * patience,
            lost_s=self.lost_s * patience,
            slow_s=self.slow_s * patience,
        )


def land_every_s(asked_for_s: float, land_again_s: float) -> float:
    """How often Land is repeated that was first asked for `asked_for_s` ago. After some seconds only as often as the
    autopilot bears: where every order begins the landing anew, it would never be over."""
    return REPEAT_S if asked_for_s < _LAND_REPEATED_S else land_again_s
