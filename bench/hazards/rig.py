"""Test rig: a simulated drone in lockstep with the program, a tap on the link between them, and timed faults."""

import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from app.autopilots.dialects import FieldValue
from app.simdrone.catalogue import get_autopilot, new_body
from app.simdrone.drone import BOOT_S, Drone
from app.simdrone.motion_capture import VehicleLinkOutput
from app.vehicles.base import OptionValue
from app.vehicles.flight_end import StopRequest
from app.vehicles.mavlink_kind import MAVLINK
from bench.hazards.cases import (
    ABORT,
    MOTORS_OFF,
    OTHER_GAIN,
    OTHER_LANDING,
    OTHER_MODE,
    OTHER_TARGET,
    STALL,
    WILD_GAINS,
    Case,
    PlannedFault,
)
from bench.hazards.trial_states import RESTING_M, State, TrialStates
from bench.hazards.wire import DIALECTS, GAINS, Command, read_command, stops_motors
from bench.lockstep import Lockstep

SILENCING: Final = frozenset({"link-lost", "wrong-system", "no-heartbeat", "reboot"})
_LONGEST_S: Final = 400.0
"""Longest trial in the drone's time, beyond all time limits of a trial."""
_NEAR_GROUND_M: Final = 0.5
_OTHER_STATION: Final = 254
_AUTO_LAND: Final = 4 << 16 | 6 << 24
_INTERFERENCE: Final[Mapping[tuple[str, str], tuple[str, Mapping[str, FieldValue]]]] = {
    (OTHER_MODE, "paparazzi"): (
        "PARAM_SET",
        {"target_component": 0, "param_id": "aut_mod", "param_value": 1.0, "param_type": 9},
    ),
    (OTHER_MODE, "ardupilot"): ("SET_MODE", {"base_mode": 1, "custom_mode": 2}),
    (OTHER_MODE, "px4"): ("SET_MODE", {"base_mode": 1, "custom_mode": 3 << 16}),
    (OTHER_LANDING, "paparazzi"): ("SCRIPT_ITEM", {"target_component": 0, "seq": 13, "name": ""}),
    (OTHER_LANDING, "ardupilot"): ("SET_MODE", {"base_mode": 1, "custom_mode": 9}),
    (OTHER_LANDING, "px4"): ("SET_MODE", {"base_mode": 1, "custom_mode": _AUTO_LAND}),
}
"""Messages of another ground station: a mode (failsafe, altitude hold, position control), and Land."""
_OTHER_HEIGHT_M: Final = 2.2
_TARGET: Final[Mapping[str, FieldValue]] = {
    "time_boot_ms": 0,
    "target_component": 1,
    "coordinate_frame": 1,
    "type_mask": 0b1101_1111_1000,
    **dict.fromkeys(("x", "y", "vx", "vy", "vz", "afx", "afy", "afz", "yaw", "yaw_rate"), 0.0),
}
_WAYPOINT: Final[Mapping[str, FieldValue]] = {
    "target_component": 0,
    "seq": 2,
    "frame": 4,
    "command": 16,
    "current": 0,
    "autocontinue": 0,
    **dict.fromkeys(("param1", "param2", "param3", "param4", "x", "y"), 0.0),
    "z": _OTHER_HEIGHT_M,
}
_OTHER_GAINS: Final = {"paparazzi": ("gui_v_kp", 900.0), "ardupilot": ("PSC_ACCZ_P", 0.6), "px4": ("MPC_Z_P", 0.7)}
"""Set point and gain that another ground station sends."""


@dataclass(frozen=True, slots=True)
class InjectedFault:
    """A fault that has begun, with the state of the trial at that time."""

    kind: str
    state: State
    begun_s: float
    ended_s: float


@dataclass(frozen=True, slots=True)
class Overridden:
    """A command to a vehicle that a pilot flies: how long ago a heartbeat that shows it arrived; None: none has."""

    at_s: float
    command: Command
    flown_s: float
    shown_s: float | None


@dataclass(frozen=True, slots=True)
class MotorStop:
    """A packet that stops the motors, with the drone's true height above the ground at its arrival."""

    at_s: float
    height_m: float


