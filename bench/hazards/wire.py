"""Commands in packets from the ground, read from the frame alone, independent of the program's own profiles."""

from collections.abc import Callable, Mapping
from enum import StrEnum
from typing import Final

from app.autopilots.dialects import ARDUPILOTMEGA, COMMON, PAPARAZZI, Dialect, Message, number, text


class Command(StrEnum):
    """Command of a packet from the ground."""

    HEARTBEAT = "heartbeat"
    REQUEST = "request"
    GAIN = "gain"
    PREPARE_ARMING = "prepare arming"
    ARM = "arm"
    TAKE_OFF = "take off"
    SET_POINT = "set point"
    FOLLOW = "follow set points"
    LAND = "land"
    MOTORS_OFF = "motors off"


DIALECTS: Final[Mapping[str, Dialect]] = {"paparazzi": PAPARAZZI, "ardupilot": ARDUPILOTMEGA, "px4": COMMON}

GAINS: Final[Mapping[str, Mapping[str, str]]] = {
    "paparazzi": {"kp": "gui_v_kp", "ki": "gui_v_ki", "kd": "gui_v_kd"},
    "ardupilot": {name: name for name in ("PSC_POSZ_P", "PSC_VELZ_P", "PSC_ACCZ_P", "PSC_ACCZ_D", "PSC_ACCZ_I")},
    "px4": {name: name for name in ("MPC_Z_P", "MPC_Z_VEL_P_ACC", "MPC_Z_VEL_D_ACC", "MPC_Z_VEL_I_ACC")},
}
"""Parameter of each gain on the vehicle."""

_BLOCKS: Final = {
    0: Command.REQUEST,
    3: Command.ARM,
    4: Command.TAKE_OFF,
    13: Command.LAND,
    14: Command.LAND,
    15: Command.LAND,
}
"""Commands of the blocks of the stock flight plan. The first has the plan set its ground reference."""
_STOPPING_BLOCKS: Final = frozenset({0, 1, 2, 3, 16})
"""Blocks that kill the motors or hold their thrust at zero."""
_KILL_SETTINGS: Final = frozenset({"kil_thr", "aut_kil_thr"})
_ARMED: Final = 128
_ARM_DISARM: Final = 400
_TERMINATE: Final = 185
_SET_MODE: Final = 176
_TAKE_OFF: Final = 22
_LAND: Final = 21
_TARGET: Final = "SET_POSITION_TARGET_LOCAL_NED"
_OFFBOARD: Final = 6.0
_ARDUPILOT_MODES: Final = {4.0: Command.PREPARE_ARMING, 9.0: Command.LAND, 6.0: Command.LAND}
_PX4_AUTO: Final = {2.0: Command.TAKE_OFF, 6.0: Command.LAND, 5.0: Command.LAND}


def read_command(autopilot: str, message: Message) -> Command:
    """Return the command that `message` is to a vehicle with this autopilot."""
    if message.get_type() == "HEARTBEAT":
        return Command.HEARTBEAT
    if stops_motors(autopilot, message) and message.get_type() != "SCRIPT_ITEM":
        return Command.MOTORS_OFF
    return _READERS[autopilot](message)


def stops_motors(autopilot: str, message: Message) -> bool:
    """Whether the message stops the motors of a vehicle that executes it, also in the air."""
    match message.get_type():
        case "COMMAND_LONG":
            command, parameter = number(message, "command"), number(message, "param1")
            return (command == _ARM_DISARM and parameter <= 0.5) or (command == _TERMINATE and parameter > 0.5)
        case "SET_MODE":
            return autopilot == "paparazzi" and not int(number(message, "base_mode")) & _ARMED
        case "SCRIPT_ITEM":
            return int(number(message, "seq")) in _STOPPING_BLOCKS
        case "PARAM_SET" if autopilot == "paparazzi":
            name, value = text(message, "param_id"), number(message, "param_value")
            return (name in _KILL_SETTINGS and int(value) != 0) or (name == "aut_mod" and int(value) == 0)
        case _:
            return False


def _gain_or_request(autopilot: str, message: Message) -> Command:
    writes = message.get_type() == "PARAM_SET" and text(message, "param_id") in GAINS[autopilot].values()
    return Command.GAIN if writes else Command.REQUEST


def _paparazzi(message: Message) -> Command:
    match message.get_type():
        case "SCRIPT_ITEM":
            return _BLOCKS.get(int(number(message, "seq")), Command.PREPARE_ARMING)
        case "MISSION_ITEM":
            return Command.SET_POINT
        case _:
            return _gain_or_request("paparazzi", message)


def _ardupilot(message: Message) -> Command:
    if message.get_type() == _TARGET:
        return Command.SET_POINT
    if message.get_type() != "COMMAND_LONG":
        return _gain_or_request("ardupilot", message)
    if number(message, "command") == _SET_MODE:
        return _ARDUPILOT_MODES.get(number(message, "param2"), Command.REQUEST)
    return _command(message)


def _px4(message: Message) -> Command:
    if message.get_type() == _TARGET:
        return Command.SET_POINT
    if message.get_type() != "COMMAND_LONG":
        return _gain_or_request("px4", message)
    if number(message, "command") == _SET_MODE:
        if number(message, "param2") == _OFFBOARD:
            return Command.FOLLOW
        return _PX4_AUTO.get(number(message, "param3"), Command.REQUEST)
    return _command(message)


def _command(message: Message) -> Command:
    known = {_ARM_DISARM: Command.ARM, _TAKE_OFF: Command.TAKE_OFF, _LAND: Command.LAND}
    return known.get(int(number(message, "command")), Command.REQUEST)


_READERS: Final[Mapping[str, Callable[[Message], Command]]] = {
    "paparazzi": _paparazzi,
    "ardupilot": _ardupilot,
    "px4": _px4,
}
