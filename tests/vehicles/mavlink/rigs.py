"""Simulated drones at the other end of a vehicle's link, whose own time is the time of both sides.

`LockstepRig` shares the thread of the test: every run is the same, and as quick as it can be computed. `UdpRig` has a
thread of its own behind real sockets and lives in real time, so many times over, for what has threads of its own on the
ground: after everything it says it waits, briefly, until these have looked at the clock, so that on a busy machine the
ground is not late by much.
"""

import struct
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Final, Self

import pytest

from app.autopilots.dialects import Message, number, text
from app.autopilots.registry import AUTOPILOTS
from app.autopilots.simulated.body import TICK_S, Make
from app.autopilots.simulated.copter import Copter
from app.core.policy import Gains
from app.simdrone.drone import Drone
from app.simdrone.motion_capture import open_outlet
from app.vehicles import registry as open_module
from app.vehicles.base import Identity, OptionValue
from app.vehicles.mavlink.addresses import Address, parse
from app.vehicles.mavlink.link import Link
from app.vehicles.mavlink.transports import Transport, open_transport
from app.vehicles.mavlink.vehicle import MavlinkVehicle
from app.vehicles.mavlink_kind import MAVLINK, open_source
from app.vehicles.mocap.addresses import parse as parse_source
from bench.lockstep import Lockstep
from tests.ports import free_port
from tests.simdrone.ground import switched_on
from tests.vehicles.mavlink.speaking import LOOPBACK

SAFE: Final[Mapping[str, Mapping[str, float]]] = {
    "paparazzi": {"kp": 283, "ki": 13, "kd": 82},
    "ardupilot": {"PSC_POSZ_P": 1.0, "PSC_VELZ_P": 5.0, "PSC_ACCZ_P": 0.5, "PSC_ACCZ_I": 1.0, "PSC_ACCZ_D": 0.0},
    "px4": {"MPC_Z_P": 1.0, "MPC_Z_VEL_P_ACC": 4.0, "MPC_Z_VEL_I_ACC": 2.0, "MPC_Z_VEL_D_ACC": 0.0},
}
_TICKS_AT_ONCE: Final = 8
_STANDS_AT_MOST_S: Final = 0.5
"""On the wall: how long the drone's time stands for threads of the ground side that have not looked at the clock since
its last messages. Then it goes on without them, for one that has nothing to hear does not look. Its own time cannot
bound this, for it stands meanwhile; no test fails by it."""
_SPEED: Final = 8.0
_BYTEWISE: Final = 6
_FAILSAFES: Final[Mapping[str, Sequence[tuple[str, int, int]]]] = {
    "ardupilot": (("FS_GCS_ENABLE", 2, 5), ("FENCE_ENABLE", 2, 1), ("FENCE_ACTION", 2, 2), ("FENCE_ALT_MAX", 9, 10)),
    "px4": (
        ("NAV_DLL_ACT", _BYTEWISE, 3),
        ("GF_ACTION", _BYTEWISE, 5),
        ("GF_MAX_VER_DIST", 9, 10),
        ("COM_OBL_RC_ACT", _BYTEWISE, 4),
    ),
}
"""Name, MAVLink's type, value."""


class _Heard:
    """What reached a drone, with its time."""

    def __init__(self, autopilot: str) -> None:
        self.autopilot = autopilot
        self.heard: list[tuple[float, Message]] = []
        self._codec = AUTOPILOTS[autopilot].dialect.codec(system=1, component=1)

    def told(self, *kinds: str) -> list[Message]:
        return [message for _, message in self.heard if message.get_type() in kinds]

    @property
    def writes(self) -> list[str]:
        """Parameters in the order in which they were written."""
        return [text(message, "param_id") for message in self.told("PARAM_SET")]


def copter_of(drone: Drone) -> Copter:
    """The drone's autopilot, which must be ArduPilot's or PX4's."""
    assert isinstance(drone.autopilot, Copter)
    return drone.autopilot


