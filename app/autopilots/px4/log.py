"""Takeoffs in PX4's logs (.ulg, "ULog").

A takeoff is detected from the land detector (`vehicle_land_detected`), the arming state and the mode
(`vehicle_status`). A log without them is searched for rises of the altitude, and a note reports this.
"""

from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import BinaryIO, Final

import numpy as np

from app.autopilots.segments import held
from app.autopilots.takeoffs import FlightLog, LogEvent, Setting, Span, spans_of
from app.core.records.trajectory import Samples
from app.logs.base import PX4_SETS, Table, names_in, numbers, refused, rows_of
from app.logs.ulog_tables import HINT, has_rows, read_ulog_tables, seconds

_POSITION, _SET_POINT, _THRUST = "vehicle_local_position", "vehicle_local_position_setpoint", "vehicle_thrust_setpoint"
_BATTERY, _STATUS, _LANDED = "battery_status", "vehicle_status", "vehicle_land_detected"
_COMMAND, _ANSWER = "vehicle_command", "vehicle_command_ack"
_TOPICS: Final = frozenset({_POSITION, _SET_POINT, _THRUST, _BATTERY, _STATUS, _LANDED, _COMMAND, _ANSWER})

_TAKEOFF, _LAND = 22, 21
_ACCEPTED: Final = 0
_ANSWERED_WITHIN_S: Final = 2.0
_TAKEOFF_MODE, _HOVER_MODE = 17, 4
_COMING_DOWN: Final = frozenset({5.0, 12.0, 18.0, 20.0})
"""Return, descend, land, precision landing: no takeoff begins in these modes."""
_ARMED: Final = 2.0
_BOUNCE_S: Final = 2.0
"""Leaving the ground sooner than this after a touchdown is not a new takeoff."""
_MODES: Final[Mapping[float, str]] = {0: "manual", 1: "altitude", 2: "position", 3: "mission", 5: "return", 18: "land"}


def read_ulog(stream: BinaryIO) -> FlightLog:
    """Read a whole log. Raises TrajectoryError if it contains no altitude."""
    tables = read_ulog_tables(stream, topics=_TOPICS, parameters=names_in(PX4_SETS))
    topics = tables.topics
    position = topics.get(_POSITION, {})
    if not {"timestamp", "z"} <= position.keys():
        raise refused("contains no vehicle_local_position.z, the altitude", HINT)
    starts, ends, landings = _moments(topics)
    return FlightLog(
        title="PX4's log (ULog)",
        clock="vehicle",
        time_s=seconds(position),
        channels=_channels(position, topics),
        from_ground=True,
        gain_sets=PX4_SETS,
        settings=tuple(Setting(*each) for each in tables.settings),
        starts=starts,
        ends=[*ends, *landings],
        landings=landings,
        in_air=_in_air(topics),
        armed=_armed(topics),
        notes=(*tables.notes, *_missing(topics)),
    )


def latest(table: Table, name: str, time_s: Samples) -> Samples:
    """A column as it was last published at each time, shape (n,); NaN before, and if it is missing."""
    if not has_rows(table, name):
        return np.full(len(time_s), np.nan)
    return held(seconds(table), numbers(table[name]), time_s)


def _channels(position: Table, topics: Mapping[str, Table]) -> dict[str, Samples]:
    """Altitude where the estimator reports it as valid, and the other channels, at the times of the position."""
    time_s, altitude_m = seconds(position), -numbers(position["z"])
    if "z_valid" in position:
        altitude_m = np.where(numbers(position["z_valid"]) != 0.0, altitude_m, np.nan)
    channels = {"altitude_m": altitude_m}
    if "vz" in position:
        channels["climb_rate_m_s"] = -numbers(position["vz"])
    for channel, topic, name, sign in (
        ("reference_m", _SET_POINT, "z", -1.0),
        ("thrust", _THRUST, "xyz[2]", -1.0),
        ("battery_v", _BATTERY, "voltage_v", 1.0),
    ):
        table = topics.get(topic, {})
        if {"timestamp", name} <= table.keys():
            channels[channel] = np.interp(time_s, seconds(table), sign * numbers(table[name]))
    return channels


