"""A whole flight's altitude control in PX4's log (.ulg), in every mode that follows an altitude.

Rows are the set-points that position control publishes, ten a second by default, with the estimates of the same time.
The accelerations between two rows are the change of the estimated climb rate: single estimates of the acceleration are
noisy, and most are not logged.
"""

from collections.abc import Mapping
from dataclasses import fields, replace
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.autopilots.px4.experiments import Px4Loop
from app.autopilots.px4.log import AIRFRAMES, ARMED, SET_POINT, SOURCES, STATUS, TAKEOFF, TARGET, VEHICLE
from app.autopilots.px4.replica.hover_range import HOVER_RANGE_NAME, hover_deviation
from app.autopilots.px4.replica.parameters import (
    LOOP_NAMES,
    THRUST_GAINS,
    estimator_step_s,
    in_accelerations,
    parameters_from,
)
from app.autopilots.px4.replica.vertical import FLIGHT, GRAVITY
from app.autopilots.recording import EventKind, Recording, Rows
from app.autopilots.segments import (
    LARGEST_LEAN,
    Condition,
    Refused,
    choose_parts,
    find_landings,
    jumps,
    thinned,
    within_limits,
)
from app.core.analysis.loop import LoggedFlight
from app.core.analysis.segment import FinerSegment, Segment
from app.core.reasons import Reason, ReasonCode, refusal
from app.core.records.trajectory import Samples

_NEEDED: Final = ("altitude_m", "climb_rate_m_s", "reference_m", "climb_rate_target_m_s", "thrust_target", "mode")
_OF_ACCELERATIONS: Final = ("acceleration_target_m_s2", "given_climb_rate_m_s", "given_acceleration_m_s2")
"""Needed since release 1.11, whose gains are of accelerations."""
_REVERSED: Final = "1.11.0"
"""The release with the wrong sign of the derivative of the climb rate."""
_DERIVATIVE: Final = "MPC_Z_VEL_D_ACC"
_ANY_HOVER: Final = 1.0
"""Releases without the parameter did not limit the estimated hover thrust to a range about another one."""
_RAMP_S: Final = 3.0
"""By default, the thrust rises so long in a takeoff."""
_UNEXPLAINED_SHARE: Final = 0.05
"""Of the climb rate targets: with more, the set-points do not tell what was fed forward."""
_ROTORS, _WINGS = 1.0, 2.0
_KINDS: Final[Mapping[float, str]] = MappingProxyType({_WINGS: "plane", 3: "rover"})
"""Kinds of vehicle in its status, but for those with rotors, 1."""
LEFT_OUT_MODES: Final = (12.0, 17.0, 18.0, 20.0)
"""Modes: descend, takeoff, land, precision landing."""
_JUMP_M: Final = 0.5
_JUMP_M_S: Final = 2.0
_EVERY_POSITION_S: Final = 0.0125
"""Rows of the position that are not further apart than this are all that there were."""
_SET_POINT_LASTS_S: Final = 1.0
_NEAR_LIMIT: Final = 1e-3
_LEAST_SHARE: Final = 0.2
"""Of hover thrust: below it, the assumed hover thrust cannot be told from thrust and acceleration."""


