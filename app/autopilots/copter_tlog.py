"""The altitude steps in a telemetry log (.tlog) of an ArduCopter or PX4.

It takes the same of them as our own link records: position, demanded throttle and the autopilot's reference, of a
flight whose set points the vehicle reports: in GUIDED, or Offboard. ArduCopter's reference is shaped again from these.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final

import numpy as np

from app.autopilots.ardupilot import logged_flight as ardupilot_flight
from app.autopilots.ardupilot.experiments import ArduPilotLoop, read_ardupilot
from app.autopilots.ardupilot.log import MODES
from app.autopilots.ardupilot.replica import parameters as ardupilot
from app.autopilots.ardupilot.replica.parameters import in_newer_names, in_older_names
from app.autopilots.frames import frame_of
from app.autopilots.px4.experiments import Px4Loop, px4_loop, read_px4
from app.autopilots.px4.replica import parameters as px4
from app.autopilots.px4.replica.hover_range import HOVER_RANGE_NAME
from app.autopilots.recording import (
    ParameterHistory,
    Parameters,
    Recording,
    Rows,
    held,
)
from app.autopilots.segments import LARGEST_LEAN, Condition, Refused, choose_parts, jumps
from app.core.analysis.loop import LoggedFlight
from app.core.analysis.recorded_flight import LARGEST_INTERVAL_S, FlownSteps
from app.core.analysis.segment import LEAD_S
from app.core.models.set_points import SetPoints, on_step
from app.core.reasons import OTHER_FRAMES, Reason, ReasonCode, refusal
from app.core.records.trajectory import Samples, Trajectory

_STEPS_APART_S: Final = 1.0
_SETTLED_S: Final = 6.5
"""Hover after the last step that is analysed."""
_INTERRUPTED_S: Final = 1.0
"""Longer intervals between two messages do not count for their rate."""
_HEARTBEAT_HOLDS_S: Final = 5.0
_OFF_GROUND_M: Final = 0.5
_JUMP_M: Final = 0.2
_SAME_TARGET_M: Final = 0.01
_AT_REST_M: Final = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class _Autopilot:
    """What differs between ArduCopter and PX4.

    `number_of_mode` is of the custom mode in a heartbeat; `mode` is the one whose set points the vehicle reports.
    `messages` are needed. Of the parameters, the gains in `bounds` are needed, and `learned` if there is one, which the
    vehicle changes by itself; `kept` are all on which the loop depends. `shapes_reference` if the reference is not the
    set point itself. `hint` says what to record.
    """

    number_of_mode: Callable[[int], int]
    mode: int
    modes: Mapping[float, str]
    messages: Sequence[str]
    bounds: Mapping[str, tuple[float, float]]
    kept: Sequence[str]
    learned: str
    shapes_reference: bool
    hint: str

    def mode_name(self, mode: int) -> str:
        """As its users call it."""
        return self.modes.get(mode, f"mode-{mode}")


_ASK: Final = (
    "Use a telemetry log of altitude steps in {mode}: hover for 5 s, climb 2 m, hover for 5 s, descend 2 m, hover for "
    "5 s. Before it read all parameters, and ask the vehicle for 50 of each of these messages a second: "
    "MAV_CMD_SET_MESSAGE_INTERVAL with 20000 µs for {messages}{or_else}. The vehicle's own log ({own}) needs none of "
    "this."
)
_IN_TAKEOFFS: Final = frozenset(
    {"TKOFF_SLEW_TIME", "TKOFF_THR_MAX", "MPC_TKO_RAMP_T", "COM_SPOOLUP_TIME", "MPC_LAND_SPEED"}
)
"""Parameters that act in takeoffs and landings alone."""
_MAY_LACK: Final = frozenset({*ardupilot.UNSUPPORTED, *px4.UNSUPPORTED, HOVER_RANGE_NAME})
"""Parameters that some releases lack."""


_AUTOPILOTS: Final[Mapping[str, _Autopilot]] = MappingProxyType(
    {
        "ardupilot": _Autopilot(
            number_of_mode=lambda mode: mode,
            mode=4,
            modes=MODES,
            messages=("LOCAL_POSITION_NED", "NAV_CONTROLLER_OUTPUT", "ATTITUDE_TARGET", "POSITION_TARGET_LOCAL_NED"),
            bounds=ArduPilotLoop.space.bounds,
            learned="MOT_THST_HOVER",
            kept=ardupilot.LOOP_NAMES,
            shapes_reference=True,
            hint=_ASK.format(
                mode="GUIDED",
                messages="32, 62, 83 and 85",
                or_else=" (in MAVProxy: long SET_MESSAGE_INTERVAL 32 20000)",
                own=".bin",
            ),
        ),
        "px4": _Autopilot(
            number_of_mode=lambda mode: mode >> 16 & 0xFF,
            mode=6,
            modes=MappingProxyType({1: "Manual", 2: "Altitude", 3: "Position", 4: "Automatic", 6: "Offboard"}),
            messages=("LOCAL_POSITION_NED", "ATTITUDE_TARGET", "POSITION_TARGET_LOCAL_NED"),
            bounds=Px4Loop.space.bounds,
            learned="",
            kept=px4.LOOP_NAMES,
            shapes_reference=False,
            hint=_ASK.format(
                mode="Offboard",
                messages="32, 83 and 85",
                or_else=" (in PX4's console: mavlink stream -s ATTITUDE_TARGET -r 50, with -d or -u for the link)",
                own=".ulg",
            ),
        ),
    }
)


def copter_steps(recording: Recording, name: str) -> LoggedFlight | None:
    """The part with the largest altitude changes, at most 120 s under the same parameters, of an ArduPilot or PX4; None
    of another autopilot.

    Raises TrajectoryError naming every message, mode and parameter that is missing, or InputError for a parameter that
    is not supported.
    """
    autopilot = _AUTOPILOTS.get(recording.autopilot.name)
    return None if autopilot is None else _Reader(name, recording, autopilot).read()


@dataclass(frozen=True, slots=True)
class _Reader:
    name: str
    recording: Recording
    autopilot: _Autopilot

    def read(self) -> LoggedFlight:
        if (frame := frame_of(self.recording)) in OTHER_FRAMES:
            raise self._refused(Reason(code=ReasonCode.NOT_A_COPTER, named=[frame]))
        if reasons := (*self._sparse_messages(), *self._missing_mode(), *self._missing_parameters()):
            raise refusal(f"{self.name} cannot be analysed.", self.autopilot.hint, reasons, self.recording.notes)
        rows = self._rows()
        time_s, target_m = rows.time_s, rows["set_point_m"]
        given, parts = choose_parts(
            time_s,
            self._conditions(rows),
            jumps(time_s, rows["altitude_m"], rows["climb_rate_m_s"], _JUMP_M),
            ParameterHistory.of(each for each in self._settings() if each[1] != self.autopilot.learned),
            np.diff(target_m, prepend=target_m[0]) / np.diff(time_s, prepend=time_s[0] - 1.0),
            self._refused,
            self.autopilot.bounds,
            lambda gain: Reason(code=ReasonCode.PARAMETER_READ_LATE, field=gain),
        )
        part = max((slice(*each) for each in parts), key=lambda each: float(np.ptp(target_m[each])))
        begin_s = float(time_s[part.start])
        flown = Trajectory(
            time_s[part] - begin_s, {name: values[part] for name, values in rows.channels.items()}, "tlog", "vehicle"
        )
        flight = self._flight(flown, {**given, **self._learned(begin_s)})
        return replace(flight, assumed=() if self.recording.has_all_parameters else self._assumed(given))

    def _rows(self) -> Trajectory:
        """Signals of a vehicle's reports, which has all that its autopilot needs; NaN where they are not known."""
        columns = self.recording.columns
        time_s, altitude_m = columns["altitude_m"].time_s, columns["altitude_m"].values
        throttle, set_point_m = columns["demanded_throttle"].beside(time_s), columns["target_altitude_m"].at(time_s)
        if self.autopilot.shapes_reference:
            reference_m = altitude_m + columns["reference_error_m"].beside(time_s)
        else:
            throttle, reference_m = throttle * columns["lean"].beside(time_s), set_point_m
        channels = {
            "altitude_m": altitude_m,
            "climb_rate_m_s": columns["climb_rate_m_s"].values,
            "throttle": throttle,
            "reference_m": reference_m,
            "set_point_m": set_point_m,
        }
        return Trajectory(time_s, channels, "tlog", "vehicle")

    def _flight(self, trajectory: Trajectory, given: Parameters) -> LoggedFlight:
        if self.autopilot.shapes_reference:
            loop = ardupilot_flight.ardupilot_loop_of(self.recording, given)
            return read_ardupilot(loop, trajectory, self._steps(trajectory))
        hovers = SetPoints(times_s=(0.0,), altitudes_m=(float(trajectory["set_point_m"][0]),))
        whole = FlownSteps(set_points=hovers, begin_s=LEAD_S, end_s=float(trajectory.time_s[-1]))
        return read_px4(replace(px4_loop(given), vehicle=self.recording.system), trajectory, whole)

    def _steps(self, trajectory: Trajectory) -> FlownSteps:
        """The steps from the first one before which the vehicle was at rest, to some time after the last; a step right
        before the end is left out."""
        time_s, target_m = trajectory.time_s, trajectory["set_point_m"]
        found = _steps_in(trajectory)
        rows = [row for row in found if time_s[row] + _STEPS_APART_S <= time_s[-1]]
        field = "POSITION_TARGET_LOCAL_NED"
        if not rows:
            numbers, named = {"rest_s": LEAD_S}, [self._mode]
            raise self._refused(Reason(code=ReasonCode.NO_STEPS, field=field, numbers=numbers, named=named))
        times_s = time_s[rows]
        if np.any(np.diff(times_s) < _STEPS_APART_S):
            numbers = {"apart_s": _STEPS_APART_S}
            raise self._refused(Reason(code=ReasonCode.STEPS_TOO_CLOSE, field=field, numbers=numbers))
        end_s = time_s[found[len(rows)]] if len(found) > len(rows) else time_s[-1]
        return FlownSteps(
            set_points=SetPoints(
                times_s=(0.0, *map(on_step, times_s.tolist())),
                altitudes_m=(float(target_m[rows[0] - 1]), *target_m[rows].tolist()),
            ),
            begin_s=float(times_s[0]),
            end_s=min(float(times_s[-1]) + _SETTLED_S, float(end_s)),
        )

    def _conditions(self, rows: Trajectory) -> Sequence[Condition]:
        time_s, lean = rows.time_s, self.recording.columns["lean"].beside(rows.time_s)
        is_known = np.isfinite(np.sum([*rows.channels.values(), lean], axis=0))
        return (
            Condition(self._is_off_ground(rows), ReasonCode.NEVER_FLEW, "LOCAL_POSITION_NED"),
            Condition(_follows(self.recording, self.autopilot, time_s), ReasonCode.ALTITUDE_NOT_HELD, "HEARTBEAT"),
            Condition(is_known, ReasonCode.GAPS, "LOCAL_POSITION_NED"),
            Condition(lean >= LARGEST_LEAN, ReasonCode.LEANS, "ATTITUDE_TARGET"),
        )

    def _is_off_ground(self, rows: Trajectory) -> Rows:
        """Rows above the place where it last was disarmed; all, before it was."""
        is_disarmed = self.recording.columns["is_armed"].at(rows.time_s) == 0.0
        rested = np.maximum.accumulate(np.where(is_disarmed, np.arange(len(rows)), -1))
        above_m = rows["altitude_m"] - rows["altitude_m"][rested]
        return np.asarray((rested < 0) | (above_m > _OFF_GROUND_M))

    def _sparse_messages(self) -> Iterator[Reason]:
        """Messages that are missing, or too rare where the vehicle flew in the mode with set points."""
        for message in self.autopilot.messages:
            found = [each.time_s for each in self.recording.columns.values() if each.source.startswith(f"{message}.")]
            rate_hz = self._rate_hz(found[0]) if found else 0.0
            if not found:
                yield Reason(code=ReasonCode.MESSAGE_MISSING, field=message)
            elif rate_hz * LARGEST_INTERVAL_S < 1.0:
                numbers = {"rate_hz": rate_hz, "needed_hz": 1.0 / LARGEST_INTERVAL_S}
                yield Reason(code=ReasonCode.MESSAGE_RARE, field=message, numbers=numbers)

    def _rate_hz(self, at_s: Samples) -> float:
        following = _follows(self.recording, self.autopilot, at_s)
        intervals_s = np.diff(at_s[following] if following.any() else at_s)
        counted = intervals_s[intervals_s <= _INTERRUPTED_S]
        return 1.0 / float(counted.mean()) if counted.size else 0.0

    def _missing_mode(self) -> Iterator[Reason]:
        armed, mode = self.recording.columns["is_armed"], self.recording.columns["mode"]
        flown = [self.autopilot.number_of_mode(int(each)) for each in mode.values[armed.values > 0.0].tolist()]
        if not flown:
            yield Reason(code=ReasonCode.NEVER_ARMED, field="HEARTBEAT")
        elif self.autopilot.mode not in flown:
            modes = [self.autopilot.mode_name(each) for each in dict.fromkeys(flown)]
            yield Reason(code=ReasonCode.OTHER_MODES, field="HEARTBEAT", named=[self._mode, *modes])

    def _missing_parameters(self) -> Iterator[Reason]:
        known = {name for _, name, _ in self._settings()}
        for each in (*self.autopilot.bounds, self.autopilot.learned):
            if each and each not in known:
                newer = [name for name in in_newer_names({each: 0.0}) if name != each]
                yield Reason(code=ReasonCode.PARAMETER_MISSING, field=each, named=newer)

    def _settings(self) -> Iterator[tuple[float, str, float]]:
        """Parameters by their older names, in order of time; values that nobody had written before hold from −∞ on."""
        logged = ((-np.inf if each.held_before else each.time_s, each) for each in self.recording.settings)
        for time_s, each in sorted(logged, key=lambda timed: timed[0]):
            older, number = in_older_names(each.name, each.value)
            if older in self.autopilot.kept:
                yield time_s, older, number

    def _learned(self, time_s: float) -> Parameters:
        """What the vehicle learns by itself, as last reported at this time, or reported first."""
        reports = [(at_s, value) for at_s, name, value in self._settings() if name == self.autopilot.learned]
        before = [value for at_s, value in reports if at_s <= time_s] or [value for _, value in reports[:1]]
        return {self.autopilot.learned: before[-1]} if before else {}

    def _assumed(self, given: Parameters) -> tuple[str, ...]:
        """By the names of the vehicle's release."""
        known = {*given, self.autopilot.learned, *_IN_TAKEOFFS, *_MAY_LACK}
        absent = [each for each in self.autopilot.kept if each not in known]
        own = ardupilot.names_of({each.name for each in self.recording.settings})
        return tuple(in_newer_names(dict.fromkeys(absent, 0.0), own))

    @property
    def _mode(self) -> str:
        return self.autopilot.mode_name(self.autopilot.mode)

    @property
    def _refused(self) -> Refused:
        return lambda reason: refusal(
            f"{self.name} cannot be analysed.", self.autopilot.hint, [reason], self.recording.notes
        )


