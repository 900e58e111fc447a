"""What a packet from the ground means to a vehicle, read from the frame alone, without the program's own profiles."""

from collections.abc import Callable, Mapping
from enum import StrEnum
from typing import Final

from app.vehicles.mavlink.dialects import ARDUPILOTMEGA, COMMON, PAPARAZZI, Dialect, Message, number, text


class Order(StrEnum):
    """What the ground told the vehicle."""

    HEARTBEAT = "heartbeat"
    ASK = "ask"
    GAIN = "gain"
    PREPARE_ARMING = "prepare arming"
    ARM = "arm"
    TAKE_OFF = "take off"
    LAND = "land"
    MOTORS_OFF = "motors off"


DIALECTS: Final[Mapping[str, Dialect]] = {"paparazzi": PAPARAZZI, "ardupilot": ARDUPILOTMEGA, "px4": COMMON}

GAINS: Final[Mapping[str, Mapping[str, str]]] = {
    "paparazzi": {"kp": "gui_v_kp", "ki": "gui_v_ki", "kd": "gui_v_kd"},
    "ardupilot": {name: name for name in ("PSC_POSZ_P", "PSC_VELZ_P", "PSC_ACCZ_P", "PSC_ACCZ_D", "PSC_ACCZ_I")},
    "px4": {name: name for name in ("MPC_Z_P", "MPC_Z_VEL_P_ACC", "MPC_Z_VEL_D_ACC", "MPC_Z_VEL_I_ACC")},
}
"""Every gain, and its parameter on the vehicle."""

_BLOCKS: Final = {3: Order.ARM, 4: Order.TAKE_OFF, 13: Order.LAND, 14: Order.LAND, 15: Order.LAND}
"""Of the stock flight plan."""
_STOPPING_BLOCKS: Final = frozenset({0, 1, 2, 3, 16})
"""Those that kill the motors or hold their thrust at none."""
_KILL_SETTINGS: Final = frozenset({"kil_thr", "aut_kil_thr"})
_ARMED: Final = 128
_ARM_DISARM: Final = 400
_TERMINATE: Final = 185
_SET_MODE: Final = 176
_TAKE_OFF: Final = 22
_LAND: Final = 21
_ARDUPILOT_MODES: Final = {4.0: Order.PREPARE_ARMING, 9.0: Order.LAND, 6.0: Order.LAND}
_PX4_AUTO: Final = {2.0: Order.TAKE_OFF, 6.0: Order.LAND, 5.0: Order.LAND}


def order(autopilot: str, message: Message) -> Order:
    """What `message` tells a vehicle of this autopilot."""
    if message.get_type() == "HEARTBEAT":
        return Order.HEARTBEAT
    if stops_motors(autopilot, message) and message.get_type() != "SCRIPT_ITEM":
        return Order.MOTORS_OFF
    return _READERS[autopilot](message)


def stops_motors(autopilot: str, message: Message) -> bool:
    """Whether the vehicle's motors would stop if it obeyed, in the air too."""
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


def _gain_or_question(autopilot: str, message: Message) -> Order:
    writes = message.get_type() == "PARAM_SET" and text(message, "param_id") in GAINS[autopilot].values()
    return Order.GAIN if writes else Order.ASK


def _paparazzi(message: Message) -> Order:
    match message.get_type():
        case "SCRIPT_ITEM":
            return _BLOCKS.get(int(number(message, "seq")), Order.PREPARE_ARMING)
        case "MISSION_ITEM":
            return Order.PREPARE_ARMING
        case _:
            return _gain_or_question("paparazzi", message)


def _ardupilot(message: Message) -> Order:
    if message.get_type() != "COMMAND_LONG":
        return _gain_or_question("ardupilot", message)
    if number(message, "command") == _SET_MODE:
        return _ARDUPILOT_MODES.get(number(message, "param2"), Order.ASK)
    return _command(message)


def _px4(message: Message) -> Order:
    if message.get_type() != "COMMAND_LONG":
        return _gain_or_question("px4", message)
    if number(message, "command") == _SET_MODE:
        return _PX4_AUTO.get(number(message, "param3"), Order.ASK)
    return _command(message)


def _command(message: Message) -> Order:
    known = {_ARM_DISARM: Order.ARM, _TAKE_OFF: Order.TAKE_OFF, _LAND: Order.LAND}
    return known.get(int(number(message, "command")), Order.ASK)


_READERS: Final[Mapping[str, Callable[[Message], Order]]] = {
    "paparazzi": _paparazzi,
    "ardupilot": _ardupilot,
    "px4": _px4,
}
