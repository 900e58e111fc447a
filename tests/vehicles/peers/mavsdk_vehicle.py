"""An independent vehicle: MAVSDK's vehicle-side plugins with the simplest possible flight model.

On the wire it has PX4's modes, parameters and answers; all of it is MAVSDK's own. Time passes by its steps, twice as
fast as on the wall and slower on a busy machine: whoever flies it has the same clock.
"""

import json
import random
import threading
from collections.abc import Mapping
from itertools import count
from types import TracebackType
from typing import Any, Final, Self

from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action_server.action_server import ActionServer, AllowableFlightModes, FlightMode
from mavsdk.plugins.mavlink_direct_server.mavlink_direct_server import MavlinkDirectServer, MavlinkMessage
from mavsdk.plugins.param_server.param_server import ParamServer
from mavsdk.plugins.telemetry_server.telemetry_server import Battery, TelemetryServer

MAKE: Final = 0
"""MAVSDK says of itself that it is a generic autopilot."""
GAINS: Final[Mapping[str, float]] = {
    "MPC_Z_P": 1.0,
    "MPC_Z_VEL_P_ACC": 4.0,
    "MPC_Z_VEL_D_ACC": 0.0,
    "MPC_Z_VEL_I_ACC": 2.0,
}
FLOATS: Final[Mapping[str, float]] = {**GAINS, "MIS_TAKEOFF_ALT": 2.5, "GF_MAX_VER_DIST": 10.0}
INTEGERS: Final[Mapping[str, int]] = {"NAV_DLL_ACT": 3, "COM_DL_LOSS_T": 10, "GF_ACTION": 5}
GROUND_M: Final = 0.5
STEP_S: Final = 0.01
_WALL_STEP_S: Final = 0.005
"""With shorter ones MAVSDK's heartbeats, one a second, would be too rare."""
_UP_M_S: Final = 1.5
_DOWN_M_S: Final = 0.7
_BATTERY_EVERY: Final = 50
_BATTERY_V: Final = 12.3


_NOISE_M = 1e-4


class StepClock:
    """Advances by the vehicle's steps."""

    def __init__(self) -> None:
        self._steps = 0
        self._stepped = threading.Condition()

    def step(self) -> None:
        with self._stepped:
            self._steps += 1
            self._stepped.notify_all()

    def now_s(self) -> float:
        return self._steps * STEP_S

    def wait_s(self, seconds: float) -> None:
        until_s = self.now_s() + seconds
        with self._stepped:
            self._stepped.wait_for(lambda: self.now_s() >= until_s)

    def wall_s(self, seconds: float) -> float:
        """Who waits for something else looks again after a step."""
        return min(seconds, _WALL_STEP_S)


class MavsdkVehicle:
    """Speaks to a ground station's port until it is left. Its climb rate is MPC_Z_P times what is missing in altitude,
    between the two limits; the other gains are only kept."""

    def __init__(self, port: int, clock: StepClock, *, armable: bool = True) -> None:
        self._clock = clock
        self.altitude_m = GROUND_M
        self.flew_with: list[dict[str, float]] = []
        """The gains that it held at each takeoff."""
        self._climb_rate_m_s = 0.0
        self._mode = FlightMode.UNKNOWN
        self._leaving = threading.Event()
        self._mavsdk: Any = Mavsdk(Configuration.create_with_component_type(ComponentType.AUTOPILOT))
        self._mavsdk.add_any_connection(f"udpout://127.0.0.1:{port}")
        component = self._mavsdk.server_component(0)
        self._parameters: Any = ParamServer(component)
        for name, value in FLOATS.items():
            self._parameters.provide_param_float(name, value)
        for name, whole in INTEGERS.items():
            self._parameters.provide_param_int(name, whole)
        self._telemetry: Any = TelemetryServer(component)
        self._direct: Any = MavlinkDirectServer(component)
        self._actions: Any = ActionServer(component)
        self._actions.set_allowable_flight_modes(
            AllowableFlightModes(can_auto_takeoff_mode=True, can_auto_land_mode=True, can_auto_loiter_mode=True)
        )
        self._actions.set_armable(armable, False)
        self._actions.set_disarmable(True, False)
        self._actions.subscribe_flight_mode_change(self._change_mode)
        self._thread = threading.Thread(target=self._run)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._leaving.set()
        self._thread.join()
        self._mavsdk.destroy()

    @property
    def stands(self) -> bool:
        return self.altitude_m <= GROUND_M

    @property
    def gains(self) -> dict[str, float]:
        """As MAVSDK keeps them, whatever was said on the wire."""
        return {name: self._held(name) for name in GAINS}

    def _held(self, name: str) -> float:
        value: float = self._parameters.retrieve_param_float(name)
        return round(value, 6)

    def _change_mode(self, _result: object, mode: FlightMode, _user_data: object = None) -> None:
        if mode is FlightMode.TAKEOFF:
            self.flew_with.append(self.gains)
        self._mode = mode

    def _run(self) -> None:
        """A position for each step, with the step's time: MAVSDK would stamp it with this computer's. In the air it
        cannot be disarmed."""
        for step in count(1):
            if self._leaving.wait(_WALL_STEP_S):
                return
            self._move()
            self._clock.step()
            self._actions.set_disarmable(self.stands, False)
            self._tell_position(step * STEP_S)
            if step % _BATTERY_EVERY == 0:
                self._telemetry.publish_sys_status(Battery(_BATTERY_V, 90.0), True, True, True, True, True)

    def _tell_position(self, time_s: float) -> None:
        down_m = -self.altitude_m - _NOISE_M * random.random()  # never the same twice
        fields = {"time_boot_ms": round(1000 * time_s), "x": 0.0, "y": 0.0, "z": down_m}
        fields |= {"vx": 0.0, "vy": 0.0, "vz": -self._climb_rate_m_s}
        self._direct.send_message(MavlinkMessage("LOCAL_POSITION_NED", fields_json=json.dumps(fields)))

    def _move(self) -> None:
        match self._mode:
            case FlightMode.TAKEOFF | FlightMode.HOLD:
                missing_m = GROUND_M + self._held("MIS_TAKEOFF_ALT") - self.altitude_m
                self._climb_rate_m_s = min(max(self._held("MPC_Z_P") * missing_m, -_DOWN_M_S), _UP_M_S)
            case FlightMode.LAND if not self.stands:
                self._climb_rate_m_s = -_DOWN_M_S
            case _:
                self._climb_rate_m_s = 0.0
        self.altitude_m = max(self.altitude_m + self._climb_rate_m_s * STEP_S, GROUND_M)
