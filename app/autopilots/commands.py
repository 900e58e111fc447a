"""What is sent to an autopilot: actions, the steps that carry them out, and the messages of these."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Final

from app.autopilots.dialects import FieldValue
from app.autopilots.measurements import DISARMING, Measurement

_ARM_DISARM: Final = 400
_FORCED: Final = 21196.0
"""The second parameter of 400 that stops motors in the air."""
_REAL32: Final = 9
TARGET: Final = "position target"
"""`Step.awaits` of a step that ends when the vehicle reports the position target of the step."""
_POSITION_ALONE: Final = 0b110111111000
"""POSITION_TARGET_TYPEMASK: everything but the position is ignored."""
_WITH_ACCELERATION: Final = _POSITION_ALONE & ~(1 << 8)
"""Position and vertical acceleration: bits 6 and 7 go on ignoring the horizontal ones."""
_LOCAL_NED: Final = 1
_REFERENCE_HZ: Final = 50.0
"""Rate of what is compared with the altitude, sample by sample."""
SET_POINT_ATTEMPTS: Final = 3
"""Sendings of a set point; together shorter than the time between two set points."""


class Action(StrEnum):
    """Actions of a vehicle, independent of the messages that its autopilot needs for them."""

    ARM = "arm"
    TAKE_OFF = "take off"
    HOLD = "hold its first set point"
    """By position targets, which it follows from now on."""
    FLY_TO = "fly to its next set point"
    LAND = "land"
    MOTORS_OFF = "motors off"
    """On the ground only: some autopilots refuse it in flight."""
    KILL = "stop its motors"
    """At any height."""


@dataclass(frozen=True, slots=True)
class Setting:
    """Parameter name on the vehicle and the value to send."""

    parameter: str
    value: float


@dataclass(frozen=True, slots=True)
class Outgoing:
    """A message to send, by its name and fields."""

    kind: str
    fields: Mapping[str, FieldValue]


@dataclass(frozen=True, slots=True)
class Step:
    """Messages sent together, up to `attempts` times, and the reply that ends the step: see `CommandReply.to`, or
    `TARGET` with its `altitude_m`, or "mode " and the mode of a heartbeat; if it awaits none, the step ends after
    `pause_s`. `shown_by`: the "mode " of a heartbeat that ends it too, for replies get lost. A step that is not
    `needed` may be refused, or have no reply; one that `persists` is sent again after a refusal, up to `attempts`
    times. If there are `modes`, it is sent only right after a heartbeat that reports one of them."""

    sends: tuple[Outgoing, ...]
    awaits: str = ""
    shown_by: str = ""
    attempts: int = 5
    pause_s: float = 0.0
    needed: bool = True
    persists: bool = False
    altitude_m: float = math.nan
    modes: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """Recipient of messages. `component` is its autopilot's, 0 until it is known; `aircraft` is the id that Paparazzi
    matches in most messages; `newer_names` are the parameters found on it that newer releases name differently, by
    their older names; `blocks` are the numbers of its flight plan's blocks by name; `stop_settings` are the
    settings found on it that stop its motors, `stops_by_command`: it has accepted the command that stops them;
    `east_m` and `north_m` are its place on the ground; `acceleration_m_s2`, up, is fed forward beside the altitude."""

    system: int
    aircraft: int
    component: int = 0
    waypoint: int = 2
    blocks: Mapping[str, int] = field(default_factory=dict)
    newer_names: Mapping[str, str] = field(default_factory=dict)
    stop_settings: tuple[str, ...] = ()
    stops_by_command: bool = False
    east_m: float = 0.0
    north_m: float = 0.0
    altitude_m: float = 3.0
    acceleration_m_s2: float = 0.0


Ask = Callable[[Outgoing, Callable[[Measurement], bool]], Measurement | None]
"""Sends a request, repeatedly if necessary, until a reply fits; returns None without one."""


@dataclass(frozen=True, slots=True)
class MessageRequest:
    """Request for a message by its id at a rate, by default that of positions. Not every autopilot sends one that is
    not `needed`."""

    message: int
    rate_hz: float | None = None
    needed: bool = True

    def step(self, target: Target, positions_hz: float = math.nan) -> Step:
        """Return the step that sends the request."""
        interval_us = round(1e6 / (self.rate_hz or positions_hz))
        request = command(target, 511, self.message, interval_us)
        return Step((request,), awaits="command 511", attempts=5 if self.needed else 2, needed=self.needed)


COPTER_TELEMETRY: Final = (
    MessageRequest(32),  # LOCAL_POSITION_NED
    MessageRequest(1, 4.0),  # SYS_STATUS
    MessageRequest(245, 4.0, needed=False),  # EXTENDED_SYS_STATE
    MessageRequest(162, 4.0, needed=False),  # FENCE_STATUS
    MessageRequest(74, 10.0, needed=False),  # VFR_HUD
    MessageRequest(30, 10.0, needed=False),  # ATTITUDE
)
"""All that a trial uses of an autopilot that sends only heartbeats unrequested, positions at the vehicle's rate."""
ALTITUDE_ERROR: Final = MessageRequest(62, _REFERENCE_HZ)
"""NAV_CONTROLLER_OUTPUT."""
DEMANDED_THROTTLE: Final = MessageRequest(83, _REFERENCE_HZ)
"""ATTITUDE_TARGET."""
FOLLOWED_TARGET: Final = MessageRequest(85, _REFERENCE_HZ)
"""POSITION_TARGET_LOCAL_NED, the position target that it follows."""


