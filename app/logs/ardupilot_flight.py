"""Reader of a whole flight's altitude control in ArduPilot's on-board log (.bin), in every mode that holds altitude."""

from collections.abc import Mapping
from itertools import pairwise
from typing import BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from app.core.analysis.flight import LoggedFlight, Segment
from app.core.control.ardupilot_parameters import FIRMWARE_NAMES, UNSUPPORTED, in_older_names, parameters_from
from app.core.errors import Problem, TrajectoryError
from app.core.records.trajectory import Samples
from app.logs.base import Table, contents, numbers, rows_of
from app.logs.dataflash import is_dataflash, read_tables
from app.logs.readers import HEAD_BYTES, READERS

_WANTED: Final = frozenset({"PSCD", "CTUN", "MODE", "EV", "PARM"})
_LOOP: Final = ("PD", "VD", "AD", "DPD", "DVD", "DAD", "TVD")
_TUNING: Final = ("ThI", "ThO", "ThH")
_HOLDS_ALTITUDE: Final = frozenset({2, 3, 4, 5, 6, 7, 16, 17})
"""ALT_HOLD, AUTO, GUIDED, LOITER, RTL, CIRCLE, POSHOLD, BRAKE."""
_NOT_LANDED, _MAYBE_LANDED, _LANDED = 28, 17, 18
_AFTER_TAKEOFF_S: Final = 2.0
_BEFORE_LANDING_S: Final = 3.0
_LONGEST_INTERVAL_S: Final = 0.25
_SHORTEST_SEGMENT_S: Final = 4.0
_LONGEST_FLIGHT_S: Final = 120.0
_RATE_HZ: Final = 400.0
_RATES_HZ: Final = (50.0, 2000.0)
_FILTER_HZ: Final = 20.0
_FILTERS_HZ: Final = (2.0, 100.0)
_LEARNED: Final = "MOT_THST_HOVER"
_NEWER_NAME: Final = "PSC_D_POS_P"


def read_ardupilot_flight(stream: BinaryIO, *, name: str) -> LoggedFlight:
    """Read the parts in flight under the same parameters, at most 120 s, those with the most altitude change first.

    Raises TrajectoryError naming the message or parameter that is missing, or InputError for one not supported.
    """
    _require_dataflash(stream, name)
    tables = read_tables(contents(stream), _WANTED)
    loop, tuning = tables.get("PSCD", {}), tables.get("CTUN", {})
    if not {"TimeUS", *_LOOP} <= loop.keys():
        raise _refused(name, "PSCD", "is missing: add NTUN to LOG_BITMASK, and fly again")
    if not {"TimeUS", *_TUNING} <= tuning.keys():
        raise _refused(name, "CTUN", "is missing: add CTUN to LOG_BITMASK, and fly again")
    time_s = numbers(loop["TimeUS"]) / 1e6
    up = {each: -numbers(loop[each]) for each in _LOOP}
    throttle = {each: _at(tuning, each, time_s) for each in _TUNING}
    sound = np.isfinite(np.sum([*up.values(), *throttle.values()], axis=0)) & (np.diff(time_s, prepend=-np.inf) > 0.0)
    begun_anew = (up["DPD"] == up["PD"]) & (up["DVD"] == up["VD"])
    changes = _parameter_changes(tables)
    usable = sound & ~begun_anew & _in_flight(tables, time_s) & _holding_altitude(tables, time_s)
    parts = _uninterrupted(time_s, usable, [at_s for at_s, _ in changes])
    if not parts:
        raise _refused(name, "PSCD", f"has no {_SHORTEST_SEGMENT_S:g} s in flight in a mode that holds altitude")
    values = {part: _values_at(changes, float(time_s[part[0]])) for part in parts}
    most = max(parts, key=lambda part: float(np.ptp(up["DPD"][part[0] : part[1]])))
    alike = [part for part in parts if values[part] == values[most]]
    chosen = sorted(_most_change(alike, up["DPD"], time_s))
    given = values[most]
    if "PSC_POSZ_P" not in given:
        raise _refused(name, "PSC_POSZ_P", f"is missing, and {_NEWER_NAME} of release 4.7 too")
    hover = float(np.median(np.concatenate([throttle["ThH"][slice(*part)] for part in chosen])))
    rate_hz, filter_hz = given.get("SCHED_LOOP_RATE", _RATE_HZ), given.get("INS_ACCEL_FILTER", _FILTER_HZ)
    return LoggedFlight(
        parameters=parameters_from({**given, _LEARNED: hover}),
        filter_hz=filter_hz if _FILTERS_HZ[0] <= filter_hz <= _FILTERS_HZ[1] else _FILTER_HZ,
        has_newer_names=_has_newer_names(tables),
        step_s=1.0 / (rate_hz if _RATES_HZ[0] <= rate_hz <= _RATES_HZ[1] else _RATE_HZ),
        segments=[_segment(time_s, up, throttle, slice(*part)) for part in chosen],
    )


def _segment(time_s: Samples, up: Mapping[str, Samples], throttle: Mapping[str, Samples], rows: slice) -> Segment:
    return Segment(
        time_s=time_s[rows],
        z_m=up["PD"][rows],
        v_m_s=up["VD"][rows],
        a_m_s2=up["AD"][rows],
        z_d_m=up["DPD"][rows],
        v_d_m_s=up["DVD"][rows],
        a_d_m_s2=up["DAD"][rows],
        v_t_m_s=up["TVD"][rows],
        throttle=throttle["ThI"][rows],
        throttle_filtered=throttle["ThO"][rows],
    )


