"""Simulated PX4.

Its altitude controller is a simplified cascade with PX4's gains, not a replica; see copter_control.py.
"""

import math
import struct
from types import MappingProxyType
from typing import ClassVar, Final

from app.simdrone.body import ACCEPTED, TEMPORARILY_REJECTED, Body, OutgoingMessage
from app.simdrone.copter import Copter
from app.simdrone.copter_control import Phase, TwoStage
from app.simdrone.copter_parameters import (
    BYTEWISE,
    Behaviour,
    FirmwareProfile,
    FlightMode,
    Kind,
    Parameter,
    Reaction,
    real,
)
from app.simdrone.copter_telemetry import HOME_AMSL_M
from app.vehicles.mavlink.arming_checks import ARMING_CHECK_SUMMARY, HEALTH_SUMMARY
from app.vehicles.mavlink.dialects import COMMON

_MANUAL: Final = 1 | 16 | 64
_AUTO: Final = 1 | 4 | 8 | 16
_TAKEOFF: Final = "AUTO.TAKEOFF"
_CLIMBED_WITHIN_M: Final = 0.8
"""NAV_MC_ALT_RAD: a takeoff has arrived this far from its height."""
_NO_POSITION: Final = 1 << 24 | 13835193
"""Event check_modes_local_pos of the autopilot."""
_LOCAL_POSITION: Final = 17
"""Component of the check, a bit of health_component_t."""
_ALL_MODES: Final = 0xFFFFFFFF
_ARMING_MODES: Final = _ALL_MODES & ~(1 << 18)
"""All modes except landing."""
_PROTOCOL: Final = 0x88
_ERROR: Final = 0x33
"""Internal and external log levels of an event."""
_ARGUMENTS: Final = 40
_SEQUENCE_NUMBERS: Final = 1 << 16
_LINK_ACTIONS: Final = {0: Reaction.NONE, 1: Reaction.HOLD}
_FENCE_ACTIONS: Final = {0: Reaction.NONE, 1: Reaction.WARN, 2: Reaction.HOLD}


def custom_mode(main: int, sub: int = 0) -> int:
    """Return the mode as in HEARTBEAT."""
    return main << 16 | sub << 24


