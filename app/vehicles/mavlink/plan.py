"""Plan of a trial: the autopilot, the set points and gains of the flight, the ground under it, and its limits."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final

from app.autopilots.autopilot import Autopilot
from app.autopilots.commands import Setting
from app.core.experiments.takeoff import SET_POINTS, WINDOW_S
from app.core.models.set_points import SetPoints
from app.vehicles.base import RECORDED_BEYOND_S
from app.vehicles.mavlink.failures import CONFIRMATION_PERIODS, HELP

RECORD_S: Final = WINDOW_S + RECORDED_BEYOND_S
"""Length of the record for the default window."""
_SLOW_S: Final = 3.0
"""Longest delay of the vehicle's clock behind ours at the end of such a record."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """Plan of a trial.

    `safe_gains` are in the order in which an abort sends them, `trial_gains` those that the vehicle was seen to hold;
    `blocks` are the names of the flight plan's blocks by number; `ground_m` is the ground on the vehicle's datum, and
    `set_point_m` the current set point, on it too; `set_points`: the takeoff's altitude, and those that follow, in the
    record's altitude; `record_s`: length of the record after the takeoff command; `radius_m`: greatest distance from
    the start; `timeout_factor` multiplies all timeouts for packets.
    """

    autopilot: Autopilot
    safe_gains: tuple[Setting, ...]
    trial_gains: tuple[Setting, ...] = ()
    blocks: Mapping[int, str] = field(default_factory=dict)
    ground_m: float
    set_point_m: float
    set_points: SetPoints = SET_POINTS
    record_s: float = RECORD_S
    min_battery_v: float
    radius_m: float = 5.0
    timeout_factor: float = 1.0

    @property
    def heartbeat_s(self) -> float:
        """Interval of the vehicle's heartbeats."""
        return self.autopilot.heartbeat_s * self.timeout_factor

    @property
    def confirmation_s(self) -> float:
        """Minimum time between two heartbeats that confirm each other."""
        return CONFIRMATION_PERIODS * self.heartbeat_s

    @property
    def slow_s(self) -> float:
        """Longest delay of the vehicle's clock behind ours at the end of the record: its share of a longer record is
        that of the default one."""
        return _SLOW_S * self.timeout_factor * max(1.0, self.record_s / RECORD_S)

    @property
    def datum_m(self) -> float:
        """Zero of the record's altitude, on the vehicle's datum."""
        return self.ground_m if self.autopilot.climbs_from_ground else 0.0

    @property
    def takeoff(self) -> SetPoints:
        """The takeoff's set point alone."""
        return SetPoints(self.set_points.times_s[:1], self.set_points.altitudes_m[:1])

    @property
    def holds_first(self) -> bool:
        """Whether the second set point is the takeoff's again, commanded by `Action.HOLD`, after which the vehicle may
        only be in the autopilot's `following_modes` until it lands."""
        return self.autopilot.holds_first and len(self.set_points.times_s) > 1

    @property
    def first_step(self) -> int:
        """Place of the first step among the set points."""
        return 2 if self.holds_first else 1

    @property
    def climb_to_m(self) -> float:
        """First set point, on the vehicle's datum."""
        return self.set_points.altitudes_m[0] + self.datum_m

    def on_ground_at(self, ground_m: float) -> "Plan":
        """Return the plan with another height of the ground."""
        moved = replace(self, ground_m=ground_m)
        return replace(moved, set_point_m=self.set_point_m + moved.datum_m - self.datum_m)

    def is_manual(self, mode: str) -> bool:
        """Whether a pilot flies the vehicle in this mode, named as in `Heartbeat`. A mode that is not known is a
        pilot's."""
        return bool(mode) and mode not in self.autopilot.automatic_modes

    def named(self, mode: str) -> str:
        """Return the display name of a mode, with what to do in one in which the vehicle does not execute Land."""
        name, does = self.autopilot.mode_names.get(mode, mode), self.autopilot.modes_without_land.get(mode)
        return name if does is None else f"{name}: {does}; {HELP}"