def _at(table: Table, column: str, time_s: Samples) -> Samples:
    """A column at other times, linear between its rows; NaN outside them."""
    at_s = numbers(table["TimeUS"]) / 1e6
    order = np.argsort(at_s, kind="stable")
    return np.interp(time_s, at_s[order], numbers(table[column])[order], left=np.nan, right=np.nan)


def _holding_altitude(tables: Mapping[str, Table], time_s: Samples) -> NDArray[np.bool_]:
    holding = np.zeros(len(time_s), dtype=np.bool_)
    changes = [*rows_of(tables.get("MODE", {}), "TimeUS", "ModeNum"), (np.inf, np.nan)]
    for (begin_s, mode), (end_s, _) in pairwise(changes):
        holding[(time_s >= begin_s) & (time_s < end_s)] = mode in _HOLDS_ALTITUDE
    return holding


def _in_flight(tables: Mapping[str, Table], time_s: Samples) -> NDArray[np.bool_]:
    """Rows between takeoff and landing, by the vehicle's own events; all rows after the first takeoff without one."""
    flying = np.zeros(len(time_s), dtype=np.bool_)
    for at_s, event in rows_of(tables.get("EV", {}), "TimeUS", "Id"):
        if event == _NOT_LANDED:
            flying |= time_s >= at_s + _AFTER_TAKEOFF_S
        elif event in {_MAYBE_LANDED, _LANDED}:
            flying &= time_s < at_s - _BEFORE_LANDING_S
    return flying


def _uninterrupted(time_s: Samples, usable: NDArray[np.bool_], cuts_s: list[float]) -> list[tuple[int, int]]:
    """First row and row after the last of each part without a gap or a cut that is long enough."""
    rows = np.flatnonzero(usable)
    if not rows.size:
        return []
    apart = (np.diff(rows) > 1) | (np.diff(time_s[rows]) > _LONGEST_INTERVAL_S)
    apart |= np.diff(np.searchsorted(cuts_s, time_s[rows], side="right")) > 0
    ends = [*np.flatnonzero(apart).tolist(), len(rows) - 1]
    begins = [0, *(end + 1 for end in ends[:-1])]
    parts = [(int(rows[begin]), int(rows[end]) + 1) for begin, end in zip(begins, ends, strict=True)]
    return [(begin, end) for begin, end in parts if time_s[end - 1] - time_s[begin] >= _SHORTEST_SEGMENT_S]


def _most_change(parts: list[tuple[int, int]], reference_m: Samples, time_s: Samples) -> list[tuple[int, int]]:
    """As many parts as fit into the longest flight, those with the largest altitude change first; a longer one is
    cut."""
    chosen: list[tuple[int, int]] = []
    left_s = _LONGEST_FLIGHT_S
    for begin, end in sorted(parts, key=lambda part: -float(np.ptp(reference_m[part[0] : part[1]]))):
        within = begin + int(np.searchsorted(time_s[begin:end], time_s[begin] + left_s, side="right"))
        if time_s[within - 1] - time_s[begin] >= _SHORTEST_SEGMENT_S:
            chosen.append((begin, within))
            left_s -= float(time_s[within - 1] - time_s[begin])
    return chosen


def _parameter_changes(tables: Mapping[str, Table]) -> list[tuple[float, Mapping[str, float]]]:
    """Times at which parameters of the loop took new values, s, with all values from then on."""
    table = tables.get("PARM", {})
    if not {"TimeUS", "Name", "Value"} <= table.keys():
        return []
    wanted = {*FIRMWARE_NAMES, *UNSUPPORTED, "SCHED_LOOP_RATE", "INS_ACCEL_FILTER"} - {_LEARNED}
    values: dict[str, float] = {}
    changes: list[tuple[float, Mapping[str, float]]] = []
    at_s = (numbers(table["TimeUS"]) / 1e6).tolist()
    for time_s, raw, logged in zip(at_s, table["Name"], numbers(table["Value"]).tolist(), strict=True):
        name, value = in_older_names(bytes(raw).partition(b"\0")[0].decode("ascii", "replace"), logged)
        if name in wanted and np.isfinite(value) and values.get(name) != value:
            values = {**values, name: value}
            changes.append((time_s, values))
    return changes


def _has_newer_names(tables: Mapping[str, Table]) -> bool:
    return any(bytes(raw).partition(b"\0")[0] == _NEWER_NAME.encode() for raw in tables.get("PARM", {}).get("Name", ()))


def _values_at(changes: list[tuple[float, Mapping[str, float]]], time_s: float) -> Mapping[str, float]:
    return next((values for at_s, values in reversed(changes) if at_s <= time_s), {})


def _require_dataflash(stream: BinaryIO, name: str) -> None:
    stream.seek(0)
    head = stream.read(HEAD_BYTES)
    if not is_dataflash(head):
        kind = next((f" ({reader.title})" for reader in READERS if reader.recognises(head)), "")
        other = f"is another kind of log{kind}" if kind else "is not a log" if head else "is empty"
        raise _refused(name, "file", f"{other}: only ArduPilot's .bin logs can be analysed")


def _refused(name: str, field: str, reason: str) -> TrajectoryError:
    return TrajectoryError(
        f"{name} cannot be analysed.",
        hint="Use ArduCopter's .bin log of a flight with altitude changes, with NTUN and CTUN in LOG_BITMASK.",
        problems=(Problem(field, reason),),
    )
