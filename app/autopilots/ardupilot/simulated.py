"""Simulated ArduCopter, up to 4.6 and from 4.7 on, in which the vertical gains have other names.

Its altitude is controlled by the replica of ArduCopter's vertical loop; see simulated_control.py. GUIDED has the
takeoff and targets of position; the S-curves of GUID_OPTIONS bit 6 and targets of speed or acceleration are missing.
"""

import contextlib
import math
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import ClassVar, Final

from app.autopilots.ardupilot.replica import parameters as loop
from app.autopilots.ardupilot.simulated_control import LOOP_HZ, ArduPilotController
from app.autopilots.dialects import ARDUPILOTMEGA, Message
from app.autopilots.simulated.body import ACCEPTED, FAILED, Body, OutgoingMessage
from app.autopilots.simulated.copter import Copter, copter_kind
from app.autopilots.simulated.copter_control import SetPoint
from app.autopilots.simulated.copter_parameters import (
    Behaviour,
    FirmwareProfile,
    FlightMode,
    Kind,
    Parameter,
    Reaction,
    read_parameters,
    real,
)
from app.core.errors import InputError

_MANUAL: Final = 1 | 16 | 64
_GUIDED: Final = 1 | 8 | 16
_REPORT_ONLY: Final = 0
_ALTITUDE_FENCE: Final = 1
_SLOWEST_LANDING_CM_S: Final = 10.0

_POSITION_ONLY: Final = 0b000111111000
_POSITION_BITS: Final = 0b000111111111
"""The bits of POSITION_TARGET_TYPEMASK for position, velocity and acceleration."""
_HOVER_THROTTLE: Final = 0.55
"""MOT_THST_HOVER as set up, somewhat too low: these vehicles hover at 0.61 to 0.63, and learn it."""

_COMMON: Final = (
    *read_parameters(Path(__file__).parent / "simulated_parameters.csv"),
    Parameter(loop.LOOP_RATE, Kind.INT16, LOOP_HZ),
    real(loop.ACCELEROMETER_FILTER, loop.ACCELEROMETER_FILTER_HZ),
)
_DEFAULTS: Final = loop.Parameters(hover_throttle=_HOVER_THROTTLE).named | dict.fromkeys(loop.UNSUPPORTED, 0.0)
"""Parameters of the vertical loop, by their names until 4.6, with the firmware's defaults."""

_GROUND_STATION: Final = "SYSID_MYGCS"
_GROUND_STATION_4_7: Final = "MAV_GCS_SYSID"


