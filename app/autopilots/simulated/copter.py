"""MAVLink 2 services common to ArduPilot and PX4: parameters, commands, modes, rates, failsafes."""

from abc import abstractmethod
from collections.abc import Callable, Mapping
from typing import Final, Self

from app.autopilots.dialects import Message, is_known, number, text
from app.autopilots.simulated.body import (
    ACCEPTED,
    FAILED,
    TEMPORARILY_REJECTED,
    UNSUPPORTED,
    Body,
    SimulatedKind,
    sender,
    whole_ticks,
)
from app.autopilots.simulated.copter_control import LOCAL_NED, AltitudeController, Phase, SetPoint
from app.autopilots.simulated.copter_parameters import Behaviour, FlightMode, Reaction, decoded, encoded
from app.autopilots.simulated.copter_telemetry import REPORTS, ReportingCopter

FORCE: Final = 21196
"""Second parameter of command 400 that makes it unconditional."""

_ESTIMATED: Final = frozenset({"LOCAL_POSITION_NED", "GLOBAL_POSITION_INT"})
_CONTROLLED: Final = frozenset({"ATTITUDE_TARGET", "NAV_CONTROLLER_OUTPUT", "POSITION_TARGET_LOCAL_NED"})
"""Sent only while the altitude controller runs."""
_GROUND_STATION: Final = 6
_REPORT_TICKS: Final = whole_ticks(30.0)
_CUSTOM_MODE: Final = 1

# MAV_CMD
LAND: Final = 21
TAKE_OFF: Final = 22
SET_MODE: Final = 176
ARM_DISARM: Final = 400
RUN_PREARM_CHECKS: Final = 401
GET_HOME: Final = 410
SET_INTERVAL: Final = 511
REQUEST_MESSAGE: Final = 512
REQUEST_CAPABILITIES: Final = 520


