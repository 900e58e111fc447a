"""Before anything flies: who answers there, whether it stands still on the ground, and whether its failsafes are on."""

import statistics
from dataclasses import dataclass, replace
from typing import Final

from app.vehicles.errors import SafeGainsError, VehicleError
from app.vehicles.mavlink.failures import RESPONSES, Failure
from app.vehicles.mavlink.measurements import Heartbeat, Position
from app.vehicles.mavlink.parameters import read_parameter
from app.vehicles.mavlink.radio import Radio

HEARTBEAT_S: Final = 5.0
WATCHED_S: Final = 2.0
POSITIONS_HZ: Final = 40.0
_LISTEN_S: Final = 0.1
_STANDS_WITHIN_M: Final = 0.3
_BATTERY_S: Final = 10.0


@dataclass(frozen=True, slots=True)
class Ground:
    """Where the vehicle stands, on its own datum."""

    altitude_m: float
    last: Position


def meet(radio: Radio, address: str) -> None:
    """Wait for the heartbeat of an autopilot of the right make, sending nothing. Raises VehicleError when none comes
    within 5 s, SafeGainsError when the vehicle is armed already."""
    until_s = radio.clock.now_s() + HEARTBEAT_S
    makes: set[int] = set()
    while radio.clock.now_s() < until_s:
        radio.listen(_LISTEN_S)
        heartbeat = radio.seen.heartbeat
        if heartbeat is not None and heartbeat.autopilot == radio.profile.autopilot:
            _take_aim(radio, heartbeat)
            return
        if heartbeat is not None:
            makes.add(heartbeat.autopilot)
    others = f" Others were heard: MAVLink's autopilots {sorted(makes)}." if makes else ""
    raise VehicleError(
        f"{RESPONSES[Failure.NO_HEARTBEAT].text} Listened {HEARTBEAT_S:g} s at {address} for {radio.profile.title} "
        f"(dialect {radio.profile.dialect.name}).{others}",
        hint="See that the vehicle is on, sends to this computer's port, and has the autopilot that was named.",
    )


def _take_aim(radio: Radio, heartbeat: Heartbeat) -> None:
    aircraft = radio.aim.aircraft or heartbeat.system
    radio.aim = replace(radio.aim, system=heartbeat.system, aircraft=aircraft)
    require_disarmed(radio)


def require_disarmed(radio: Radio) -> None:
    """Raises SafeGainsError: nobody knows what an armed vehicle is doing, so nothing but Land may be sent to it."""
    if radio.seen.heartbeat is not None and radio.seen.heartbeat.armed:
        raise SafeGainsError(
            "The vehicle is armed, although nobody here armed it.",
            hint="Land it, see that its motors have stopped, then verify its gains and release it.",
        )


def prepare(radio: Radio, telemetry_hz: float) -> None:
    """Learn the flight plan, ask for telemetry, read the failsafes. Raises VehicleError for what is not as it must."""
    blocks = radio.profile.explore(radio.ask, radio.aim)
    radio.aim = replace(radio.aim, blocks=blocks)
    if why := radio.perform(radio.profile.prepare(radio.aim, telemetry_hz)):
        raise VehicleError(f"The vehicle could not be set up. {why}", hint="Read what it said, then try again.")
    _require_failsafes(radio)


def _require_failsafes(radio: Radio) -> None:
    off = [
        f"{requirement.parameter} ({requirement.what})"
        for requirement in radio.profile.requirements
        if not read_parameter(radio, requirement.parameter)
    ]
    if off:
        raise VehicleError(
            f"The vehicle's own failsafes are off, or it does not tell: {', '.join(off)}.",
            hint="Switch them on in the autopilot: when the link is lost, nothing else brings it down.",
        )


def stand(radio: Radio, *, min_battery_v: float, watched_s: float = WATCHED_S) -> Ground:
    """Watch the vehicle on the ground. Raises VehicleError naming everything that is not as it must be before a flight,
    SafeGainsError when it is armed."""
    radio.listen(0.0)
    radio.seen.positions.clear()
    begun_s = radio.clock.now_s()
    while (now_s := radio.clock.now_s()) < begun_s + watched_s or (
        radio.seen.battery_v is None and now_s < begun_s + _BATTERY_S
    ):
        radio.listen(_LISTEN_S)
    require_disarmed(radio)
    positions = [position for _, position in radio.seen.positions]
    if problems := [*_motion_problems(positions), *_battery_problems(radio.seen.battery_v, min_battery_v)]:
        raise VehicleError(
            f"The vehicle is not ready to fly. {' '.join(problems)}", hint="Correct this, then try again."
        )
    return Ground(statistics.median(position.altitude_m for position in positions), positions[-1])


def _motion_problems(positions: list[Position]) -> list[str]:
    if len(positions) < 2 or positions[-1].time_boot_s <= positions[0].time_boot_s:
        return [f"{len(positions)} positions came instead of {POSITIONS_HZ:g} a second."]
    problems = []
    rate_hz = (len(positions) - 1) / (positions[-1].time_boot_s - positions[0].time_boot_s)
    if rate_hz < POSITIONS_HZ:
        problems.append(f"Its position comes {rate_hz:.1f} times a second, it takes {POSITIONS_HZ:g}.")
    altitudes = [position.altitude_m for position in positions]
    if (moved_m := max(altitudes) - min(altitudes)) > _STANDS_WITHIN_M:
        problems.append(f"Its altitude moved by {moved_m:.2f} m on the ground.")
    return problems


def _battery_problems(battery_v: float | None, min_battery_v: float) -> list[str]:
    if battery_v is None:
        return [f"It did not tell its battery's voltage within {_BATTERY_S:g} s."]
    if battery_v < min_battery_v:
        return [f"Its battery is at {battery_v:.1f} V, below {min_battery_v:g} V."]
    return []
