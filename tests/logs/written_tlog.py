"""Telemetry logs of simulated altitude steps, as a ground station would write them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Final, Literal

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega

from app.autopilots.ardupilot.replica.parameters import Parameters
from app.autopilots.px4.replica import parameters as px4_parameters
from app.core.records.trajectory import Samples
from bench.copters.px4_simulation import fly_reference
from bench.copters.simulation import SimulatedCopter, fly_targets
from tests.core.analysis.flights import QUIET
from tests.core.analysis.px4_flights import CALM
from tests.logs.recorded import Telemetry
from tests.logs.written import PARAMETERS as ARDUPILOT_PARAMETERS

GUIDED, LOITER = 4, 5
OFFBOARD, HOLD = 6 << 16, 4 << 16 | 3 << 24
LOCAL_POSITION, CONTROLLER, ATTITUDE, TARGET = (
    "local_position_ned",
    "nav_controller_output",
    "attitude_target",
    "position_target_local_ned",
)
GLOBAL_POSITION, HUD, LEAN = "global_position_int", "vfr_hud", "attitude"
GROUND_STATION: Final = (GLOBAL_POSITION, HUD, LEAN, CONTROLLER)
"""What many ask for, 4 of each a second."""
HOME_M: Final = 488.0
_AUTOPILOT: Final = {"ardupilot": 3, "px4": 12}
_MODE: Final = {"ardupilot": GUIDED, "px4": OFFBOARD}
PX4_PARAMETERS: Final[Mapping[str, float]] = {
    "MPC_Z_P": 1.0,
    "MPC_Z_VEL_P_ACC": 4.0,
    "MPC_Z_VEL_I_ACC": 2.0,
    "MPC_Z_VEL_D_ACC": 0.0,
    "MPC_THR_HOVER": 0.4,
}

Autopilot = Literal["ardupilot", "px4"]
CLIMB_AND_DESCENT: Final = ((0.0, 5.0), (5.0, 7.0), (11.5, 5.0))
STEPS: Final = ((0.0, 5.0), (5.0, 6.0), (10.0, 5.0), (15.0, 6.0), (20.0, 5.0))


@dataclass(frozen=True, slots=True)
class Signals:
    """Altitude, climb rate, throttle, set point and reference at 50 Hz, up, shape (n,) each."""

    altitude_m: Samples
    climb_rate_m_s: Samples
    throttle: Samples
    target_m: Samples
    reference_m: Samples


@cache
def flown(autopilot: Autopilot, set_points: tuple[tuple[float, float], ...], lasts_s: float = 18.0) -> Signals:
    """A flight of a quiet vehicle along these set points."""
    return fly(autopilot, QUIET if autopilot == "ardupilot" else CALM, set_points, lasts_s)


def fly(
    autopilot: Autopilot,
    copter: SimulatedCopter,
    set_points: tuple[tuple[float, float], ...],
    lasts_s: float,
    *,
    seed: int = 1,
) -> Signals:
    """A flight from hover along these set points (from when on, altitude)."""
    step_s, every = (0.0025, 8) if autopilot == "ardupilot" else (px4_parameters.STEP_S, 2)
    time_s = step_s * np.arange(round(lasts_s / step_s))
    times_s, altitudes_m = np.array(set_points).T
    target_m = altitudes_m[np.searchsorted(times_s, time_s, side="right") - 1]
    if autopilot == "ardupilot":
        parameters = Parameters(hover_throttle=copter.assumed_hover_throttle)
        rows = fly_targets(copter, parameters, target_m, seed=seed)[::every]
        return Signals(rows[:, 0], rows[:, 1], rows[:, 7], target_m[::every], rows[:, 3])
    reference = np.column_stack([target_m, np.zeros((len(target_m), 2))])
    parameters_of_px4 = px4_parameters.Parameters(hover_thrust=copter.assumed_hover_throttle)
    rows = fly_reference(copter, parameters_of_px4, reference, seed=seed)[::every]
    return Signals(rows[:, 0], rows[:, 1], rows[:, 3], target_m[::every], target_m[::every])


@dataclass(frozen=True, kw_only=True)
class Recording:
    """How a flight of a vehicle was recorded.

    `every` is that of its messages that is sent, `without` those that are not. The parameters, but for those `unread`,
    are read before the flight, or after it; those in `changes` are written in flight. Throttles above `full_from` are
    full. The log begins in the air. `signals` are of this flight, by default a quiet vehicle's.
    """

    autopilot: Autopilot = "ardupilot"
    set_points: tuple[tuple[float, float], ...] = CLIMB_AND_DESCENT
    lasts_s: float = 18.0
    parameters: Mapping[str, float] = field(default_factory=lambda: ARDUPILOT_PARAMETERS)
    parameters_after: bool = False
    changes: Sequence[tuple[float, str, float]] = ()
    mode: int | None = None
    kind: int = 2
    every: int = 1
    without: tuple[str, ...] = ()
    sends: tuple[str, ...] = (LOCAL_POSITION, CONTROLLER, ATTITUDE, TARGET)
    unread: tuple[str, ...] = ()
    armed: bool = True
    system: int = 1
    full_from: float = 1.0
    lean_rad: float = 0.0
    boots_at_s: float | None = None
    signals: Signals | None = None

    @property
    def content(self) -> bytes:
        """The file."""
        return self.written().content

    def written(self) -> Telemetry:
        """The log, to which more may be added."""
        log = Telemetry(ardupilotmega, autopilot=_AUTOPILOT[self.autopilot], system=self.system)
        self._read_parameters(log, now=not self.parameters_after)
        self._fly(log)
        self._read_parameters(log, now=self.parameters_after)
        return log

    def _read_parameters(self, log: Telemetry, *, now: bool) -> None:
        for name, value in self.parameters.items() if now else ():
            if name not in self.unread:
                log.vehicle("param_value", name.encode(), value, 9, 900, 0)

    def _fly(self, log: Telemetry) -> None:
        signals = self.signals or flown(self.autopilot, self.set_points, self.lasts_s)
        step_s = self.lasts_s / len(signals.altitude_m)
        changes = list(self.changes)
        mode = _MODE[self.autopilot] if self.mode is None else self.mode
        for row in range(0, len(signals.altitude_m), self.every):
            log.now_s += self.every * step_s
            if self.boots_at_s is not None and row * step_s >= self.boots_at_s > (row - self.every) * step_s:
                log.booted_s = log.now_s
            if row % (50 // self.every * self.every) == 0:
                log.vehicle("heartbeat", self.kind, _AUTOPILOT[self.autopilot], 128 * self.armed, mode, 4)
            while changes and changes[0][0] <= row * step_s:
                _, name, value = changes.pop(0)
                log.ground("param_set", 1, 1, name.encode(), value, 9)
                log.vehicle("param_value", name.encode(), value, 9, 900, 0)
            self._report(log, signals, row)

    def _report(self, log: Telemetry, signals: Signals, row: int) -> None:
        height, climb = signals.altitude_m[row], signals.climb_rate_m_s[row]
        throttle = 1.0 if signals.throttle[row] > self.full_from else signals.throttle[row]
        tilted = (np.cos(0.5 * self.lean_rad), np.sin(0.5 * self.lean_rad), 0.0, 0.0)
        above_home = (0, 0, round(-1e2 * climb), 0)
        messages = {
            LOCAL_POSITION: (log.boot_ms, 0.0, 0.0, -height, 0.0, 0.0, -climb),
            GLOBAL_POSITION: (log.boot_ms, 0, 0, round(1e3 * (HOME_M + height)), round(1e3 * height), *above_home),
            HUD: (0.0, 0.0, 0, round(100 * throttle), HOME_M + height, climb),
            LEAN: (log.boot_ms, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
            CONTROLLER: (0.0, 0.0, 0, 0, 0, signals.reference_m[row] - height, 0.0, 0.0),
            ATTITUDE: (log.boot_ms, 0, tilted, 0.0, 0.0, 0.0, throttle),
            TARGET: (log.boot_ms, 1, 0xDF8, 0.0, 0.0, -signals.target_m[row], *[0.0] * 8),
        }
        sent = set(self.sends) - set(self.without) - ({CONTROLLER} if self.autopilot == "px4" else set())
        for kind in sorted(sent, reverse=True):
            log.vehicle(kind, *messages[kind])


PX4_RECORDING: Final = Recording(autopilot="px4", set_points=STEPS, lasts_s=25.0, parameters=PX4_PARAMETERS)


def frames_of(content: bytes) -> list[bytes]:
    """The records of a log of MAVLink 1 or 2, without signatures: the time and the frame of each."""
    records, start = [], 0
    while start < len(content):
        length = content[start + 9] + (8 if content[start + 8] == 0xFE else 12)
        records.append(content[start : start + 8 + length])
        start += 8 + length
    return records


def repeated_and_late(content: bytes, *, seed: int = 1) -> bytes:
    """The log with every tenth record twice, and every tenth some records later."""
    random, records = np.random.default_rng(seed), frames_of(content)
    late = random.uniform(0.0, 8.0, len(records)) * (random.random(len(records)) < 0.1)
    places = np.arange(len(records)) + late
    again = np.flatnonzero(random.random(len(records)) < 0.1)
    order = np.argsort(np.append(places, places[again] + 3.5), kind="stable")
    return b"".join(np.array([*records, *(records[each] for each in again)], dtype=object)[order])


def together(*contents: bytes) -> bytes:
    """One log of several, in order of receipt."""
    records: list[bytes] = [record for content in contents for record in frames_of(content)]
    records.sort(key=lambda record: record[:8])
    return b"".join(records)
