"""Reader of the vertical loop in PX4's log (.ulg): positions, set-points, hover thrust and the parameters."""

from collections.abc import Mapping, Sequence
from typing import BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from app.autopilots.px4.log import latest
from app.core.control.px4 import FLIGHT, HOVER_MAX, HOVER_MIN, RAMP_UP
from app.core.control.px4_log import LoopLog
from app.core.control.px4_parameters import FIRMWARE_NAMES, GAINS, UNSUPPORTED, Parameters, parameters_from
from app.core.errors import InputError, Problem
from app.core.records.trajectory import Samples
from app.logs.base import Table, numbers
from app.logs.ulog_tables import has_rows, read_ulog_tables, seconds

_POSITION, _TARGET, _SET_POINT = "vehicle_local_position", "vehicle_local_position_setpoint", "trajectory_setpoint"
_TAKEOFF, _HOVER = "takeoff_status", "hover_thrust_estimate"
_LANDED, _LIMITS = "vehicle_land_detected", "vehicle_constraints"
_NEEDED: Final[Mapping[str, Sequence[str]]] = {
    _POSITION: ("z", "vz"),
    _TARGET: ("z", "vz", "acceleration[2]", "thrust[2]"),
    _TAKEOFF: ("takeoff_state",),
}
_SAME_RUN_S: Final = 0.004
"""A target is published at most so long after the position that it was computed from, the next position later."""


def read_px4_log(stream: BinaryIO, *, name: str) -> LoopLog:
    """Read all runs of the loop from the ramp of a takeoff on, until a parameter of the loop changes.

    Raises TrajectoryError if it is not a ULog, and InputError that names the topic or parameter that is missing or not
    supported.
    """
    tables = read_ulog_tables(
        stream,
        topics={*_NEEDED, _SET_POINT, _HOVER, _LANDED, _LIMITS},
        parameters={*FIRMWARE_NAMES, *UNSUPPORTED},
    )
    topics = tables.topics
    for topic, columns in _NEEDED.items():
        if not has_rows(topics.get(topic, {}), *columns):
            raise _refused(name, topic, "is missing")
    position, target = topics[_POSITION], topics[_TARGET]
    position_s, time_s = seconds(position), seconds(target)
    kept = np.flatnonzero(np.diff(np.maximum.accumulate(position_s), prepend=-np.inf) > 0.0)
    position_s = position_s[kept]

    def column(topic: str, name: str) -> Samples:
        return latest(topics.get(topic, {}), name, time_s)

    takeoff = column(_TAKEOFF, "takeoff_state")
    place = np.searchsorted(position_s, time_s, side="right") - 1
    fresh = (place >= 0) & (time_s - position_s[place] <= _SAME_RUN_S)
    thrust = -numbers(target["thrust[2]"])
    rows = np.flatnonzero(fresh & (takeoff >= RAMP_UP) & np.isfinite(thrust))
    rows = rows[np.diff(place[rows], prepend=-1) > 0]
    if not rows.size:
        raise _refused(name, _TARGET, "has no row in flight beside a position")
    begin_s = float(time_s[rows[0]])
    rows = rows[time_s[rows] < _first_change_s(tables.settings, begin_s)]
    values = {each: value for at_s, each, value in tables.settings if at_s <= begin_s}
    for gain in GAINS:
        if gain not in values:
            raise _refused(name, gain, "is missing")
    parameters = parameters_from(values)
    set_z = numbers(target["z"])
    set_vz, set_az, known = _set_points(topics.get(_SET_POINT, {}), time_s, set_z)
    up, down = column(_LIMITS, "speed_up"), column(_LIMITS, "speed_down")
    z_m, vz_m_s = numbers(position["z"])[kept], numbers(position["vz"])[kept]
    return LoopLog(
        parameters=parameters,
        time_s=position_s,
        z_m=z_m,
        vz_m_s=vz_m_s,
        z_derivative_m_s=numbers(position["z_deriv"])[kept] if "z_deriv" in position else vz_m_s,
        place=place[rows],
        takeoff=takeoff[rows],
        ground_contact=column(_LANDED, "ground_contact")[rows] > 0.0,
        set_z_m=set_z[rows],
        set_vz_m_s=set_vz[rows],
        set_az_m_s2=set_az[rows],
        known=known[rows],
        limit_up_m_s=np.where(np.isfinite(up), up, parameters.climb_m_s)[rows],
        limit_down_m_s=np.where(np.isfinite(down), down, parameters.descent_m_s)[rows],
        hover=_hover(topics.get(_HOVER, {}), time_s, takeoff, parameters)[rows],
        out_vz_m_s=numbers(target["vz"])[rows],
        out_az_m_s2=numbers(target["acceleration[2]"])[rows],
        out_thrust=thrust[rows],
    )


