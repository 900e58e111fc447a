"""Events on the time line of a recorded takeoff: command, lift-off, glitch, gap, abort, landing, and pinned notes."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from app.core.records.trajectory import Samples, Trajectory

AIRBORNE_M: Final = 0.1
"""Height above which the vehicle has left the ground."""
_GAP_S: Final = 1.0
"""Time without samples from which the link counts as lost."""
_GAP_INTERVALS: Final = 5.0
"""A gap is that many times longer than the usual interval, because some logs have less than a sample a second."""
_NAMED: Final = 3
_PINNED: Final = re.compile(r"\s*(-?\d{1,4}(?:\.\d{1,6})?)\s?s\s?[:–-]\s?(\S.*)")


@dataclass(frozen=True, slots=True)
class FlightEvent:
    """What happened, at a time in seconds since the command."""

    time_s: float
    name: str


def flight_events(
    trajectory: Trajectory, glitches_s: Sequence[float] = (), planned: Sequence[FlightEvent] = ()
) -> tuple[FlightEvent, ...]:
    """The events that the record shows, in order, with its glitches, which begin at `glitches_s`.

    Lift-off: the first sample more than 0.1 m above the last one before the command. Landing: the first sample at most
    that high after the last one higher. Abort: the set point, where it was recorded, returns to the ground. No data: no
    samples for longer than a second, which is no glitch as well. Only the command, the glitches and the times without
    data, if there is no altitude. The `planned` events happened, unless the record or the flight ended before them.
    More than three of a kind are one event, at the first.
    """
    time_s, channels = trajectory.time_s, trajectory.channels
    gaps = _gaps(time_s)
    others_s = [begin_s for begin_s in glitches_s if begin_s not in dict(gaps)]
    glitches = [FlightEvent(begin_s, "Glitch") for begin_s in others_s]
    lost = [FlightEvent(begin_s, f"No data for {lasts_s:.1f} s") for begin_s, lasts_s in gaps]
    found = [
        FlightEvent(0.0, "Command"),
        *_few(glitches, f"{len(glitches)} glitches"),
        *_few(lost, f"No data, {len(lost)} times"),
    ]
    if "altitude_m" not in channels or not len(time_s):
        return tuple(sorted(found, key=_time))
    is_commanded = time_s >= 0.0
    ground_m = channels["altitude_m"][max(0, int(np.argmax(is_commanded)) - 1)]
    airborne = np.flatnonzero(is_commanded & (channels["altitude_m"] - ground_m > AIRBORNE_M))
    if airborne.size:
        found.append(FlightEvent(float(time_s[airborne[0]]), "Lift-off"))
    abort = _abort(trajectory)
    if abort is not None:
        found.append(FlightEvent(float(time_s[abort]), "Abort"))
    until_s = float(time_s[-1 if abort is None else abort])
    found += [event for event in planned if event.time_s <= until_s]
    if airborne.size and airborne[-1] < len(time_s) - 1:
        found.append(FlightEvent(float(time_s[airborne[-1] + 1]), "Landing"))
    return tuple(sorted(found, key=_time))


def pinned_notes(note: str) -> tuple[FlightEvent, ...]:
    """The lines of a flight's note that begin with a time, as in "2.4 s: wobble", in order of time."""
    lines = filter(None, map(_PINNED.fullmatch, note.splitlines()))
    return tuple(sorted((FlightEvent(float(line[1]), line[2].strip()) for line in lines), key=_time))


def _time(event: FlightEvent) -> float:
    return event.time_s


def _few(events: list[FlightEvent], together: str) -> list[FlightEvent]:
    """The events, or one for all of them if they are many."""
    return events if len(events) <= _NAMED else [FlightEvent(min(map(_time, events)), together)]


def _gaps(time_s: Samples) -> list[tuple[float, float]]:
    """Beginning and length of each gap, s."""
    intervals_s = np.diff(time_s)
    if not intervals_s.size:
        return []
    places = np.flatnonzero(intervals_s > max(_GAP_S, _GAP_INTERVALS * float(np.median(intervals_s))))
    return [(float(time_s[place]), float(intervals_s[place])) for place in places]


def _abort(trajectory: Trajectory) -> int | None:
    """Index of the first sample after the command whose set point is below half of the highest."""
    set_point = trajectory.channels.get("set_point_m")
    if set_point is None or not set_point.max() > 0.0:
        return None
    commanded = np.flatnonzero(set_point > 0.5 * set_point.max())
    dropped = np.flatnonzero(set_point[commanded[0] :] <= 0.5 * set_point.max())
    return int(commanded[0] + dropped[0]) if dropped.size else None
