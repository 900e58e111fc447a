"""What any flight left behind, as one type: named columns, events, parameters, and notes of what was lost or damaged.

A decoder of each format makes a `Recording` of what a firmware logged; takeoffs, the segments of a flight and the check
of the replica are derived from it. A column's name ends in its unit (1, a share, if in none); altitudes, their rates
and thrusts are positive up.
"""

from bisect import bisect_right
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from enum import StrEnum
from itertools import groupby
from operator import attrgetter, itemgetter
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from app.autopilots.autopilot import Autopilot
from app.core.errors import InputError, Problem, TrajectoryError
from app.core.records.trajectory import Samples
from app.logs.base import Table, numbers

LONGEST_INTERVAL_S: Final = 0.25
"""Between rows that are further apart, nothing is known."""

Rows = NDArray[np.bool_]
Parameters = Mapping[str, float]
Refused = Callable[[str, str], InputError]
"""The error that a field and a reason make."""


class EventKind(StrEnum):
    """What happened: the vehicle starting anew, its clock going on some time later; a command or mode that begins a
    takeoff, another command or mode; leaving the ground, reaching it, the motors being switched on or off; a parameter
    becoming another, the end of what is recorded."""

    BOOT = "boot"
    TAKEOFF = "takeoff"
    COMMAND = "command"
    MODE = "mode"
    LIFT_OFF = "lift-off"
    LANDING = "landing"
    MOTORS_ON = "motors on"
    MOTORS_OFF = "motors off"
    PARAMETER = "parameter"
    END = "end"


COMMANDS: Final[Mapping[float, tuple[EventKind, str]]] = {
    22: (EventKind.TAKEOFF, "the command NAV_TAKEOFF"),
    21: (EventKind.COMMAND, "the command NAV_LAND"),
}
"""Commands of MAVLink that begin and end a flight."""


@dataclass(frozen=True, slots=True)
class Event:
    """An event in seconds of the recording, and its description: "the block Takeoff"."""

    kind: EventKind
    time_s: float
    what: str


@dataclass(frozen=True, slots=True)
class Span:
    """An interval in which a condition held, in seconds; `end_s` is infinite if the recording ends first."""

    begin_s: float
    end_s: float


@dataclass(frozen=True, slots=True)
class Setting:
    """A parameter that the vehicle used from this time on, −∞ if from before the recording; NaN if it is unknown from
    then on. `held_before`: it is reported for the first time, and nobody had written it before in the recording."""

    time_s: float
    name: str
    value: float
    held_before: bool = False


@dataclass(frozen=True, slots=True)
class Source:
    """Where a column comes from: a field of a message, and the factor to the column's unit. A state `holds_s` long."""

    message: str
    field: str
    factor: float = 1.0
    holds_s: float | None = None

    def __str__(self) -> str:
        return f"{self.message}.{self.field}"


@dataclass(frozen=True, slots=True)
class Column:
    """One quantity as its source reported it, shape (n,) each, n ≥ 1; `time_s` increases.

    A quantity changes steadily between two reports, or keeps the last one for `holds_s`.
    """

    time_s: Samples
    values: Samples
    source: str
    holds_s: float | None = None

    def at(self, time_s: Samples) -> Samples:
        """The quantity at other times, shape (m,)."""
        if time_s is self.time_s:
            return self.values
        if self.holds_s is None:
            return np.interp(time_s, self.time_s, self.values)
        return held(self.time_s, self.values, time_s, longest_s=self.holds_s)

    def beside(self, time_s: Samples) -> Samples:
        """The quantity between two reports that are near to each other, shape (m,); NaN elsewhere."""
        at_s = self.time_s
        if time_s is at_s:
            return self.values
        if len(at_s) < 2:
            return np.full(len(time_s), np.nan)
        after = np.clip(np.searchsorted(at_s, time_s), 1, len(at_s) - 1)
        found = np.interp(time_s, at_s, self.values, left=np.nan, right=np.nan)
        found[at_s[after] - at_s[after - 1] > LONGEST_INTERVAL_S] = np.nan
        return found