def list_parameters(target: Target) -> Outgoing:
    return Outgoing("PARAM_REQUEST_LIST", {"target_system": target.aircraft, "target_component": 0})


def read_parameter(target: Target, parameter: str, place: int = -1) -> Outgoing:
    """Return a request for a parameter, or for the one at a place in the vehicle's list, which must not be past its
    end, because Paparazzi reads beyond its table."""
    return Outgoing(
        "PARAM_REQUEST_READ",
        {"target_system": target.aircraft, "target_component": 0, "param_id": parameter, "param_index": place},
    )


def command(target: Target, code: int, *parameters: float) -> Outgoing:
    """Return a COMMAND_LONG; missing parameters are 0."""
    filled = (*parameters, *(0.0 for _ in range(7 - len(parameters))))
    return Outgoing(
        "COMMAND_LONG",
        {
            "target_system": target.aircraft,
            "target_component": 0,
            "command": code,
            "confirmation": 0,
            **{f"param{place + 1}": value for place, value in enumerate(filled)},
        },
    )


def set_mode(target: Target, *mode: float) -> Outgoing:
    """Return the command to enter a custom mode, with its submode if there is one."""
    return command(target, 176, 1.0, *mode)


def request_version(target: Target) -> Outgoing:
    """Return a request for one AUTOPILOT_VERSION."""
    return command(target, 512, 148)


def set_parameter(target: Target, parameter: str, value: float, *, component: int) -> Outgoing:
    """Return the message that sets a floating-point parameter, the type of all gains."""
    return Outgoing(
        "PARAM_SET",
        {
            "target_system": target.aircraft,
            "target_component": component,
            "param_id": parameter,
            "param_value": value,
            "param_type": _REAL32,
        },
    )


def disarm(target: Target, *, forced: bool = False) -> Outgoing:
    """Return the command to disarm; `forced` also in flight, where an autopilot would refuse it."""
    return command(target, _ARM_DISARM, 0.0, _FORCED if forced else 0.0)


def position_target(target: Target) -> Outgoing:
    """Return SET_POSITION_TARGET_LOCAL_NED: position, and a vertical acceleration if one is fed forward, in the
    vehicle's local frame, whose z points down."""
    unused = dict.fromkeys(("vx", "vy", "vz", "afx", "afy", "yaw", "yaw_rate"), 0.0)
    return Outgoing(
        "SET_POSITION_TARGET_LOCAL_NED",
        {
            "time_boot_ms": 0,
            "target_system": target.aircraft,
            "target_component": target.component,
            "coordinate_frame": _LOCAL_NED,
            "type_mask": _WITH_ACCELERATION if target.acceleration_m_s2 else _POSITION_ALONE,
            "x": target.north_m,
            "y": target.east_m,
            "z": -target.altitude_m,
            "afz": -target.acceleration_m_s2,
            **unused,
        },
    )


def follow_target(target: Target) -> Step:
    """Return the step that sends a position target until the vehicle reports it."""
    sends = (position_target(target),)
    return Step(sends, awaits=TARGET, attempts=SET_POINT_ATTEMPTS, altitude_m=target.altitude_m)


def copter_steps(action: Action, target: Target, *land: float) -> tuple[Step, ...]:
    """Return the steps of an autopilot that flies by modes, of which `land` is that of a landing: to arm in the mode
    that it is in, to fly to a position target, to land, and to stop the motors."""
    match action:
        case Action.ARM:
            return (Step((command(target, _ARM_DISARM, 1.0),), awaits=DISARMING),)
        case Action.LAND:
            return (Step((set_mode(target, *land),)),)
        case Action.MOTORS_OFF | Action.KILL:
            return (Step((disarm(target, forced=action is Action.KILL),)),)
        case _:
            return (follow_target(target),)
