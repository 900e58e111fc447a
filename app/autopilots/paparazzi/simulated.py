"""Simulated Paparazzi rotorcraft firmware over MAVLink 1.

The vertical loop is the exact replica. All other behaviour was observed on the wire of the real one, including its
hazards: it stops motors in the air on command, accepts any gain, and does not reply to many requests.
"""

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Final

from app.autopilots.dialects import Message, is_known, number, text
from app.autopilots.paparazzi.simulated_plan import (
    BLOCKS,
    DESCENT_M_S,
    GEO_INIT,
    HOME_HEIGHT_M,
    KILL_SETTING,
    LANDED_AFTER_S,
    MAX_DISTANCE_M,
    NEWER_KILL_SETTING,
    TAKEOFF,
    WAYPOINTS,
    FlightPlan,
    Vertical,
    held,
    settings,
)
from app.autopilots.paparazzi.simulated_telemetry import (
    BARE_POSITION_PERIOD_S,
    BY_HAND,
    FAILSAFE,
    FIX_TICKS,
    GUIDED,
    HOME,
    KILL,
    MESSAGES,
    NAV,
    ReportingPaparazzi,
)
from app.autopilots.simulated.body import (
    ACCEPTED,
    ARMED,
    FAILED,
    MOTORS_OFF,
    TICK_S,
    TICK_STEPS,
    UNSUPPORTED,
    Body,
    Fields,
    Make,
    SimulatedKind,
    VerticalCommand,
    sender,
    whole_ticks,
)
from app.autopilots.simulated.copter_parameters import Kind, Parameter
from app.core.control.vertical_guidance import ALT, CLIMB, POSITION_BITS, SPEED_BITS, fix

MODES: Final = (KILL, FAILSAFE, HOME, BY_HAND, NAV, GUIDED)
_WITHOUT_PLAN: Final = (KILL, FAILSAFE, HOME, BY_HAND)
"""Modes in which no block is flown."""
FAILSAFE_DESCENT_M_S: Final = 1.3
HOMING_M_S: Final = 3.0

RECEIVE_BUFFER: Final = 256
TRANSACTION_S: Final = 15.3
_MAVLINK_1: Final = 0xFE
_BEHIND: Final = Parameter("", Kind.REAL32, math.nan)
_ARM_DISARM: Final = 400
_NAV_WAYPOINT: Final = 16
_LOCAL_ENU: Final = 4
_HIGHEST_M: Final = 10_000.0

_POLL_TICKS: Final = whole_ticks(0.018)
_NAV_TICKS: Final = 16
_BLOCK_TICKS: Final = whole_ticks(0.1)

_IDLE_THRUST: Final = 500 / 9600
_COUNTS_AFTER_S: Final = 1.0
"""Time with thrust, or without, after which it counts as flying, or not."""
_TOUCHES_BELOW_M: Final = 0.03
_REFERENCE_LAG_S: Final = 2 * 0.85 / math.radians(100.0)
"""Time by which the reference (ζ 0.85, 100 °/s) lags behind a moving set point."""