def px4_flight(recording: Recording, name: str) -> LoggedFlight:
    """The parts in flight under the same parameters, at most 120 s, those with the most manoeuvres first.

    Raises TrajectoryError naming the topic or parameter that is missing, or InputError for one not supported.
    """
    refused, older = _refused(recording, name), THRUST_GAINS if has_thrust_gains(recording) else {}
    _require_columns(recording, refused)
    rows, lean = _rows(recording), _lean(recording)
    time_s, thrust = rows.time_s, rows.throttle
    target = np.where(thrust > _NEAR_LIMIT, 0.0, np.nan) if older else recording.at("acceleration_target_m_s2", time_s)
    is_sound = np.isfinite(rows.z_m + rows.v_m_s + rows.v_t_m_s + target + thrust)
    follows = np.isfinite(rows.z_d_m + rows.v_d_m_s + rows.a_d_m_s2)
    given, chosen = choose_parts(
        time_s,
        (
            Condition(_flying(recording, time_s), ReasonCode.NEVER_FLEW, TAKEOFF),
            Condition(~_coming_or_going(recording, time_s), ReasonCode.ONLY_TAKEOFFS_OR_LANDINGS, STATUS),
            Condition(follows, ReasonCode.MANUAL_ALTITUDE, str(SOURCES["reference_m"])),
            Condition(is_sound, ReasonCode.NOT_NUMBERS, TARGET),
            Condition(lean >= LARGEST_LEAN, ReasonCode.LEANS, f"{TARGET}.thrust"),
        ),
        _is_reset(recording, rows),
        recording.history({*LOOP_NAMES, *THRUST_GAINS.values(), VEHICLE}),
        _manoeuvres(rows),
        refused,
        {older.get(gain, gain): ends for gain, ends in Px4Loop.space.bounds.items()},
        lambda gain: Reason(code=ReasonCode.PARAMETER_MISSING, field=gain),
    )
    kept = [thinned(time_s, part) for part in chosen]
    mean = float(np.mean(np.concatenate([thrust[each] for each in kept])))
    parameters = parameters_from(in_accelerations(given, mean) if older else given)
    logged_s = float(np.median(np.diff(recording.columns["altitude_m"].time_s)))
    limits = parameters.thrust_min + _NEAR_LIMIT, parameters.thrust_max - _NEAR_LIMIT
    free = is_sound & (thrust > limits[0]) & (thrust < limits[1])
    hover = np.full(len(time_s), mean) if older else _hover(rows, target, free)
    down = np.concatenate([recording.at("descent_limit_m_s", time_s)[each] for each in kept])
    flight = LoggedFlight(
        loop=Px4Loop(
            parameters=parameters,
            step_s=logged_s if not older and 0.0 < logged_s <= _EVERY_POSITION_S else estimator_step_s(given),
            row_s=float(np.median(np.concatenate([np.diff(time_s[each]) for each in kept]))),
            descent_m_s=float(np.median(down)) if np.isfinite(down).all() else parameters.descent_m_s,
            hover_deviation=hover_deviation({HOVER_RANGE_NAME: _ANY_HOVER, **given}),
            vehicle=int(given.get(VEHICLE, 1.0)),
            thrust_gains_at=mean if older else None,
        ),
        segments=[_segment(recording, replace(rows, assumed_hover=hover), lean, each) for each in kept],
    )
    return _with_feed_forward(flight) if older else flight


def has_thrust_gains(recording: Recording) -> bool:
    """Whether the gains are those until release 1.10, by the parameters or, where it has none, by what it logged."""
    names = {each.name for each in recording.settings}
    has_older = "acceleration_target_m_s2" not in recording.columns or not names.isdisjoint(THRUST_GAINS.values())
    return has_older and names.isdisjoint(THRUST_GAINS)


def _with_feed_forward(flight: LoggedFlight) -> LoggedFlight:
    """The flight with what the climb rate targets have beyond the set-points: until release 1.10, set-points were
    logged rarely or not at all, and the rates that modes fed forward, or limited, are in the targets alone."""
    loop = flight.loop
    beyond = [each.v_t_m_s - loop.climb_rate_targets(each) for each in flight.segments]
    if np.mean(np.abs(np.concatenate(beyond)) > loop.target_tolerance_m_s) <= _UNEXPLAINED_SHARE:
        return flight
    fed = [replace(each, v_d_m_s=each.v_d_m_s + rest) for each, rest in zip(flight.segments, beyond, strict=True)]
    return replace(flight, segments=fed, lacks=Reason(code=ReasonCode.FEED_FORWARD_UNKNOWN, field=SET_POINT))


def _rows(recording: Recording) -> Segment:
    """All rows of position control, without accelerations and the assumed hover thrust."""
    columns = recording.columns
    time_s = columns["thrust_target"].time_s
    z_m, v_m_s = (
        np.interp(time_s, columns[each].time_s, columns[each].values, left=np.nan, right=np.nan)
        for each in ("altitude_m", "climb_rate_m_s")
    )
    v_d, a_d = _feed_forward(recording, time_s)
    thrust, unknown = within_limits(columns["thrust_target"].values), np.full(len(time_s), np.nan)
    return Segment(
        time_s=time_s,
        z_m=z_m,
        v_m_s=v_m_s,
        a_m_s2=unknown,
        z_d_m=columns["reference_m"].values,
        v_d_m_s=v_d,
        a_d_m_s2=a_d,
        v_t_m_s=columns["climb_rate_target_m_s"].values,
        throttle=thrust,
        throttle_filtered=thrust,
        assumed_hover=unknown,
    )


