"""PX4's log (.ulg, "ULog") to a `Recording`: which topic and field means what."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import BinaryIO, Final

import numpy as np

from app.autopilots.mavlink import hardware_id
from app.autopilots.px4.profile import PX4
from app.autopilots.recording import (
    COMMANDS,
    Column,
    Event,
    EventKind,
    Recording,
    Rows,
    Setting,
    Source,
    Span,
    columns_of,
    date_of,
    release_of,
    spans_of,
)
from app.core.records.trajectory import Samples
from app.logs.base import Table, rows_of
from app.logs.ulog import ULogTables, read_ulog_tables

POSITION, TARGET, SET_POINT = "vehicle_local_position", "vehicle_local_position_setpoint", "trajectory_setpoint"
TAKEOFF, STATUS, _ATTITUDE = "takeoff_status", "vehicle_status", "vehicle_attitude_setpoint"
_LANDED, _LIMITS, _HOVER = "vehicle_land_detected", "vehicle_constraints", "hover_thrust_estimate"
_COMMAND, _ANSWER = "vehicle_command", "vehicle_command_ack"


def _state(topic: str, field: str) -> Source:
    return Source(topic, field, holds_s=np.inf)


SOURCES: Final[Mapping[str, Source]] = {
    "altitude_m": Source(POSITION, "z", -1.0),
    "altitude_is_valid": _state(POSITION, "z_valid"),
    "climb_rate_m_s": Source(POSITION, "vz", -1.0),
    "acceleration_m_s2": Source(POSITION, "az", -1.0),
    "altitude_derivative_m_s": Source(POSITION, "z_deriv", -1.0),
    "altitude_resets": _state(POSITION, "z_reset_counter"),
    "climb_rate_resets": _state(POSITION, "vz_reset_counter"),
    "reference_m": Source(TARGET, "z", -1.0),
    "climb_rate_target_m_s": Source(TARGET, "vz", -1.0),
    "acceleration_target_m_s2": Source(TARGET, "acceleration[2]", -1.0),
    "thrust_target": Source(TARGET, "thrust[2]", -1.0),
    "thrust_target_north": Source(TARGET, "thrust[0]"),
    "thrust_target_east": Source(TARGET, "thrust[1]"),
    "given_altitude_m": Source(SET_POINT, "position[2]", -1.0),
    "given_climb_rate_m_s": Source(SET_POINT, "velocity[2]", -1.0),
    "given_acceleration_m_s2": Source(SET_POINT, "acceleration[2]", -1.0),
    "takeoff_state": _state(TAKEOFF, "takeoff_state"),
    "mode": _state(STATUS, "nav_state"),
    "arming_state": _state(STATUS, "arming_state"),
    "vehicle_type": _state(STATUS, "vehicle_type"),
    "is_landed": _state(_LANDED, "landed"),
    "has_contact": _state(_LANDED, "ground_contact"),
    "climb_limit_m_s": _state(_LIMITS, "speed_up"),
    "descent_limit_m_s": _state(_LIMITS, "speed_down"),
    "hover_thrust": Source(_HOVER, "hover_thrust"),
    "hover_thrust_is_valid": Source(_HOVER, "valid"),
    "thrust": Source("vehicle_thrust_setpoint", "xyz[2]", -1.0),
    "battery_v": Source("battery_status", "voltage_v"),
}
"""The given values are the set-points, in force until the next one; `thrust` is that of the body, logged more often
than its target."""
_OLDER_SOURCES: Final[Mapping[str, Source]] = {
    "given_altitude_m": Source(SET_POINT, "z", -1.0),
    "given_climb_rate_m_s": Source(SET_POINT, "vz", -1.0),
    "thrust": Source("actuator_controls_0", "control[3]"),
    "demanded_throttle": Source(_ATTITUDE, "thrust"),
    "roll_deg": Source(_ATTITUDE, "roll_body", np.degrees(1.0)),
    "pitch_deg": Source(_ATTITUDE, "pitch_body", np.degrees(1.0)),
    "is_rotary_wing": _state(STATUS, "is_rotary_wing"),
}
"""The same, or what there was instead, in releases until 1.13."""
VEHICLE: Final = "MAV_SYS_ID"
AIRFRAMES: Final[Mapping[str, Mapping[str, range]]] = {
    "CA_AIRFRAME": {"plane": range(1, 2), "VTOL": range(2, 5), "rover": range(5, 7), "helicopter": range(10, 13)},
    "MAV_TYPE": {
        "plane": range(1, 2), "helicopter": range(4, 5), "rover": range(10, 11), "boat": range(11, 12),
        "submarine": range(12, 13), "VTOL": range(19, 26),
    },
    "SYS_AUTOSTART": {"VTOL": range(13000, 14000), "plane": range(2100, 3000), "rover": range(50000, 51000)},
}  # fmt: skip
"""Kinds of vehicles that are no copter with several rotors, by the values of parameters."""

_RELEASE, _BOOT_DATE, _BOARD, _GPS = "ver_sw_release", "boot_time_utc_us", "sys_uuid", "vehicle_gps_position"
_ANSWERED_WITHIN_S: Final = 2.0
_TAKEOFF_MODE, _HOVER_MODE = 17, 4
_COMING_DOWN: Final = (5.0, 12.0, 18.0, 20.0)
"""Return, descend, land, precision landing: no takeoff begins in these modes."""
ARMED: Final = 2.0
_BOUNCE_S: Final = 2.0
"""Leaving the ground sooner than this after a touchdown is not a new takeoff."""
_MODES: Final[Mapping[float, str]] = {0: "manual", 1: "altitude", 2: "position", 3: "mission", 5: "return", 18: "land"}


def read_px4(stream: BinaryIO) -> Recording:
    """Decode a whole log. Raises TrajectoryError if it is not a readable ULog."""
    wanted = {_COMMAND, _ANSWER, _GPS, *(source.message for source in (*SOURCES.values(), *_OLDER_SOURCES.values()))}
    tables = read_ulog_tables(stream, topics=wanted, values={_RELEASE, _BOOT_DATE, _BOARD})
    columns = columns_of(tables.topics, _OLDER_SOURCES, clock="timestamp")
    columns |= columns_of(tables.topics, SOURCES, clock="timestamp")
    arming = columns.get("arming_state")
    recording = Recording(
        title="PX4's log (ULog)",
        autopilot=PX4,
        release=release_of(tables.information.get(_RELEASE, 0)),
        hardware_id=hardware_id(tables.texts.get(_BOARD, "")),
        columns=columns,
        sources=[topic for topic, table in tables.topics.items() if len(table.get("timestamp", ()))],
        settings=[Setting(*each) for each in tables.settings],
        notes=tables.notes,
        started_at=date_of(_booted_s(tables)),
    )
    return replace(
        recording,
        events=[*_commands(tables.topics), *_changes(recording)],
        in_air=_in_air(recording),
        armed=None if arming is None else _spans(arming.time_s, arming.values == ARMED),
        remarks=list(_remarks(columns)),
    )


def _booted_s(tables: ULogTables) -> float:
    """Time since 1970 at 0 s, by the vehicle's own clock or by its GPS; 0 if neither was set."""
    fixes = rows_of(tables.topics.get(_GPS, {}), "timestamp", "time_utc_usec")
    return tables.information.get(_BOOT_DATE, 0) / 1e6 or next((us / 1e6 - at_s for at_s, us in fixes if us), 0.0)


