"""A whole flight's altitude control in ArduPilot's on-board log (.bin), in every mode that holds altitude."""

from collections.abc import Sequence
from functools import partial
from typing import Final

import numpy as np

from app.autopilots.ardupilot.experiments import ArduPilotLoop
from app.autopilots.ardupilot.log import LOOP, history
from app.autopilots.ardupilot.replica.parameters import (
    ACCELEROMETER_FILTER,
    ACCELEROMETER_FILTER_HZ,
    LOOP_NAMES,
    LOOP_RATE,
    LOOP_RATE_HZ,
    LOOP_RATES_HZ,
    in_newer_names,
    parameters_from,
)
from app.autopilots.recording import LONGEST_INTERVAL_S, EventKind, Recording, Refused, Rows, refusal
from app.autopilots.segments import (
    LARGEST_LEAN,
    SHORTEST_PART_S,
    choose_parts,
    jumps,
    thinned,
)
from app.core.analysis.loop import LoggedFlight
from app.core.analysis.segment import Segment
from app.core.records.trajectory import Samples

_TUNING: Final = ("demanded_throttle", "thrust", "hover_throttle")
_ONE_OF_TWO: Final = (["desired_altitude_m"], ["reference_m"])
"""Columns without which the other one is the reference."""
_HOLDS_ALTITUDE: Final = (2, 3, 4, 5, 6, 7, 16, 17)
"""ALT_HOLD, AUTO, GUIDED, LOITER, RTL, CIRCLE, POSHOLD, BRAKE."""
_AFTER_TAKEOFF_S: Final = 2.0
_BEFORE_LANDING_S: Final = 3.0
_ABOVE_GROUND_M: Final = 1.0
_TELLING: Final = (EventKind.BOOT, EventKind.MOTORS_ON, EventKind.LIFT_OFF, EventKind.LANDING, EventKind.MOTORS_OFF)
"""Events after which it is known whether the vehicle is in the air, or not any more."""
_JUMP_M: Final = 0.1
_JUMP_M_S: Final = 1.0
_LARGEST_ACCELERATION_M_S2: Final = 50.0
_LEARNED: Final = "MOT_THST_HOVER"
_THRUST_CURVE: Final = ("MOT_THST_EXPO", "MOT_SPIN_MIN", "MOT_SPIN_MAX", "MOT_BAT_VOLT_MIN", "MOT_BAT_VOLT_MAX")
_USED: Final = frozenset({*LOOP_NAMES, *_THRUST_CURVE} - {_LEARNED})


def ardupilot_flight(recording: Recording, name: str) -> LoggedFlight:
    """The parts in flight under the same parameters, at most 120 s, those with the most manoeuvres first.

    Raises TrajectoryError naming the message or parameter that is missing, or InputError for one not supported.
    """
    refused = refusal(
        f"{name} cannot be analysed.",
        "Use ArduCopter's .bin log of a flight with altitude changes, with NTUN and CTUN in LOG_BITMASK.",
    )
    _require_messages(recording, refused)
    time_s = recording.columns["altitude_m"].time_s
    lean, throttle = _lean(recording, time_s), [recording.columns[each].beside(time_s) for each in _TUNING]
    rows = _rows(recording, lean, throttle)
    motion = (rows.z_d_m, rows.z_m, rows.v_m_s, rows.a_m_s2, rows.v_d_m_s, rows.a_d_m_s2, rows.v_t_m_s)
    is_sound = np.isfinite(np.sum(motion, axis=0))
    is_sound &= np.abs(rows.a_m_s2) <= _LARGEST_ACCELERATION_M_S2
    is_sound &= np.all([(each >= 0.0) & (each <= 1.0) for each in throttle], axis=0)
    conditions = (
        (is_sound, "PSCD", "has no rows of numbers beside rows of CTUN"),
        (_in_flight(recording, time_s), "EV", "has no takeoff, or nothing between takeoff and landing"),
        (
            np.isin(recording.at("mode", time_s), _HOLDS_ALTITUDE),
            "MODE",
            "has no mode that holds altitude in flight",
        ),
        (
            np.nan_to_num(recording.at("vibration_failsafe", time_s)) == 0.0,
            "ERR",
            "has vibration compensation active throughout the flight",
        ),
        (lean >= LARGEST_LEAN, "ATT", "leans by more than 30° throughout the flight"),
    )
    none_found = (
        f"has no {SHORTEST_PART_S:g} s flown in an altitude-holding mode without a gap of {LONGEST_INTERVAL_S:g} "
        "s, a jump in altitude or a parameter change"
    )
    given, chosen = choose_parts(
        time_s,
        conditions,
        _is_reset(rows),
        history(recording, _USED),
        rows.a_d_m_s2,
        refused,
        ("PSCD", none_found),
        ArduPilotLoop.space.bounds,
        lambda gain: f"is missing, and {next(iter(in_newer_names({gain: 0.0})))} of release 4.7 too",
    )
    hover = float(np.median(np.concatenate([rows.assumed_hover[slice(*part)] for part in chosen])))
    rate_hz = given.get(LOOP_RATE, LOOP_RATE_HZ)
    if not LOOP_RATES_HZ[0] <= rate_hz <= LOOP_RATES_HZ[1]:
        raise refused(LOOP_RATE, f"must be {LOOP_RATES_HZ[0]:g} to {LOOP_RATES_HZ[1]:g} Hz, got {rate_hz:g}")
    newer = in_newer_names(dict.fromkeys(ArduPilotLoop.space.bounds, 0.0)).keys()
    return LoggedFlight(
        loop=ArduPilotLoop(
            parameters=parameters_from({**given, _LEARNED: hover}),
            filter_hz=given.get(ACCELEROMETER_FILTER, ACCELEROMETER_FILTER_HZ),
            step_s=1.0 / rate_hz,
            has_newer_names=any(each.name in newer for each in recording.settings),
        ),
        segments=[rows.part(thinned(time_s, part)) for part in chosen],
    )


