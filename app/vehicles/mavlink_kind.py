"""The kind `mavlink`: vehicles with one of the registered autopilots, controlled over a MAVLink link."""

import math
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final

from app.autopilots.autopilot import Autopilot, check_gains
from app.autopilots.registry import AUTOPILOTS
from app.core.clock import Clock, ScaledClock
from app.core.definition import Option
from app.core.errors import InputError, Problem
from app.core.policy import Gains
from app.vehicles.base import ALTITUDE_LIMIT_M, HIGHEST_SET_POINT_M, LAND_COMMAND_S, RECORDED_BEYOND_S, Identity
from app.vehicles.kinds import HERE, Hosts, Options, VehicleKind
from app.vehicles.mavlink import addresses
from app.vehicles.mocap import addresses as sources

if TYPE_CHECKING:
    from app.vehicles.mavlink.altitude_sources import AltitudeSource
    from app.vehicles.mavlink.vehicle import MavlinkVehicle

SCORED: Final = ("vehicle", "mocap")

_PLANNED: Final = tuple(each for each in AUTOPILOTS.values() if each.flying_blocks)
"""Autopilots that fly by a flight plan on board, which lands the vehicle after its own time limit."""
_SIGNING: Final = tuple(each for each in AUTOPILOTS.values() if each.dialect.can_sign)
_DEFAULT: Final = next(iter(AUTOPILOTS.values()))


def _names(autopilots: Iterable[Autopilot]) -> tuple[str, ...]:
    return tuple(each.name for each in autopilots)


def _titles(autopilots: Iterable[Autopilot]) -> str:
    return ", ".join(each.title for each in autopilots)


def _choice(names: Iterable[str]) -> str:
    *others, last = names
    return f"{', '.join(others)} or {last}"


def is_simulated(options: Options, simulation_hosts: Hosts = HERE) -> bool:
    """Whether the vehicle is declared as simulated and its address is on this computer or one of `simulation_hosts`."""
    return bool(options["simulated"]) and _may_simulate(addresses.parse(str(options["address"])), simulation_hosts)


def _may_simulate(address: addresses.Address, simulation_hosts: Hosts) -> bool:
    return addresses.is_loopback(address) or (address.kind != "serial" and address.place in simulation_hosts)


def _open(
    options: Options,
    safe_gains: Gains,
    trial_parameters: Path | None,
    identity: Identity | None = None,
    on_wait: Callable[[], None] = lambda: None,
    was_flying: bool = False,
    *,
    observes: bool = False,
) -> "MavlinkVehicle":
    """Open the vehicle. It counts as REAL unless it is on this computer: other simulation hosts are not known here.

    The modules that talk to a vehicle are imported here, so that only the process that opens one loads them.
    """
    from app.vehicles.mavlink.vehicle import MavlinkVehicle  # noqa: PLC0415

    clock = ScaledClock(float(options["clock_speed"]))
    place = str(options["second_source"])
    source = open_source(place, clock) if place else None
    try:
        return MavlinkVehicle(
            options,
            safe_gains,
            is_real=not is_simulated(options),
            clock=clock,
            identity=identity,
            observes=observes,
            decided=identity is not None,
            was_flying=was_flying,
            trial_parameters=trial_parameters,
            source=source,
            on_wait=on_wait,
        )
    except BaseException:
        if source is not None:
            source.close()
        raise


def open_source(place: str, clock: Clock) -> "AltitudeSource":
    """Open the second source of altitude at this address. Raises InputError for an invalid address, VehicleError if
    nothing is received there; odometry on the vehicle's own link is not waited for."""
    from app.vehicles.mocap.natnet import NatNetSource  # noqa: PLC0415
    from app.vehicles.mocap.odometry import OdometrySource, StreamSource  # noqa: PLC0415

    match sources.parse(place):
        case sources.NatNetAddress() as address:
            return NatNetSource(address, clock)
        case sources.OdometryAddress():
            return OdometrySource("odometry on the vehicle's own link", clock)
        case sources.StreamAddress() as address:
            return StreamSource(address, clock)


def _longest_window_s(options: Options) -> float:
    if options["autopilot"] not in _names(_PLANNED):
        return math.inf
    return float(options["plan_time_s"]) - RECORDED_BEYOND_S - LAND_COMMAND_S


