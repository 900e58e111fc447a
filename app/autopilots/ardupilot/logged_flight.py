"""A whole flight's altitude control in ArduPilot's on-board log (.bin), in every mode that holds altitude."""

from collections.abc import Mapping, Sequence
from functools import partial
from types import MappingProxyType
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
    NEWER_NAMES,
    in_newer_names,
    parameters_from,
)
from app.autopilots.recording import EventKind, Recording, Rows
from app.autopilots.segments import (
    LARGEST_LEAN,
    Condition,
    Refused,
    choose_parts,
    find_landings,
    has_neighbour,
    jumps,
    thinned,
    within_limits,
)
from app.core.analysis.loop import LoggedFlight
from app.core.analysis.segment import Segment
from app.core.control.parameter_checks import require_within
from app.core.reasons import Reason, ReasonCode, refusal
from app.core.records.trajectory import Samples

_TUNING: Final = ("demanded_throttle", "thrust", "hover_throttle")
_ONE_OF_TWO: Final = (["desired_altitude_m"], ["reference_m"])
"""Columns without which the other one is the reference."""
HOLDS_ALTITUDE: Final = (2, 3, 4, 5, 6, 7, 16, 17)
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
_HELICOPTERS: Final = (6.0, 11.0, 13.0)
"""FRAME_CLASS of helicopters with one rotor, two and four."""
_FIRMWARES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "AntennaTracker": "tracker",
        "ArduPlane": "plane",
        "ArduRover": "rover",
        "ArduSub": "submarine",
        "Blimp": "airship",
        "Rover": "rover",
    }
)
_UNTIL_4_0: Final = frozenset({"THR_ALT_P", "POS_Z_P", "PSC_ACC_XY_FILT"})
"""Parameters of releases that do not log this loop, whatever their LOG_BITMASK."""
_LOG_BITS: Final[Mapping[str, int]] = MappingProxyType({"CTUN": 1 << 4, "NTUN": 1 << 5})


def ardupilot_flight(recording: Recording, name: str) -> LoggedFlight:
    """The parts in flight under the same parameters, at most 120 s, those with the most manoeuvres first.

    Raises TrajectoryError naming the message or parameter that is missing, or InputError for one not supported.
    """
    refused = _refused(recording, name)
    _require_messages(recording, refused)
    time_s = recording.columns["altitude_m"].time_s
    lean = _lean(recording, time_s)
    throttle = [within_limits(recording.columns[each].beside(time_s)) for each in _TUNING]
    rows = _rows(recording, lean, throttle)
    motion = (rows.z_d_m, rows.z_m, rows.v_m_s, rows.a_m_s2, rows.v_d_m_s, rows.a_d_m_s2, rows.v_t_m_s, *throttle)
    is_sound = np.isfinite(np.sum(motion, axis=0)) & (np.abs(rows.a_m_s2) <= _LARGEST_ACCELERATION_M_S2)
    is_calm = np.nan_to_num(recording.at("vibration_failsafe", time_s)) == 0.0
    given, chosen = choose_parts(
        time_s,
        (
            Condition(_in_flight(recording, time_s), ReasonCode.NEVER_FLEW, "EV"),
            Condition(_holds_altitude(recording, time_s), ReasonCode.ALTITUDE_NOT_HELD, "MODE"),
            Condition(~_landings(recording, time_s), ReasonCode.ONLY_TAKEOFFS_OR_LANDINGS, "EV"),
            Condition(is_calm, ReasonCode.VIBRATION_FAILSAFE, "ERR"),
            Condition(has_neighbour(time_s), ReasonCode.GAPS, "PSCD"),
            Condition(is_sound, ReasonCode.NOT_NUMBERS, "PSCD"),
            Condition(lean >= LARGEST_LEAN, ReasonCode.LEANS, "ATT"),
        ),
        _is_reset(rows),
        history(recording, _USED),
        rows.a_d_m_s2,
        refused,
        ArduPilotLoop.space.bounds,
        lambda gain: Reason(code=ReasonCode.PARAMETER_MISSING, field=gain, named=[*in_newer_names({gain: 0.0})]),
    )
    require_within(given, {LOOP_RATE: LOOP_RATES_HZ})
    hover = float(np.median(np.concatenate([rows.assumed_hover[slice(*part)] for part in chosen])))
    return LoggedFlight(
        loop=ArduPilotLoop(
            parameters=parameters_from({**given, _LEARNED: hover}),
            filter_hz=given.get(ACCELEROMETER_FILTER, ACCELEROMETER_FILTER_HZ),
            step_s=1.0 / given.get(LOOP_RATE, LOOP_RATE_HZ),
            has_newer_names=has_newer_names(recording),
        ),
        segments=[rows.part(thinned(time_s, part)) for part in chosen],
    )