def _rows(recording: Recording, lean: Samples, throttle: Sequence[Samples]) -> Segment:
    """All rows of the loop. A leaning vehicle demands more throttle by the cosine of its lean, so the share of it that
    carries is given."""
    columns, (demanded, sent, hover) = recording.columns, throttle
    return Segment(
        time_s=columns["altitude_m"].time_s,
        z_m=columns["altitude_m"].values,
        v_m_s=columns["climb_rate_m_s"].values,
        a_m_s2=columns["acceleration_m_s2"].values,
        z_d_m=columns["desired_altitude_m" if "desired_altitude_m" in columns else "reference_m"].values,
        v_d_m_s=columns["desired_climb_rate_m_s"].values,
        a_d_m_s2=columns["desired_acceleration_m_s2"].values,
        v_t_m_s=columns["climb_rate_target_m_s"].values,
        throttle=demanded,
        throttle_filtered=sent * lean,
        assumed_hover=hover,
    )


def _lean(recording: Recording, time_s: Samples) -> Samples:
    """Cosine of the lean, shape (n,); 1 where it was not logged."""
    if not {"roll_deg", "pitch_deg"} <= recording.columns.keys():
        return np.ones(len(time_s))
    roll, pitch = (np.radians(recording.columns[each].beside(time_s)) for each in ("roll_deg", "pitch_deg"))
    return np.asarray(np.nan_to_num(np.cos(roll) * np.cos(pitch), nan=1.0))


def _is_reset(rows: Segment) -> Rows:
    """Rows at which the reference began anew, or the estimator moved altitude or climb rate."""
    jump = partial(jumps, rows.time_s)
    return np.asarray(
        ((rows.z_d_m == rows.z_m) & (rows.v_d_m_s == rows.v_m_s))
        | jump(rows.z_m, rows.v_m_s, _JUMP_M)
        | jump(rows.z_d_m, rows.v_d_m_s, _JUMP_M)
        | jump(rows.v_m_s, rows.a_m_s2, _JUMP_M_S)
    )


def _in_flight(recording: Recording, time_s: Samples) -> Rows:
    """Rows between takeoff and landing, by the vehicle's own events. Where none tells whether it flew, as in a log that
    begins in the air, those well above the lowest altitude, which is 0 or less, and with thrust."""
    altitude_m, thrust = recording.columns["altitude_m"].values, recording.at("thrust", time_s)
    lowest_m = np.min(altitude_m[np.isfinite(altitude_m)], initial=0.0)
    is_up = (altitude_m > lowest_m + _ABOVE_GROUND_M) & (thrust > 0.0)
    flying, unknown_from_s = is_up, -np.inf
    for event in recording.events_of(*_TELLING):
        if event.kind in (EventKind.MOTORS_ON, EventKind.LIFT_OFF):
            flying = flying & (time_s < unknown_from_s)
        if event.kind is EventKind.LIFT_OFF:
            flying = flying | (time_s >= event.time_s + _AFTER_TAKEOFF_S)
        else:
            flying = flying & (time_s < event.time_s - _BEFORE_LANDING_S)
        unknown_from_s = event.time_s if event.kind is EventKind.BOOT else np.inf
        flying = flying | (is_up & (time_s >= unknown_from_s))
    return flying


def _require_messages(recording: Recording, refused: Refused) -> None:
    """Require what an analysis needs, of a copter."""
    if not recording.sources:
        raise refused("file", "has no data: copy the whole log")
    if recording.firmware:
        raise refused("MSG", f"is of {recording.firmware}, not of ArduCopter")
    found = {column.source for column in recording.columns.values()}
    absent = [name for name, source in LOOP.items() if str(source) not in found]
    if len(absent) == len(LOOP):
        older = "; the log has PSCZ of an older release, which is not supported" if "PSCZ" in recording.sources else ""
        raise refused("PSCD", f"is missing: add NTUN to LOG_BITMASK, and fly again{older}")
    if absent and absent not in _ONE_OF_TWO:
        raise refused(str(LOOP[absent[0]]), "is missing: this release is not supported")
    if not recording.columns.keys() >= set(_TUNING):
        raise refused("CTUN", "is missing: add CTUN to LOG_BITMASK, and fly again")