def _conflicts(options: Options, simulation_hosts: Hosts) -> tuple[Problem, ...]:
    problems = []
    autopilot = AUTOPILOTS.get(str(options["autopilot"]))
    if autopilot is None:
        problems.append(Problem("autopilot", f"must be {', '.join(AUTOPILOTS)}, got {options['autopilot']}"))
    try:
        address = addresses.parse(str(options["address"]))
        if autopilot and autopilot.sends_to_port and address.kind == "udp" and address.local_port is None:
            usual = autopilot.address.rpartition("@")[2]
            problems.append(
                Problem(
                    "address",
                    f"must name the port of this computer that {autopilot.title} sends to: {address}@LOCALPORT, "
                    f"usually @{usual}",
                )
            )
        if options["simulated"] and not _may_simulate(address, simulation_hosts):
            here = " or ".join(("127.0.0.1", *sorted(simulation_hosts)))
            problems.append(Problem("simulated", f"must be off for {address}: a simulation has the address {here}"))
    except InputError as error:
        problems += error.problems
    problems += _second_source_problems(str(options["second_source"]), str(options["scored_source"]))
    if options["signing_key_file"] and autopilot and not autopilot.dialect.can_sign:
        reason = f"is not supported: {autopilot.title} uses MAVLink 1, which has no signatures"
        problems.append(Problem("signing_key_file", reason))
    if options["clock_speed"] != 1.0 and not options["simulated"]:
        problems.append(Problem("clock_speed", "must be 1: a real vehicle flies in real time"))
    return tuple(problems)


def _autopilot(options: Options) -> Autopilot:
    return AUTOPILOTS[str(options["autopilot"])]


def _second_source_problems(place: str, scored: str) -> tuple[Problem, ...]:
    if scored not in SCORED:
        return (Problem("scored_source", f"must be {' or '.join(SCORED)}, got {scored}"),)
    if not place:
        return (Problem("scored_source", "needs a second source of altitude"),) if scored == "mocap" else ()
    try:
        sources.parse(place)
    except InputError as error:
        return error.problems
    return ()


def _plan_option(name: str, title: str, default: float, unit: str, lower: float, upper: float) -> Option:
    """A setting of vehicles that fly by a flight plan on board."""
    return Option(name, f"{_titles(_PLANNED)}{title}", default, unit, lower, upper, autopilots=_names(_PLANNED))


MAVLINK: Final = VehicleKind(
    name="mavlink",
    title="Vehicle over MAVLink",
    line=f"A real vehicle with {_choice(each.title for each in AUTOPILOTS.values())}, or a simulated one with the same "
    "protocol.",
    is_real=True,
    experiments=tuple(dict.fromkeys(each.name for autopilot in AUTOPILOTS.values() for each in autopilot.experiments)),
    options=(
        Option("autopilot", f"Autopilot: {_choice(AUTOPILOTS)}", _DEFAULT.name, label="Kind of autopilot"),
        Option(
            "address",
            "Address of the vehicle: udp:HOST:PORT@LOCALPORT, udpin:…, tcp:… or serial:DEVICE:BAUD",
            _DEFAULT.simulated_address,
            label="Address",
        ),
        Option("simulated", "Simulated vehicle on this computer", False),
        Option("system_id", "MAVLink system id; 0: the first autopilot received", 0.0, "", 0.0, 255.0),
        _plan_option("aircraft_id", "'s aircraft id (AC_ID); 0: the same as the system id", 0.0, "", 0.0, 255.0),
        Option("telemetry_hz", "Requested rate of positions", 50.0, "Hz", 40.0, 200.0),
        _plan_option("climb_waypoint", ": number of the waypoint that the takeoff climbs to", 2.0, "", 1.0, 254.0),
        Option("min_battery_v", "Lowest battery voltage to fly with", 10.5, "V", 0.0, 60.0),
        Option("radius_m", "Maximum distance from the start", 5.0, "m", 0.5, 100.0),
        _plan_option("plan_radius_m", ": maximum distance from HOME in the flight plan", 8.0, "m", 0.5, 1000.0),
        _plan_option("plan_time_s", ": time limit of the flight plan's takeoff", 45.0, "s", 15.0, 600.0),
        Option("clock_speed", "Speed of the vehicle's clock; 1 for a real vehicle", 1.0, "×", 0.1, 100.0),
        Option(
            "second_source",
            "Second source of altitude: natnet:HOST?body=ID, odometry or mavlink:ADDRESS; empty: none",
            "",
            label="Second source of altitude",
        ),
        Option("scored_source", "Scored source of altitude", "vehicle", choices=SCORED),
        Option(
            "signing_key_file",
            f"{_titles(_SIGNING)}: file with the 64 hexadecimal digits of the MAVLink 2 signing key; empty: unsigned",
            "",
            label="Signing key file",
            autopilots=_names(_SIGNING),
        ),
        Option(
            "log_folder", "Folder for the telemetry logs of all flights; empty: none", "", label="Telemetry log folder"
        ),
    ),
    open=_open,
    connect=partial(_open, observes=True),
    find_conflicts=_conflicts,
    is_simulation=is_simulated,
    experiments_for=lambda options: tuple(each.name for each in _autopilot(options).experiments),
    check_gains=lambda options, gains: check_gains(gains, _autopilot(options).gain_sets[0]),
    longest_window_s=_longest_window_s,
    altitude_limit_m=ALTITUDE_LIMIT_M,
    highest_set_point_m=HIGHEST_SET_POINT_M,
)