class Copter(ReportingCopter):
    """One copter from switching on."""

    def __init__(self, body: Body, controller: AltitudeController, *, system: int) -> None:
        super().__init__(body, controller, system=system)
        self._armed_s = 0.0
        self._heartbeat_s: float | None = None
        self.tune()

    # ------------------------------------------------------------ differences between autopilots

    @abstractmethod
    def tune(self) -> None:
        """Pass the parameters to the controller."""

    @abstractmethod
    def requested_mode(self, main: int, sub: int) -> FlightMode | None:
        """Return the mode requested by command 176."""

    @abstractmethod
    def take_off(self, param7: float) -> int:
        """Execute command 22; return the result."""

    @abstractmethod
    def follow(self, target: SetPoint, type_mask: int) -> None:
        """Process a position target, whose altitude is above the ground, with its POSITION_TARGET_TYPEMASK."""

    def follow_stream(self) -> None:
        """Fly by streamed set points, in a mode of behaviour FOLLOW."""

    @abstractmethod
    def link_loss(self) -> tuple[float, Reaction]:
        """Return the timeout without a ground station, s, and the reaction."""

    @abstractmethod
    def fence(self) -> tuple[float, Reaction]:
        """Return the altitude limit, m, and the reaction."""

    def counts_heartbeat(self, _message: Message) -> bool:
        """Return whether the heartbeat of this ground station counts."""
        return True

    def mode_refusal(self, _mode: FlightMode) -> str | None:
        """Return why a commanded mode is not entered; None if it is."""
        return None

    # ------------------------------------------------------------ time

    def receive(self, data: bytes) -> None:
        for message in self._codec.parse(data):
            handler = _HANDLERS.get(message.get_type()) if is_known(message) else None
            if handler is not None and getattr(message, "target_system", 0) in (0, self.system):
                handler(self, message)

    def advance(self) -> None:
        was_landing = self.controller.phase is Phase.LANDING
        self.controller.tick()
        if was_landing and not self.controller.flies:
            self.kill()
        self._watch_idling()
        self._watch_link()
        self._watch_fence()

    def restore_persistent(self, before: Self) -> None:
        """Copy the parameters and the hardware id after a reboot."""
        self.parameters, self.uid = before.parameters, before.uid
        self.tune()

    # ------------------------------------------------------------ flying

    def climb(self, height_m: float) -> None:
        """Take off to this height."""
        self.took_off = True
        self.controller.take_off(height_m)

    def enter(self, mode: FlightMode) -> None:
        self.mode = mode
        match mode.behaviour:
            case Behaviour.LAND:
                self.controller.land()
            case Behaviour.STAY:
                self.controller.hold()
            case Behaviour.TAKE_OFF:
                if self.armed:
                    self.take_off(float("nan"))
            case Behaviour.FOLLOW:
                self.follow_stream()

    @property
    def is_by_hand(self) -> bool:
        return self.mode.name == self.firmware.by_hand

    def take_over(self) -> None:
        self.enter(self.find_mode(self.firmware.by_hand))

    def hand_back(self) -> None:
        self.enter(self.find_mode(self.firmware.automatic))

    def kill(self) -> None:
        self.armed = False
        self.controller.stop()

    def fly_home(self) -> None:
        self.enter(self.find_mode(self.firmware.home))

    def mode_numbered(self, custom: int) -> FlightMode | None:
        """Return the mode with this number in HEARTBEAT."""
        return next((mode for mode in self.firmware.modes if mode.custom_mode == custom), None)

    def find_mode(self, name: str) -> FlightMode:
        return next(mode for mode in self.firmware.modes if mode.name == name)

    def _arm(self, *, force: bool) -> int:
        reason = None if force and not self.refuses_arming else self.arming_refusal()
        if reason is not None:
            self.send_text(reason)
            return self.firmware.refused
        if not self.armed:
            self.armed, self._armed_s = True, self.boot_s
            self.controller.arm()
            if self.mode.behaviour is Behaviour.TAKE_OFF:
                self.enter(self.mode)
        return ACCEPTED

    def arming_refusal(self) -> str | None:
        if reason := Copter.prearm_failure(self):
            return reason
        return None if self.mode.may_arm else self.firmware.not_armable

    def _watch_idling(self) -> None:
        limit_s = self.parameters[self.firmware.idle_limit]
        if self.armed and not self.controller.flies and limit_s > 0.0 and self.boot_s - self._armed_s > limit_s:
            self.kill()

    def _watch_link(self) -> None:
        """React to a lost ground station, if there has been one."""
        limit_s, reaction = self.link_loss()
        if reaction is Reaction.NONE or self._heartbeat_s is None or not self.controller.flies:
            return
        if self.boot_s - self._heartbeat_s > limit_s:
            self._heartbeat_s = None
            self.react(reaction, self.firmware.link_lost)

    def _watch_fence(self) -> None:
        limit_m, reaction = self.fence()
        is_outside = reaction is not Reaction.NONE and self.controller.flies and self.body.altitude_m > limit_m
        was_outside, self.is_breached = self.is_breached, is_outside
        if is_outside and not was_outside:
            self.breaches += 1
            self.send("FENCE_STATUS")
            self.react(reaction, self.firmware.fence_breached)

    def report(self, due: list[str]) -> None:
        for kind in due:
            if self._can_send(kind):
                self.send(kind)
        if not self.armed and self._ticks % _REPORT_TICKS == 0:
            self.report_checks()

    def report_checks(self) -> None:
        """Report the failed arming check, if any."""
        if (reason := self.prearm_failure()) is not None:
            self.send_text(self.firmware.unready + reason)

    def react(self, reaction: Reaction, reason: str) -> None:
        """Send the reason, and change the mode as this reaction of a failsafe demands."""
        self.send_text(reason)
        if reaction is Reaction.LAND:
            self.enter(self.find_mode(self.firmware.land))
        elif reaction is Reaction.HOLD:
            self.enter(self.find_mode(self.firmware.hold))

    # ------------------------------------------------------------ sending

    def send(self, kind: str) -> None:
        """Send one of the reports now."""
        self._send(kind, REPORTS[kind](self))

    def _can_send(self, kind: str) -> bool:
        if kind in _ESTIMATED:
            return self.has_estimate
        return kind not in _CONTROLLED or self.controller.flies

    def send_parameter(self, place: int) -> None:
        if place >= len(self.parameters):
            return
        parameter, value = self.parameters.at(place)
        self._send(
            "PARAM_VALUE",
            {
                "param_id": parameter.name,
                "param_value": encoded(value, parameter.kind, bytewise=self.firmware.is_bytewise),
                "param_type": int(parameter.kind),
                "param_count": len(self.parameters),
                "param_index": place,
            },
        )

    # ------------------------------------------------------------ receiving

    def _on_heartbeat(self, message: Message) -> None:
        if number(message, "type") == _GROUND_STATION and self.counts_heartbeat(message):
            self._heartbeat_s = self.boot_s

    def _on_param_set(self, message: Message) -> None:
        """Set a parameter without a range check; reply with the value then held."""
        place = self.parameters.place(text(message, "param_id"))
        if place is None or self.ignores_parameters:
            return
        parameter, _ = self.parameters.at(place)
        is_bytewise = self.firmware.is_bytewise
        fits = not is_bytewise or number(message, "param_type") == parameter.kind
        value = decoded(number(message, "param_value"), parameter.kind, bytewise=is_bytewise)
        if fits and value is not None:
            self.parameters[parameter.name] = value
            self.tune()
        self.send_parameter(place)

    def _on_set_mode(self, message: Message) -> None:
        """Set the mode by the older message, which has no reply."""
        mode = self.mode_numbered(int(number(message, "custom_mode")))
        if mode is not None and int(number(message, "base_mode")) & _CUSTOM_MODE:
            self._enter_if_allowed(mode)

    def _on_position_target(self, message: Message) -> None:
        if int(number(message, "coordinate_frame")) == LOCAL_NED:
            target = SetPoint.from_message(message, ground_m=self.firmware.ground_m)
            self.follow(target, int(number(message, "type_mask")))

    def _on_data_stream(self, message: Message) -> None:
        """Set the rate of all telemetry by the older message."""
        rate_hz = number(message, "req_message_rate") if number(message, "start_stop") else 0.0
        for kind in self.firmware.streams:
            self.report_every(kind, 1.0 / rate_hz if rate_hz > 0.0 else 0.0)

    def _on_command(self, message: Message) -> None:
        command = int(number(message, "command"))
        handler = _COMMANDS.get(command)
        result = UNSUPPORTED if handler is None else handler(self, message)
        self._send("COMMAND_ACK", {"command": command, "result": result, **sender(message)})

    def _handle_arm(self, message: Message) -> int:
        force = number(message, "param2") == FORCE
        if number(message, "param1") > 0.5:
            return self._arm(force=force)
        if not (self.body.stands or force):
            self.send_text(self.firmware.not_landed)
            return self.firmware.refused
        self.kill()
        return ACCEPTED

    def _handle_mode(self, message: Message) -> int:
        mode = self.requested_mode(_whole(number(message, "param2")), _whole(number(message, "param3")))
        if mode is None or not _whole(number(message, "param1")) & _CUSTOM_MODE:
            return FAILED
        return self._enter_if_allowed(mode)

    def _enter_if_allowed(self, mode: FlightMode) -> int:
        if (reason := self.mode_refusal(mode)) is not None:
            self.send_text(reason)
            return self.firmware.refused
        self.enter(mode)
        return ACCEPTED

    def _handle_land(self, _message: Message) -> int:
        self.enter(self.find_mode(self.firmware.land))
        return ACCEPTED

    def _handle_interval(self, message: Message) -> int:
        """Set the interval of a message in microseconds; 0 is the default, less than 0 never."""
        kind = self._requested(message)
        if kind is None:
            return FAILED
        interval_us = number(message, "param2")
        default_s = self.firmware.periods_s.get(kind, 0.0)
        self.report_every(kind, default_s if interval_us == 0.0 else interval_us / 1e6)
        return ACCEPTED

    def _handle_request(self, message: Message) -> int:
        kind = self._requested(message)
        if kind is None:
            return UNSUPPORTED
        self.send(kind)
        return ACCEPTED

    def _requested(self, message: Message) -> str | None:
        """Return the message that a command is about, or None if this autopilot lacks it."""
        kind = self.dialect.name_of(_whole(number(message, "param1")))
        return kind if kind in REPORTS and kind not in self.firmware.lacks else None

    def _handle_checks(self, _message: Message) -> int:
        if self.armed:
            return TEMPORARILY_REJECTED
        self.report_checks()
        return ACCEPTED

    def _handle_report(self, message: Message) -> int:
        self.send(_REPORTS[int(number(message, "command"))])
        return ACCEPTED