class Rig(Lockstep):
    """The simulated drone of one case."""

    def __init__(self, case: Case) -> None:
        self.case = case
        self.states = TrialStates(window_s=case.window_s)
        self.injected: list[InjectedFault] = []
        self.sent: list[tuple[float, Command]] = []
        self.stops: list[MotorStop] = []
        self.packets: int = 0
        self.flew_on: Mapping[str, float] | None = None
        self.rose_m = 0.0
        self._stood_m: float | None = None
        self.impact_m_s = 0.0
        self.touched_down_s = 0.0
        self.stop_request: StopRequest | None = None
        self.stalls_s = 0.0
        self.overridden: list[Overridden] = []
        self._by_hand_since_s: float | None = None
        self._shown_s: float | None = None
        self._waiting = list(case.faults)
        self._kind = get_autopilot(case.autopilot)
        body = new_body("twin", {}, seed=case.seed % 100_000)
        outlet = VehicleLinkOutput() if case.has_second_source else None
        super().__init__(Drone(body, lambda fresh: self._kind.set_up(fresh, self._kind.system), outlet=outlet))
        self._codec = DIALECTS[case.autopilot].codec(system=1, component=1)
        self._reading = DIALECTS[case.autopilot].codec(system=1, component=1)
        self._other = DIALECTS[case.autopilot].codec(system=_OTHER_STATION, component=1)

    def tick(self) -> None:
        """Advance by one tick. Raises TimeoutError if the trial takes too long."""
        super().tick()
        self._update_rise()
        if self.drone.body.altitude_m > RESTING_M:
            self.touched_down_s = self.drone.time_s
        if 0.0 < self.drone.body.altitude_m < _NEAR_GROUND_M:
            self.impact_m_s = max(self.impact_m_s, -self.drone.body.climb_rate_m_s)
        self._update()
        if self.drone.time_s > _LONGEST_S:
            raise TimeoutError(f"the trial was not over after {_LONGEST_S:g} s")

    def _update_rise(self) -> None:
        """Note how far the drone has risen since its motors began to turn: where it stands is not exactly at zero."""
        body = self.drone.body
        if body.is_resting:
            self._stood_m = None
            return
        self._stood_m = body.altitude_m if self._stood_m is None else self._stood_m
        self.rose_m = max(self.rose_m, body.altitude_m - self._stood_m)

    def arriving(self, frames: list[bytes]) -> list[bytes]:
        """Note since when a pilot has flown the drone, and when a heartbeat first showed it."""
        if not (self.drone.autopilot.armed and self.drone.autopilot.is_by_hand):
            self._by_hand_since_s = self._shown_s = None
            return frames
        now_s = self.drone.time_s
        if self._by_hand_since_s is None:  # a mode from before the takeoff command says nothing after it
            self._by_hand_since_s = now_s if self.states.first_s(State.TAKEOFF) is not None else math.inf
        if self._shown_s is None and self._by_hand_since_s <= now_s:
            kinds = {message.get_type() for frame in frames for message in self._reading.parse(frame)}
            self._shown_s = now_s if "HEARTBEAT" in kinds else None
        return frames

    def write(self, data: bytes) -> bool:
        for message in self._codec.parse(data) if self.remote == self.peer else ():
            self._tap(read_command(self.case.autopilot, message), stops=stops_motors(self.case.autopilot, message))
        return super().write(data)

    # ---- the options of the connection, and the true gains

    def options(self) -> dict[str, OptionValue]:
        chosen: dict[str, OptionValue] = {"autopilot": self.case.autopilot, "simulated": True}
        return MAVLINK.check(chosen | {"system_id": self._kind.system if self.case.pinned else 0}, field="options")

    def held(self) -> dict[str, float]:
        """Return the gains that the vehicle truly holds."""
        names = GAINS[self.case.autopilot]
        return {gain: self.drone.autopilot.parameters[parameter] for gain, parameter in names.items()}

    def holds(self, gains: Mapping[str, float]) -> bool:
        return self.held() == {gain: _single(value) for gain, value in gains.items()}

    # ---- the tap, and the injection of faults

    def _tap(self, command: Command, *, stops: bool) -> None:
        now_s, height_m = self.drone.time_s, self.drone.body.altitude_m
        self.packets += command is not Command.HEARTBEAT
        self.sent.append((now_s, command))
        if (self._by_hand_since_s or math.inf) <= now_s and command in (Command.LAND, Command.FOLLOW, Command.TAKE_OFF):
            shown_s = None if self._shown_s is None else now_s - self._shown_s
            self.overridden.append(Overridden(now_s, command, now_s - (self._by_hand_since_s or now_s), shown_s))
        if stops:
            self.stops.append(MotorStop(now_s, height_m))
        if self.states.now is None or self.states.ended_s < now_s:
            return
        acting = [each for each in self.injected if each.begun_s <= now_s < each.ended_s]
        silent = [each.begun_s for each in acting if each.kind in SILENCING]
        self.states.receive(
            command,
            now_s,
            armed=self.drone.autopilot.armed,
            height_m=height_m,
            silent_since_s=min(silent) if silent else None,
        )

    def _update(self) -> None:
        """Update the state of the trial and inject the faults that are due."""
        now_s = self.drone.time_s
        if self.states.ended_s < now_s:
            return
        self.states.update_height(self.drone.body.altitude_m, now_s)
        if self.flew_on is None and self.states.now is State.RECORD:
            self.flew_on = self.held()
        for planned in tuple(self._waiting):
            since_s = self.states.first_s(planned.state)
            if since_s is not None and now_s >= since_s + planned.delay_s:
                self._waiting.remove(planned)
                self._inject(planned, now_s)

    def _inject(self, planned: PlannedFault, now_s: float) -> None:
        state = self.states.now
        if state is None:
            return
        lasts_s = BOOT_S if planned.kind == "reboot" else planned.duration_s
        self.injected.append(InjectedFault(planned.kind, state, now_s, now_s + lasts_s))
        match planned.kind:
            case str(kind) if kind in (ABORT, MOTORS_OFF):
                self.stop_request = StopRequest(
                    f"the operator's {kind}", motors_off=kind == MOTORS_OFF or self._is_stopping
                )
            case str(kind) if kind in (OTHER_MODE, OTHER_LANDING):
                self._interfere(_INTERFERENCE[kind, self.case.autopilot])
            case str(kind) if kind == OTHER_TARGET:
                self._interfere(self._other_target())
            case str(kind) if kind == OTHER_GAIN:
                name, value = _OTHER_GAINS[self.case.autopilot]
                fields: dict[str, FieldValue] = {
                    "target_component": 1,
                    "param_id": name,
                    "param_value": value,
                    "param_type": 9,
                }
                self._interfere(("PARAM_SET", fields))
            case str(kind) if kind == STALL:
                self.stalls_s += planned.duration_s
            case str(kind) if kind != WILD_GAINS:
                self.drone.inject_fault(kind, planned.duration_s)

    @property
    def _is_stopping(self) -> bool:
        return self.stop_request is not None and self.stop_request.motors_off

    def _other_target(self) -> tuple[str, Mapping[str, FieldValue]]:
        """Return a set point between those of the trial, on the vehicle's own datum."""
        if self.case.autopilot == "paparazzi":
            return "MISSION_ITEM", _WAYPOINT
        ground_m = 0.51 if self.case.autopilot == "px4" else 0.0
        return "SET_POSITION_TARGET_LOCAL_NED", {**_TARGET, "z": -(_OTHER_HEIGHT_M + ground_m)}

    def decide(self) -> StopRequest | None:
        """Return the operator's request, after the time for which the program's process stands still."""
        stalls_s, self.stalls_s = self.stalls_s, 0.0
        if stalls_s:
            self.wait_s(stalls_s)
        return self.stop_request

    def _interfere(self, message: tuple[str, Mapping[str, FieldValue]]) -> None:
        """Send a message to the drone from another ground station."""
        kind, fields = message
        target = {"target_system": self._kind.system}
        self.drone.receive(self._other.pack(DIALECTS[self.case.autopilot].message(kind, {**target, **fields})))


def _single(value: float) -> float:
    return float(struct.unpack("<f", struct.pack("<f", value))[0])
