"""A simulated drone at the other end of real sockets, whose own time is the time of both sides, and a tap on the wire.

After each few milliseconds of its time the drone waits until the ground's threads have looked at the clock: however
busy the machine is, the ground is not late by more than that, and the drone flies as fast as the machine can.
"""

import socket
import struct
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from types import TracebackType
from typing import Final, Self

from app.vehicles.base import OptionValue, Stop
from app.vehicles.mavlink.addresses import UdpAddress
from app.vehicles.mavlink.dialects import FieldValue
from app.vehicles.mavlink.kind import MAVLINK
from app.vehicles.mavlink.transports import open_transport
from app.vehicles.simdrone.autopilots.registry import get_autopilot
from app.vehicles.simdrone.body import new_body
from app.vehicles.simdrone.cameras import OwnLink
from app.vehicles.simdrone.drone import BOOT_S, Drone
from bench.hazards.cases import ABORT, MOTORS_OFF, OTHER_LANDING, OTHER_MODE, WILD_GAINS, Case, Mishap
from bench.hazards.stages import Stage, Stages
from bench.hazards.wire import DIALECTS, GAINS, Order, order, stops_motors

LOOPBACK: Final = "127.0.0.1"
SILENCING: Final = frozenset({"link-lost", "wrong-system", "no-heartbeat", "reboot"})
_TICKS_AT_ONCE: Final = 2
_PATIENCE_S: Final = 0.5
"""On the wall, for the ground to look at the clock."""
_SHORTEST_WAIT_S: Final = 0.001
_LONGEST_S: Final = 400.0
"""Of the drone's time: nothing that a trial may wait for takes as long."""
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


class Rig:
    """One drone for one case. The clock of both sides, in seconds of the drone's time."""

    def __init__(self, case: Case) -> None:
        self.case = case
        self.stages = Stages()
        self.struck: list[Struck] = []
        self.stops: list[Stopping] = []
        self.heard: int = 0
        self.flew_on: Mapping[str, float] | None = None
        self.wanted: Stop | None = None
        self.problem: BaseException | None = None
        self._waiting = list(case.mishaps)
        self._kind = get_autopilot(case.autopilot)
        self._outlet = OwnLink() if case.has_second_source else None
        body = new_body("twin", {}, seed=case.seed % 100_000)
        self.drone = Drone(body, lambda fresh: self._kind.set_up(fresh, self._kind.system), outlet=self._outlet)
        self._ports = _free_port(), _free_port()
        self._transport = open_transport(UdpAddress(LOOPBACK, self._ports[0], self._ports[1]))
        self._codec = DIALECTS[case.autopilot].codec(system=1, component=1)
        self._other = DIALECTS[case.autopilot].codec(system=_OTHER_STATION, component=1)
        self._pilot = threading.current_thread()
        self._looked: dict[threading.Thread, bool] = {}
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stopping.set()
        self._thread.join()
        self._transport.close()

    # ---- the clock of both sides

    def now_s(self) -> float:
        self._looked[threading.current_thread()] = True
        return self.drone.time_s

    def wait_s(self, seconds: float) -> None:
        until_s = self.now_s() + seconds
        while self.now_s() < until_s and self.problem is None:
            time.sleep(_SHORTEST_WAIT_S)

    def wall_s(self, seconds: float) -> float:
        """Short, for only looking at the clock lets the drone's time pass."""
        return min(seconds, _SHORTEST_WAIT_S)

    # ---- what the ground is given, and what is true

    def options(self) -> dict[str, OptionValue]:
        address = str(UdpAddress(LOOPBACK, self._ports[1], self._ports[0]))
        chosen: dict[str, OptionValue] = {"autopilot": self.case.autopilot, "address": address, "simulated": True}
        return MAVLINK.check(chosen | {"system_id": self._kind.system if self.case.pinned else 0}, field="options")

    def held(self) -> dict[str, float]:
        """The gains that the vehicle truly holds."""
        names = GAINS[self.case.autopilot]
        return {gain: self.drone.autopilot.held(parameter) for gain, parameter in names.items()}

    def holds(self, gains: Mapping[str, float]) -> bool:
        return self.held() == {gain: _single(value) for gain, value in gains.items()}

    # ---- the drone's thread

    def _run(self) -> None:
        try:
            while not self._stopping.is_set():
                self._hear()
                frames = [frame for _ in range(_TICKS_AT_ONCE) for frame in self.drone.tick()]
                self._watch()
                for thread in tuple(self._looked):
                    self._looked[thread] = False
                for frame in frames:
                    self._transport.write(frame)
                self._wait_for_ground(everybody=bool(frames))
        except BaseException as error:  # noqa: BLE001 - told by the other thread
            self.problem = error

    def _hear(self) -> None:
        for data, _ in self._transport.read(0.0):
            for message in self._codec.parse(data):
                self._tap(order(self.case.autopilot, message), stops=stops_motors(self.case.autopilot, message))
            self.drone.receive(data)

    def _tap(self, told: Order, *, stops: bool) -> None:
        now_s, height_m = self.drone.time_s, self.drone.body.altitude_m
        self.heard += told is not Order.HEARTBEAT
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
        if now_s > _LONGEST_S:
            raise TimeoutError(f"the trial was not over after {_LONGEST_S:g} s")
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
                self.wanted = Stop(f"the operator's {kind}", motors_off=kind == MOTORS_OFF or self._is_stopping)
            case str(kind) if kind in (OTHER_MODE, OTHER_LANDING):
                self._interfere(_INTERFERENCE[kind, self.case.autopilot])
            case str(kind) if kind != WILD_GAINS:
                self.drone.afflict(kind, mishap.duration_s)

    @property
    def _is_stopping(self) -> bool:
        return self.wanted is not None and self.wanted.motors_off

    def _interfere(self, message: tuple[str, Mapping[str, FieldValue]]) -> None:
        """Another ground station speaks to the drone."""
        kind, fields = message
        target = {"target_system": self._kind.system}
        self.drone.receive(self._other.pack(DIALECTS[self.case.autopilot].message(kind, {**target, **fields})))

    def _wait_for_ground(self, *, everybody: bool) -> None:
        """The thread that flies must look at the clock; those that listen too, when there was something to hear."""
        until_s = time.monotonic() + _PATIENCE_S
        while time.monotonic() < until_s and not self._stopping.is_set():
            late = [
                thread
                for thread, looked in tuple(self._looked.items())
                if not looked and thread.is_alive() and (everybody or thread is self._pilot)
            ]
            if not late:
                return
            time.sleep(0.0001)


def _single(value: float) -> float:
    return float(struct.unpack("<f", struct.pack("<f", value))[0])


def _free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((LOOPBACK, 0))
        port: int = probe.getsockname()[1]
        return port
