"""A simulated drone in lockstep with its ground side, a tap on the wire between them, and mishaps when they are due."""

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from app.simdrone.body import new_body
from app.simdrone.drone import BOOT_S, Drone, Lockstep
from app.simdrone.motion_capture import VehicleLinkOutput
from app.simdrone.registry import get_autopilot
from app.vehicles.base import OptionValue, StopRequest
from app.vehicles.mavlink.dialects import FieldValue
from app.vehicles.mavlink_kind import MAVLINK
from bench.hazards.cases import ABORT, MOTORS_OFF, OTHER_LANDING, OTHER_MODE, WILD_GAINS, Case, Mishap
from bench.hazards.stages import Stage, Stages
from bench.hazards.wire import DIALECTS, GAINS, Order, order, stops_motors

SILENCING: Final = frozenset({"link-lost", "wrong-system", "no-heartbeat", "reboot"})
_LONGEST_S: Final = 400.0
"""Of the drone's time: nothing that a trial may wait for takes as long."""
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
"""Failsafe, altitude hold, position control; and how each lands."""


@dataclass(frozen=True, slots=True)
class Struck:
    """A mishap that set in, and where the trial was then."""

    kind: str
    stage: Stage
    begun_s: float
    ended_s: float


@dataclass(frozen=True, slots=True)
class Stopping:
    """A packet that stops motors, and the true height over the ground at which it came."""

    at_s: float
    height_m: float


class Rig(Lockstep):
    """One drone for one case."""

    def __init__(self, case: Case) -> None:
        self.case = case
        self.stages = Stages()
        self.struck: list[Struck] = []
        self.sent: list[tuple[float, Order]] = []
        self.stops: list[Stopping] = []
        self.heard: int = 0
        self.flew_on: Mapping[str, float] | None = None
        self.impact_m_s = 0.0
        self.wanted: StopRequest | None = None
        self._waiting = list(case.mishaps)
        self._kind = get_autopilot(case.autopilot)
        body = new_body("twin", {}, seed=case.seed % 100_000)
        outlet = VehicleLinkOutput() if case.has_second_source else None
        super().__init__(Drone(body, lambda fresh: self._kind.set_up(fresh, self._kind.system), outlet=outlet))
        self._codec = DIALECTS[case.autopilot].codec(system=1, component=1)
        self._other = DIALECTS[case.autopilot].codec(system=_OTHER_STATION, component=1)

    def tick(self) -> None:
        """Raises TimeoutError when nothing that a trial may wait for takes as long."""
        super().tick()
        if 0.0 < self.drone.body.altitude_m < _NEAR_GROUND_M:
            self.impact_m_s = max(self.impact_m_s, -self.drone.body.climb_rate_m_s)
        self._watch()
        if self.drone.time_s > _LONGEST_S:
            raise TimeoutError(f"the trial was not over after {_LONGEST_S:g} s")

    def write(self, data: bytes) -> bool:
        for message in self._codec.parse(data):
            self._tap(order(self.case.autopilot, message), stops=stops_motors(self.case.autopilot, message))
        return super().write(data)

    # ---- what the ground is given, and what is true

    def options(self) -> dict[str, OptionValue]:
        chosen: dict[str, OptionValue] = {"autopilot": self.case.autopilot, "simulated": True}
        return MAVLINK.check(chosen | {"system_id": self._kind.system if self.case.pinned else 0}, field="options")

    def held(self) -> dict[str, float]:
        """The gains that the vehicle truly holds."""
        names = GAINS[self.case.autopilot]
        return {gain: self.drone.autopilot.held(parameter) for gain, parameter in names.items()}

    def holds(self, gains: Mapping[str, float]) -> bool:
        return self.held() == {gain: _single(value) for gain, value in gains.items()}

    # ---- the wire, and what is due

    def _tap(self, told: Order, *, stops: bool) -> None:
        now_s, height_m = self.drone.time_s, self.drone.body.altitude_m
        self.heard += told is not Order.HEARTBEAT
        self.sent.append((now_s, told))
        if stops:
            self.stops.append(Stopping(now_s, height_m))
        if self.stages.now is None or self.stages.over_s < now_s:
            return
        acting = [each for each in self.struck if each.begun_s <= now_s < each.ended_s]
        silent = [each.begun_s for each in acting if each.kind in SILENCING]
        self.stages.hear(
            told,
            now_s,
            armed=self.drone.autopilot.armed,
            height_m=height_m,
            silent_since_s=min(silent) if silent else None,
        )

    def _watch(self) -> None:
        """What is due now."""
        now_s = self.drone.time_s
        if self.stages.over_s < now_s:
            return
        self.stages.height(self.drone.body.altitude_m, now_s)
        if self.flew_on is None and self.stages.now is Stage.RECORD:
            self.flew_on = self.held()
        for mishap in tuple(self._waiting):
            since_s = self.stages.first_s(mishap.stage)
            if since_s is not None and now_s >= since_s + mishap.delay_s:
                self._waiting.remove(mishap)
                self._strike(mishap, now_s)

    def _strike(self, mishap: Mishap, now_s: float) -> None:
        stage = self.stages.now
        if stage is None:
            return
        lasts_s = BOOT_S if mishap.kind == "reboot" else mishap.duration_s
        self.struck.append(Struck(mishap.kind, stage, now_s, now_s + lasts_s))
        match mishap.kind:
            case str(kind) if kind in (ABORT, MOTORS_OFF):
                self.wanted = StopRequest(f"the operator's {kind}", motors_off=kind == MOTORS_OFF or self._is_stopping)
            case str(kind) if kind in (OTHER_MODE, OTHER_LANDING):
                self._interfere(_INTERFERENCE[kind, self.case.autopilot])
            case str(kind) if kind != WILD_GAINS:
                self.drone.inject_fault(kind, mishap.duration_s)

    @property
    def _is_stopping(self) -> bool:
        return self.wanted is not None and self.wanted.motors_off

    def _interfere(self, message: tuple[str, Mapping[str, FieldValue]]) -> None:
        """Another ground station speaks to the drone."""
        kind, fields = message
        target = {"target_system": self._kind.system}
        self.drone.receive(self._other.pack(DIALECTS[self.case.autopilot].message(kind, {**target, **fields})))


def _single(value: float) -> float:
    return float(struct.unpack("<f", struct.pack("<f", value))[0])
