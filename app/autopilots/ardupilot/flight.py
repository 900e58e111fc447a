"""Reader of a whole flight's altitude control in ArduPilot's on-board log (.bin), in every mode that holds altitude."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from app.autopilots.recording import LONGEST_INTERVAL_S, ParameterHistory, Parameters, Rows, beside
from app.autopilots.segments import (
    LARGEST_LEAN,
    SHORTEST_PART_S,
    choose_parts,
    jumps,
    thinned,
    usable_rows,
)
from app.core.analysis.ardupilot_loop import SPACE, ArduPilotLoop
from app.core.analysis.flight import LoggedFlight
from app.core.analysis.segment import Segment
from app.core.control.ardupilot_parameters import (
    ACCELEROMETER_FILTER,
    ACCELEROMETER_FILTER_HZ,
    LOOP_NAMES,
    LOOP_RATE,
    LOOP_RATE_HZ,
    LOOP_RATES_HZ,
    in_newer_names,
    in_older_names,
    parameters_from,
)
from app.core.errors import Problem, TrajectoryError
from app.core.records.trajectory import Samples
from app.logs.base import Table, contents, numbers, rows_of
from app.logs.dataflash import parameters_in, read_tables

_WANTED: Final = frozenset({"PSCD", "PSCZ", "CTUN", "ATT", "MODE", "EV", "ERR", "PARM", "MSG"})
_LOOP: Final = ("PD", "VD", "AD", "DVD", "DAD", "TVD")
_REFERENCES: Final = ("DPD", "TPD")
"""The shaped altitude: releases before 4.6 log it as the target."""
_TUNING: Final = ("ThI", "ThO", "ThH")
_HOLDS_ALTITUDE: Final = frozenset({2, 3, 4, 5, 6, 7, 16, 17})
"""ALT_HOLD, AUTO, GUIDED, LOITER, RTL, CIRCLE, POSHOLD, BRAKE."""
_OTHER_FIRMWARE: Final = re.compile(rb"(ArduPlane|ArduRover|Rover|ArduSub|Blimp|AntennaTracker) V\d")
_NOT_LANDED, _LANDED = 28, 18
_VIBRATION_FAILSAFE: Final = 29
_AFTER_TAKEOFF_S: Final = 2.0
_BEFORE_LANDING_S: Final = 3.0
_JUMP_M: Final = 0.1
_JUMP_M_S: Final = 1.0
_LARGEST_ACCELERATION_M_S2: Final = 50.0
_RESTART_S: Final = 1.0
_LEARNED: Final = "MOT_THST_HOVER"
_THRUST_CURVE: Final = ("MOT_THST_EXPO", "MOT_SPIN_MIN", "MOT_SPIN_MAX", "MOT_BAT_VOLT_MIN", "MOT_BAT_VOLT_MAX")
_USED: Final = frozenset({*LOOP_NAMES, *_THRUST_CURVE} - {_LEARNED})


@dataclass(frozen=True, slots=True)
class _Logged:
    """Rows of the loop, up, shape (n,) each, with the throttle beside them; `time_s` increases."""

    time_s: Samples
    up: Mapping[str, Samples]
    throttle: Mapping[str, Samples]
    lean: Samples
    """Cosine of the lean."""

    @property
    def is_sound(self) -> Rows:
        """Rows of numbers that can be."""
        acceleration = np.abs(self.up["AD"]) <= _LARGEST_ACCELERATION_M_S2
        throttle = [(self.throttle[name] >= 0.0) & (self.throttle[name] <= 1.0) for name in _TUNING]
        known = np.isfinite(np.sum(list(self.up.values()), axis=0))
        return np.asarray(known & acceleration & np.all(throttle, axis=0))

    @property
    def is_reset(self) -> Rows:
        """Rows at which the reference began anew, or the estimator moved altitude or climb rate."""
        up = self.up
        begun_anew = (up["reference"] == up["PD"]) & (up["DVD"] == up["VD"])
        return np.asarray(
            begun_anew
            | jumps(self.time_s, up["PD"], up["VD"], _JUMP_M)
            | jumps(self.time_s, up["reference"], up["DVD"], _JUMP_M)
            | jumps(self.time_s, up["VD"], up["AD"], _JUMP_M_S)
        )

    def segment(self, rows: NDArray[np.int64]) -> Segment:
        """The rows as a segment. A leaning vehicle demands more throttle by the cosine of its lean, so the share of it
        that carries is given."""
        return Segment(
            time_s=self.time_s[rows],
            z_m=self.up["PD"][rows],
            v_m_s=self.up["VD"][rows],
            a_m_s2=self.up["AD"][rows],
            z_d_m=self.up["reference"][rows],
            v_d_m_s=self.up["DVD"][rows],
            a_d_m_s2=self.up["DAD"][rows],
            v_t_m_s=self.up["TVD"][rows],
            throttle=self.throttle["ThI"][rows],
            throttle_filtered=self.throttle["ThO"][rows] * self.lean[rows],
            assumed_hover=self.throttle["ThH"][rows],
        )


def read_ardupilot_flight(stream: BinaryIO, *, name: str) -> LoggedFlight:
    """Read the parts in flight under the same parameters, at most 120 s, those with the most manoeuvres first.

    Raises TrajectoryError naming the message or parameter that is missing, or InputError for one not supported.
    """
    tables = read_tables(contents(stream), _WANTED)
    if not any(map(len, tables.values())):
        raise _refused(name, "file", "has no data: copy the whole log")
    _require_copter(tables, name)
    logged = _logged(tables, name)
    history = _parameter_history(tables)
    time_s = logged.time_s
    conditions = (
        (logged.is_sound, "PSCD", "has no rows of numbers beside rows of CTUN"),
        (_in_flight(tables, time_s), "EV", "has no takeoff, or nothing between takeoff and landing"),
        (_holding_altitude(tables, time_s), "MODE", "has no mode that holds altitude in flight"),
        (~_compensating_vibration(tables, time_s), "ERR", "has vibration compensation active throughout the flight"),
        (logged.lean >= LARGEST_LEAN, "ATT", "leans by more than 30° throughout the flight"),
    )
    usable = usable_rows(conditions, partial(_refused, name))
    given, chosen = choose_parts(time_s, usable, logged.is_reset, history, logged.up["DAD"])
    if not chosen:
        raise _refused(
            name,
            "PSCD",
            f"has no {SHORTEST_PART_S:g} s flown in an altitude-holding mode without a gap of {LONGEST_INTERVAL_S:g} "
            "s, a jump in altitude or a parameter change",
        )
    hover = float(np.median(np.concatenate([logged.throttle["ThH"][slice(*part)] for part in chosen])))
    _require_gains(given, name)
    rate_hz = given.get(LOOP_RATE, LOOP_RATE_HZ)
    if not LOOP_RATES_HZ[0] <= rate_hz <= LOOP_RATES_HZ[1]:
        raise _refused(name, LOOP_RATE, f"must be {LOOP_RATES_HZ[0]:g} to {LOOP_RATES_HZ[1]:g} Hz, got {rate_hz:g}")
    return LoggedFlight(
        loop=ArduPilotLoop(
            parameters=parameters_from({**given, _LEARNED: hover}),
            filter_hz=given.get(ACCELEROMETER_FILTER, ACCELEROMETER_FILTER_HZ),
            step_s=1.0 / rate_hz,
            has_newer_names=_has_newer_names(tables),
        ),
        segments=[logged.segment(thinned(time_s, part)) for part in chosen],
    )


def _require_copter(tables: Mapping[str, Table], name: str) -> None:
    """Require that no message is the one in which another vehicle's firmware tells its version."""
    for message in tables.get("MSG", {}).get("Message", np.empty(0, "S64")).tolist():
        firmware = _OTHER_FIRMWARE.match(message) if isinstance(message, bytes) else None
        if firmware is not None:
            raise _refused(name, "MSG", f"is of {firmware[1].decode()}, not of ArduCopter")