class Paparazzi(ReportingPaparazzi):
    """One autopilot from power-on. `tuned_telemetry`: it was built with a telemetry file that sends
    the position at 51 Hz; otherwise the rate is 1.25 Hz. `kill_setting`, `landed_after_s` and `max_distance_m` are as
    in its settings and its flight plan; `sends_mode`: its heartbeat contains the mode's number."""

    def __init__(
        self,
        body: Body,
        system: int,
        *,
        tuned_telemetry: bool = True,
        kill_setting: str = KILL_SETTING,
        landed_after_s: float = LANDED_AFTER_S,
        max_distance_m: float = MAX_DISTANCE_M,
        sends_mode: bool = False,
    ) -> None:
        super().__init__(body, settings(kill_setting), system=system, sends_mode=sends_mode)
        self.position_after_s = 1.0
        """Time from the start until the position is known."""
        self._received = bytearray()
        self._kill_setting = kill_setting
        self._plan = FlightPlan(landed_after_s=landed_after_s)
        self._max_distance_m = max_distance_m
        self._reported_seq: int | None = None
        self._transaction_ends_s = 0.0
        self._idle_s = 0.0
        self._thrust_s = 0.0
        self._flies = False
        self._touched_s: float | None = None
        self._touched_m = 0.0
        self._held_m = 0.0
        if not tuned_telemetry:
            self.report_every("LOCAL_POSITION_NED", BARE_POSITION_PERIOD_S)
        self._set_motors(on=False)

    # ------------------------------------------------------------ time

    def receive(self, data: bytes) -> None:
        self._received += data

    def advance(self) -> None:
        if self._ticks % _POLL_TICKS == 0:
            self._listen()
        if self._ticks % _NAV_TICKS == 0:
            self._navigate()
        command = self._command()
        self.body.advance(TICK_STEPS, command)
        if self._ticks % FIX_TICKS == 0:
            is_driven = command is not MOTORS_OFF and not self.body.motors_dead
            self.estimator.fix(self.body.altitude_m, self.body.climb_rate_m_s, is_driven=is_driven)
        self._watch_thrust()

    # ------------------------------------------------------------ flying

    @property
    def is_by_hand(self) -> bool:
        return self.mode == BY_HAND

    def take_over(self) -> None:
        self._set_mode(BY_HAND)
        self._held_m = self.height_m

    def hand_back(self) -> None:
        self._set_mode(NAV)

    def kill(self) -> None:
        self._set_motors(on=False)
        if (place := self.parameters.place(self._kill_setting)) is not None:
            self.send_parameter(place)

    def fly_home(self) -> None:
        self._set_mode(HOME)

    def _set_motors(self, *, on: bool) -> None:
        self.armed = on and self.mode != KILL and not self.refuses_arming
        if self._kill_setting:
            self.parameters[self._kill_setting] = 0.0 if self.armed else 1.0

    def _set_mode(self, mode: int) -> None:
        """Set the mode; modes that the airframe does not have are ignored."""
        if mode not in MODES:
            return
        self.parameters["aut_mod"] = mode
        if mode == KILL:
            self._set_motors(on=False)

    def _enter(self, seq: int) -> None:
        self._plan.enter(seq, self.height_m)
        self._touched_s = None
        if self._plan.block.motors is not None:
            self._set_motors(on=self._plan.block.motors)
        if self._plan.seq == TAKEOFF:
            self.took_off = True

    def _navigate(self) -> None:
        """Run the flight plan. Too far from HOME it flies there by itself, and runs no block until its mode is set."""
        distance_m = abs(self.north_m)
        if self.mode == NAV and distance_m > self._max_distance_m:
            self._set_mode(HOME)
        homing_m_s = -min(max(self.north_m, -HOMING_M_S), HOMING_M_S)  # slower over the last metres
        self.body.steered_m_s = homing_m_s if self.mode == HOME else 0.0
        if self.mode in _WITHOUT_PLAN:
            return
        has_position = self.boot_s >= self.position_after_s
        following = self._plan.next(
            _NAV_TICKS * TICK_S, self.height_m, distance_m, flies=self._flies, has_position=has_position
        )
        if following is not None:
            if self._plan.seq == GEO_INIT:
                self.refer_to_ground()
            self._enter(following)

    def _command(self) -> VerticalCommand:
        if not self.armed:
            return MOTORS_OFF
        if self.mode in _WITHOUT_PLAN:
            return self._without_plan()
        match self._plan.block.vertical:
            case Vertical.THROTTLE:
                return MOTORS_OFF
            case Vertical.WAYPOINT:
                return self._altitude(self._plan.altitudes_m[self._plan.block.waypoint])
            case Vertical.DESCEND:
                return self._descent()

    def _without_plan(self) -> VerticalCommand:
        heights_m = {HOME: HOME_HEIGHT_M, BY_HAND: self._held_m}
        if self.mode in heights_m:
            return self._altitude(heights_m[self.mode])
        return self._vertical(CLIMB, fix(-FAILSAFE_DESCENT_M_S, SPEED_BITS))

    def _descent(self) -> VerticalCommand:
        """Return the command to descend at a constant rate. On the ground the reference continues below the vehicle,
        which the replica's climb mode (of an older version) prevents, so that the thrust fades as in the recorded
        landings."""
        if self._touched_s is None and self.body.altitude_m < _TOUCHES_BELOW_M:
            self._touched_s, self._touched_m = self.boot_s, self.height_m
        if self._touched_s is None:
            return self._vertical(CLIMB, fix(-DESCENT_M_S, SPEED_BITS))
        sunk_m = DESCENT_M_S * (self.boot_s - self._touched_s + _REFERENCE_LAG_S)
        return self._altitude(self._touched_m - sunk_m)

    def _altitude(self, target_m: float) -> VerticalCommand:
        """Return the command to an altitude in the local frame, converted to the body's origin, the ground."""
        return self._vertical(ALT, fix(target_m, POSITION_BITS) - self.ground_counts)

    def _vertical(self, mode: int, target: int) -> VerticalCommand:
        kp, ki, kd = (int(self.parameters[f"gui_v_{name}"]) for name in ("kp", "ki", "kd"))
        return VerticalCommand(mode, target, kp, ki, kd)

    def _watch_thrust(self) -> None:
        """Update whether it counts as flying: thrust above idle, or not, for a second."""
        pushes = self.body.thrust > _IDLE_THRUST
        self._thrust_s = self._thrust_s + TICK_S if pushes else 0.0
        self._idle_s = 0.0 if pushes else self._idle_s + TICK_S
        if self._thrust_s >= _COUNTS_AFTER_S:
            self._flies = True
        elif self.body.is_resting or self._idle_s >= _COUNTS_AFTER_S:
            self._flies = False

    # ------------------------------------------------------------ sending

    def report(self, due: list[str]) -> None:
        if self._ticks % _BLOCK_TICKS == 0 and self._plan.seq != self._reported_seq:
            self._reported_seq = self._plan.seq
            self._send("SCRIPT_CURRENT", {"seq": self._plan.seq}, "mission")
        for kind in due:
            self._send(kind, MESSAGES[kind](self))

    def send_parameter(self, place: int) -> None:
        """Send a setting; a place past the end sends what is behind the table, as the real one does."""
        count = len(self.parameters)
        known, value = self.parameters.at(place) if place < count else (_BEHIND, math.nan)
        fields: Fields = {
            "param_id": known.name,
            "param_value": value,
            "param_type": Kind.REAL32,
            "param_count": count,
            "param_index": place,
        }
        self._send("PARAM_VALUE", fields)

    # ------------------------------------------------------------ receiving

    def _listen(self) -> None:
        """Process what was received since the last poll; if it does not fit into the buffer, it is lost entirely."""
        data = bytes(self._received) if len(self._received) <= RECEIVE_BUFFER else b""
        self._received.clear()
        for message in self._codec.parse(data):
            if not is_known(message) or message.get_msgbuf()[0] != _MAVLINK_1:
                continue
            handler = _HANDLERS.get(message.get_type())
            if handler is not None and number(message, "target_system") == self.system:
                handler(self, message)

    def _on_param_set(self, message: Message) -> None:
        """Set a parameter; wrong types, NaN and unknown names have no reply."""
        name, value = text(message, "param_id"), number(message, "param_value")
        place = self.parameters.place(name)
        if place is None or self.ignores_parameters or math.isnan(value):
            return
        if number(message, "param_type") != Kind.REAL32:
            return
        self._set(place, name, value)
        self.send_parameter(place)

    def _set(self, place: int, name: str, value: float) -> None:
        match name:
            case "aut_mod":
                self._set_mode(math.trunc(value) if math.isfinite(value) else -1)
            case _ if name == self._kill_setting:
                self._set_motors(on=math.isfinite(value) and math.trunc(value) == 0)
            case _:
                self.parameters[name] = held(self.parameters.at(place)[0].kind, value)
        if name == "gui_v_ki":
            self.body.forget_error_sum()

    def _on_command(self, message: Message) -> None:
        command, param1 = int(number(message, "command")), number(message, "param1")
        result = UNSUPPORTED
        if command == _ARM_DISARM:
            wanted = param1 > 0.5
            self._set_motors(on=wanted)
            result = ACCEPTED if self.armed == wanted else FAILED
        self._send("COMMAND_ACK", {"command": command, "result": result})

    def _on_set_mode(self, message: Message) -> None:
        self._set_motors(on=bool(int(number(message, "base_mode")) & ARMED))

    def _on_data_stream(self, message: Message) -> None:
        stream = int(number(message, "req_stream_id"))
        self._send("DATA_STREAM", {"stream_id": stream})

    def _on_block_list(self, message: Message) -> None:
        self._transaction_ends_s = self.boot_s + TRANSACTION_S
        self._send("SCRIPT_COUNT", {"count": len(BLOCKS), **sender(message)}, "blocks")

    def _on_block_request(self, message: Message) -> None:
        seq = int(number(message, "seq"))
        if not self._is_listing_blocks or seq >= len(BLOCKS):
            return
        self._transaction_ends_s = self.boot_s + TRANSACTION_S
        self._send("SCRIPT_ITEM", {"seq": seq, "name": BLOCKS[seq].name, **sender(message)}, "blocks")

    def _on_block(self, message: Message) -> None:
        """Enter a block, unless the list is being read or no block is flown; there is no reply in any case."""
        if not self._is_listing_blocks and self.mode not in (HOME, BY_HAND):
            self._enter(int(number(message, "seq")))

    def _on_mission_ack(self, _message: Message) -> None:
        self._transaction_ends_s = 0.0

    def _on_waypoint(self, message: Message) -> None:
        seq, height_m = int(number(message, "seq")), number(message, "z")
        is_waypoint = number(message, "frame") == _LOCAL_ENU and number(message, "command") == _NAV_WAYPOINT
        if not is_waypoint or seq >= len(WAYPOINTS) or not abs(height_m) <= _HIGHEST_M:
            return
        self._plan.altitudes_m[WAYPOINTS[seq]] = height_m
        self._send("MISSION_ACK", sender(message), "mission")

    @property
    def _is_listing_blocks(self) -> bool:
        return self.boot_s < self._transaction_ends_s


