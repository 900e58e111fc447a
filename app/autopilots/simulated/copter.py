"""MAVLink 2 services common to ArduPilot and PX4: parameters, commands, modes, rates, failsafes."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import ClassVar, Final, Self

from app.autopilots.dialects import FieldValue, Message, is_known, number, text
from app.autopilots.simulated import copter_telemetry
from app.autopilots.simulated.body import (
    ACCEPTED,
    FAILED,
    TEMPORARILY_REJECTED,
    TICK_S,
    UNSUPPORTED,
    Body,
    OutgoingMessage,
    SimulatedKind,
    Timetable,
    whole_ticks,
)
from app.autopilots.simulated.copter_control import LOCAL_NED, AltitudeController, Phase, SetPoint
from app.autopilots.simulated.copter_parameters import Behaviour, FirmwareProfile, FlightMode, Parameters, Reaction

COMPONENT: Final = 1
FORCE: Final = 21196
"""Second parameter of command 400 that makes it unconditional."""

ESTIMATE_AFTER_S: Final = 3.0
"""Time from the start until the position is known well enough to arm and to be sent."""
_ESTIMATED: Final = frozenset({"LOCAL_POSITION_NED", "GLOBAL_POSITION_INT"})
_CONTROLLED: Final = frozenset({"ATTITUDE_TARGET", "NAV_CONTROLLER_OUTPUT", "POSITION_TARGET_LOCAL_NED"})
"""Sent only while the altitude controller runs."""
_SIMULATED: Final = int.from_bytes(b"GAINLIN\0", "big")
"""Hardware id of a simulated drone, except its last byte."""
_GROUND_STATION: Final = 6
_LIST_EVERY_TICKS: Final = 2
_REPORT_TICKS: Final = whole_ticks(30.0)
_TEXT_LENGTH: Final = 50
_LAST_TEXT: Final = 65535
_ACTIVE: Final = 4
_STANDBY: Final = 3
_ALTITUDE_BREACH: Final = 2
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


class Copter(ABC):
    """One autopilot from switching on; see `Autopilot`."""

    firmware: ClassVar[FirmwareProfile]

    def __init__(self, body: Body, controller: AltitudeController, *, system: int) -> None:
        self.dialect = self.firmware.dialect
        self.system, self.component = system, COMPONENT
        self.uid = _SIMULATED | system
        self.refuses_arming = False
        self.ignores_parameters = False
        self.took_off = False
        self.estimate_after_s = ESTIMATE_AFTER_S
        self.armed = False
        self.mode = self.firmware.modes[0]
        self.parameters = Parameters(self.firmware.parameters)
        self.controller = controller
        self._body = body
        self._codec = self.dialect.codec(system=system, component=COMPONENT)
        self._ticks = 0
        self._armed_s = 0.0
        self._heartbeat_s: float | None = None
        self._is_breached = False
        self._breaches = 0
        self._listing: int | None = None
        self._texts = 0
        self._timetable = Timetable.from_periods(self.firmware.periods_s)
        self._out: list[OutgoingMessage] = []
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

    def follow_stream(self) -> None:  # noqa: B027  not every autopilot has such a mode
        """Fly by streamed set points, in a mode of behaviour FOLLOW."""

    @abstractmethod
    def link_loss(self) -> tuple[float, Reaction]:
        """Return the timeout without a ground station, s, and the reaction."""

    @abstractmethod
    def fence(self) -> tuple[float, Reaction]:
        """Return the altitude limit, m, and the reaction."""

    @abstractmethod
    def idle_limit_s(self) -> float:
        """Return the time for which it stays armed on the ground, s."""

    def counts_heartbeat(self, _message: Message) -> bool:
        """Return whether the heartbeat of this ground station counts."""
        return True

    def mode_refusal(self, _mode: FlightMode) -> str | None:
        """Return why a commanded mode is not entered; None if it is."""
        return None

    def prearm_failure(self) -> str | None:
        """Return why its arming checks do not pass, as reported regularly; None if they pass."""
        return self.firmware.no_estimate if self.refuses_arming or not self._has_estimate else None

    @property
    def _has_estimate(self) -> bool:
        return self.boot_s >= self.estimate_after_s

    # ------------------------------------------------------------ time

    @property
    def boot_s(self) -> float:
        return self._ticks * TICK_S

    def receive(self, data: bytes) -> None:
        for message in self._codec.parse(data):
            handler = _HANDLERS.get(message.get_type()) if is_known(message) else None
            if handler is not None and getattr(message, "target_system", 0) in (0, self.system):
                handler(self, message)

    def tick(self) -> list[OutgoingMessage]:
        self._ticks += 1
        was_landing = self.controller.phase is Phase.LANDING
        self.controller.tick()
        if was_landing and not self.controller.flies:
            self._disarm()
        self._watch_idling()
        self._watch_link()
        self._watch_fence()
        self._report()
        self._report_readiness()
        out, self._out = self._out, []
        return out

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
        self._disarm()

    def fly_home(self) -> None:
        self.enter(self.find_mode(self.firmware.home))

    def held(self, parameter: str) -> float:
        return self.parameters[parameter]

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

    def _disarm(self) -> None:
        self.armed = False
        self.controller.stop()

    def _watch_idling(self) -> None:
        limit_s = self.idle_limit_s()
        if self.armed and not self.controller.flies and limit_s > 0.0 and self.boot_s - self._armed_s > limit_s:
            self._disarm()

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
        is_outside = reaction is not Reaction.NONE and self.controller.flies and self._body.altitude_m > limit_m
        was_outside, self._is_breached = self._is_breached, is_outside
        if is_outside and not was_outside:
            self._breaches += 1
            self.send("FENCE_STATUS")
            self.react(reaction, self.firmware.fence_breached)

    def _report_readiness(self) -> None:
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

    def send_text(self, text: str) -> None:
        """Send a critical STATUSTEXT; a long text is sent in several chunks with one number."""
        self._texts = self._texts % _LAST_TEXT + 1 if len(text) > _TEXT_LENGTH else self._texts
        for chunk, start in enumerate(range(0, len(text), _TEXT_LENGTH)):
            number = self._texts if len(text) > _TEXT_LENGTH else 0
            part = text[start : start + _TEXT_LENGTH]
            self._out.append(
                OutgoingMessage("STATUSTEXT", {"severity": 2, "text": part, "id": number, "chunk_seq": chunk})
            )

    def send(self, kind: str) -> None:
        """Send one of the reports now."""
        self._out.append(OutgoingMessage(kind, copter_telemetry.REPORTS[kind].fields(self._snapshot())))

    def _report(self) -> None:
        if self._listing is not None and self._ticks % _LIST_EVERY_TICKS == 0:
            self._send_parameter(self._listing)
            self._listing = self._listing + 1 if self._listing + 1 < len(self.parameters) else None
        due = [kind for kind in self._timetable.due(self._ticks) if self._can_send(kind)]
        if due:
            now = self._snapshot()
            self._out += [OutgoingMessage(kind, copter_telemetry.REPORTS[kind].fields(now)) for kind in due]

    def _can_send(self, kind: str) -> bool:
        if kind in _ESTIMATED:
            return self._has_estimate
        return kind not in _CONTROLLED or self.controller.flies

    def _snapshot(self) -> copter_telemetry.Snapshot:
        body, firmware = self._body, self.firmware
        return copter_telemetry.Snapshot(
            boot_s=self.boot_s,
            north_m=body.north_m,
            north_m_s=body.north_m_s,
            local_m=body.altitude_m + firmware.ground_m,
            altitude_m=body.altitude_m,
            climb_rate_m_s=body.climb_rate_m_s,
            thrust=body.thrust,
            battery_v=body.battery_v,
            armed=self.armed,
            autopilot=firmware.autopilot,
            base_mode=self.mode.base_mode,
            custom_mode=self.mode.custom_mode,
            status=_ACTIVE if self.controller.flies else _STANDBY,
            landed_state=_LANDED_STATES[self.controller.phase],
            version=firmware.version,
            uid=self.uid,
            breach_type=_ALTITUDE_BREACH if self._is_breached else 0,
            breaches=self._breaches,
            ready=self.prearm_failure() is None,
            controller=self.controller,
        )

    def _send_parameter(self, place: int) -> None:
        parameter, value = self.parameters.at(place)
        fields: dict[str, FieldValue] = {
            "param_id": parameter.name,
            "param_value": self.firmware.coding.encode(value, parameter.kind),
            "param_type": int(parameter.kind),
            "param_count": len(self.parameters),
            "param_index": place,
        }
        self._out.append(OutgoingMessage("PARAM_VALUE", fields))

    def _acknowledge(self, message: Message, command: int, result: int) -> None:
        sender = {"target_system": message.get_srcSystem(), "target_component": message.get_srcComponent()}
        fields = {"command": command, "result": result, "progress": 0, "result_param2": 0, **sender}
        self._out.append(OutgoingMessage("COMMAND_ACK", fields))

    # ------------------------------------------------------------ receiving

    def _on_heartbeat(self, message: Message) -> None:
        if number(message, "type") == _GROUND_STATION and self.counts_heartbeat(message):
            self._heartbeat_s = self.boot_s

    def _on_param_list(self, _message: Message) -> None:
        self._listing = 0

    def _on_param_read(self, message: Message) -> None:
        """Send a parameter; a request for an unknown one has no reply."""
        index = int(number(message, "param_index"))
        place = self.parameters.place(text(message, "param_id")) if index < 0 else index
        if place is not None and place < len(self.parameters):
            self._send_parameter(place)

    def _on_param_set(self, message: Message) -> None:
        """Set a parameter without a range check; reply with the value then held."""
        place = self.parameters.place(text(message, "param_id"))
        if place is None or self.ignores_parameters:
            return
        parameter, _ = self.parameters.at(place)
        coding = self.firmware.coding
        fits = not coding.is_strict or number(message, "param_type") == parameter.kind
        value = coding.decode(number(message, "param_value"), parameter.kind)
        if fits and value is not None:
            self.parameters[parameter.name] = value
            self.tune()
        self._send_parameter(place)

    def _on_set_mode(self, message: Message) -> None:
        """Set the mode by the older message, which has no reply."""
        custom = int(number(message, "custom_mode"))
        mode = next((mode for mode in self.firmware.modes if mode.custom_mode == custom), None)
        if mode is not None and int(number(message, "base_mode")) & _CUSTOM_MODE:
            self._enter_if_allowed(mode)

    def _on_position_target(self, message: Message) -> None:
        if int(number(message, "coordinate_frame")) == LOCAL_NED:
            target = SetPoint.from_message(message).above(self.firmware.ground_m)
            self.follow(target, int(number(message, "type_mask")))

    def _on_data_stream(self, message: Message) -> None:
        """Set the rate of all telemetry by the older message."""
        rate_hz = number(message, "req_message_rate") if number(message, "start_stop") else 0.0
        for kind in self.firmware.streams:
            self._timetable.set(kind, 1.0 / rate_hz if rate_hz > 0.0 else 0.0)

    def _on_command(self, message: Message) -> None:
        command = int(number(message, "command"))
        handler = _COMMANDS.get(command)
        result = UNSUPPORTED if handler is None else handler(self, message)
        self._acknowledge(message, command, result)

    def _handle_arm(self, message: Message) -> int:
        force = number(message, "param2") == FORCE
        if number(message, "param1") > 0.5:
            return self._arm(force=force)
        if not (self.controller.is_landed or force):
            self.send_text(self.firmware.not_landed)
            return self.firmware.refused
        self._disarm()
        return ACCEPTED

    def _handle_mode(self, message: Message) -> int:
        main, sub = number(message, "param2"), number(message, "param3")
        mode = self.requested_mode(_whole(main), _whole(sub))
        if mode is None or not _whole(number(message, "param1")) & _CUSTOM_MODE:
            return FAILED
        return self._enter_if_allowed(mode)

    def _enter_if_allowed(self, mode: FlightMode) -> int:
        if (reason := self.mode_refusal(mode)) is not None:
            self.send_text(reason)
            return self.firmware.refused
        self.enter(mode)
        return ACCEPTED

    def _handle_take_off(self, message: Message) -> int:
        return self.take_off(number(message, "param7"))

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
        self._timetable.set(kind, default_s if interval_us == 0.0 else interval_us / 1e6)
        return ACCEPTED

    def _handle_request(self, message: Message) -> int:
        kind = self._requested(message)
        if kind is None:
            return UNSUPPORTED
        self.send(kind)
        return ACCEPTED

    def _requested(self, message: Message) -> str | None:
        """Return the message that a command is about, or None if this autopilot lacks it."""
        kind = copter_telemetry.KINDS_BY_NUMBER.get(_whole(number(message, "param1")))
        return None if kind in self.firmware.lacks else kind

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


_LANDED_STATES: Final = {
    Phase.IDLE: copter_telemetry.ON_GROUND,
    Phase.CLIMBING: copter_telemetry.TAKING_OFF,
    Phase.HOLDING: copter_telemetry.IN_AIR,
    Phase.LANDING: copter_telemetry.LANDING,
}

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
    TAKE_OFF: Copter._handle_take_off,
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