def _follows(recording: Recording, autopilot: _Autopilot, time_s: Samples) -> Rows:
    """Times, shape (n,), between two heartbeats with armed motors in the mode with set points, or after the last."""
    armed, modes = recording.columns["is_armed"], recording.columns["mode"]
    at_s, is_mode = armed.time_s, [autopilot.number_of_mode(int(mode)) == autopilot.mode for mode in modes.values]
    following = ((armed.values > 0.0) & is_mode).astype(np.float64)
    before = held(at_s, following, time_s, longest_s=_HEARTBEAT_HOLDS_S)
    after = held(-at_s[::-1], following[::-1], -time_s)
    return np.asarray((before == 1.0) & (np.isnan(after) | (after == 1.0)))


def _steps_in(trajectory: Trajectory) -> list[int]:
    """Rows at which the set point of a part changes, from the first change before which the vehicle was at rest."""
    time_s, target_m = trajectory.time_s, trajectory["set_point_m"]
    changes = (np.flatnonzero(np.abs(np.diff(target_m)) > _SAME_TARGET_M) + 1).tolist()

    def is_at_rest_before(row: int) -> bool:
        lead = slice(int(np.searchsorted(time_s, time_s[row] - LEAD_S)), row)
        away_m = np.abs(trajectory["reference_m"][lead] - target_m[row - 1])
        return bool(time_s[row] >= LEAD_S and away_m.max() <= _AT_REST_M and np.ptp(target_m[lead]) <= _SAME_TARGET_M)

    first = next((place for place, row in enumerate(changes) if is_at_rest_before(row)), len(changes))
    return changes[first:]
