"""Detection of takeoffs in a recording: where each begins and ends, the gains it was flown with, and its record.

Takeoffs are detected in the same way for every format. If the autopilot
logs when it was in the air, each such interval that rises by 0.5 m is a flight, and nothing else is: an estimate that
settles at boot, or jumps at a touchdown, is not. Otherwise flights are detected by altitude, while the motors were
armed if that is known: off the ground by 0.15 m and on to at least 0.5 m. A flight begins with the takeoff command if
the log contains one, else at lift-off; it ends with the landing command, a change of a gain, or on the ground.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Final

import numpy as np

from app.autopilots.recording import Event, EventKind, Recording, Span
from app.core.errors import Problem, TrajectoryError
from app.core.formatting import format_gains, times
from app.core.policy import Gains
from app.core.records.trajectory import CHANNEL_UNITS, Samples, Trajectory

NEAR_GROUND_M: Final = 0.15
HIGHEST_HOP_M: Final = 0.5
LONGEST_S: Final = 600.0
MIN_SAMPLES: Final = 20
MAX_SAMPLES: Final = 200_000
MAX_TAKEOFFS: Final = 200
NOT_COMMANDED: Final = "not comparable: it begins at lift-off, because the log does not contain the takeoff command"

_RISE_S: Final = (0.5, 1.0, 2.0, 3.0)
_STOOD_M: Final = 0.05
_LANDED_S: Final = 2.0
_BEFORE_S: Final = 1.0
_COMMAND_AHEAD_S: Final = 10.0
_LISTED: Final = 50
_LARGEST: Final = 1e6
_LANDINGS: Final = (EventKind.LANDING, EventKind.MOTORS_OFF)
_ENDS: Final = (EventKind.COMMAND, EventKind.MODE, *_LANDINGS, EventKind.BOOT)
_ALTITUDES: Final = frozenset({"altitude_m", "reference_m", "set_point_m"})


@dataclass(frozen=True, slots=True, kw_only=True)
class Takeoff:
    """One takeoff.

    `trajectory` is its record, with time counted from its beginning; `gains` are those used then, empty if not in the
    log; `gain_names` are those of its autopilot, empty if the format has none; `notes` explain how both were read.
    `start_s` is in seconds since the log's first sample. A takeoff that is not `is_commanded` begins at lift-off: its
    error is over another window than that of a commanded one, and not comparable with it. `started_at` is when it
    began, in UTC, by the log's clock; None if the log has no date.
    """

    number: int
    start_s: float
    begins_with: str
    trajectory: Trajectory
    gains: Gains
    gain_names: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    is_commanded: bool = True
    started_at: datetime | None = None

    @property
    def summary(self) -> str:
        """Description for a list to choose from."""
        held = format_gains(self.gains) or "gains not in the log"
        highest = f"{self.trajectory['altitude_m'].max():.2f}".replace("-", "−")
        return (
            f"{self.start_s:.1f} s into the log, at {self.begins_with}: {self.trajectory.time_s[-1]:.1f} s recorded, "
            f"highest {highest} m, {held}"
        )


def find_takeoffs(log: Recording) -> tuple[Takeoff, ...]:
    """Find the takeoffs, ordered by time. Raises TrajectoryError if there is none."""
    time_s, channels = _usable(log)
    altitude_m = channels["altitude_m"]
    found: list[Takeoff] = []
    free_from_s = -np.inf
    for stood, down in _flights(log, time_s, altitude_m):
        begin = _beginning(log, float(time_s[stood]), free_from_s)
        held = _GainsAt(log, begin.time_s)
        kept, end = _kept(log, time_s, begin, held, stood, down)
        if kept.stop - kept.start >= MIN_SAMPLES:
            first, past = _between(time_s, begin.time_s - _BEFORE_S, begin.time_s)
            ground_m = float(altitude_m[first:past].mean() if past > first else altitude_m[stood])
            record = _Record(log, begin, end, ground_m, held)
            found.append(record.takeoff(len(found) + 1, time_s, channels, kept))
        free_from_s = float(time_s[down])
        if len(found) > MAX_TAKEOFFS:
            raise TrajectoryError(
                f"The log contains more than {MAX_TAKEOFFS} takeoffs.",
                hint="Trim it to the flights of one day, or choose the log of one flight.",
                problems=(Problem("file", "contains too many flights"),),
            )
    if not found:
        raise TrajectoryError(
            "The log contains no takeoff.",
            hint="Choose the log of the flight itself, recorded from before the takeoff.",
            problems=(
                Problem(
                    "altitude_m",
                    f"varies by {np.ptp(altitude_m):.2f} m within {time_s[-1] - time_s[0]:.1f} s, without a rise by "
                    f"{HIGHEST_HOP_M:g} m {_where_looked(log)} in at least {MIN_SAMPLES} samples",
                ),
            ),
        )
    return tuple(found)


def choose(takeoffs: Sequence[Takeoff], number: int | None) -> Takeoff:
    """The takeoff with this number, or the only one. Raises TrajectoryError that lists them if it is not clear."""
    if number is None and len(takeoffs) == 1:
        return takeoffs[0]
    if number is not None and 1 <= number <= len(takeoffs):
        return takeoffs[number - 1]
    happened = "The log contains one takeoff" if len(takeoffs) == 1 else f"The log contains {len(takeoffs)} takeoffs"
    raise TrajectoryError(
        f"{happened}." if number is None else f"{happened}; there is no takeoff {number}.",
        hint="Specify the number of the takeoff; nothing was stored.",
        problems=tuple(Problem("takeoff", f"{each.number}: {each.summary}") for each in takeoffs[:_LISTED]),
    )


def _usable(log: Recording) -> tuple[Samples, Mapping[str, Samples]]:
    """Samples with a valid altitude, and the other channels beside it. Raises TrajectoryError if too few remain."""
    altitude = log.columns["altitude_m"]
    with np.errstate(invalid="ignore"):
        good = np.isfinite(altitude.values) & (np.abs(altitude.values) <= _LARGEST)
    good &= log.at("altitude_is_valid", altitude.time_s) != 0.0
    time_s = altitude.time_s[good]
    if len(time_s) < MIN_SAMPLES:
        raise TrajectoryError(
            f"The log contains {len(time_s)} usable samples of the altitude; a flight needs at least {MIN_SAMPLES}.",
            hint="Record the vehicle's local position at 20 Hz or more during the whole flight.",
            problems=(Problem("altitude_m", "has too few samples"),),
        )
    channels = (name for name in log.columns if name in CHANNEL_UNITS)
    return time_s, {name: log.columns[name].at(altitude.time_s)[good] for name in channels}


def _where_looked(log: Recording) -> str:
    if log.in_air is None:
        return f"in {_RISE_S[-1]:g} s{'' if log.armed is None else ' while it was armed'}"
    return f"while it was in the air ({times(len(log.in_air))}, from the autopilot's status)"


def _flights(log: Recording, time_s: Samples, altitude_m: Samples) -> Iterator[tuple[int, int]]:
    """Indices of the last sample on the ground before each flight, and of the first one down again (or the last)."""
    if log.in_air is not None:
        yield from _flights_in_air(time_s, altitude_m, log.in_air)
        return
    landings_s = [landing.time_s for landing in log.events_of(*_LANDINGS)]
    for armed in (Span(-np.inf, np.inf),) if log.armed is None else log.armed:
        first, past = _between(time_s, armed.begin_s, armed.end_s)
        for stood, down in _flights_by_altitude(time_s[first:past], altitude_m[first:past], landings_s):
            yield first + stood, first + down


def _flights_in_air(time_s: Samples, altitude_m: Samples, in_air: Sequence[Span]) -> Iterator[tuple[int, int]]:
    """Every interval in the air that rises by more than a hop above the ground level in the second before it."""
    last = len(time_s) - 1
    for span in in_air:
        first, off = _between(time_s, span.begin_s - _BEFORE_S, span.begin_s)
        stood = min(max(off - 1, 0), last)
        down = min(int(np.searchsorted(time_s, span.end_s)), last)
        ground_m = float(np.median(altitude_m[first:off])) if off > first else float(altitude_m[stood])
        risen = np.flatnonzero(altitude_m[stood : down + 1] > ground_m + HIGHEST_HOP_M)
        if len(risen):
            yield stood, min(_down(time_s, altitude_m, stood + int(risen[0]), ground_m), down)


def _flights_by_altitude(
    time_s: Samples, altitude_m: Samples, landings_s: Sequence[float]
) -> Iterator[tuple[int, int]]:
    """Every rise by more than a hop within three seconds."""
    landings = np.searchsorted(time_s, np.sort(np.asarray(landings_s, dtype=np.float64)))
    lowest_m = altitude_m.copy()
    for lag_s in _RISE_S:
        np.minimum(lowest_m, altitude_m[np.searchsorted(time_s, time_s - lag_s)], out=lowest_m)
    risen = np.flatnonzero(altitude_m - lowest_m > HIGHEST_HOP_M)
    free_from = 0
    while (place := int(np.searchsorted(risen, free_from))) < len(risen):
        up = int(risen[place])
        first = min(max(free_from, int(np.searchsorted(time_s, time_s[up] - _RISE_S[-1]))), up)
        ground_m = float(altitude_m[first : up + 1].min())
        stood = first + int(np.flatnonzero(altitude_m[first : up + 1] <= ground_m + _STOOD_M)[-1])
        announced = landings[landings > up][:1].tolist()
        down = min(_down(time_s, altitude_m, up, ground_m), *announced, len(time_s) - 1)
        yield stood, down
        free_from = down + 1


def _down(time_s: Samples, altitude_m: Samples, up: int, ground_m: float) -> int:
    """Index from which the altitude stays near the ground for two seconds; past the last one if it never does."""
    soon = int(np.searchsorted(time_s, time_s[up] + LONGEST_S))
    for past_all in (soon, len(time_s)):  # most flights are short, so search a part of a long log first
        low = altitude_m[up:past_all] <= ground_m + NEAR_GROUND_M
        edges = np.flatnonzero(np.diff(np.concatenate(([False], low, [False])).astype(np.int8))) + up
        for first, past in edges.reshape(-1, 2).tolist():
            if time_s[past - 1] - time_s[first] >= _LANDED_S:
                return int(first)
    return len(time_s)


def _beginning(log: Recording, stood_s: float, free_from_s: float) -> Event:
    """The event from which time counts: the first command, since later ones repeat it, or else the lift-off."""
    ahead_s = max(free_from_s, stood_s - _COMMAND_AHEAD_S)
    commands = [start for start in log.events_of(EventKind.TAKEOFF) if ahead_s < start.time_s <= stood_s + _RISE_S[-1]]
    blocks = [
        Event(EventKind.TAKEOFF, each.begin_s, "the block in which it lifted off")
        for each in log.blocks
        if ahead_s < each.begin_s <= stood_s < each.end_s
    ]
    lift_off = Event(EventKind.LIFT_OFF, stood_s, "lift-off")
    return min(commands or blocks, key=lambda start: start.time_s, default=lift_off)


def _kept(
    log: Recording, time_s: Samples, begin: Event, held: "_GainsAt", stood: int, down: int
) -> tuple[slice, Event]:
    """The samples of the record, and the event that ends it; without a description for the landing or the log's end.

    Commands end a flight only in the air: a mode reported by a heartbeat may be a second old.
    """
    off_s = max(begin.time_s, float(time_s[stood]))
    ends = [moment for moment in log.events_of(*_ENDS) if moment.time_s > off_s]
    changes = [moment for moment in held.changes if moment.time_s > begin.time_s]
    too_long = Event(EventKind.END, begin.time_s + LONGEST_S, "the longest record that is kept")
    landing = Event(EventKind.LANDING, float(time_s[down]), "")
    end = min((*ends, *changes, landing, too_long), key=lambda moment: moment.time_s)
    first, past = _between(time_s, begin.time_s - _BEFORE_S, end.time_s)
    return slice(first, min(past, first + MAX_SAMPLES)), end


def _between(time_s: Samples, first_s: float, last_s: float) -> tuple[int, int]:
    """Index of the first sample of an interval, and the one past its last."""
    first = int(np.searchsorted(time_s, first_s))
    return first, max(first, int(np.searchsorted(time_s, last_s, side="right")))


class _GainsAt:
    """The gains that the vehicle used at a time, and their later changes."""

    def __init__(self, log: Recording, at_s: float) -> None:
        known = {setting.name for setting in log.settings}
        sets = log.autopilot.logged_gains
        logged = next((gains for gains in sets if known.issuperset(gain.parameter for gain in gains)), ())
        names = [gain.parameter for gain in logged]
        settings = sorted((each for each in log.settings if each.name in names), key=lambda each: each.time_s)
        gains = {each.name: each.value for each in settings if each.time_s <= at_s}
        self.learned_late = sorted(set(names) - set(gains))
        for each in settings:
            gains.setdefault(each.name, each.value)
        is_known = not any(map(np.isnan, gains.values()))
        self.gains: Gains = {gain.gain: gain.logged(gains[gain.parameter]) for gain in logged if is_known}
        self.changes = [
            Event(
                EventKind.PARAMETER,
                each.time_s,
                f"{each.name} becoming {'unknown' if np.isnan(each.value) else f'{each.value:g}'}",
            )
            for each in settings
            if is_known and each.time_s > at_s and each.value != gains[each.name]
        ]


@dataclass(frozen=True, slots=True)
class _Record:
    """Data from which one takeoff is assembled."""

    log: Recording
    begin: Event
    end: Event
    ground_m: float
    held: _GainsAt

    def takeoff(self, number: int, time_s: Samples, channels: Mapping[str, Samples], kept: slice) -> Takeoff:
        ground_m = self.ground_m if self.log.autopilot.climbs_from_ground else 0.0
        cut = {name: values[kept] - (ground_m if name in _ALTITUDES else 0.0) for name, values in channels.items()}
        complete = {name: values for name, values in cut.items() if np.isfinite(values).all()}
        notes = (*self.log.notes, *self.log.remarks, *self._notes([name for name in cut if name not in complete]))
        return Takeoff(
            number=number,
            start_s=self.begin.time_s - float(time_s[0]),
            begins_with=self.begin.what,
            trajectory=Trajectory(
                time_s[kept] - self.begin.time_s,
                complete,
                source="; ".join((self.log.title, f"time from {self.begin.what}", *notes)),
                clock=self.log.clock,
            ),
            gains=self.held.gains,
            gain_names=tuple(gain.gain for gain in self.log.autopilot.gain_sets[0]),
            notes=notes,
            is_commanded=self.begin.kind is EventKind.TAKEOFF,
        )

    def _notes(self, left_out: Sequence[str]) -> Iterator[str]:
        if self.begin.kind is not EventKind.TAKEOFF:
            yield NOT_COMMANDED
        if self.log.autopilot.climbs_from_ground:
            yield f"altitude relative to the ground, which is at {self.ground_m:.2f} m in the log"
        if self.held.learned_late:
            yield f"known only after the takeoff: {', '.join(self.held.learned_late)}"
        if left_out:
            yield f"left out because of missing values: {', '.join(left_out)}"
        if self.end.what:
            yield f"ends after {self.end.time_s - self.begin.time_s:.1f} s with {self.end.what}"