def has_newer_names(recording: Recording) -> bool:
    """Whether the vehicle's parameters have the names of release 4.7."""
    return any(each.name in NEWER_NAMES for each in recording.settings)


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


def _holds_altitude(recording: Recording, time_s: Samples) -> Rows:
    return np.isin(recording.at("mode", time_s), HOLDS_ALTITUDE)


def _landings(recording: Recording, time_s: Samples) -> Rows:
    """Rows of the last descent before each touchdown."""
    downs_s = [event.time_s for event in recording.events_of(EventKind.LANDING, EventKind.MOTORS_OFF)]
    altitude_m = recording.columns["altitude_m"].values
    return find_landings(time_s, altitude_m, recording.at("climb_rate_m_s", time_s), downs_s)


def frame_of(recording: Recording) -> str:
    """The kind of vehicle, by its parameters, frame and firmware; empty if it is a copter with several rotors."""
    latest = {each.name: each.value for each in recording.settings}
    is_helicopter = recording.frame.startswith("HELI") or any(name.startswith("H_") for name in latest)
    if is_helicopter or latest.get("FRAME_CLASS") in _HELICOPTERS:
        return "helicopter"
    if latest.get("Q_ENABLE"):
        return "VTOL"
    return _FIRMWARES.get(recording.firmware, "")


def _refused(recording: Recording, name: str) -> Refused:
    hint = "Use ArduCopter's .bin log of a flight with altitude changes, with NTUN and CTUN in LOG_BITMASK."
    return lambda reason: refusal(f"{name} cannot be analysed.", hint, [reason], recording.notes)


def _require_messages(recording: Recording, refused: Refused) -> None:
    """Require what an analysis needs, of a copter."""
    if not recording.sources:
        raise refused(Reason(code=ReasonCode.NO_DATA))
    if frame := frame_of(recording):
        raise refused(Reason(code=ReasonCode.NOT_A_COPTER, named=[frame]))
    from_loop = {name for name, column in recording.columns.items() if not column.source.startswith("CTUN.")}
    absent = [name for name in LOOP if name not in from_loop]
    if len(absent) == len(LOOP):
        raise refused(_absent(recording, "PSCD", "NTUN"))
    if absent and absent not in _ONE_OF_TWO:
        raise refused(Reason(code=ReasonCode.COLUMN_MISSING, field=str(LOOP[absent[0]])))
    if not recording.columns.keys() >= set(_TUNING):
        raise refused(_absent(recording, "CTUN", "CTUN"))


def _absent(recording: Recording, message: str, bit: str) -> Reason:
    """Why a message has no columns: its bit of LOG_BITMASK is not set, or the release logs something else."""
    latest = {each.name: each.value for each in recording.settings}
    would_be_logged = "LOG_BITMASK" in latest and not latest.keys() & _UNTIL_4_0
    if would_be_logged and not int(latest["LOG_BITMASK"]) & _LOG_BITS[bit]:
        return Reason(code=ReasonCode.LOG_BIT_UNSET, field=message, named=[bit])
    is_logged = message in recording.sources
    return Reason(code=ReasonCode.COLUMN_MISSING if is_logged else ReasonCode.MESSAGE_MISSING, field=message)
