"""Faults that are injected into a simulated drone: when each begins and ends, and what they do together."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from app.autopilots.simulated.body import OutgoingMessage
from app.core.errors import InputError, Problem
from app.core.policy import is_finite
from app.simdrone.fault_kinds import FAULTS, Fault, FaultTarget

CONNECT: Final = "connect"
FORM: Final = "NAME[:DURATION]@T, T in seconds after the takeoff command, or NAME[:DURATION]@connect"


@dataclass(frozen=True, slots=True)
class PlannedFault:
    """A fault and its time: `start_s` after the takeoff command, None from the beginning; with an infinite
    `duration_s` it does not end."""

    fault: str
    start_s: float | None
    duration_s: float = float("inf")

    def is_active(self, now_s: float, takeoff_s: float | None) -> bool:
        """Whether it is active at `now_s`; both times are in seconds since the drone was switched on."""
        if self.start_s is None:
            return now_s < self.duration_s
        return takeoff_s is not None and 0.0 <= now_s - takeoff_s - self.start_s < self.duration_s


def parse_fault(text: str) -> PlannedFault:
    """Parse a fault of `FORM`. Raises InputError with the reason if it is invalid."""
    what, at, when = text.partition("@")
    name, colon, duration = what.partition(":")
    if name not in FAULTS:
        raise _unusable(f"must be one of {', '.join(FAULTS)}, got {name!r}")
    if not at:
        raise _unusable(f"must have a time: {FORM}")
    start_s = None if when == CONNECT else _seconds(when)
    return PlannedFault(name, start_s, _seconds(duration)) if colon else PlannedFault(name, start_s)


class Faults:
    """Planned and active faults of one drone."""

    def __init__(self, planned: Sequence[PlannedFault]) -> None:
        self._waiting: list[tuple[PlannedFault, Fault]] = []
        self._working: list[tuple[PlannedFault, Fault]] = []
        for plan in planned:
            self.add(plan)

    def add(self, plan: PlannedFault) -> None:
        """Add a fault, also in flight."""
        self._waiting.append((plan, FAULTS[plan.fault]()))

    def update(self, now_s: float, takeoff_s: float | None, drone: FaultTarget) -> None:
        """Begin and end faults at their times; each occurs once."""
        for entry in [each for each in self._waiting if each[0].is_active(now_s, takeoff_s)]:
            self._waiting.remove(entry)
            self._working.append(entry)
            entry[1].begin(drone)
        for entry in [each for each in self._working if not each[0].is_active(now_s, takeoff_s)]:
            self._working.remove(entry)
            entry[1].end(drone)

    @property
    def receives_nothing(self) -> bool:
        return any(fault.receives_nothing for _, fault in self._working)

    def messages(self, messages: list[OutgoingMessage]) -> list[OutgoingMessage]:
        for _, fault in self._working:
            messages = fault.transform_messages(messages)
        return messages

    def frames(self, frames: list[bytes]) -> list[bytes]:
        for _, fault in self._working:
            frames = fault.transform_frames(frames)
        return frames


def _seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = float("nan")
    if not (is_finite(seconds) and seconds >= 0.0):
        raise _unusable(f"a time must be a number of seconds, 0 or more, got {text!r}")
    return seconds


def _unusable(reason: str) -> InputError:
    return InputError(
        "This fault is not valid.",
        problems=(Problem("fault", reason),),
        hint="For example link-lost:8@6, reboot@5 or no-heartbeat@connect.",
    )
