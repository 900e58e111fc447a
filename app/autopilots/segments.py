"""Parts of a logged flight that can be analysed: rows that follow each other without a gap, a jump or a change."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.autopilots.recording import LONGEST_INTERVAL_S, EventKind, ParameterHistory, Parameters, Recording, Rows, Span
from app.core.errors import TrajectoryError
from app.core.reasons import LEFT_OUT, Reason, ReasonCode
from app.core.records.trajectory import Samples

SHORTEST_PART_S: Final = 4.0
LONGEST_FLIGHT_S: Final = 120.0
LARGEST_LEAN: Final = 0.866
"""Cosine of the lean beyond which rows are left out: 30°."""
_INTERVAL_S: Final = 0.1
_ALREADY_THIN: Final = 0.9
_NEAR_GROUND_M: Final = 0.3
_DESCENT_M_S: Final = 0.1
_DESCENT_S: Final = 1.0
_UNSEEN_S: Final = 2.0
"""A touchdown that much later than the last row before it was not recorded."""
_IDLE: Final = 0.05
_ABOVE_GROUND_M: Final = 0.5
_TELLING: Final = (EventKind.BOOT, EventKind.MOTORS_ON, EventKind.LIFT_OFF, EventKind.LANDING, EventKind.MOTORS_OFF)
"""Events after which it is known whether the vehicle is in the air, or not any more."""

Part = tuple[int, int]
"""First row, and the row after the last."""
Refused = Callable[[Reason], TrajectoryError]
"""The error that a reason makes."""


@dataclass(frozen=True, slots=True)
class Condition:
    """Rows that can be used, shape (n,), why the others cannot, and the message or column that tells."""

    rows: Rows
    code: ReasonCode
    field: str


_HELD: Final = frozenset(
    {ReasonCode.NEVER_FLEW, ReasonCode.ALTITUDE_NOT_HELD, ReasonCode.OTHER_MODES, ReasonCode.MANUAL_ALTITUDE}
)
"""What these conditions leave is flown with the altitude held."""


def within_limits(throttle: Samples, beyond: float = 1e-3) -> Samples:
    """Shares of full throttle, shape (n,), of which those less than `beyond` below 0 or above 1 are these; NaN for what
    is not a throttle."""
    near = (throttle >= -beyond) & (throttle <= 1.0 + beyond)
    return np.where(near, np.clip(throttle, 0.0, 1.0), np.nan)


def has_neighbour(time_s: Samples) -> Rows:
    """Rows, shape (n,), beside another one without a gap."""
    near = np.diff(time_s) <= LONGEST_INTERVAL_S
    return np.asarray(np.append(False, near) | np.append(near, False))


def jumps(time_s: Samples, values: Samples, rates: Samples, largest: float) -> Rows:
    """Rows, shape (n,), whose value differs by more than `largest` from what its rate made of the one before."""
    followed = 0.5 * (rates[1:] + rates[:-1]) * np.diff(time_s)
    return np.append(False, np.abs(np.diff(values) - followed) > largest)


def in_flight(
    recording: Recording, altitude_m: Samples, thrust: Samples, *, after_s: float = 0.0, before_s: float = 0.0
) -> Rows:
    """Rows of the altitude, shape (n,), between takeoff and landing, by the vehicle's own reports, but for the seconds
    after each lift-off and before each touchdown. Where none tells whether it flew, as in a log that begins in the air,
    those above the lowest altitude, which is 0 or less, with thrust, as far as that is known, and armed motors."""
    time_s = recording.columns["altitude_m"].time_s
    if recording.in_air is not None:
        return _within(time_s, recording.in_air)
    lowest_m = np.min(altitude_m[np.isfinite(altitude_m)], initial=0.0)
    is_up = (altitude_m > lowest_m + _ABOVE_GROUND_M) & ~(thrust <= _IDLE)
    if recording.armed is not None:
        return is_up & _within(time_s, recording.armed)
    flying, unknown_from_s = is_up, -np.inf
    for event in recording.events_of(*_TELLING):
        if event.kind in (EventKind.MOTORS_ON, EventKind.LIFT_OFF):
            flying = flying & (time_s < unknown_from_s)
        if event.kind is EventKind.LIFT_OFF:
            flying = flying | (time_s >= event.time_s + after_s)
        else:
            flying = flying & (time_s < event.time_s - before_s)
        unknown_from_s = event.time_s if event.kind is EventKind.BOOT else np.inf
        flying = flying | (is_up & (time_s >= unknown_from_s))
    return flying


def _within(time_s: Samples, spans: Iterable[Span]) -> Rows:
    inside = np.zeros(len(time_s), dtype=np.bool_)
    for span in spans:
        inside |= (time_s >= span.begin_s) & (time_s < span.end_s)
    return inside


def find_landings(time_s: Samples, altitude_m: Samples, climb_rate_m_s: Samples, downs_s: Iterable[float]) -> Rows:
    """Rows, shape (n,), of the last descent before each of these times of a touchdown, whichever mode flew it: from
    where it begins to the contact, and on the ground until that is reported."""
    landing, known = np.zeros(len(time_s), dtype=np.bool_), np.isfinite(altitude_m + climb_rate_m_s)
    if not known.any():
        return landing
    at_s, z_m = time_s[known], altitude_m[known]
    fallen_m = np.interp(at_s - _DESCENT_S, at_s, z_m) - z_m
    level_s = at_s[(climb_rate_m_s[known] >= -_DESCENT_M_S) & (fallen_m <= _DESCENT_M_S * _DESCENT_S)]
    for down_s in downs_s:
        before = z_m[at_s <= down_s]
        above = np.flatnonzero(before > before[-1:] + _NEAR_GROUND_M)
        if above.size and at_s[len(before) - 1] >= down_s - _UNSEEN_S:
            begin_s = level_s[level_s <= at_s[above[-1]]][-1:]
            landing |= (time_s >= (begin_s[0] if begin_s.size else -np.inf)) & (time_s <= down_s)
    return landing


def _find_parts(
    time_s: Samples, conditions: Sequence[Condition], begins: Rows, cuts_s: Sequence[float]
) -> tuple[list[Part], Reason]:
    """Parts of usable rows that last long enough, and why there is no more: the filter that leaves out most, with the
    seconds of all. A part also ends at a gap, before a row of `begins`, and at each of `cuts_s`.

    `time_s`, shape (n,), increases, and `cuts_s` does too. What leaves out a row is the first condition that it does
    not meet; a part that is too short, what ends it, or else what begins it.
    """
    codes = [each.code for each in conditions]
    codes += [ReasonCode.GAPS, ReasonCode.RESETS, ReasonCode.PARAMETER_CHANGES, ReasonCode.TOO_SHORT]
    gap, reset, change, too_short = range(len(conditions), len(codes))
    seconds = np.minimum(np.diff(time_s, append=time_s[-1:]), LONGEST_INTERVAL_S)
    passed = np.array([each.rows for each in conditions])
    cause = np.where(passed.all(axis=0), too_short, passed.argmin(axis=0))
    lost_s = np.bincount(cause, seconds, minlength=len(codes))
    lost_s[too_short] = 0.0
    rows = np.flatnonzero(cause == too_short)
    cut = np.searchsorted(cuts_s, time_s[rows], side="right")
    ends = (np.diff(rows) > 1, np.diff(time_s[rows]) > LONGEST_INTERVAL_S, begins[rows[1:]], np.diff(cut) > 0)
    separators = np.select(ends, (cause[rows[:-1] + 1], gap, reset, change), default=too_short)
    separated = np.flatnonzero(separators != too_short)
    between = [0, *separators[separated].tolist(), 0]
    found = []
    for place, part in enumerate(np.split(rows, separated + 1) if rows.size else ()):
        if time_s[part[-1]] - time_s[part[0]] >= SHORTEST_PART_S:
            found.append((int(part[0]), int(part[-1]) + 1))
        else:
            lost_s[between[place + 1] or between[place] or too_short] += seconds[part].sum()
    held = np.all([each.rows for each in conditions if each.code in _HELD], axis=0)
    left_out_s: dict[str, float] = {}
    for code, each_s in zip(codes[1:], lost_s[1:].tolist(), strict=True):
        if each_s:
            left_out_s[f"{LEFT_OUT}{code.key}_s"] = left_out_s.get(f"{LEFT_OUT}{code.key}_s", 0.0) + each_s
    flown_s = float(seconds[cause > 0].sum())
    most = int(np.argmax(lost_s[1:])) + 1 if flown_s else 0
    why = Reason(
        code=codes[most],
        field=conditions[most].field if most < len(conditions) else "file",
        numbers={"flown_s": flown_s, "held_s": float(seconds[held].sum()), **left_out_s, "needed_s": SHORTEST_PART_S},
    )
    return found, why


def _richest(time_s: Samples, sums: Samples, part: Part, lasts_s: float) -> Part:
    """The stretch of a part of at most `lasts_s` in which `sums`, shape (n + 1,), grow the most; the part itself if it
    is not longer."""
    first, end = part
    ends = np.searchsorted(time_s[first:end], time_s[first:end] + lasts_s, side="right") + first
    best = first + int(np.argmax(sums[ends] - sums[first:end]))
    return best, int(ends[best - first])


def choose_parts(
    time_s: Samples,
    conditions: Sequence[Condition],
    begins: Rows,
    history: ParameterHistory,
    acceleration_m_s2: Samples,
    refused: Refused,
    bounds: Mapping[str, tuple[float, float]],
    absent: Callable[[str], Reason],
) -> tuple[Parameters, list[Part]]:
    """The parts to analyse, under the parameters of the one with most manoeuvres, and these parameters: as many as fit
    into the longest flight, in order, those with most manoeuvres first; a longer one is shortened.

    Signals have shape (n,). `acceleration_m_s2` is that of the reference: how much it manoeuvres is its square, summed
    over time, which is what a fit learns from. The first of the conditions tells the flight from the ground.

    Raises what `refused` makes of the condition that leaves out most, if no part is long enough; and of a gain in
    `bounds` that is missing, by the reason that `absent` gives, or not positive where the search has no zero.
    """
    parts, why = _find_parts(time_s, conditions, begins, history.times_s)
    if not parts:
        raise refused(why)
    squares = np.nan_to_num(acceleration_m_s2) ** 2
    sums = np.append(0.0, np.cumsum(squares * np.diff(time_s, prepend=time_s[0])))
    parts.sort(key=lambda part: float(sums[part[1]] - sums[part[0]]), reverse=True)
    given = history.at(float(time_s[parts[0][0]]))
    for each, (least, _) in bounds.items():
        if each not in given:
            raise refused(absent(each))
        if given[each] < 0.0 or (least and not given[each]):
            raise refused(Reason(code=ReasonCode.PARAMETER_NOT_POSITIVE, field=each, numbers={"value": given[each]}))
    chosen, left_s = [], LONGEST_FLIGHT_S
    for part in (each for each in parts if history.at(float(time_s[each[0]])) == given):
        first, end = _richest(time_s, sums, part, left_s)
        duration_s = float(time_s[end - 1] - time_s[first])
        if duration_s >= SHORTEST_PART_S:
            chosen.append((first, end))
            left_s -= duration_s
    return given, sorted(chosen)


def thinned(time_s: Samples, part: Part) -> NDArray[np.int64]:
    """Rows of a part at about ten a second or fewer, as vehicles log them by default."""
    first, end = part
    if np.median(np.diff(time_s[first:end])) >= _ALREADY_THIN * _INTERVAL_S:
        return np.arange(first, end)
    tenths = np.floor((time_s[first:end] - time_s[first]) / _INTERVAL_S + 0.5)
    return first + np.flatnonzero(np.diff(tenths, prepend=-1.0) > 0.0)