def _spans(time_s: Samples, holds: Rows) -> list[Span]:
    return spans_of(zip(time_s.tolist(), holds.tolist(), strict=True))


def _commands(topics: Mapping[str, Table]) -> Iterator[Event]:
    """Commands to take off and to land that were not refused."""
    answers = rows_of(topics.get(_ANSWER, {}), "timestamp", "command", "result")
    refusals = [(time_s, command) for time_s, command, result in answers if result]
    for time_s, command in rows_of(topics.get(_COMMAND, {}), "timestamp", "command"):
        refused_at = [at for at, what in refusals if what == command and 0.0 <= at - time_s <= _ANSWERED_WITHIN_S]
        if command in COMMANDS and not refused_at:
            kind, what = COMMANDS[command]
            yield Event(kind, time_s, what)


def _changes(recording: Recording) -> Iterator[Event]:
    """Modes that begin and end a flight, and landings."""
    if "mode" in recording.columns:
        time_s, modes = recording.columns["mode"].time_s, recording.columns["mode"].values
        takes_off = (modes == _TAKEOFF_MODE) & _may_be_armed(recording, time_s)
        begins = takes_off & ~np.append(False, takes_off[:-1])
        ends = (np.diff(modes, prepend=modes[0]) != 0.0) & ~np.isin(modes, (_TAKEOFF_MODE, _HOVER_MODE))
        yield from (Event(EventKind.TAKEOFF, at_s, "the takeoff mode") for at_s in time_s[begins].tolist())
        for at_s, mode in zip(time_s[ends].tolist(), modes[ends].tolist(), strict=True):
            yield Event(EventKind.MODE, at_s, f"the mode {_MODES.get(mode, f'{mode:g}')}")
    if "is_landed" in recording.columns:
        landed = recording.columns["is_landed"]
        down = (landed.values[1:] != 0.0) & (landed.values[:-1] == 0.0)
        yield from (Event(EventKind.LANDING, at_s, "the landing") for at_s in landed.time_s[1:][down].tolist())


def _may_be_armed(recording: Recording, time_s: Samples) -> Rows:
    """Whether the motors were armed at these times, or it was not reported, shape (n,)."""
    state = recording.at("arming_state", time_s)
    return np.asarray((state == ARMED) | np.isnan(state))


def _in_air(recording: Recording) -> list[Span] | None:
    """Intervals from each lift-off to the touchdown, from the land detector, with the motors armed if that is known.

    A lift-off in a descending mode, or within two seconds of a touchdown (a bounce), is not counted. None without the
    land detector.
    """
    columns = recording.columns
    if "is_landed" not in columns:
        return None
    time_s = np.unique(
        np.concatenate([columns[each].time_s for each in ("is_landed", "arming_state") if each in columns])
    )
    flying = (recording.at("is_landed", time_s) == 0.0) & _may_be_armed(recording, time_s)
    spans = _spans(time_s, flying)
    modes = recording.at("mode", np.array([span.begin_s for span in spans]))
    touched_s = [-np.inf, *(span.end_s for span in spans)]
    return [
        span
        for span, before_s, mode in zip(spans, touched_s, modes.tolist(), strict=False)
        if mode not in _COMING_DOWN and span.begin_s - before_s >= _BOUNCE_S
    ]


def _remarks(columns: Mapping[str, Column]) -> Iterator[str]:
    """On missing topics, needed to tell a takeoff from a jump of the altitude, and on the method used instead."""
    has_status = {"mode", "arming_state"} <= columns.keys()
    if "is_landed" not in columns:
        how = "while it was armed" if has_status else "armed or not"
        yield (
            f"no {_LANDED} in the log, so the takeoff is found from a rise of the altitude, {how}: check that "
            "it is the right flight"
        )
    elif not has_status:
        yield (
            f"no {STATUS} in the log, so the takeoff is found from the land detector alone: check that it is "
            "the right flight"
        )