def _moments(topics: Mapping[str, Table]) -> tuple[list[LogEvent], list[LogEvent], list[LogEvent]]:
    """Takeoff commands and modes, those that end a flight, and landings."""
    starts: list[LogEvent] = []
    ends: list[LogEvent] = []
    landings: list[LogEvent] = []
    refusals = [
        (time_s, command)
        for time_s, command, result in rows_of(topics.get(_ANSWER, {}), "timestamp", "command", "result")
        if result
    ]
    for time_s, command in rows_of(topics.get(_COMMAND, {}), "timestamp", "command"):
        refused_at = [at for at, what in refusals if what == command and 0.0 <= at - time_s <= _ANSWERED_WITHIN_S]
        if command in {_TAKEOFF, _LAND} and not refused_at:
            moments, name = (starts, "NAV_TAKEOFF") if command == _TAKEOFF else (ends, "NAV_LAND")
            moments.append(LogEvent(time_s, f"the command {name}"))
    before: float | None = None
    is_armed = _at(rows_of(topics.get(_STATUS, {}), "timestamp", "arming_state"))
    was_taking_off = False
    for time_s, mode in rows_of(topics.get(_STATUS, {}), "timestamp", "nav_state"):
        takes_off = mode == _TAKEOFF_MODE and is_armed(time_s) in {_ARMED, None}
        if takes_off and not was_taking_off:
            starts.append(LogEvent(time_s, "the takeoff mode"))
        elif before not in {None, mode} and mode not in {_TAKEOFF_MODE, _HOVER_MODE}:
            ends.append(LogEvent(time_s, f"the mode {_MODES.get(mode, f'{mode:g}')}"))
        before, was_taking_off = mode, takes_off
    before = None
    for time_s, landed in rows_of(topics.get(_LANDED, {}), "timestamp", "landed"):
        if landed and before == 0.0:
            landings.append(LogEvent(time_s, "the landing"))
        before = landed
    return starts, ends, landings


def _in_air(topics: Mapping[str, Table]) -> list[Span] | None:
    """Intervals from each lift-off to the touchdown, from the land detector, with the motors armed if that is known.

    A lift-off in a descending mode, or within two seconds of a touchdown (a bounce), is not counted. None without the
    land detector.
    """
    landed = list(rows_of(topics.get(_LANDED, {}), "timestamp", "landed"))
    if not landed:
        return None
    arming = list(rows_of(topics.get(_STATUS, {}), "timestamp", "arming_state"))
    mode = _at(rows_of(topics.get(_STATUS, {}), "timestamp", "nav_state"))
    is_landed, is_armed = _at(landed), _at(arming)
    times = sorted({time_s for time_s, _ in (*landed, *arming)})
    spans = spans_of((time_s, is_landed(time_s) == 0.0 and is_armed(time_s) in {_ARMED, None}) for time_s in times)
    touched_s = [-np.inf, *(span.end_s for span in spans)]
    return [
        span
        for span, before_s in zip(spans, touched_s, strict=False)
        if mode(span.begin_s) not in _COMING_DOWN and span.begin_s - before_s >= _BOUNCE_S
    ]


def _armed(topics: Mapping[str, Table]) -> list[Span] | None:
    """Intervals with the motors armed; None if the log does not report them."""
    arming = list(rows_of(topics.get(_STATUS, {}), "timestamp", "arming_state"))
    return spans_of((time_s, state == _ARMED) for time_s, state in arming) if arming else None


def _at(rows: Iterable[tuple[float, ...]]) -> Callable[[float], float | None]:
    """A function of time that returns the latest value of these rows (time, value); None before the first."""
    samples = sorted((time_s, value) for time_s, value in rows)
    times = [time_s for time_s, _ in samples]

    def value_at(time_s: float) -> float | None:
        place = bisect_right(times, time_s)
        return samples[place - 1][1] if place else None

    return value_at


def _missing(topics: Mapping[str, Table]) -> Iterator[str]:
    """Notes on missing topics, needed to tell a takeoff from a jump of the altitude, and on the method used instead."""
    has_status = any(True for _ in rows_of(topics.get(_STATUS, {}), "timestamp", "arming_state", "nav_state"))
    if not any(True for _ in rows_of(topics.get(_LANDED, {}), "timestamp", "landed")):
        how = "while it was armed" if has_status else "armed or not"
        yield (
            f"no {_LANDED} in the log, so the takeoff is found from a rise of the altitude, {how}: check that "
            "it is the right flight"
        )
    elif not has_status:
        yield (
            f"no {_STATUS} in the log, so the takeoff is found from the land detector alone: check that it is "
            "the right flight"
        )
