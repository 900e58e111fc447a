"""The vertical loop in PX4's log (.ulg), to be compared with the replica: positions, set-points and hover thrust."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.autopilots.px4.log import SOURCES, TARGET
from app.autopilots.px4.replica.parameters import DEFAULTS, UNSUPPORTED, Parameters, parameters_from
from app.autopilots.px4.replica.replay import LoopLog
from app.autopilots.px4.replica.vertical import FLIGHT, HOVER_MAX, HOVER_MIN, RAMP_UP
from app.autopilots.recording import Recording, refusal
from app.core.errors import InputError
from app.core.records.trajectory import Samples

_NEEDED: Final = (
    "altitude_m", "climb_rate_m_s", "reference_m", "climb_rate_target_m_s", "acceleration_target_m_s2", "thrust_target",
    "takeoff_state",
)  # fmt: skip
_HINT: Final = (
    "Give PX4's .ulg log of a flight with position control, recorded with bits 0 and 1 of SDLOG_PROFILE: with "
    "bit 1 (estimator replay) every position is logged."
)
_SAME_RUN_S: Final = 0.004
"""A target is published at most so long after the position that it was computed from, the next position later."""


def px4_loop_log(recording: Recording, *, name: str) -> LoopLog:
    """All runs of the loop from the ramp of a takeoff on, until a parameter of the loop changes.

    Raises InputError that names the topic or parameter that is missing or not supported.
    """
    refused = refusal(f"{name} cannot be compared with the replica.", _HINT, error=InputError)
    columns = recording.columns
    for each in _NEEDED:
        if each not in columns:
            raise refused(SOURCES[each].message, "is missing")
    position_s, time_s = columns["altitude_m"].time_s, columns["thrust_target"].time_s
    takeoff = recording.at("takeoff_state", time_s)
    place = np.searchsorted(position_s, time_s, side="right") - 1
    fresh = (place >= 0) & (time_s - position_s[place] <= _SAME_RUN_S)
    thrust = columns["thrust_target"].values
    rows = np.flatnonzero(fresh & (takeoff >= RAMP_UP) & np.isfinite(thrust))
    rows = rows[np.diff(place[rows], prepend=-1) > 0]
    if not rows.size:
        raise refused(TARGET, "has no row in flight beside a position")
    begin_s = float(time_s[rows[0]])
    history = recording.history({*DEFAULTS, *UNSUPPORTED})
    changes_s = [change_s for change_s in history.times_s if change_s > begin_s]
    rows = rows[time_s[rows] < min(changes_s, default=np.inf)]
    values = history.at(begin_s)
    for gain in Parameters().gains:
        if gain not in values:
            raise refused(gain, "is missing")
    parameters = parameters_from(values)
    set_z_m = -columns["reference_m"].values
    set_vz_m_s, set_az_m_s2, known = _set_points(recording, time_s, set_z_m)
    up, down = (recording.at(f"{each}_limit_m_s", time_s) for each in ("climb", "descent"))
    derivative = "altitude_derivative_m_s" if "altitude_derivative_m_s" in columns else "climb_rate_m_s"
    return LoopLog(
        parameters=parameters,
        time_s=position_s,
        z_m=-columns["altitude_m"].values,
        vz_m_s=-columns["climb_rate_m_s"].values,
        z_derivative_m_s=-columns[derivative].values,
        place=place[rows],
        takeoff=takeoff[rows],
        ground_contact=recording.at("has_contact", time_s)[rows] > 0.0,
        set_z_m=set_z_m[rows],
        set_vz_m_s=set_vz_m_s[rows],
        set_az_m_s2=set_az_m_s2[rows],
        known=known[rows],
        limit_up_m_s=np.where(np.isfinite(up), up, parameters.climb_m_s)[rows],
        limit_down_m_s=np.where(np.isfinite(down), down, parameters.descent_m_s)[rows],
        hover=_hover(recording, time_s, takeoff, parameters)[rows],
        out_vz_m_s=-columns["climb_rate_target_m_s"].values[rows],
        out_az_m_s2=-columns["acceleration_target_m_s2"].values[rows],
        out_thrust=thrust[rows],
    )


def _set_points(recording: Recording, time_s: Samples, set_z_m: Samples) -> tuple[Samples, Samples, NDArray[np.bool_]]:
    """Set-points of velocity and acceleration in force at each time, shape (n,) each, and whether they are known.

    They are if the last message has the altitude in force, and is of the same time or followed by an equal one: most
    are not logged.
    """
    names = ("given_altitude_m", "given_climb_rate_m_s", "given_acceleration_m_s2")
    if not recording.columns.keys() >= set(names):
        unknown = np.full(len(time_s), np.nan)
        return unknown, unknown, np.zeros(len(time_s), dtype=np.bool_)
    at_s = recording.columns[names[0]].time_s
    z, vz, az = (-recording.columns[name].values for name in names)
    last = np.maximum(np.searchsorted(at_s, time_s, side="right") - 1, 0)
    following = np.minimum(last + 1, len(at_s) - 1)
    repeated = (following > last) & _equal(vz[following], vz[last]) & _equal(az[following], az[last])
    known = _equal(z[last], set_z_m) & (at_s[last] <= time_s) & ((at_s[last] == time_s) | repeated)
    return vz[last], az[last], known


def _equal(one: Samples, other: Samples) -> NDArray[np.bool_]:
    equal: NDArray[np.bool_] = (one == other) | (np.isnan(one) & np.isnan(other))
    return equal


def _hover(recording: Recording, time_s: Samples, takeoff: Samples, parameters: Parameters) -> Samples:
    """Hover thrust in force at each time, shape (n,); NaN where it is not known.

    In flight it is between two valid estimates that were logged around it, or before the first valid one the parameter.
    """
    on_ground = np.where(takeoff < FLIGHT, parameters.hover_thrust, np.nan)
    if not recording.columns.keys() >= {"hover_thrust", "hover_thrust_is_valid"}:
        return on_ground
    at_s, valid = recording.columns["hover_thrust"].time_s, recording.columns["hover_thrust_is_valid"].values > 0.0
    estimates = np.clip(recording.columns["hover_thrust"].values, HOVER_MIN, HOVER_MAX)
    last = np.searchsorted(at_s, time_s, side="right") - 1
    following = np.minimum(last + 1, len(at_s) - 1)
    around = (last >= 0) & (following > last) & valid[last] & valid[following]
    none_yet = ~np.logical_or.accumulate(valid)[following]
    in_flight = np.where(none_yet, parameters.hover_thrust, np.nan)
    in_flight[around] = np.interp(time_s[around], at_s, estimates)
    return np.where(takeoff < FLIGHT, on_ground, in_flight)
