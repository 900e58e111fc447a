"""`gainline sim-drone`: a simulated drone that speaks MAVLink like a real autopilot."""

import signal
from collections.abc import Sequence
from contextlib import ExitStack, closing

from app.autopilots.simulated_kinds import SIMULATED
from app.cli.console import console
from app.common.errors import InputError, Problem
from app.core.clock import ScaledClock
from app.simdrone.catalogue import get_autopilot, new_body
from app.simdrone.drone import Drone, Server, parse_fault
from app.simdrone.motion_capture import open_outlet
from app.vehicles.mavlink.addresses import Address, is_loopback, parse
from app.vehicles.mavlink.transports import open_transport
from app.vehicles.mocap.addresses import NatNetAddress, SourceAddress, StreamAddress
from app.vehicles.mocap.addresses import parse as parse_source


def run_sim_drone(
    autopilot: str | None,
    *,
    link: str | None,
    vehicle: str,
    settings: Sequence[str],
    seed: int,
    speed: float,
    catch_up_s: float,
    faults: Sequence[str],
    system: int | None,
    failsafes: bool,
    mocap: str | None,
    any_network: bool,
) -> None:
    """Serve the drone until SIGINT or SIGTERM; for the main thread only.

    Raises InputError for settings that cannot be used, and LinkError when the link cannot be opened.
    """
    kind = get_autopilot(autopilot or next(iter(SIMULATED)))
    address = parse(link or kind.link)
    seen_at = None if mocap is None else parse_source(mocap)
    if not any_network:
        _require_loopback("--link", address)
        _require_loopback("--mocap", _mocap_address(seen_at))
    planned = [parse_fault(text) for text in faults]
    clock = ScaledClock(speed)
    number = kind.system if system is None else system
    switch_on = kind.set_up if failsafes else kind.make
    body = new_body(vehicle, _options(settings), seed=seed)
    with ExitStack() as opened:
        outlet = None if seen_at is None else opened.enter_context(closing(open_outlet(seen_at)))
        drone = Drone(body, lambda fresh: switch_on(fresh, number), planned, outlet)
        transport = opened.enter_context(closing(open_transport(address)))
        server = Server(drone, transport, clock, catch_up_s=catch_up_s)
        out = console()
        out.print(f"{kind.title}, system {number}, flight model {vehicle}, on {address}.")
        if seen_at is not None:
            out.print(f"Motion capture: {seen_at}.")
        out.print(f"Simulated time runs at {speed:g} times real time. Press Ctrl-C to stop.")
        for each in (signal.SIGINT, signal.SIGTERM):
            signal.signal(each, lambda *_: server.stop())
        server.run()
        if server.lost_s > 0.0:
            out.print(f"This computer was too slow: the drone's clock is {server.lost_s:.1f} s behind.")


def _mocap_address(source: SourceAddress | None) -> Address | None:
    """Address at which the motion capture data is received; None if it goes over the drone's own link."""
    match source:
        case StreamAddress(link):
            return link
        case NatNetAddress():
            return Address("udpin", source.host, source.command_port)
        case _:
            return None


def _require_loopback(option: str, address: Address | None) -> None:
    if address is not None and not is_loopback(address):
        raise InputError(
            "A simulated drone accepts links on this computer only.",
            problems=(Problem(option, f"{address} is not an address of this computer"),),
            hint="Anyone who can reach the address can fly the drone. To allow that, add --any-network.",
        )


def _options(settings: Sequence[str]) -> dict[str, float]:
    """Parse `NAME=NUMBER` settings, each an option of the body's vehicle kind."""
    options: dict[str, float] = {}
    for setting in settings:
        name, _, number = setting.partition("=")
        try:
            options[name] = float(number)
        except ValueError as error:
            raise InputError(
                "Invalid setting.",
                problems=(Problem(f"--set {name}", f"must be NAME=NUMBER, got {setting!r}"),),
                hint="For example --set wind_m_s=3; docs/vehicles.md lists the settings of jsbsim and twin.",
            ) from error
    return options
