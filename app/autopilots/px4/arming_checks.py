"""PX4's arming checks, from its events.

Since release 1.14 PX4 sends the results of its arming checks as events
(https://mavlink.io/en/services/events.html): a summary of the failing components and of the modes in which it may arm,
one event for each check, and a summary of its health, in this order and with consecutive sequence numbers
(https://github.com/mavlink/libevents, README). The text of a check is in PX4's component metadata, which is not
requested; the summary names the failing components. Numbers and names below are from the metadata that a PX4 of March
2026 wrote into its log (tests/data/logs/px4_takeoff.ulg.gz).
"""

import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final

from app.autopilots.autopilot import ArmingChecks
from app.autopilots.measurements import VehicleEvent

ARMING_CHECK_SUMMARY: Final = 1 << 24 | 11047904
"""The autopilot's component, and the event commander_arming_check_summary."""
HEALTH_SUMMARY: Final = 1 << 24 | 1914663
"""commander_health_summary."""
COMPONENTS: Final = (
    "None", "Absolute pressure", "Differential pressure", "GPS", "Optical flow", "Vision position estimate",
    "Distance sensor", "Remote Control (RC or Joystick)", "Motors/ESCs", "UTM", "Logging", "Battery",
    "Communication links", "Rate controller", "Attitude controller", "Position controller", "Attitude estimate",
    "Local position estimate", "Mission", "Avoidance", "System", "Camera", "Gimbal", "Payload",
    "Global position estimate", "Storage", "Parachute", "Magnetometer", "Accelerometer", "Gyroscope",
    "Open Drone ID system", "Traffic Avoidance (ADSB/FLARM)",
)  # fmt: skip
"""Components by the bits of health_component_t. The first stands for no component."""
MODE_GROUPS: Final[Mapping[str, int]] = MappingProxyType(
    {
        "1.0": 0, "2.0": 1, "3.0": 2, "4.4": 3, "4.3": 4, "4.5": 5, "5.0": 10, "6.0": 14, "7.0": 15, "4.2": 17,
        "4.6": 18,
    }
)  # fmt: skip
"""Bits of navigation_mode_group_t by the profile's names of the modes."""

_SUMMARY: Final = struct.Struct("<BIIII")
"""Chunk, components with errors and with warnings, modes in which it may arm, modes that may run."""
_CHECK: Final = struct.Struct("<IB")
"""Modes that the check concerns, and the component."""
_SEQUENCE_NUMBERS: Final = 1 << 16
_MOST_CHECKS: Final = 256
"""Maximum number of checks of one chunk; beyond it the end of the chunk was lost."""


@dataclass(slots=True)
class _Report:
    """One chunk of the results. `is_whole` once all its checks have been received."""

    chunk: int
    errors: int
    may_arm: int
    checks: list[tuple[int, int]] = field(default_factory=list)
    is_whole: bool = False

    def failing(self, group: int | None) -> int:
        """Return the failing components; if the chunk is whole, only those with a check for this group of modes."""
        if not self.is_whole or group is None:
            return self.errors
        about = {component for modes, component in self.checks if modes >> group & 1}
        return self.errors & sum(1 << component for component in about)


class Px4ArmingChecks(ArmingChecks):
    """Latest results, assembled from events as they arrive; lost events are not waited for."""

    def __init__(self) -> None:
        self._reports: dict[int, _Report] = {}
        self._open: _Report | None = None
        self._next = 0

    def take(self, event: VehicleEvent) -> None:
        ahead = (event.sequence - self._next) % _SEQUENCE_NUMBERS
        if event.number == ARMING_CHECK_SUMMARY:
            chunk, errors, _, may_arm, _ = _SUMMARY.unpack_from(event.arguments)
            self._open = self._reports[chunk] = _Report(chunk, errors, may_arm)
        elif ahead >= _SEQUENCE_NUMBERS // 2:  # repeated on request
            return
        elif self._open is not None:
            self._proceed(self._open, event, is_next=ahead == 0)
        self._next = (event.sequence + 1) % _SEQUENCE_NUMBERS

    def _proceed(self, report: _Report, event: VehicleEvent, *, is_next: bool) -> None:
        if is_next and event.number != HEALTH_SUMMARY and len(report.checks) < _MOST_CHECKS:
            report.checks.append(_CHECK.unpack_from(event.arguments))
            return
        ends = event.number == HEALTH_SUMMARY and event.arguments[0] == report.chunk
        report.is_whole = is_next and ends
        self._open = None

    def failing(self, mode: str) -> tuple[str, ...]:
        """Return the components that prevent arming in this mode, or in any mode if modes cannot be distinguished."""
        failing = 0
        for report in self._reports.values():
            failing |= report.failing(MODE_GROUPS.get(mode))
        return tuple(name for bit, name in enumerate(COMPONENTS) if bit and failing >> bit & 1)

    @property
    def arming_modes(self) -> frozenset[str]:
        """Modes in which it may arm; none without results."""
        reports = self._reports.values()
        return frozenset(
            mode
            for mode, group in MODE_GROUPS.items()
            if reports and all(each.may_arm >> group & 1 for each in reports)
        )