def _whole(value: float) -> int:
    """Return a command parameter as an integer; -1 if it is not finite or too large."""
    return int(value) if abs(value) < 1e9 else -1


_REPORTS: Final = {GET_HOME: "HOME_POSITION", REQUEST_CAPABILITIES: "AUTOPILOT_VERSION"}

_HANDLERS: Final[Mapping[str, Callable[[Copter, Message], None]]] = {
    "HEARTBEAT": Copter._on_heartbeat,
    "PARAM_REQUEST_LIST": Copter._on_param_list,
    "PARAM_REQUEST_READ": Copter._on_param_read,
    "PARAM_SET": Copter._on_param_set,
    "REQUEST_DATA_STREAM": Copter._on_data_stream,
    "SET_MODE": Copter._on_set_mode,
    "SET_POSITION_TARGET_LOCAL_NED": Copter._on_position_target,
    "COMMAND_LONG": Copter._on_command,
}

_COMMANDS: Final[Mapping[int, Callable[[Copter, Message], int]]] = {
    LAND: Copter._handle_land,
    TAKE_OFF: lambda copter, message: copter.take_off(number(message, "param7")),
    SET_MODE: Copter._handle_mode,
    ARM_DISARM: Copter._handle_arm,
    RUN_PREARM_CHECKS: Copter._handle_checks,
    GET_HOME: Copter._handle_report,
    SET_INTERVAL: Copter._handle_interval,
    REQUEST_MESSAGE: Copter._handle_request,
    REQUEST_CAPABILITIES: Copter._handle_report,
}


def copter_kind(
    name: str, title: str, make: Callable[[Body, int], Copter], failsafes: Mapping[str, float]
) -> SimulatedKind:
    """Return a kind of copter whose failsafes are these parameters."""

    def set_up(body: Body, system: int) -> Copter:
        copter = make(body, system)
        for parameter, value in failsafes.items():
            copter.parameters[parameter] = value
        return copter

    return SimulatedKind(name=name, title=title, system=1, link="udp:127.0.0.1:14550", make=make, set_up=set_up)
