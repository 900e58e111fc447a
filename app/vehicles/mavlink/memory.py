"""What was last heard of a vehicle, message by message."""

from collections import deque
from dataclasses import dataclass, field
from typing import Final

from app.autopilots.autopilot import ArmingChecks, ReferenceSource
from app.autopilots.measurements import (
    AltitudeError,
    Battery,
    BlockEntered,
    Heartbeat,
    LandedState,
    Measurement,
    Position,
    StatusText,
    TargetAltitude,
    Throttle,
    VehicleEvent,
    Version,
)
from app.core.records.trajectory import THROTTLE_HOLDS_S
from app.vehicles.mavlink.monitors.clock import (
    AHEAD_S,
    BACK_S,
    CLOCK_DRIFT,
    RESTARTED_S,
    OtherClock,
    may_have_begun,
    unwrapped,
)

_REFERENCE_HOLDS_S: Final = 0.25
"""Greatest age of a report of the autopilot's reference."""
_BEHIND_S: Final = 20.0
"""A clock that fell behind ours by more than this was not only late: the vehicle may have restarted while nothing was
heard."""
_KNOWN_BY: Final = 10
"""Positions by a clock before it is known to be the vehicle's. Fewer may be a stranger's, heard before the vehicle's
own positions were requested."""


@dataclass(slots=True)
class LoopReports:
    """Latest reports of a vehicle's vertical loop, with their times of receipt."""

    throttle: float | None = None
    throttle_s: float = float("-inf")
    exact_throttle_s: float = float("-inf")
    altitude_error_m: float = 0.0
    altitude_error_s: float = float("-inf")
    target_m: float = 0.0
    target_s: float = float("-inf")

    def throttle_at(self, now_s: float) -> float | None:
        """Return the throttle last reported, as a share of full; None without a recent report."""
        return self.throttle if now_s - self.throttle_s <= THROTTLE_HOLDS_S else None

    def reference_at(self, source: ReferenceSource, altitude_m: float, now_s: float) -> float | None:
        """Return the autopilot's own reference of a vehicle at this altitude; None without a recent report."""
        if source == "error" and now_s - self.altitude_error_s <= _REFERENCE_HOLDS_S:
            return altitude_m + self.altitude_error_m
        return self.target_m if source == "target" and now_s - self.target_s <= _REFERENCE_HOLDS_S else None

    def note(self, measurement: Measurement | None, now_s: float) -> None:
        """Note what is reported of the vertical loop: a less exact throttle only while no exact one arrives."""
        match measurement:
            case Throttle(share=share, exact=exact):
                self.exact_throttle_s = now_s if exact else self.exact_throttle_s
                if exact or now_s - self.exact_throttle_s > THROTTLE_HOLDS_S:
                    self.throttle, self.throttle_s = share, now_s
            case AltitudeError(error_m=error_m):
                self.altitude_error_m, self.altitude_error_s = error_m, now_s
            case TargetAltitude(altitude_m=altitude_m):
                self.target_m, self.target_s = altitude_m, now_s


class RestartCounter:
    """Counts the restarts of a vehicle on the ground by its positions.

    A clock that jumps ahead counts, too: while this computer slept, the vehicle may have restarted.
    """

    def __init__(self) -> None:
        self.restarts = 0
        self._last: Position | None = None
        self._last_s = 0.0
        self._heard = 0
        self._other: OtherClock | None = None

    def take(self, position: Position, now_s: float) -> None:
        """Process a position received at `now_s` by our clock."""
        position = unwrapped(position, self._last)
        if self._last is None or self._is_expected(self._last, position, now_s):
            self._last, self._last_s, self._other = position, now_s, None
            self._heard += 1
        elif not -BACK_S <= position.time_boot_s - self._last.time_boot_s <= 0.0:  # otherwise it is late or repeated
            self._take_other(position, now_s)

    def _is_expected(self, last: Position, position: Position, now_s: float) -> bool:
        """Whether the position is by the same clock. One that fell behind may be that of a simulation that stood still,
        unless it can have begun since the last position."""
        gained_s, passed_s = position.time_boot_s - last.time_boot_s, now_s - self._last_s
        is_behind = gained_s < (1.0 - CLOCK_DRIFT) * passed_s - _BEHIND_S
        return 0.0 < gained_s <= passed_s + AHEAD_S and not (
            is_behind and may_have_begun(position.time_boot_s, passed_s)
        )

    def _take_other(self, position: Position, now_s: float) -> None:
        other = self._other
        first_s = other.first_s if other is not None and other.goes_on(position, now_s) else now_s
        if now_s - first_s < RESTARTED_S:
            self._other = OtherClock(first_s=first_s, last_s=now_s, last=position)
        else:
            self.restarts += self._heard >= _KNOWN_BY
            self._last, self._last_s, self._other, self._heard = position, now_s, None, 1