def _first_change_s(settings: Sequence[tuple[float, str, float]], begin_s: float) -> float:
    """When a parameter first has another value than at the beginning; infinite if none has."""
    values: dict[str, float] = {}
    for at_s, name, value in settings:
        if at_s > begin_s and values.get(name) != value:
            return at_s
        values[name] = value
    return np.inf


def _set_points(table: Table, time_s: Samples, set_z: Samples) -> tuple[Samples, Samples, NDArray[np.bool_]]:
    """Set-points of velocity and acceleration in force at each time, shape (n,) each, and whether they are known.

    They are if the last message has the altitude in force, and is of the same time or followed by an equal one: most
    are not logged.
    """
    names = ("position[2]", "velocity[2]", "acceleration[2]")
    if not has_rows(table, *names):
        unknown = np.full(len(time_s), np.nan)
        return unknown, unknown, np.zeros(len(time_s), dtype=np.bool_)
    at_s = seconds(table)
    z, vz, az = (numbers(table[name]) for name in names)
    last = np.maximum(np.searchsorted(at_s, time_s, side="right") - 1, 0)
    following = np.minimum(last + 1, len(at_s) - 1)
    repeated = (following > last) & _equal(vz[following], vz[last]) & _equal(az[following], az[last])
    known = _equal(z[last], set_z) & (at_s[last] <= time_s) & ((at_s[last] == time_s) | repeated)
    return vz[last], az[last], known


def _equal(one: Samples, other: Samples) -> NDArray[np.bool_]:
    equal: NDArray[np.bool_] = (one == other) | (np.isnan(one) & np.isnan(other))
    return equal


def _hover(table: Table, time_s: Samples, takeoff: Samples, parameters: Parameters) -> Samples:
    """Hover thrust in force at each time, shape (n,); NaN where it is not known.

    In flight it is between two valid estimates that were logged around it, or before the first valid one the parameter.
    """
    on_ground = np.where(takeoff < FLIGHT, parameters.hover_thrust, np.nan)
    if not has_rows(table, "hover_thrust", "valid"):
        return on_ground
    at_s, valid = seconds(table), numbers(table["valid"]) > 0.0
    estimates = np.clip(numbers(table["hover_thrust"]), HOVER_MIN, HOVER_MAX)
    last = np.searchsorted(at_s, time_s, side="right") - 1
    following = np.minimum(last + 1, len(at_s) - 1)
    around = (last >= 0) & (following > last) & valid[last] & valid[following]
    none_yet = ~np.logical_or.accumulate(valid)[following]
    in_flight = np.where(none_yet, parameters.hover_thrust, np.nan)
    in_flight[around] = np.interp(time_s[around], at_s, estimates)
    return np.where(takeoff < FLIGHT, on_ground, in_flight)


def _refused(name: str, field: str, reason: str) -> InputError:
    return InputError(
        f"{name} cannot be compared with the replica.",
        hint="Give PX4's .ulg log of a flight with position control, recorded with bits 0 and 1 of SDLOG_PROFILE: with "
        "bit 1 (estimator replay) every position is logged.",
        problems=(Problem(field, reason),),
    )