def columns_of(
    tables: Mapping[str, Table], sources: Mapping[str, Source], *, clock: str, ticks_per_s: float = 1e6
) -> dict[str, Column]:
    """The columns that were logged, in order of time, those of a message at the same `time_s`; `clock` is the field
    with the time.

    Reports older than one before them are left out. Of several at the same time the first counts, or for a state the
    last.
    """
    columns: dict[str, Column] = {}
    orders: dict[tuple[str, bool], tuple[Samples, NDArray[np.int64]]] = {}
    for name, source in sources.items():
        table = tables.get(source.message, {})
        if {clock, source.field} <= table.keys() and len(table[clock]):
            is_state = source.holds_s is not None
            if (source.message, is_state) not in orders:
                at_s = numbers(table[clock]) / ticks_per_s
                rows = _latest(at_s) if is_state else increasing(at_s)
                orders[source.message, is_state] = at_s[rows], rows
            time_s, rows = orders[source.message, is_state]
            values = source.factor * numbers(table[source.field])[rows]
            columns[name] = Column(time_s, values, str(source), source.holds_s)
    return columns


@dataclass(frozen=True, slots=True)
class ParameterHistory:
    """The values in force from each time on, s, increasing."""

    times_s: Sequence[float]
    values: Sequence[Parameters]

    @classmethod
    def of(cls, logged: Iterable[tuple[float, str, float]]) -> Self:
        """The history of logged values (time, name, value), in order of time."""
        times_s, history = [], []
        values: Parameters = {}
        for time_s, name, value in logged:
            if np.isfinite(value) and values.get(name) != value:
                values = {**values, name: value}
                times_s.append(time_s)
                history.append(values)
        return cls(times_s, history)

    def at(self, time_s: float) -> Parameters:
        """The values at a time."""
        place = bisect_right(self.times_s, time_s) - 1
        return self.values[place] if place >= 0 else {}


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """A recording of one vehicle, `system` in MAVLink, under an `autopilot`.

    `firmware` is named if it is not that of a copter; `release` is its version and `frame` that of the vehicle, as far
    as they are known, one of `OTHER_FRAMES` if it is no copter with several rotors. `sources` are the messages
    that it has, of which some are columns. `in_air` are the intervals from lift-off to touchdown, `armed`
    those with the motors armed, both as reported by the autopilot and in order; None if it does not report them.
    `hardware_id` is that of the board, as `mavlink.hardware_id` has it, and `vehicle_name` the vehicle's own; empty if
    the log does not tell, as in simulations. `blocks` are the intervals in blocks of a flight plan, each from the
    command that activated it. `notes` say what was lost or damaged, and `remarks` how takeoffs are found for want of a
    message. `started_at` is the date, UTC, of its 0 s, None if unknown. `others` are those of other vehicles in the
    same log, and `heard_s` the time of one clock for all, s, at which each is heard first.
    """

    title: str
    autopilot: Autopilot
    clock: str = "vehicle"
    system: int = 1
    firmware: str = ""
    release: str = ""
    frame: str = ""
    hardware_id: str = ""
    vehicle_name: str = ""
    columns: Mapping[str, Column]
    sources: Collection[str] = ()
    settings: Sequence[Setting] = ()
    has_all_parameters: bool = True
    events: Sequence[Event] = ()
    in_air: Sequence[Span] | None = None
    armed: Sequence[Span] | None = None
    blocks: Sequence[Span] = ()
    notes: Sequence[str] = ()
    remarks: Sequence[str] = ()
    started_at: datetime | None = None
    others: Sequence["Recording"] = ()
    heard_s: float = 0.0

    def at(self, name: str, time_s: Samples) -> Samples:
        """A column at these times, shape (n,); NaN if there is none."""
        return self.columns[name].at(time_s) if name in self.columns else np.full(len(time_s), np.nan)

    def events_of(self, *kinds: EventKind) -> list[Event]:
        return [event for event in self.events if event.kind in kinds]

    def history(self, names: Collection[str]) -> ParameterHistory:
        """Of these parameters."""
        return ParameterHistory.of((each.time_s, each.name, each.value) for each in self.settings if each.name in names)

    def parameters_at(self, time_s: float) -> dict[str, float]:
        """All parameters by the firmware's names, as known at a time; those first reported later as they are then, and
        none that is unknown at the time."""
        known: dict[str, float] = {}
        for each in sorted(self.settings, key=attrgetter("time_s")):
            if each.time_s <= time_s or each.name not in known:
                known[each.name] = each.value
        return {name: value for name, value in known.items() if np.isfinite(value)}