def _logged(tables: Mapping[str, Table], name: str) -> _Logged:
    loop, tuning = tables.get("PSCD", {}), tables.get("CTUN", {})
    if "TimeUS" not in loop:
        older = "; the log has PSCZ of an older release, which is not supported" if tables.get("PSCZ") else ""
        raise _refused(name, "PSCD", f"is missing: add NTUN to LOG_BITMASK, and fly again{older}")
    reference = next((each for each in _REFERENCES if each in loop), None)
    absent = [each for each in _LOOP if each not in loop]
    if reference is None or absent:
        raise _refused(
            name, f"PSCD.{absent[0] if absent else _REFERENCES[0]}", "is missing: this release is not supported"
        )
    if not {"TimeUS", *_TUNING} <= tuning.keys():
        raise _refused(name, "CTUN", "is missing: add CTUN to LOG_BITMASK, and fly again")
    at_s = numbers(loop["TimeUS"]) / 1e6
    rows = _increasing(at_s)
    time_s = at_s[rows]
    attitude = tables.get("ATT", {})
    lean = np.ones(len(time_s))
    if {"TimeUS", "Roll", "Pitch"} <= attitude.keys():
        roll, pitch = (np.radians(_beside(attitude, each, time_s)) for each in ("Roll", "Pitch"))
        lean = np.nan_to_num(np.cos(roll) * np.cos(pitch), nan=1.0)
    return _Logged(
        time_s,
        {"reference": -numbers(loop[reference])[rows]} | {each: -numbers(loop[each])[rows] for each in _LOOP},
        {each: _beside(tuning, each, time_s) for each in _TUNING},
        lean,
    )