class LockstepRig(Lockstep, _Heard):
    """`heard` is everything that reached the drone, with the drone's time."""

    def __init__(
        self,
        autopilot: str = "paparazzi",
        faults: Sequence[str] = (),
        *,
        release: str = "",
        make: Make | None = None,
        body: Mapping[str, OptionValue] | None = None,
        mocap: str = "",
    ) -> None:
        self._outlet = open_outlet(parse_source(mocap)) if mocap else None
        options = {"scatter": 0.0, **(body or {})}
        drone = switched_on(release or autopilot, options=options, faults=faults, outlet=self._outlet, make=make)
        Lockstep.__init__(self, drone)
        _Heard.__init__(self, autopilot)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._outlet is not None:
            self._outlet.close()

    def write(self, data: bytes) -> bool:
        self.heard += [(self.drone.time_s, message) for message in self._codec.parse(data)]
        return super().write(data)

    # ---- the ground side

    def options(self, **options: OptionValue) -> dict[str, OptionValue]:
        return MAVLINK.check({"autopilot": self.autopilot, "simulated": True, **options}, field="options")

    def link(self, target_system: int | None = None) -> Link:
        """As another ground station has it."""
        address, dialect = parse(str(self.options()["address"])), AUTOPILOTS[self.autopilot].dialect
        return Link(address, dialect, clock=self, target_system=target_system, transport=self)

    def switch_on_failsafes(self) -> None:
        """As a person does with another ground station before the first flight."""
        with closing(self.link()) as link:
            while link._vehicle_system is None:
                link.receive(0.1)
            for name, kind, value in _FAILSAFES[self.autopilot]:
                whole = struct.unpack("<f", struct.pack("<i", value))[0] if kind == _BYTEWISE else float(value)
                whom = {"target_system": 1, "target_component": 0}
                link.send("PARAM_SET", **whom, param_id=name, param_type=kind, param_value=whole)
            self.wait_s(TICK_S)

    def change_last_parameter(self) -> None:
        """As another ground station does, to the parameter that was written last."""
        last = self.told("PARAM_SET")[-1]
        whole = {name: int(number(last, name)) for name in ("target_system", "target_component", "param_type")}
        changed = number(last, "param_value") + 1.0
        with closing(self.link()) as other:
            other.send("PARAM_SET", **whole, param_id=text(last, "param_id"), param_value=changed)

    def take_the_place_of_every_vehicle(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Whoever opens a vehicle over MAVLink is given this one, with the options asked for."""
        kind = replace(MAVLINK, open=self._open)
        monkeypatch.setattr(open_module, "VEHICLE_KINDS", {**open_module.VEHICLE_KINDS, kind.name: kind})

    def _open(
        self, options: Mapping[str, OptionValue], safe_gains: Gains, trial_parameters: Path | None
    ) -> MavlinkVehicle:
        return self.vehicle(safe_gains, trial_parameters=trial_parameters, **options)

    def vehicle(
        self, safe_gains: Gains | None = None, *, trial_parameters: Path | None = None, **options: OptionValue
    ) -> MavlinkVehicle:
        safe = SAFE[self.autopilot] if safe_gains is None else safe_gains
        chosen = self.options(**options)
        place = str(chosen["second_source"])
        source = open_source(place, self) if place else None
        return MavlinkVehicle(
            chosen,
            safe,
            is_real=False,
            clock=self,
            trial_parameters=trial_parameters,
            source=source,
            transport=self,
        )

    def connected(self, identity: Identity, trial_parameters: Path, **options: OptionValue) -> MavlinkVehicle:
        """As the fleet connects a vehicle that it knows."""
        return MavlinkVehicle(
            self.options(**options),
            SAFE[self.autopilot],
            is_real=False,
            clock=self,
            identity=identity,
            observes=True,
            trial_parameters=trial_parameters,
            transport=self,
        )


class UdpRig(_Heard):
    """The same behind a socket. `speed` is its time's, unless the machine is busy: only a ground in this process waits
    with it."""

    def __init__(
        self, autopilot: str = "paparazzi", faults: Sequence[str] = (), *, mocap: str = "", speed: float = _SPEED
    ) -> None:
        super().__init__(autopilot)
        self.speed = speed
        self._outlet = open_outlet(parse_source(mocap)) if mocap else None
        self.drone = switched_on(autopilot, options={"scatter": 0.0}, faults=faults, outlet=self._outlet)
        self._ports = free_port(), free_port()
        self._transport: Transport = open_transport(Address("udp", LOOPBACK, self._ports[0], self._ports[1]))
        self.problem: BaseException | None = None
        self._lookers: dict[threading.Thread, bool] = {}
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
        if self._outlet is not None:
            self._outlet.close()
        if self.problem is not None and error is None:
            raise self.problem

    # ---- the clock of both sides

    def now_s(self) -> float:
        self._lookers[threading.current_thread()] = True
        if self.problem is not None:
            raise RuntimeError("the simulated drone broke down") from self.problem
        return self.drone.time_s

    def wait_s(self, seconds: float) -> None:
        time.sleep(max(self.wall_s(seconds), 0.0))

    def wall_s(self, seconds: float) -> float:
        return seconds / self.speed

    # ---- the ground side

    def options(self, **options: OptionValue) -> dict[str, OptionValue]:
        address = str(Address("udp", LOOPBACK, self._ports[1], self._ports[0]))
        chosen = {"autopilot": self.autopilot, "address": address, "simulated": True, **options}
        return MAVLINK.check(chosen, field="options")

    def vehicle(self, **options: OptionValue) -> MavlinkVehicle:
        chosen = self.options(**options)
        place = str(chosen["second_source"])
        source = open_source(place, self) if place else None
        return MavlinkVehicle(chosen, SAFE[self.autopilot], is_real=False, clock=self, source=source)

    def switch_on_failsafes(self) -> None:
        """Before its thread starts."""
        for name, _, value in _FAILSAFES[self.autopilot]:
            copter_of(self.drone).parameters[name] = float(value)

    # ---- the drone's thread

    def _run(self) -> None:
        try:
            while not self._stopping.is_set():
                for data, _ in self._transport.read(0.0):
                    self.heard += [(self.drone.time_s, message) for message in self._codec.parse(data)]
                    self.drone.receive(data)
                frames = [frame for _ in range(_TICKS_AT_ONCE) for frame in self.drone.tick()]
                for looker in tuple(self._lookers):
                    self._lookers[looker] = False
                for frame in frames:
                    self._transport.write(frame)
                time.sleep(_TICKS_AT_ONCE * TICK_S / self.speed)
                if frames:
                    self._wait_for_lookers()
        except BaseException as error:  # noqa: BLE001 - told by the other thread
            self.problem = error

    def _wait_for_lookers(self) -> None:
        until_s = time.monotonic() + _STANDS_AT_MOST_S
        while time.monotonic() < until_s and not all(
            looked or not thread.is_alive() for thread, looked in tuple(self._lookers.items())
        ):
            time.sleep(0.0002)
