"""A whole flight's altitude control in ArduPilot's on-board log (.bin), in every mode that holds altitude."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from functools import partial
from types import MappingProxyType
from typing import Final

import numpy as np

from app.autopilots.ardupilot.experiments import ArduPilotLoop, ardupilot_loop
from app.autopilots.ardupilot.log import BESIDE, LOOP, LOOPS, TUNING, history
from app.autopilots.ardupilot.replica.parameters import (
    LOOP_NAMES,
    in_newer_names,
    in_older_names,
    names_of,
)
from app.autopilots.ardupilot.replica.replay import climb_rate_targets
from app.autopilots.recording import EventKind, Recording, Rows, Source
from app.autopilots.segments import (
    LARGEST_LEAN,
    Condition,
    choose_parts,
    find_landings,
    has_neighbour,
    in_flight,
    jumps,
    thinned,
    within_limits,
)
from app.core.analysis.loop import LoggedFlight
from app.core.analysis.segment import Segment
from app.core.errors import TrajectoryError
from app.core.reasons import Reason, ReasonCode, refusal
from app.core.records.trajectory import Samples

_TUNING: Final = ("demanded_throttle", "thrust", "hover_throttle")
_REFERENCES: Final = frozenset({"desired_altitude_m", "reference_m"})
"""Columns without which the other one is the reference."""
HOLDS_ALTITUDE: Final = (2, 3, 4, 5, 6, 7, 10, 13, 15, 16, 17, 19, 21, 22, 23, 24, 27)
"""ALT_HOLD, AUTO, GUIDED, LOITER, RTL, CIRCLE, OF_LOITER, SPORT, AUTOTUNE, POSHOLD, BRAKE, AVOID_ADSB, SMART_RTL,
FLOWHOLD, FOLLOW, ZIGZAG, AUTO_RTL."""
_AFTER_TAKEOFF_S: Final = 2.0
_BEFORE_LANDING_S: Final = 3.0
_JUMP_M: Final = 0.1
_JUMP_M_S: Final = 1.0
_LARGEST_ACCELERATION_M_S2: Final = 50.0
_LARGEST_DEMAND: Final = 10.0
"""So far beyond its limits the loop may demand throttle."""
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
_SINCE_4_1: Final = "PSC_VELZ_I"
"""A parameter of all releases whose loop shapes its acceleration, and that log it in a message of its own."""
_CONSTANTS_UNTIL_4_0: Final[Mapping[str, float]] = MappingProxyType({"PSC_VELZ_FLTE": 4.0})
_LOG_BITS: Final[Mapping[str, tuple[str, int]]] = MappingProxyType(
    {
        "CTUN": ("CTUN", 1 << 4),
        "PSCD": ("NTUN", 1 << 5),
        "PSCZ": ("NTUN", 1 << 5),
        "RATE": ("ATTITUDE_MED", 1 << 0 | 1 << 1),
    }
)
"""The bit of LOG_BITMASK for a message, and those of which one suffices."""


def ardupilot_flight(recording: Recording, name: str) -> LoggedFlight:
    """The parts in flight under the same parameters, at most 120 s, those with the most manoeuvres first.

    Raises TrajectoryError naming the message or parameter that is missing, or InputError for one not supported.
    """
    refused = partial(_refusal, recording, name)
    _require_messages(recording, refused)
    altitude = recording.columns["altitude_m"]
    time_s, message = altitude.time_s, altitude.source.partition(".")[0]
    lean = _lean(recording, time_s)
    demanded, *used = (recording.columns[each].beside(time_s) for each in _TUNING)
    throttle = [within_limits(demanded, _LARGEST_DEMAND), *map(within_limits, used)]
    rows = _rows(recording, lean, throttle)
    motion = (rows.z_d_m, rows.z_m, rows.v_m_s, rows.a_m_s2, rows.v_d_m_s, rows.a_d_m_s2, rows.v_t_m_s, *throttle)
    is_sound = np.isfinite(np.sum(motion, axis=0)) & (np.abs(rows.a_m_s2) <= _LARGEST_ACCELERATION_M_S2)
    is_calm = np.nan_to_num(recording.at("vibration_failsafe", time_s)) == 0.0
    given, chosen = choose_parts(
        time_s,
        (
            Condition(_in_flight(recording), ReasonCode.NEVER_FLEW, "EV"),
            Condition(_holds_altitude(recording, time_s), ReasonCode.ALTITUDE_NOT_HELD, "MODE"),
            Condition(~_landings(recording, time_s), ReasonCode.ONLY_TAKEOFFS_OR_LANDINGS, "EV"),
            Condition(is_calm, ReasonCode.VIBRATION_FAILSAFE, "ERR"),
            Condition(has_neighbour(time_s), ReasonCode.GAPS, message),
            Condition(is_sound, ReasonCode.NOT_NUMBERS, message),
            Condition(lean >= LARGEST_LEAN, ReasonCode.LEANS, "ATT"),
        ),
        _is_reset(rows),
        history(recording, _USED),
        rows.a_d_m_s2,
        refused,
        ArduPilotLoop.space.bounds,
        lambda gain: Reason(code=ReasonCode.PARAMETER_MISSING, field=gain, named=[*in_newer_names({gain: 0.0})]),
    )
    hover = float(np.median(np.concatenate([rows.assumed_hover[slice(*part)] for part in chosen])))
    loop = replace(ardupilot_loop_of(recording, {**given, _LEARNED: hover}), row_s=None)
    segments = [rows.part(thinned(time_s, part)) for part in chosen]
    if "desired_climb_rate_m_s" not in recording.columns:
        segments = [TuningSegment.of(each, loop) for each in segments]
    return LoggedFlight(loop=loop, segments=segments)


def ardupilot_loop_of(recording: Recording, given: Mapping[str, float]) -> ArduPilotLoop:
    """The loop of a recording with these parameters, by the names of releases 4.0 to 4.6. Raises InputError for one
    that the replica lacks, or that is outside its range."""
    is_tuning = "altitude_m" in recording.columns and recording.columns["altitude_m"].source.startswith("CTUN.")
    differentiates = is_tuning and _SINCE_4_1 not in given
    loop = ardupilot_loop({**given, **(_CONSTANTS_UNTIL_4_0 if differentiates else {})})
    return replace(loop, names=names_of({each.name for each in recording.settings}), differentiates=differentiates)


class TuningSegment(Segment):
    """A segment of CTUN, which has no desired climb rate: what of its target does not come from the deviation. With
    some releases and modes the altitude of the reference changes without one, and the climb rate has a bias."""

    @property
    def moves_m_s(self) -> Samples:
        return np.gradient(self.z_d_m, self.time_s)

    @property
    def rises_m_s(self) -> Samples:
        return self.v_m_s - np.mean(self.v_m_s - np.gradient(self.z_m, self.time_s))

    @classmethod
    def of(cls, rows: Segment, loop: ArduPilotLoop) -> "TuningSegment":
        """The rows under this loop."""
        from_deviation = climb_rate_targets(loop.parameters, rows.z_d_m - rows.z_m, np.zeros_like(rows.z_m))
        v_d_m_s = rows.v_t_m_s - from_deviation
        derived = {"v_d_m_s": v_d_m_s, "a_d_m_s2": np.gradient(v_d_m_s, rows.time_s)}
        return cls(**{each.name: getattr(rows, each.name) for each in fields(rows)} | derived)


def _rows(recording: Recording, lean: Samples, throttle: Sequence[Samples]) -> Segment:
    """All rows of the loop. A leaning vehicle demands more throttle by the cosine of its lean, so the share of it that
    carries is given."""
    columns, (demanded, sent, hover) = recording.columns, throttle
    time_s = columns["altitude_m"].time_s

    def beside(name: str, differentiated: Samples | None = None) -> Samples:
        """A column; if it was not logged, the slope of another one."""
        if name in columns or differentiated is None:
            return columns[name].beside(time_s)
        return np.gradient(differentiated, time_s) if len(time_s) > 1 else np.zeros(1)

    z_d_m = beside("desired_altitude_m" if "desired_altitude_m" in columns else "reference_m")
    v_d_m_s = beside("desired_climb_rate_m_s", z_d_m)
    return Segment(
        time_s=time_s,
        z_m=beside("altitude_m"),
        v_m_s=beside("climb_rate_m_s"),
        a_m_s2=beside("acceleration_m_s2"),
        z_d_m=z_d_m,
        v_d_m_s=v_d_m_s,
        a_d_m_s2=beside("desired_acceleration_m_s2", v_d_m_s),
        v_t_m_s=beside("climb_rate_target_m_s"),
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
        | jump(rows.v_t_m_s, rows.a_d_m_s2, _JUMP_M_S)
    )


def _in_flight(recording: Recording) -> Rows:
    """Rows between takeoff and landing, and not near them."""
    altitude = recording.columns["altitude_m"]
    thrust = recording.at("thrust", altitude.time_s)
    return in_flight(recording, altitude.values, thrust, after_s=_AFTER_TAKEOFF_S, before_s=_BEFORE_LANDING_S)


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


def _refusal(recording: Recording, name: str, *reasons: Reason) -> TrajectoryError:
    hint = "Use ArduCopter's .bin log of a flight with altitude changes."
    return refusal(f"{name} cannot be analysed.", hint, reasons, recording.notes)


def _require_messages(recording: Recording, refused: Callable[..., TrajectoryError]) -> None:
    """Require what an analysis needs, of a copter."""
    if not recording.sources:
        raise refused(Reason(code=ReasonCode.NO_DATA))
    if frame := frame_of(recording):
        raise refused(Reason(code=ReasonCode.NOT_A_COPTER, named=[frame]))
    columns, latest = recording.columns, dict(in_older_names(each.name, each.value) for each in recording.settings)
    loop = LOOP if _SINCE_4_1 in latest else TUNING
    if "altitude_m" in columns:
        loop = next(each for each in LOOPS if str(each["altitude_m"]) == columns["altitude_m"].source)
    known = columns.keys() | (_REFERENCES if columns.keys() & _REFERENCES else set())
    needed = {**loop, **{each: BESIDE[each] for each in (*_TUNING, "mode")}}
    absent = [source for name, source in needed.items() if name not in known]
    first = {source.message: source for source in reversed(absent)}
    reasons = [_absent(recording, latest, each) for each in reversed(first.values())]
    otherwise = [each for each in reasons if each.code is ReasonCode.COLUMN_MISSING]
    if reasons:
        raise refused(*(otherwise or reasons))


def _absent(recording: Recording, latest: Mapping[str, float], source: Source) -> Reason:
    """Why there is no such column: the release logs something else, the bit of LOG_BITMASK is not set, or another
    cause."""
    if source.message in recording.sources:
        return Reason(code=ReasonCode.COLUMN_MISSING, field=str(source))
    bit, mask = _LOG_BITS.get(source.message, ("", 0))
    if mask and "LOG_BITMASK" in latest and not int(latest["LOG_BITMASK"]) & mask:
        return Reason(code=ReasonCode.LOG_BIT_UNSET, field=source.message, named=[bit])
    return Reason(code=ReasonCode.MESSAGE_MISSING, field=source.message)
