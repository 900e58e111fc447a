"""Paparazzi: MAVLink 1, flight plan blocks instead of modes, integer gains."""

from collections.abc import Mapping
from functools import partial
from types import MappingProxyType
from typing import Final

from app.autopilots import commands, mavlink
from app.autopilots.autopilot import Autopilot, AutopilotError, GainParameter, ModeParameter
from app.autopilots.commands import Action, Ask, Outgoing, Step, Target
from app.autopilots.dialects import PAPARAZZI as DIALECT
from app.autopilots.dialects import Message, number, text
from app.autopilots.measurements import Block, BlockCount, BlockEntered, CommandReply, Measurement, Version
from app.autopilots.paparazzi.parameter_file import PARAMETER_FILE
from app.core.experiments.altitude_steps import AltitudeSteps
from app.core.experiments.takeoff import Takeoff

WAIT_GPS: Final = "Wait GPS"
GEO_INIT: Final = "Geo init"
HOLDING: Final = "Holding point"
START_ENGINE: Final = "Start Engine"
TAKE_OFF: Final = "Takeoff"
LAND: Final = "land here"
AFTER_LAND: Final = ("land", "flare", "landed")
"""Blocks after "land here" in stock plans. That is left at once, so the vehicle reports the first of these."""
GROUND_BLOCKS: Final = (WAIT_GPS, GEO_INIT, HOLDING)
BLOCKS: Final = (HOLDING, START_ENGINE, TAKE_OFF, LAND, AFTER_LAND[-1])

_LOCAL_ENU: Final = 4
_WAYPOINT: Final = 16
_SETTLE_S: Final = 0.5
_FAILSAFE: Final = "0"
_NAV: Final = "4"
_HOME: Final = "home"
_ALL_COMPONENTS: Final = 0
_STOP_SETTINGS: Final = ("kil_thr", "aut_kil_thr")
_CUSTOM_MODE_BIT: Final = 1
_HOME_NUMBER: Final = 2
"""Number of the autopilot's mode HOME, in the heartbeats of releases that send it; its base mode is that of NAV."""


def _explore(ask: Ask, target: Target) -> Mapping[str, int]:
    """Request the list of blocks once; the acknowledgement that ends it is sent before every change of block, which the
    listing otherwise prevents for 15 s."""
    counted = ask(Outgoing("SCRIPT_REQUEST_LIST", _to(target)), lambda reply: isinstance(reply, BlockCount))
    if not isinstance(counted, BlockCount):
        raise _without_blocks("It did not list the blocks of its flight plan.")
    blocks: dict[str, int] = {}
    for seq in range(counted.count):
        found = ask(Outgoing("SCRIPT_REQUEST", _to(target) | {"seq": seq}), partial(_is_block, seq))
        if not isinstance(found, Block):
            raise _without_blocks(f"It did not name block {seq} of {counted.count}.")
        blocks.setdefault(found.name, found.number)
    if missing := [name for name in BLOCKS if name not in blocks]:
        raise _without_blocks(f"Its flight plan has no block {', '.join(missing)}.")
    return blocks


def _is_block(number: int, reply: Measurement) -> bool:
    return isinstance(reply, Block) and reply.number == number


def _refer_to_ground(target: Target) -> tuple[Step, ...]:
    """Begin the flight plan again: "Wait GPS" waits for a position, "Geo init" sets the reference after 10 s."""
    begins = [name for name in GROUND_BLOCKS[:-1] if name in target.blocks]
    return (Step(_block(target, begins[0])),) if GEO_INIT in begins else ()


def _steps(action: Action, target: Target) -> tuple[Step, ...]:
    match action:
        case Action.ARM:
            return (
                Step((_climb_here(target),), awaits="waypoint"),
                Step(_block(target, HOLDING), pause_s=_SETTLE_S),
                Step(_block(target, START_ENGINE)),
            )
        case Action.TAKE_OFF:
            return (Step(_block(target, TAKE_OFF)),)
        case Action.HOLD | Action.FLY_TO:
            return (Step((_climb_here(target),), awaits="waypoint", attempts=commands.SET_POINT_ATTEMPTS),)
        case Action.LAND:
            return (Step(_block(target, LAND)),)
        case Action.MOTORS_OFF | Action.KILL:
            stops = (
                commands.set_parameter(target, name, 1.0, component=_ALL_COMPONENTS)
                for name in target.stop_settings or _STOP_SETTINGS
            )
            return (Step((commands.disarm(target), *stops)),)


def _to(target: Target) -> dict[str, float]:
    """Return the recipient of messages on blocks and waypoints: the MAVLink system id. Others have the aircraft id."""
    return {"target_system": target.system, "target_component": 0}


def _acknowledge(target: Target) -> Outgoing:
    return Outgoing("MISSION_ACK", _to(target) | {"type": 0})