_HANDLERS: Final[Mapping[str, Callable[[Paparazzi, Message], None]]] = {
    "PARAM_REQUEST_LIST": Paparazzi._on_param_list,
    "PARAM_REQUEST_READ": Paparazzi._on_param_read,
    "PARAM_SET": Paparazzi._on_param_set,
    "COMMAND_LONG": Paparazzi._on_command,
    "SET_MODE": Paparazzi._on_set_mode,
    "REQUEST_DATA_STREAM": Paparazzi._on_data_stream,
    "SCRIPT_REQUEST_LIST": Paparazzi._on_block_list,
    "SCRIPT_REQUEST": Paparazzi._on_block_request,
    "SCRIPT_ITEM": Paparazzi._on_block,
    "MISSION_ACK": Paparazzi._on_mission_ack,
    "MISSION_ITEM": Paparazzi._on_waypoint,
}


def _kind(name: str, title: str, make: Make) -> SimulatedKind:
    return SimulatedKind(name=name, title=title, system=31, link="udp:127.0.0.1:4244@4245", make=make, set_up=make)


KINDS: Final = (
    _kind("paparazzi", "Paparazzi with a telemetry file for tuning", Paparazzi),
    _kind(
        "paparazzi-bare",
        "Paparazzi as built by default: position at 1.25 Hz",
        partial(Paparazzi, tuned_telemetry=False),
    ),
    _kind(
        "paparazzi-5.10",
        "Paparazzi of 2017, in which the setting that stops the throttle has another name",
        partial(Paparazzi, kill_setting=NEWER_KILL_SETTING),
    ),
)