class Px4(Copter):
    """PX4. Return-to-launch and termination only land, because the vehicle does not move horizontally."""

    firmware: ClassVar[FirmwareProfile] = FirmwareProfile(
        dialect=COMMON,
        autopilot=12,
        version=0x011000FF,
        parameters=(
            real("MPC_Z_P", 1.0),
            real("MPC_Z_VEL_P_ACC", 4.0),
            real("MPC_Z_VEL_I_ACC", 2.0),
            real("MPC_Z_VEL_D_ACC", 0.0),
            real("MPC_TKO_SPEED", 1.5),
            real("MPC_LAND_SPEED", 0.7),
            real("MIS_TAKEOFF_ALT", 2.5),
            Parameter("NAV_DLL_ACT", Kind.INT32, 0),
            Parameter("COM_DL_LOSS_T", Kind.INT32, 10),
            real("COM_DISARM_PRFLT", 10.0),
            Parameter("GF_ACTION", Kind.INT32, 2),
            real("GF_MAX_VER_DIST", 0.0),
            real("GF_MAX_HOR_DIST", 0.0),
            Parameter("MAV_SYS_ID", Kind.INT32, 1),
            Parameter("SYS_AUTOSTART", Kind.INT32, 4001),
        ),
        coding=BYTEWISE,
        periods_s=MappingProxyType(
            {
                "HEARTBEAT": 1.0,
                "LOCAL_POSITION_NED": 0.02,
                "GLOBAL_POSITION_INT": 0.02,
                "ATTITUDE": 0.02,
                "VFR_HUD": 0.05,
                "SYS_STATUS": 0.2,
                "GPS_RAW_INT": 0.2,
                "EXTENDED_SYS_STATE": 0.2,
                "BATTERY_STATUS": 0.5,
                "SYSTEM_TIME": 1.0,
                "HOME_POSITION": 2.0,
            }
        ),
        streams=(),
        modes=(
            FlightMode("POSCTL", custom_mode(3), _MANUAL),
            FlightMode("MANUAL", custom_mode(1), _MANUAL),
            FlightMode("ALTCTL", custom_mode(2), _MANUAL),
            FlightMode(_TAKEOFF, custom_mode(4, 2), _AUTO, Behaviour.TAKE_OFF),
            FlightMode("AUTO.LOITER", custom_mode(4, 3), _AUTO),
            FlightMode("AUTO.RTL", custom_mode(4, 5), _AUTO, Behaviour.LAND),
            FlightMode("AUTO.LAND", custom_mode(4, 6), _AUTO, Behaviour.LAND, may_arm=False),
        ),
        land="AUTO.LAND",
        hold="AUTO.LOITER",
        by_hand="POSCTL",
        automatic="AUTO.LOITER",
        refused=TEMPORARILY_REJECTED,
        unready="Preflight Fail: ",
        no_estimate="Arming denied: resolve system health failures first",
        not_armable="Arming denied: Mode not suitable for takeoff",
        not_landed="Disarming denied: not landed",
        link_lost="GCS connection lost",
        fence_breached="Geofence violated: maximum altitude exceeded",
        ground_m=0.51,
    )

    def __init__(self, body: Body, *, system: int) -> None:
        self._cascade = TwoStage()
        super().__init__(body, self._cascade, system=system)
        self._events = 0
        self._reported_failing: bool | None = None

    def tick(self) -> list[OutgoingMessage]:
        """Advance by one tick. At its takeoff height it switches to hold, and also once it has landed and disarmed. If
        Land is commanded after that, it stays in the landing mode, and does not arm."""
        was_armed = self.armed
        messages = super().tick()
        if self._is_failing != self._reported_failing:
            self._send_check_events()
        if was_armed and not self.armed and self.mode.behaviour is Behaviour.LAND:
            self.mode = self.find_mode(self.firmware.hold)
        if self.mode.name == _TAKEOFF and self.flyer.phase is Phase.HOLDING and self.flyer.left_m < _CLIMBED_WITHIN_M:
            self.mode = self.find_mode(self.firmware.hold)
        return messages

    def prearm_failure(self) -> str | None:
        """Return why it cannot be armed, including the mode."""
        return self.arming_refusal()

    def report_checks(self) -> None:
        super().report_checks()
        self._send_check_events()

    @property
    def _is_failing(self) -> bool:
        """Whether it has no position estimate, which prevents arming in every mode."""
        return Copter.prearm_failure(self) is not None

    def _send_check_events(self) -> None:
        """Send the results of its arming checks as events, in the order of the events interface."""
        failing = self._reported_failing = self._is_failing
        self._send_event(
            ARMING_CHECK_SUMMARY,
            *(0, 1 << _LOCAL_POSITION if failing else 0, 0),
            *((0, 0) if failing else (_ARMING_MODES, _ARMING_MODES)),
            layout="<BIIII",
        )
        if failing:
            self._send_event(_NO_POSITION, _ALL_MODES, _LOCAL_POSITION, layout="<IB", levels=_ERROR)
        self._send_event(HEALTH_SUMMARY, 0, 0, 0, 0, layout="<BIII")

    def _send_event(self, number: int, *arguments: int, layout: str, levels: int = _PROTOCOL) -> None:
        """Send an event as a broadcast."""
        packed = struct.pack(layout, *arguments)
        self._out.append(
            OutgoingMessage(
                "EVENT",
                {
                    "id": number,
                    "event_time_boot_ms": int(self.boot_s * 1000.0),
                    "sequence": self._events % _SEQUENCE_NUMBERS,
                    "destination_component": 0,
                    "destination_system": 0,
                    "log_levels": levels,
                    "arguments": packed.ljust(_ARGUMENTS, b"\0"),
                },
            )
        )
        self._events += 1

    def tune(self) -> None:
        cascade = self._cascade
        cascade.altitude_p = self.parameters["MPC_Z_P"]
        cascade.climb_p = self.parameters["MPC_Z_VEL_P_ACC"]
        cascade.climb_i = self.parameters["MPC_Z_VEL_I_ACC"]
        cascade.climb_d = self.parameters["MPC_Z_VEL_D_ACC"]

    def requested_mode(self, main: int, sub: int) -> FlightMode | None:
        wanted = custom_mode(max(main, 0), max(sub, 0))
        return next((mode for mode in self.firmware.modes if mode.custom_mode == wanted), None)

    def take_off(self, param7: float) -> int:
        """Take off to `param7` metres above sea level, or, if it is not finite, to MIS_TAKEOFF_ALT above the place of
        takeoff. A disarmed vehicle takes off when it is armed."""
        self.mode = self.find_mode(_TAKEOFF)
        height_m = param7 - HOME_AMSL_M if math.isfinite(param7) else self.parameters["MIS_TAKEOFF_ALT"]
        if height_m <= 0.0:
            self.send_text("Already higher than takeoff altitude")
        elif self.armed and not self.flyer.flies:
            self.climb(height_m, self.parameters["MPC_TKO_SPEED"])
        return ACCEPTED

    def landing_speed_m_s(self) -> float:
        return self.parameters["MPC_LAND_SPEED"]

    def link_loss(self) -> tuple[float, Reaction]:
        return self.parameters["COM_DL_LOSS_T"], _LINK_ACTIONS.get(int(self.parameters["NAV_DLL_ACT"]), Reaction.LAND)

    def fence(self) -> tuple[float, Reaction]:
        """Return limit and reaction of the altitude fence; a distance of 0 disables it."""
        limit_m = self.parameters["GF_MAX_VER_DIST"]
        if limit_m <= 0.0:
            return math.inf, Reaction.NONE
        return limit_m, _FENCE_ACTIONS.get(int(self.parameters["GF_ACTION"]), Reaction.LAND)

    def idle_limit_s(self) -> float:
        return self.parameters["COM_DISARM_PRFLT"]
