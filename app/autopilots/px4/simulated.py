"""Simulated PX4.

Its altitude is controlled by the replica of PX4's vertical loop; see simulated_control.py. OFFBOARD takes set points of
position, velocity and acceleration, of which only the vertical parts act.
"""

import contextlib
import math
import struct
from pathlib import Path
from typing import ClassVar, Final

from app.autopilots.dialects import COMMON
from app.autopilots.px4.arming_checks import ARMING_CHECK_SUMMARY, HEALTH_SUMMARY
from app.autopilots.px4.replica import parameters as loop
from app.autopilots.px4.simulated_control import Px4Controller
from app.autopilots.simulated.body import ACCEPTED, TEMPORARILY_REJECTED, Body, OutgoingMessage
from app.autopilots.simulated.copter import Copter, copter_kind
from app.autopilots.simulated.copter_control import Phase, SetPoint
from app.autopilots.simulated.copter_parameters import (
    Behaviour,
    FirmwareProfile,
    FlightMode,
    Reaction,
    read_parameters,
    read_periods,
    real,
)
from app.autopilots.simulated.copter_telemetry import HOME_AMSL_M
from app.core.errors import InputError

_MANUAL: Final = 1 | 16 | 64
_AUTO: Final = 1 | 4 | 8 | 16
_TAKEOFF: Final = "AUTO.TAKEOFF"
_OFFBOARD: Final = "OFFBOARD"
_SLOWEST_STREAM_S: Final = 0.5
"""Longest interval between set points of one stream."""
_LARGEST_SET_POINT: Final = 1e6
_STREAMED_FOR_S: Final = 1.0
"""A stream counts once it has lasted for so long."""
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
_OFFBOARD_ACTIONS: Final = dict.fromkeys((0, 1, 2, 5), Reaction.HOLD)
"""COM_OBL_RC_ACT: hold also in place of the modes of a pilot, which need a radio control that there is not."""
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
            *(real(name, value) for name, value in loop.DEFAULTS.items()),
            *(real(name, 0.0) for name in loop.UNSUPPORTED),
            *read_parameters(Path(__file__).parent / "simulated_parameters.csv"),
        ),
        is_bytewise=True,
        periods_s=read_periods(Path(__file__).parent / "simulated_periods.csv"),
        streams=(),
        modes=(
            FlightMode("POSCTL", custom_mode(3), _MANUAL),
            FlightMode("MANUAL", custom_mode(1), _MANUAL),
            FlightMode("ALTCTL", custom_mode(2), _MANUAL),
            FlightMode(_TAKEOFF, custom_mode(4, 2), _AUTO, Behaviour.TAKE_OFF),
            FlightMode("AUTO.LOITER", custom_mode(4, 3), _AUTO),
            FlightMode("AUTO.RTL", custom_mode(4, 5), _AUTO, Behaviour.LAND),
            FlightMode(_OFFBOARD, custom_mode(6), _AUTO, Behaviour.FOLLOW),
            FlightMode("AUTO.LAND", custom_mode(4, 6), _AUTO, Behaviour.LAND, may_arm=False),
        ),
        land="AUTO.LAND",
        home="AUTO.RTL",
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
        idle_limit="COM_DISARM_PRFLT",
        ground_m=0.51,
        lacks=frozenset({"NAV_CONTROLLER_OUTPUT"}),
    )

    controller: Px4Controller

    def __init__(self, body: Body, system: int) -> None:
        defaults = {parameter.name: parameter.default for parameter in self.firmware.parameters}
        super().__init__(body, Px4Controller(body, defaults, ground_m=self.firmware.ground_m), system=system)
        self._streamed_s = self._stream_began_s = -math.inf
        self._chosen = self.mode
        self._events = 0
        self._reported_failing: bool | None = None

    def tick(self) -> list[OutgoingMessage]:
        """Advance by one tick. At its takeoff height it switches to hold. When it disarms it returns to the last mode
        that was chosen and in which it may be armed: after targets, to OFFBOARD, where it does not arm without a
        stream. If Land is commanded after that, it stays in the landing mode, and does not arm either."""
        was_armed = self.armed
        self._watch_stream()
        messages = super().tick()
        self.took_off |= self.controller.flies
        if self._is_failing != self._reported_failing:
            self._send_check_events()
        if self.mode.name == _TAKEOFF and self.controller.phase is Phase.HOLDING:
            self.mode = self.find_mode(self.firmware.hold)
        self._chosen = self.mode if self.mode.may_arm else self._chosen
        if was_armed and not self.armed:
            self.mode = self._chosen
        return messages

    def prearm_failure(self) -> str | None:
        """Return why it cannot be armed, including the mode."""
        return self.arming_refusal()

    def arming_refusal(self) -> str | None:
        if self.mode.name == _OFFBOARD and not self._is_streamed_to:
            return self.firmware.no_estimate
        return super().arming_refusal()

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
        self._send(
            "EVENT",
            {
                "id": number,
                "event_time_boot_ms": self.boot_ms,
                "sequence": self._events % _SEQUENCE_NUMBERS,
                "log_levels": levels,
                "arguments": struct.pack(layout, *arguments).ljust(_ARGUMENTS, b"\0"),
            },
        )
        self._events += 1

    def tune(self) -> None:
        """Pass the parameters to the loop. With values for which it is not defined, it keeps those it had."""
        with contextlib.suppress(InputError):
            self.controller.tune(self.parameters.values())

    def requested_mode(self, main: int, sub: int) -> FlightMode | None:
        return self.mode_numbered(custom_mode(max(main, 0), max(sub, 0)))

    def mode_refusal(self, mode: FlightMode) -> str | None:
        """Refuse OFFBOARD without a stream of set points."""
        is_refused = mode.name == _OFFBOARD and not self._is_streamed_to
        return "Switching to Offboard is currently not available" if is_refused else None

    def follow(self, target: SetPoint, type_mask: int) -> None:  # noqa: ARG002  NaN tells what is not given
        """Store a set point, in which the altitude, its rate or the acceleration is given."""
        if not target.given or max(map(abs, target.given)) > _LARGEST_SET_POINT:
            return
        if self.boot_s - self._streamed_s > _SLOWEST_STREAM_S:
            self._stream_began_s = self.boot_s
        self._streamed_s = self.boot_s
        self.controller.stream(target)

    def follow_stream(self) -> None:
        self.controller.begin_following()

    @property
    def _is_streamed_to(self) -> bool:
        is_fresh = self.boot_s - self._streamed_s <= self.parameters["COM_OF_LOSS_T"]
        return is_fresh and self.boot_s - self._stream_began_s >= _STREAMED_FOR_S

    def _watch_stream(self) -> None:
        """React to the loss of the set points in OFFBOARD."""
        if self.mode.name != _OFFBOARD or not self.controller.flies:
            return
        if self.boot_s - self._streamed_s > self.parameters["COM_OF_LOSS_T"]:
            action = _OFFBOARD_ACTIONS.get(int(self.parameters["COM_OBL_RC_ACT"]), Reaction.LAND)
            self.react(action, "No offboard signal")

    def take_off(self, param7: float) -> int:
        """Take off to `param7` metres above sea level, or, if it is not finite, to MIS_TAKEOFF_ALT above the place of
        takeoff. A disarmed vehicle takes off when it is armed."""
        if self.mode.name == _OFFBOARD:
            self.controller.hold()
        self.mode = self.find_mode(_TAKEOFF)
        height_m = param7 - HOME_AMSL_M if math.isfinite(param7) else self.parameters["MIS_TAKEOFF_ALT"]
        if height_m <= 0.0:
            self.send_text("Already higher than takeoff altitude")
        elif self.armed and not self.controller.flies:
            self.climb(height_m)
        return ACCEPTED

    def link_loss(self) -> tuple[float, Reaction]:
        return self.parameters["COM_DL_LOSS_T"], _LINK_ACTIONS.get(int(self.parameters["NAV_DLL_ACT"]), Reaction.LAND)

    def fence(self) -> tuple[float, Reaction]:
        """Return limit and reaction of the altitude fence; a distance of 0 disables it."""
        limit_m = self.parameters["GF_MAX_VER_DIST"]
        if limit_m <= 0.0:
            return math.inf, Reaction.NONE
        return limit_m, _FENCE_ACTIONS.get(int(self.parameters["GF_ACTION"]), Reaction.LAND)


KINDS: Final = (
    copter_kind(
        "px4",
        "PX4",
        Px4,
        failsafes={
            "NAV_DLL_ACT": 3.0,  # land
            "GF_ACTION": 5.0,  # land
            "GF_MAX_VER_DIST": 10.0,
            "COM_OBL_RC_ACT": 4.0,  # land without set points
        },
    ),
)