def _block(target: Target, name: str) -> tuple[Outgoing, ...]:
    activate = Outgoing("SCRIPT_ITEM", {**_to(target), "seq": target.blocks[name], "name": ""})
    return (_acknowledge(target), activate)


def _climb_here(target: Target) -> Outgoing:
    """Return the message that sets the waypoint of the takeoff straight above the vehicle."""
    fields = {
        "seq": target.waypoint,
        "frame": _LOCAL_ENU,
        "command": _WAYPOINT,
        "current": 0,
        "autocontinue": 0,
        **{f"param{place}": 0.0 for place in range(1, 5)},
        "x": target.east_m,
        "y": target.north_m,
        "z": target.altitude_m,
    }
    return Outgoing("MISSION_ITEM", _to(target) | fields)


def _without_blocks(what: str) -> AutopilotError:
    return AutopilotError(
        f"The vehicle cannot be flown by its flight plan. {what}",
        hint=f"Use Paparazzi v5.8 or newer and a flight plan with the blocks {', '.join(BLOCKS)}.",
    )


def _heartbeat(message: Message) -> Measurement | None:
    """Read a HEARTBEAT; the mode is the base mode, except for HOME, without the bits for armed and for a custom mode,
    which newer releases set."""
    mode = str(int(number(message, "base_mode")) & ~(mavlink.ARMED_BIT | _CUSTOM_MODE_BIT))
    is_home = mode == _NAV and number(message, "custom_mode") == _HOME_NUMBER
    return mavlink.heartbeat(message, _HOME if is_home else mode)


def _version(message: Message) -> Version | None:
    """Read the version from decimal digits: 51000 is 5.10.0. Its `uid` is not a hardware id: its simulation also sends
    one."""
    packed = int(number(message, "flight_sw_version"))
    return Version(f"{packed // 10000}.{packed // 100 % 100}.{packed % 100}") if packed else None


PAPARAZZI: Final = Autopilot(
    name="paparazzi",
    title="Paparazzi",
    experiments=(Takeoff(), AltitudeSteps()),
    dialect=DIALECT,
    autopilot=9,
    label="Paparazzi (AR.Drone 2)",
    address="udp:192.168.1.1:4245@4244",
    simulated_address="udp:127.0.0.1:4245@4244",
    sends_to_port=True,
    heartbeat_s=0.5,
    lift_off_s=1.5,
    land_again_s=6.0,
    climbs_from_ground=False,
    reference="replica",
    flying_modes=frozenset({_NAV}),
    following_modes=frozenset({_NAV}),
    landing_modes=frozenset({_NAV}),
    automatic_modes=frozenset({_FAILSAFE, _NAV, _HOME, "8"}),
    mode_names=MappingProxyType({_NAV: "Automatic", _HOME: "Home", "8": "Guided", "64": "Manual", "80": "Manual"}),
    modes_without_land=MappingProxyType({_HOME: "it flies back by itself and ignores Land"}),
    mode_parameter=ModeParameter(
        "aut_mod", 13.0, MappingProxyType({0.0: _FAILSAFE, 1.0: _FAILSAFE, 2.0: _HOME, 19.0: "8"})
    ),
    arming_blocks=frozenset({HOLDING, START_ENGINE}),
    ground_blocks=GROUND_BLOCKS,
    flying_blocks=frozenset({TAKE_OFF}),
    landing_blocks=frozenset({LAND, *AFTER_LAND}),
    landed_blocks=frozenset({AFTER_LAND[-1]}),
    gain_sets=(
        (
            GainParameter("kp", "gui_v_kp", 0.0, 4000.0, whole=True),
            GainParameter("ki", "gui_v_ki", 0.0, 2000.0, whole=True, integrates=True),
            GainParameter("kd", "gui_v_kd", 0.0, 800.0, whole=True),
        ),
    ),
    parameter_file=PARAMETER_FILE,
    logs_own_names=True,
    parameter_component=_ALL_COMPONENTS,
    stop_settings=_STOP_SETTINGS,
    readers={
        **mavlink.READERS,
        "HEARTBEAT": _heartbeat,
        "MISSION_ACK": lambda message: CommandReply(
            "waypoint", number(message, "type") == 0, f"result {number(message, 'type'):.0f}"
        ),
        "SCRIPT_COUNT": lambda message: BlockCount(int(number(message, "count"))),
        "SCRIPT_ITEM": lambda message: Block(int(number(message, "seq")), text(message, "name")),
        "SCRIPT_CURRENT": lambda message: BlockEntered(int(number(message, "seq"))),
        "AUTOPILOT_VERSION": _version,
    },
    sends_hardware_id=False,
    reports_version=False,
    steps=_steps,
    holds_first=False,
    explore=_explore,
    conclude=lambda target: (_acknowledge(target),),
    refer_to_ground=_refer_to_ground,
)
"""v5.8 or newer, with the `mavlink` module and the blocks of the stock flight plans. It sends its version every few
seconds. Altitude is read only from LOCAL_POSITION_NED, because other messages mix their units."""