def _lean(recording: Recording) -> Samples:
    """Cosine of the lean, shape (n,): the vertical share of the thrust."""
    columns = recording.columns
    thrust = within_limits(columns["thrust_target"].values)
    horizontal = [
        columns[each].values ** 2 for each in ("thrust_target_north", "thrust_target_east") if each in columns
    ]
    with np.errstate(invalid="ignore", divide="ignore"):
        lean = thrust / np.sqrt(thrust**2 + np.sum(horizontal, axis=0))
    return np.asarray(np.nan_to_num(lean, nan=1.0))


def _flying(recording: Recording, time_s: Samples) -> Rows:
    """Rows after the ramp of a takeoff, without contact to the ground."""
    on_ground = [np.nan_to_num(recording.at(each, time_s)) > 0.0 for each in ("is_landed", "has_contact")]
    flying = recording.at("takeoff_state", time_s) == FLIGHT
    if "takeoff_state" not in recording.columns:
        spans = ((each.begin_s + _RAMP_S, each.end_s) for each in recording.in_air or ())
        flying = np.any([(time_s >= begin_s) & (time_s < end_s) for begin_s, end_s in spans], axis=0)
    return np.asarray(flying & ~np.any(on_ground, axis=0))


def _coming_or_going(recording: Recording, time_s: Samples) -> Rows:
    """Rows of takeoffs and landings, by the mode and, as any mode may land, by the last descent to each touchdown."""
    altitude = recording.columns["altitude_m"]
    downs_s = [event.time_s for event in recording.events_of(EventKind.LANDING)]
    downs_s += [span.end_s for span in recording.armed or () if np.isfinite(span.end_s)]
    landing = find_landings(altitude.time_s, altitude.values, recording.columns["climb_rate_m_s"].values, downs_s)
    after = np.minimum(np.searchsorted(altitude.time_s, time_s), len(landing) - 1)
    return np.asarray(landing[after] | np.isin(recording.at("mode", time_s), LEFT_OUT_MODES))


def _is_reset(recording: Recording, rows: Segment) -> Rows:
    """Rows at which the estimator moved altitude or climb rate."""
    counters = [np.nan_to_num(recording.at(each, rows.time_s)) for each in ("altitude_resets", "climb_rate_resets")]
    resets = np.sum(counters, axis=0)
    return np.asarray(
        (np.diff(resets, prepend=resets[0]) != 0.0)
        | jumps(rows.time_s, rows.z_m, rows.v_m_s, _JUMP_M)
        | (np.abs(np.diff(rows.v_m_s, prepend=rows.v_m_s[0])) > _JUMP_M_S)
    )


def _hover(rows: Segment, acceleration_target: Samples, free: Rows) -> Samples:
    """Hover thrust that the loop assumed, shape (n,): thrust over that share of hover thrust which the acceleration
    target asks for, from the rows that are `free` of the limits of the thrust."""
    share = 1.0 + acceleration_target / float(GRAVITY)
    known = np.flatnonzero(free & (share > _LEAST_SHARE))
    if not known.size:
        return np.full(len(rows.time_s), np.nan)
    return np.interp(rows.time_s, rows.time_s[known], rows.throttle[known] / share[known])


def _segment(recording: Recording, rows: Segment, lean: Samples, kept: NDArray[np.int64]) -> FinerSegment:
    """These rows, with the thrust between them where it was logged more often."""
    part = rows.part(kept)
    time_s, changes = part.time_s, np.diff(part.v_m_s) / np.diff(part.time_s)
    at_s, thrust = time_s, part.throttle
    if "thrust" in recording.columns:
        finer = recording.columns["thrust"]
        values = within_limits(finer.values) * np.interp(finer.time_s, rows.time_s, lean)
        between = (finer.time_s > time_s[0]) & (finer.time_s < time_s[-1]) & np.isfinite(values)
        at_s, first = np.unique(np.append(time_s, finer.time_s[between]), return_index=True)
        thrust = np.append(thrust, values[between])[first]
    signals = {each.name: getattr(part, each.name) for each in fields(part)}
    return FinerSegment(**signals | {"a_m_s2": np.append(changes[0], changes)}, motor_time_s=at_s, motor_values=thrust)