def _increasing(at_s: Samples) -> NDArray[np.int64]:
    """Rows, shape (k,), of the last time that the clock started, each later than all before it."""
    restarts = np.flatnonzero(np.diff(at_s) < -_RESTART_S)
    first = int(restarts[-1]) + 1 if restarts.size else 0
    latest = np.maximum.accumulate(np.nan_to_num(at_s[first:], nan=-np.inf))
    return first + np.flatnonzero(np.diff(latest, prepend=-np.inf) > 0.0)


def _beside(table: Table, column: str, time_s: Samples) -> Samples:
    """A column at other times, of the last time that the clock started."""
    at_s = numbers(table["TimeUS"]) / 1e6
    rows = _increasing(at_s)
    return beside(at_s[rows], numbers(table[column])[rows], time_s)


def _holding_altitude(tables: Mapping[str, Table], time_s: Samples) -> Rows:
    holding = np.zeros(len(time_s), dtype=np.bool_)
    changes = [*rows_of(tables.get("MODE", {}), "TimeUS", "ModeNum"), (np.inf, np.nan)]
    for (begin_s, mode), (end_s, _) in pairwise(changes):
        holding[(time_s >= begin_s) & (time_s < end_s)] = mode in _HOLDS_ALTITUDE
    return holding


def _in_flight(tables: Mapping[str, Table], time_s: Samples) -> Rows:
    """Rows between takeoff and landing, by the vehicle's own events."""
    flying = np.zeros(len(time_s), dtype=np.bool_)
    for at_s, event in rows_of(tables.get("EV", {}), "TimeUS", "Id"):
        if event == _NOT_LANDED:
            flying |= time_s >= at_s + _AFTER_TAKEOFF_S
        elif event == _LANDED:
            flying &= time_s < at_s - _BEFORE_LANDING_S
    return flying


def _compensating_vibration(tables: Mapping[str, Table], time_s: Samples) -> Rows:
    """Rows while the failsafe for vibration replaced the loop."""
    compensating = np.zeros(len(time_s), dtype=np.bool_)
    for at_s, subsystem, code in rows_of(tables.get("ERR", {}), "TimeUS", "Subsys", "ECode"):
        if subsystem == _VIBRATION_FAILSAFE:
            compensating[time_s >= at_s] = code != 0.0
    return compensating


def _parameter_history(tables: Mapping[str, Table]) -> ParameterHistory:
    """The parameters that the analysis uses, by their older names."""
    logged = ((time_s, *in_older_names(name, value)) for time_s, name, value in parameters_in(tables))
    return ParameterHistory.of(each for each in logged if each[1] in _USED)


def _has_newer_names(tables: Mapping[str, Table]) -> bool:
    newer = in_newer_names(dict.fromkeys(SPACE.bounds, 0.0)).keys()
    return any(name in newer for _, name, _ in parameters_in(tables))


def _require_gains(given: Parameters, name: str) -> None:
    for each in SPACE.bounds:
        if each not in given:
            (newer,) = in_newer_names({each: 0.0})
            raise _refused(name, each, f"is missing, and {newer} of release 4.7 too")
        if given[each] <= 0.0:
            raise _refused(name, each, f"must be positive, got {given[each]:g}")


def _refused(name: str, field: str, reason: str) -> TrajectoryError:
    return TrajectoryError(
        f"{name} cannot be analysed.",
        hint="Use ArduCopter's .bin log of a flight with altitude changes, with NTUN and CTUN in LOG_BITMASK.",
        problems=(Problem(field, reason),),
    )