@dataclass(slots=True)
class VehicleMemory:
    """Latest measurements of a vehicle; positions with their time of receipt. `block` is the number of the current
    block of its flight plan."""

    heartbeat: Heartbeat | None = None
    heartbeat_s: float = float("-inf")
    agreed_since_s: float = float("-inf")
    """Since when every heartbeat has reported the same of its motors, armed or disarmed."""
    version: str = ""
    uid: str = ""
    block: int | None = None
    block_s: float = float("-inf")
    has_ground_reference: bool = False
    """Whether its flight plan was heard to set its ground reference, and it has not restarted since."""
    battery_v: float | None = None
    loop: LoopReports = field(default_factory=LoopReports)
    reports_landing: bool = False
    """Whether it has sent its landed state."""
    may_arm: bool | None = None
    """Whether it reports that it may be armed in its mode; None if it never reports that. One that has done so, or that
    sends events, may not while it reports nothing."""
    arming_checks: ArmingChecks = field(default_factory=ArmingChecks)
    positions: deque[tuple[float, Position]] = field(default_factory=lambda: deque(maxlen=1000))
    restart_counter: RestartCounter = field(default_factory=RestartCounter)
    status_texts: deque[str] = field(default_factory=lambda: deque(maxlen=5))
    status_text_s: float | None = None
    _piece_of: int = field(init=False, default=0)
    _pieces: str = field(init=False, default="")

    @property
    def restarts(self) -> int:
        """Number of times that the vehicle has restarted since it was connected."""
        return self.restart_counter.restarts

    def forget_vehicle(self) -> None:
        """Discard its identity, the results of its arming checks and its ground reference."""
        self.version = self.uid = ""
        self.may_arm = None
        self.has_ground_reference = False
        self.arming_checks = type(self.arming_checks)()

    def note(self, measurement: Measurement | None, now_s: float) -> None:
        self.reports_landing |= isinstance(measurement, LandedState)
        match measurement:
            case Heartbeat(armed=armed):
                if self.heartbeat is None or self.heartbeat.armed != armed:
                    self.agreed_since_s = now_s
                self.heartbeat, self.heartbeat_s = measurement, now_s
            case Version(version=version, uid=uid):
                self.version, self.uid = version or self.version, uid or self.uid
            case BlockEntered(number=number):
                self.block, self.block_s = number, now_s
            case Battery(voltage_v=volts, may_arm=may_arm):
                self.battery_v = volts if volts is not None else self.battery_v
                self.may_arm = False if may_arm is None and self.may_arm is not None else may_arm
            case Throttle() | AltitudeError() | TargetAltitude():
                self.loop.note(measurement, now_s)
            case VehicleEvent():
                self.arming_checks.take(measurement)
                self.may_arm = bool(self.may_arm)
            case Position():
                self.positions.append((now_s, measurement))
                before = self.restarts
                self.restart_counter.take(measurement, now_s)
                self.has_ground_reference &= self.restarts == before
            case StatusText():
                self._add_chunk(measurement, now_s)

    def _add_chunk(self, chunk: StatusText, now_s: float) -> None:
        """Assemble the chunks of a status text in order; a lost chunk is not waited for."""
        if chunk.number != self._piece_of or chunk.place == 0:
            self._piece_of, self._pieces = chunk.number, ""
        self._pieces += chunk.text
        if chunk.is_last:
            self.status_texts.append(self._pieces)
            self.status_text_s = now_s
            self._piece_of, self._pieces = 0, ""