def _manoeuvres(rows: Segment) -> Samples:
    """Acceleration that the reference alone asks for, shape (n,): steps of the altitude count too."""
    target, time_s = rows.v_d_m_s + rows.z_d_m, rows.time_s
    return np.diff(target, prepend=target[0]) / np.diff(time_s, prepend=time_s[0] - 1.0) + rows.a_d_m_s2


def _feed_forward(recording: Recording, time_s: Samples) -> tuple[Samples, Samples]:
    """Climb rate and acceleration that the set-points give beside the altitude, up, shape (n,) each: 0 where they give
    none, NaN where no set-point is near."""
    from scipy.interpolate import CubicHermiteSpline

    if "given_climb_rate_m_s" not in recording.columns:
        return np.zeros(len(time_s)), np.zeros(len(time_s))
    at_s, v = recording.columns["given_climb_rate_m_s"].time_s, recording.columns["given_climb_rate_m_s"].values
    if len(at_s) < 2:
        return np.full(len(time_s), np.nan), np.full(len(time_s), np.nan)
    a = recording.at("given_acceleration_m_s2", at_s)
    rates = np.where(np.isfinite(v) & np.isfinite(a), a, 0.0)
    if "given_acceleration_m_s2" not in recording.columns:
        rates = np.gradient(np.nan_to_num(v), at_s)
    v_d = CubicHermiteSpline(at_s, np.nan_to_num(v), rates)(np.clip(time_s, at_s[0], at_s[-1]))
    a_d = np.interp(time_s, at_s, np.nan_to_num(a))
    after = np.clip(np.searchsorted(at_s, time_s), 1, len(at_s) - 1)
    near = (time_s >= at_s[0]) & (time_s - at_s[after - 1] <= _SET_POINT_LASTS_S)
    return np.where(near, v_d, np.nan), np.where(near, a_d, np.nan)


def frame_of(recording: Recording) -> str:
    """The kind of vehicle, by its status and parameters; empty if it is a copter with several rotors, or not known."""
    latest = {each.name: each.value for each in recording.settings}
    by_parameters = [
        kind for name, kinds in AIRFRAMES.items() for kind, values in kinds.items() if latest.get(name) in values
    ]
    status, older = (recording.columns.get(each) for each in ("vehicle_type", "is_rotary_wing"))
    reported = [] if status is None else np.unique(status.values).tolist()
    if older is not None:
        armed = recording.at("arming_state", older.time_s) == ARMED
        reported = np.unique(_WINGS - (older.values[armed] > 0.0)).tolist()
    by_status = ["VTOL" if _ROTORS in reported else _KINDS[each] for each in reported if each in _KINDS]
    return next(iter([*by_parameters, *by_status]), "")


def _refused(recording: Recording, name: str) -> Refused:
    hint = (
        "Use PX4's .ulg log of a flight with altitude changes in Hold, Mission or Offboard mode, with bit 0 of "
        "SDLOG_PROFILE set, its default. Takeoffs are left out: their ramp decides, not the gains."
    )
    return lambda reason: refusal(f"{name} cannot be analysed.", hint, [reason], recording.notes)


def _require_columns(recording: Recording, refused: Refused) -> None:
    """Require what an analysis needs, and that the vehicle flies on rotors alone, if the log tells."""
    if not recording.sources:
        raise refused(Reason(code=ReasonCode.NO_DATA))
    if frame := frame_of(recording):
        raise refused(Reason(code=ReasonCode.NOT_A_COPTER, named=[frame]))
    latest = {each.name: each.value for each in recording.settings}
    if recording.release.partition("-")[0] == _REVERSED and latest.get(_DERIVATIVE):
        raise refused(Reason(code=ReasonCode.DERIVATIVE_REVERSED, field=_DERIVATIVE, named=[recording.release]))
    needed = _NEEDED if has_thrust_gains(recording) else (*_NEEDED, *_OF_ACCELERATIONS)
    for each in needed if "is_landed" in recording.columns else (*needed, "takeoff_state"):
        source = SOURCES[each]
        if source.message not in recording.sources:
            raise refused(Reason(code=ReasonCode.MESSAGE_MISSING, field=source.message))
        if each not in recording.columns:
            raise refused(Reason(code=ReasonCode.COLUMN_MISSING, field=str(source)))
