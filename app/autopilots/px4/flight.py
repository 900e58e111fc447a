"""Reader of a whole flight's altitude control in PX4's log (.ulg), in every mode that follows an altitude.

Rows are the set-points that position control publishes, ten a second by default, with the estimates of the same time.
The accelerations between two rows are the change of the estimated climb rate: single estimates of the acceleration are
noisy, and most are not logged.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from app.autopilots.px4.log import latest
from app.autopilots.segments import (
    LARGEST_LEAN,
    LONGEST_INTERVAL_S,
    SHORTEST_PART_S,
    ParameterHistory,
    Parameters,
    Rows,
    choose_parts,
    increasing,
    jumps,
    thinned,
    usable_rows,
)
from app.core.analysis.flight import LoggedFlight
from app.core.analysis.px4_loop import SPACE, Px4Loop
from app.core.analysis.segment import FinerSegment, Segment
from app.core.control.px4 import FLIGHT, GRAVITY
from app.core.control.px4_parameters import (
    LOOP_NAMES,
    estimator_step_s,
    hover_deviation,
    parameters_from,
)
from app.core.errors import Problem, TrajectoryError
from app.core.records.trajectory import Samples
from app.logs.base import Table, numbers
from app.logs.ulog_tables import ULogTables, has_rows, read_ulog_tables, seconds

_POSITION, _TARGET, _SET_POINT = "vehicle_local_position", "vehicle_local_position_setpoint", "trajectory_setpoint"
_TAKEOFF, _STATUS = "takeoff_status", "vehicle_status"
_LANDED, _LIMITS = "vehicle_land_detected", "vehicle_constraints"
_THRUST: Final = "vehicle_thrust_setpoint"
"""That of the body, logged more often than the set-points."""
_NEEDED: Final[Mapping[str, Sequence[str]]] = {
    _POSITION: ("z", "vz"),
    _TARGET: ("z", "vz", "acceleration[2]", "thrust[2]"),
    _SET_POINT: ("velocity[2]", "acceleration[2]"),
    _TAKEOFF: ("takeoff_state",),
    _STATUS: ("nav_state",),
}
_KIND: Final = "vehicle_type"
_OTHER_KINDS: Final = 2
"""The first kind of vehicle that does not fly on rotors; a VTOL changes from one to the other."""
_LEFT_OUT: Final = (12.0, 17.0, 18.0, 20.0)
"""Modes: descend, takeoff, land, precision landing."""
_JUMP_M: Final = 0.5
_JUMP_M_S: Final = 2.0
_EVERY_POSITION_S: Final = 0.0125
"""Rows of the position that are not further apart than this are all that there were."""
_SET_POINT_LASTS_S: Final = 1.0
_NEAR_LIMIT: Final = 1e-3
_LEAST_SHARE: Final = 0.2
"""Of hover thrust: below it, the assumed hover thrust cannot be told from thrust and acceleration."""
_VEHICLE: Final = "MAV_SYS_ID"
_USED: Final = frozenset({*LOOP_NAMES, _VEHICLE})


@dataclass(frozen=True, slots=True)
class _Logged:
    """Rows of position control, up, shape (n,) each; `time_s` increases. `resets` counts those of the estimator.
    The thrust is also known at `finer_s`, shape (k,), k ≥ 0, if it was logged more often."""

    time_s: Samples
    up: Mapping[str, Samples]
    acceleration_target: Samples
    thrust: Samples
    lean: Samples
    state: Mapping[str, Samples]
    resets: Samples
    finer_s: Samples
    finer_thrust: Samples

    @property
    def is_sound(self) -> Rows:
        """Rows of numbers that can be."""
        known = np.isfinite(self.up["z"] + self.up["v"] + self.up["v_t"] + self.acceleration_target + self.thrust)
        return np.asarray(known & (self.thrust >= 0.0) & (self.thrust <= 1.0))

    @property
    def is_flying(self) -> Rows:
        """Rows after the ramp of a takeoff, without contact to the ground."""
        landed, contact = (np.nan_to_num(self.state[name]) > 0.0 for name in ("landed", "ground_contact"))
        return np.asarray((self.state["takeoff_state"] == FLIGHT) & ~landed & ~contact)

    @property
    def is_reset(self) -> Rows:
        """Rows at which the estimator moved altitude or climb rate."""
        up = self.up
        return np.asarray(
            (np.diff(self.resets, prepend=self.resets[0]) != 0.0)
            | jumps(self.time_s, up["z"], up["v"], _JUMP_M)
            | (np.abs(np.diff(up["v"], prepend=up["v"][0])) > _JUMP_M_S)
        )

    def hover(self, limits: tuple[float, float]) -> Samples:
        """Hover thrust that the loop assumed, shape (n,): thrust over that share of hover thrust which the acceleration
        target asks for, from rows between the limits of the thrust."""
        share = 1.0 + self.acceleration_target / float(GRAVITY)
        free = (self.thrust > limits[0] + _NEAR_LIMIT) & (self.thrust < limits[1] - _NEAR_LIMIT)
        known = np.flatnonzero(self.is_sound & free & (share > _LEAST_SHARE))
        if not known.size:
            return np.full(len(self.time_s), np.nan)
        return np.interp(self.time_s, self.time_s[known], self.thrust[known] / share[known])

    def segment(self, rows: NDArray[np.int64], hover: Samples) -> Segment:
        """The rows as a segment, with the hover thrust of every logged row."""
        time_s, v_m_s = self.time_s[rows], self.up["v"][rows]
        changes = np.diff(v_m_s) / np.diff(time_s)
        finer_s, finer_thrust = self._finer(rows)
        return FinerSegment(
            motor_time_s=finer_s,
            motor_values=finer_thrust,
            time_s=time_s,
            z_m=self.up["z"][rows],
            v_m_s=v_m_s,
            a_m_s2=np.append(changes[0], changes),
            z_d_m=self.up["z_d"][rows],
            v_d_m_s=self.up["v_d"][rows],
            a_d_m_s2=self.up["a_d"][rows],
            v_t_m_s=self.up["v_t"][rows],
            throttle=self.thrust[rows],
            throttle_filtered=self.thrust[rows],
            assumed_hover=hover[rows],
        )

    def _finer(self, rows: NDArray[np.int64]) -> tuple[Samples, Samples]:
        """Thrust of the rows and between them, and its times, shape (k,) each."""
        time_s, thrust = self.time_s[rows], self.thrust[rows]
        between = (self.finer_s > time_s[0]) & (self.finer_s < time_s[-1]) & np.isfinite(self.finer_thrust)
        at_s, first = np.unique(np.append(time_s, self.finer_s[between]), return_index=True)
        return at_s, np.append(thrust, self.finer_thrust[between])[first]


def read_px4_flight(stream: BinaryIO, *, name: str) -> LoggedFlight:
    """Read the parts in flight under the same parameters, at most 120 s, those with the most manoeuvres first.

    Raises TrajectoryError naming the topic or parameter that is missing, or InputError for one not supported.
    """
    tables = read_ulog_tables(stream, topics={*_NEEDED, _LANDED, _LIMITS, _THRUST}, parameters=_USED)
    if not any(map(has_rows, tables.topics.values())):
        raise _refused(tables, name, "file", "has no data: copy the whole log")
    _require_rotors(tables, name)
    _require_topics(tables, name)
    logged = _logged(tables.topics)
    conditions = (
        (logged.is_sound, _TARGET, "has no rows of numbers beside positions"),
        (logged.is_flying, _TAKEOFF, "never reports a flight: the log has no takeoff whose ramp was finished"),
        (~(logged.state[_KIND] >= _OTHER_KINDS), f"{_STATUS}.{_KIND}", "is never that of a copter in flight"),
        (
            ~np.isin(logged.state["nav_state"], _LEFT_OUT),
            _STATUS,
            "has no mode in flight but takeoffs and landings, in which the ramp and the ground decide",
        ),
        (
            np.isfinite(logged.up["z_d"] + logged.up["v_d"] + logged.up["a_d"]),
            f"{_TARGET}.z",
            "has no altitude to follow in flight, as in manual modes: fly in Hold, Mission or Offboard",
        ),
        (logged.lean >= LARGEST_LEAN, f"{_TARGET}.thrust", "leans by more than 30° throughout the flight"),
    )
    usable = usable_rows(conditions, partial(_refused, tables, name))
    history = ParameterHistory.of(tables.settings)
    given, chosen = choose_parts(logged.time_s, usable, logged.is_reset, history, _manoeuvres(logged))
    if not chosen:
        raise _refused(
            tables,
            name,
            _TARGET,
            f"has no {SHORTEST_PART_S:g} s with an altitude to follow between takeoff and landing, without a gap of "
            f"{LONGEST_INTERVAL_S:g} s, a reset of the estimator or a parameter change",
        )
    _require_gains(tables, given, name)
    parameters = parameters_from(given)
    rows = [thinned(logged.time_s, part) for part in chosen]
    down = np.concatenate([logged.state["speed_down"][each] for each in rows])
    step_s = _step_s(tables.topics[_POSITION], given)
    hover = logged.hover((parameters.thrust_min, parameters.thrust_max))
    return LoggedFlight(
        loop=Px4Loop(
            parameters=parameters,
            step_s=step_s,
            row_s=float(np.median(np.concatenate([np.diff(logged.time_s[each]) for each in rows]))),
            descent_m_s=float(np.median(down)) if np.isfinite(down).all() else parameters.descent_m_s,
            hover_deviation=hover_deviation(given),
            vehicle=int(given.get(_VEHICLE, 1.0)),
        ),
        segments=[logged.segment(each, hover) for each in rows],
    )


def _manoeuvres(logged: _Logged) -> Samples:
    """Acceleration that the reference alone asks for, shape (n,): steps of the altitude count too."""
    target, time_s = logged.up["v_d"] + logged.up["z_d"], logged.time_s
    return np.diff(target, prepend=target[0]) / np.diff(time_s, prepend=time_s[0] - 1.0) + logged.up["a_d"]


def _step_s(position: Table, given: Parameters) -> float:
    """Interval of the estimates, s: as logged, or where not all were, as the estimator's parameters say, in whole
    intervals of the IMU."""
    logged_s = float(np.median(np.diff(seconds(position))))
    if 0.0 < logged_s <= _EVERY_POSITION_S:
        return logged_s
    return estimator_step_s(given)


def _logged(topics: Mapping[str, Table]) -> _Logged:
    target, position = topics[_TARGET], topics[_POSITION]
    kept = increasing(seconds(target))
    time_s, thrust = seconds(target)[kept], -numbers(target["thrust[2]"])[kept]
    known = increasing(seconds(position))
    position_s = seconds(position)[known]

    def estimate(name: str) -> Samples:
        return np.interp(time_s, position_s, numbers(position[name])[known], left=np.nan, right=np.nan)

    def state(topic: str, name: str) -> Samples:
        return latest(topics.get(topic, {}), name, time_s)

    v_d, a_d = _feed_forward(topics[_SET_POINT], time_s)
    finer_s, finer_thrust = _finer_thrust(topics.get(_THRUST, {}))
    up = {"z": -estimate("z"), "v": -estimate("vz"), "v_d": v_d, "a_d": a_d}
    up |= {"z_d": -numbers(target["z"])[kept], "v_t": -numbers(target["vz"])[kept]}
    horizontal = [numbers(target[each])[kept] for each in ("thrust[0]", "thrust[1]") if each in target]
    with np.errstate(invalid="ignore", divide="ignore"):
        lean = thrust / np.sqrt(thrust**2 + np.sum(np.square(horizontal), axis=0))
    lean = np.nan_to_num(lean, nan=1.0)
    return _Logged(
        time_s=time_s,
        finer_s=finer_s,
        finer_thrust=finer_thrust * np.interp(finer_s, time_s, lean),
        up=up,
        acceleration_target=-numbers(target["acceleration[2]"])[kept],
        thrust=thrust,
        lean=lean,
        state={
            "takeoff_state": state(_TAKEOFF, "takeoff_state"),
            "nav_state": state(_STATUS, "nav_state"),
            _KIND: state(_STATUS, _KIND),
            "landed": state(_LANDED, "landed"),
            "ground_contact": state(_LANDED, "ground_contact"),
            "speed_down": state(_LIMITS, "speed_down"),
        },
        resets=np.sum(
            [np.nan_to_num(state(_POSITION, each)) for each in ("z_reset_counter", "vz_reset_counter")], axis=0
        ),
    )


def _feed_forward(table: Table, time_s: Samples) -> tuple[Samples, Samples]:
    """Climb rate and acceleration that the set-points give beside the altitude, up, shape (n,) each: 0 where they give
    none, NaN where no set-point is near."""
    from scipy.interpolate import CubicHermiteSpline

    kept = increasing(seconds(table))
    at_s = seconds(table)[kept]
    v, a = (-numbers(table[name])[kept] for name in ("velocity[2]", "acceleration[2]"))
    rates = np.where(np.isfinite(v) & np.isfinite(a), a, 0.0)
    if len(at_s) < 2:
        return np.full(len(time_s), np.nan), np.full(len(time_s), np.nan)
    v_d = CubicHermiteSpline(at_s, np.nan_to_num(v), rates)(np.clip(time_s, at_s[0], at_s[-1]))
    a_d = np.interp(time_s, at_s, np.nan_to_num(a))
    after = np.clip(np.searchsorted(at_s, time_s), 1, len(at_s) - 1)
    near = (time_s >= at_s[0]) & (time_s - at_s[after - 1] <= _SET_POINT_LASTS_S)
    return np.where(near, v_d, np.nan), np.where(near, a_d, np.nan)


def _finer_thrust(table: Table) -> tuple[Samples, Samples]:
    """Thrust of the body and its times, shape (k,) each; none if it was not logged."""
    if not has_rows(table, "xyz[2]"):
        return np.empty(0), np.empty(0)
    kept = increasing(seconds(table))
    return seconds(table)[kept], -numbers(table["xyz[2]"])[kept]


def _require_rotors(tables: ULogTables, name: str) -> None:
    """Require that the vehicle flew on rotors at some time, if the log tells."""
    kinds = tables.topics.get(_STATUS, {}).get(_KIND, np.zeros(1))
    if len(kinds) and np.all(numbers(kinds) >= _OTHER_KINDS):
        raise _refused(tables, name, f"{_STATUS}.{_KIND}", "is never that of a copter: fixed wing, or on the ground")


def _require_topics(tables: ULogTables, name: str) -> None:
    for topic, columns in _NEEDED.items():
        table = tables.topics.get(topic, {})
        if not has_rows(table):
            raise _refused(tables, name, topic, "is missing: set bit 0 of SDLOG_PROFILE, its default, and fly again")
        for column in columns:
            if column not in table:
                raise _refused(tables, name, f"{topic}.{column}", "is missing: this release is not supported")


def _require_gains(tables: ULogTables, given: Parameters, name: str) -> None:
    for each, (least, _) in SPACE.bounds.items():
        if each not in given:
            raise _refused(tables, name, each, "is missing")
        if given[each] < 0.0 or (least and not given[each]):
            raise _refused(tables, name, each, f"must be positive, got {given[each]:g}")


def _refused(tables: ULogTables, name: str, field: str, reason: str) -> TrajectoryError:
    return TrajectoryError(
        f"{name} cannot be analysed.",
        hint="Use PX4's .ulg log of a flight with altitude changes in Hold, Mission or Offboard mode, with bit 0 of "
        "SDLOG_PROFILE set, its default. Takeoffs are left out: their ramp decides, not the gains.",
        problems=(Problem(field, "; ".join((reason, *tables.notes))),),
    )