def final_parameters(recording: Recording) -> dict[str, float]:
    """All parameters of a log by the firmware's names, Paparazzi's gains by their names here, as last known in flight:
    what is written after the last landing has not flown."""
    ended_s = np.inf
    if spans := recording.in_air or recording.armed:
        ended_s = spans[-1].end_s
    else:
        for event in sorted(recording.events_of(*_BEGIN_FLIGHT, *_END_FLIGHT), key=attrgetter("time_s")):
            ended_s = np.inf if event.kind in _BEGIN_FLIGHT else min(ended_s, event.time_s)
    return recording.parameters_at(ended_s)


_BEGIN_FLIGHT: Final = (EventKind.TAKEOFF, EventKind.MOTORS_ON, EventKind.LIFT_OFF)
_END_FLIGHT: Final = (EventKind.LANDING, EventKind.MOTORS_OFF)


def date_of(utc_s: float) -> datetime | None:
    """The date, UTC, of a time since 1970; None if no clock was set, or it is ahead."""
    is_set = CLOCK_SET_S <= utc_s <= (datetime.now(UTC) + timedelta(days=1)).timestamp()
    return datetime.fromtimestamp(utc_s, UTC) if is_set else None


CLOCK_SET_S: Final = datetime(2001, 1, 1, tzinfo=UTC).timestamp()
"""A recorder whose clock is before this has none."""


def release_of(packed: int) -> str:
    """The version of a firmware in four bytes, as "1.15.1" or "1.13.0-dev"; empty if they are none."""
    *version, stage = packed.to_bytes(4, "big")
    is_release = 0 < version[0] <= _LARGEST_MAJOR and stage in _STAGES
    return ".".join(map(str, version)) + _STAGES[stage] if is_release else ""


_STAGES: Final[Mapping[int, str]] = {0: "-dev", 64: "-alpha", 128: "-beta", 192: "-rc", 255: ""}
"""By the last byte of a release."""
_LARGEST_MAJOR: Final = 9


def refusal(happened: str, hint: str, notes: Sequence[str] = (), error: type[InputError] = TrajectoryError) -> Refused:
    """Errors of a log in which this happened, with `notes` after each reason."""
    return lambda field, reason: error(happened, hint=hint, problems=(Problem(field, "; ".join((reason, *notes))),))


def restarts(boots: int) -> list[str]:
    """The note on how often the vehicle started anew, if it did."""
    return [f"the vehicle restarted and reset its clock ({boots}×)"] if boots else []


def left_out(skipped_bytes: int, odd_rows: int) -> list[str]:
    """The note on what of a file was left out as damaged, if anything was."""
    found = f"{skipped_bytes} bytes, and {odd_rows} rows with an impossible time"
    return [f"damaged and left out: {found}"] if skipped_bytes or odd_rows else []


def spans_of(states: Iterable[tuple[float, bool]]) -> list[Span]:
    """Intervals in which a condition held, from timed reports of it."""
    changes = [next(same) for _, same in groupby(states, key=itemgetter(1))]
    ends_s = [*(time_s for time_s, _ in changes[1:]), np.inf]
    return [Span(begin_s, end_s) for (begin_s, holds), end_s in zip(changes, ends_s, strict=False) if holds]


def increasing(at_s: Samples) -> NDArray[np.int64]:
    """Rows, shape (k,), each later than all before it."""
    latest = np.fmax.accumulate(at_s)
    return np.flatnonzero(np.append(~np.isnan(at_s[:1]), latest[1:] > latest[:-1]))


def _latest(at_s: Samples) -> NDArray[np.int64]:
    """The last row, shape (k,), of each time that is later than all before it."""
    kept = np.flatnonzero(at_s >= np.fmax.accumulate(at_s))
    return np.append(kept[:-1][at_s[kept[1:]] > at_s[kept[:-1]]], kept[-1:])


def held(at_s: Samples, values: Samples, time_s: Samples, *, longest_s: float = np.inf) -> Samples:
    """The value last reported at each time, shape (n,), of those at `at_s`, shape (k,), which increases; NaN before the
    first, and where the last is older than `longest_s`."""
    last = np.searchsorted(at_s, time_s, side="right") - 1
    if not len(at_s):
        return np.full(len(time_s), np.nan)
    return np.where((last >= 0) & (time_s - at_s[last] <= longest_s), values[last], np.nan)