class ArduPilot(Copter):
    """ArduCopter up to 4.6. Return-to-launch only lands, because the vehicle does not move horizontally."""

    firmware: ClassVar[FirmwareProfile] = FirmwareProfile(
        dialect=ARDUPILOTMEGA,
        autopilot=3,
        version=0x040600FF,
        parameters=(
            Parameter("SYSID_THISMAV", Kind.INT16, 1),
            Parameter(_GROUND_STATION, Kind.INT16, 255),
            *_COMMON,
            *(real(name, value) for name, value in _DEFAULTS.items()),
        ),
        periods_s=MappingProxyType({"HEARTBEAT": 1.0}),
        streams=(
            "LOCAL_POSITION_NED",
            "GLOBAL_POSITION_INT",
            "ATTITUDE",
            "VFR_HUD",
            "SYS_STATUS",
            "GPS_RAW_INT",
            "BATTERY_STATUS",
            "SYSTEM_TIME",
        ),
        modes=(
            FlightMode("STABILIZE", 0, _MANUAL),
            FlightMode("ALT_HOLD", 2, _MANUAL),
            FlightMode("GUIDED", 4, _GUIDED),
            FlightMode("LOITER", 5, _GUIDED),
            FlightMode("RTL", 6, _GUIDED, Behaviour.LAND, may_arm=False),
            FlightMode("LAND", 9, _GUIDED, Behaviour.LAND, may_arm=False),
            FlightMode("BRAKE", 17, _GUIDED, may_arm=False),
        ),
        land="LAND",
        home="RTL",
        hold="BRAKE",
        by_hand="ALT_HOLD",
        automatic="GUIDED",
        refused=FAILED,
        unready="Pre",
        no_estimate="Arm: Need Position Estimate",
        not_armable="Arm: Mode not armable",
        not_landed="Disarm: not landed",
        link_lost="GCS Failsafe",
        fence_breached="Max Alt fence breached",
        idle_limit="DISARM_DELAY",
        ground_m=0.0,
    )
    ground_station: ClassVar[str] = _GROUND_STATION
    integral_gain: ClassVar[str] = "PSC_ACCZ_I"

    controller: ArduPilotController

    def __init__(self, body: Body, system: int) -> None:
        super().__init__(body, ArduPilotController(body), system=system)

    def tune(self) -> None:
        """Pass the parameters to the loop. With values for which it is not defined, it keeps those it had."""
        values = dict(loop.in_older_names(name, value) for name, value in self.parameters.values().items())
        with contextlib.suppress(InputError):
            self.controller.tune(
                loop.parameters_from(values),
                accelerometer_hz=values[loop.ACCELEROMETER_FILTER],
                spool_s=values["MOT_SPOOL_TIME"],
                land_m_s=max(values["LAND_SPEED"], _SLOWEST_LANDING_CM_S) / 100.0,
            )

    def tick(self) -> list[OutgoingMessage]:
        messages = super().tick()
        if self.parameters["MOT_HOVER_LEARN"] and (hover := self.controller.learned_hover()) is not None:
            self.parameters["MOT_THST_HOVER"] = hover
        return messages

    def prearm_failure(self) -> str | None:
        return super().prearm_failure() or self._gain_failure()

    def arming_refusal(self) -> str | None:
        return super().arming_refusal() or self._gain_failure()

    def _gain_failure(self) -> str | None:
        """Return the failed check of the gains: without the integral a wrong MOT_THST_HOVER is never corrected."""
        return None if self.parameters[self.integral_gain] > 0.0 else f"Arm: {self.integral_gain} must be > 0"

    def requested_mode(self, main: int, sub: int) -> FlightMode | None:  # noqa: ARG002  one number suffices
        return self.mode_numbered(main)

    def take_off(self, param7: float) -> int:
        """Take off to `param7` metres above the place of takeoff; only from the ground, armed and in GUIDED."""
        if self.mode.name != "GUIDED" or not self.armed or self.controller.flies or not math.isfinite(param7):
            return FAILED
        self.climb(param7)
        return ACCEPTED

    def follow(self, target: SetPoint, type_mask: int) -> None:
        """Fly to a target of position alone, in GUIDED; other targets are ignored."""
        is_position = type_mask & _POSITION_BITS == _POSITION_ONLY and math.isfinite(target.altitude_m)
        if self.mode.name == "GUIDED" and is_position:
            self.controller.move_to(target.altitude_m)

    def link_loss(self) -> tuple[float, Reaction]:
        """Return timeout and reaction: Land for every action of FS_GCS_ENABLE except 0."""
        return self.parameters["FS_GCS_TIMEOUT"], Reaction.LAND if self.parameters["FS_GCS_ENABLE"] else Reaction.NONE

    def fence(self) -> tuple[float, Reaction]:
        """Return limit and reaction of the altitude fence: Land for every action except the report."""
        is_on = self.parameters["FENCE_ENABLE"] and int(self.parameters["FENCE_TYPE"]) & _ALTITUDE_FENCE
        if not is_on:
            return math.inf, Reaction.NONE
        reports = self.parameters["FENCE_ACTION"] == _REPORT_ONLY
        return self.parameters["FENCE_ALT_MAX"], Reaction.WARN if reports else Reaction.LAND

    def counts_heartbeat(self, message: Message) -> bool:
        """Count only heartbeats of its own ground station."""
        return message.get_srcSystem() == self.parameters[self.ground_station]


class ArduPilot47(ArduPilot):
    """ArduCopter from 4.7 on: other names, and acceleration gains of a tenth."""

    firmware: ClassVar[FirmwareProfile] = replace(
        ArduPilot.firmware,
        version=0x040700FF,
        parameters=(
            Parameter("MAV_SYSID", Kind.INT16, 1),
            Parameter(_GROUND_STATION_4_7, Kind.INT16, 255),
            *_COMMON,
            *(real(name, value) for name, value in loop.in_newer_names(_DEFAULTS).items()),
        ),
    )
    ground_station: ClassVar[str] = _GROUND_STATION_4_7
    integral_gain: ClassVar[str] = "PSC_D_ACC_I"


_FAILSAFES: Final = {"FS_GCS_ENABLE": 5.0, "FENCE_ENABLE": 1.0, "FENCE_ACTION": 2.0, "FENCE_ALT_MAX": 10.0}
"""Land when the ground station is lost; stay inside the fence."""

KINDS: Final = (
    copter_kind("ardupilot", "ArduCopter up to 4.6", ArduPilot, _FAILSAFES),
    copter_kind("ardupilot-4.7", "ArduCopter from 4.7 on", ArduPilot47, _FAILSAFES),
)
