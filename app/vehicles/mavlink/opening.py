"""Opening of a vehicle's link by its options."""

import datetime as dt
from collections.abc import Callable
from pathlib import Path
from typing import Final

from app.autopilots.commands import Target
from app.autopilots.dialects import read_key
from app.autopilots.registry import AUTOPILOTS
from app.core.clock import Clock, ScaledClock
from app.vehicles.kinds import Options
from app.vehicles.mavlink import addresses
from app.vehicles.mavlink.events import PacketReceived
from app.vehicles.mavlink.link import Link, Received
from app.vehicles.mavlink.radio import REPLY_TIMEOUT_S, AutopilotLink
from app.vehicles.mavlink.transports import Transport

TAKEOFF_ALTITUDE_M: Final = 3.0
MAX_UNSCALED_SPEED: Final = 4.0
"""Up to this clock speed the timeouts of a simulated vehicle are those of a real one. Beyond, they are longer by its
clock, because the pauses of a busy computer are in wall time."""


def open_radio(
    options: Options,
    clock: Clock | None,
    *,
    on_message: Callable[[Received], None] | None,
    on_wait: Callable[[list[PacketReceived]], None] = lambda _packets: None,
    is_silent: Callable[[], bool] = lambda: False,
    transport: Transport | None = None,
) -> AutopilotLink:
    """Open the link to a vehicle.

    `clock` is the vehicle's time, by default that of its options; for `on_message` and `on_wait` see AutopilotLink;
    no heartbeats are sent while `is_silent` returns true; `transport` replaces the address and the thread that reads
    it. Raises LinkError if the link or its log cannot be opened, InputError for a signing key that cannot be read or
    used.
    """
    profile = AUTOPILOTS[str(options["autopilot"])]
    clock = clock or ScaledClock(float(options["clock_speed"]))
    key_file = str(options["signing_key_file"])
    link = Link(
        addresses.parse(str(options["address"])),
        profile.dialect,
        clock=clock,
        target_system=int(options["system_id"]) or None,
        make=profile.autopilot,
        tlog=_log_path(str(options["log_folder"])),
        signing_key=read_key(Path(key_file)) if key_file else None,
        transport=transport,
        is_silent=is_silent,
    )
    target = Target(
        system=0,
        aircraft=int(options["aircraft_id"]),
        waypoint=int(options["climb_waypoint"]),
        altitude_m=TAKEOFF_ALTITUDE_M,
    )
    return AutopilotLink(
        link,
        profile,
        clock,
        target,
        reply_timeout_s=REPLY_TIMEOUT_S * max(1.0, float(options["clock_speed"]) / MAX_UNSCALED_SPEED),
        on_message=on_message,
        on_wait=on_wait,
    )


def _log_path(folder: str) -> Path | None:
    """Return a new file name for every opening, with its time in UTC; None without a folder."""
    if not folder:
        return None
    return Path(folder) / f"{dt.datetime.now(dt.UTC):%Y%m%dT%H%M%S.%f}.tlog"
