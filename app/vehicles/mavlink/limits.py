"""What a trial keeps an eye on: a pure memory of what was heard, and the limits that it is held against."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final

from app.vehicles.mavlink import agreement
from app.vehicles.mavlink.agreement import Second
from app.vehicles.mavlink.failures import Failure, Finding
from app.vehicles.mavlink.measurements import Battery, BlockEntered, Breach, Heartbeat, Measurement, Position
from app.vehicles.mavlink.signals import Sighted

GROUND_M: Final = 0.15
"""Nearer to the ground than this a vehicle may stand on it."""
RESTING_M_S: Final = 0.1
FRESH_S: Final = 0.5
"""A sample older than this says nothing about where the vehicle is now."""

_HEARTBEATS_MISSED: Final = 3.5
_ATTENDED_S: Final = 0.1
"""The most that one packet tells of the time before it: what a stall delayed may come in any order."""
_JUMP_M: Final = 0.3
_JUMP_M_S: Final = 6.0
_ACCELERATION_M_S2: Final = 20.0
_MOST_GLITCHES: Final = 3
_OWN_CEILING_M: Final = 0.5
"""How far below our ceiling a vehicle's own may be."""
_LOW_BATTERY_S: Final = 1.0
_NO_BATTERY_S: Final = 10.0
_REBOOT_S: Final = 1.0
"""A clock that falls back by less is a packet that came late."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """`set_point_m` is on the vehicle's own datum, as altitudes are; `ceiling_m` counts from the ground under it;
    modes are as `Heartbeat` names them, empty where any will do, `mode_names` what people call them; heartbeats come
    every `heartbeat_s`. `blocks` are a flight plan's by number, `arming_blocks` and so on the names of those that
    the vehicle may be in, empty where it has none."""

    set_point_m: float
    heartbeat_s: float
    min_battery_v: float
    silent_s: float = 1.0
    stuck_s: float = 0.25
    ceiling_m: float = 4.5
    radius_m: float = 5.0
    climb_rate_m_s: float = 4.0
    crossing_m: float = 0.3
    crossings: int = 4
    flying_modes: frozenset[str] = frozenset()
    landing_modes: frozenset[str] = frozenset()
    mode_names: Mapping[str, str] = field(default_factory=dict)
    blocks: Mapping[int, str] = field(default_factory=dict)
    arming_blocks: frozenset[str] = frozenset()
    flying_blocks: frozenset[str] = frozenset()
    landing_blocks: frozenset[str] = frozenset()

    def stretched(self, patience: float) -> "Limits":
        """The same with so many times the patience for packets that do not come."""
        return replace(
            self,
            heartbeat_s=self.heartbeat_s * patience,
            silent_s=self.silent_s * patience,
            stuck_s=self.stuck_s * patience,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Watch:
    """What was heard so far. Times in s by the ground's clock, apart from those inside a Position."""

    heard_s: float
    heartbeat_s: float
    advanced_s: float
    battery_s: float
    battery_v: float | None = None
    low_since_s: float | None = None
    stuck_s: float = 0.0
    last: Position | None = None
    origin: Position | None = None
    doubted: Position | None = None
    glitches: int = 0
    side: int = -1
    crossings: int = 0
    armed: bool = False
    mode: str = ""
    block: str = ""
    block_s: float = 0.0
    second: Second | None = None
    rebooted: bool = False
    breached: bool = False


def begin(now_s: float, *, last: Position | None = None, battery_v: float | None = None) -> Watch:
    """Nothing is late yet. `last` is where the vehicle stands."""
    return Watch(
        heard_s=now_s,
        heartbeat_s=now_s,
        advanced_s=now_s,
        battery_s=now_s,
        battery_v=battery_v,
        last=last,
        origin=last,
    )


def hear(
    watch: Watch, measurement: Measurement | None, now_s: float, limits: Limits
) -> tuple[Watch, tuple[Position, ...]]:
    """The memory after one packet (None: one that measures nothing), and the positions that it makes certain."""
    stuck_s = watch.stuck_s + min(now_s - watch.heard_s, _ATTENDED_S)
    watch = replace(watch, heard_s=now_s, stuck_s=stuck_s)
    match measurement:
        case Position():
            return _hear_position(watch, measurement, now_s, limits)
        case Heartbeat(armed=armed, mode=mode):
            watch = replace(watch, heartbeat_s=now_s, armed=armed, mode=mode)
        case Battery(voltage_v=volts):
            low = volts < limits.min_battery_v
            since = (watch.low_since_s if watch.low_since_s is not None else now_s) if low else None
            watch = replace(watch, battery_v=volts, battery_s=now_s, low_since_s=since)
        case Breach():
            watch = replace(watch, breached=True)
        case BlockEntered(number=number):
            watch = replace(watch, block=limits.blocks.get(number, str(number)), block_s=now_s)
        case _:
            pass
    return watch, ()


def sight(watch: Watch, sighted: Sighted) -> Watch:
    """The memory after the second source of altitude spoke."""
    second = watch.second or Second(heard_s=sighted.now_s)
    vehicle_m = watch.last.altitude_m if watch.last is not None and is_fresh(watch, sighted.now_s) else None
    return replace(watch, second=agreement.sight(second, sighted, vehicle_m))


def find_on_ground(watch: Watch, limits: Limits, now_s: float) -> Finding | None:
    """The gravest limit that a vehicle does not keep that has not been told to take off."""
    if watch.rebooted:
        return Finding(failure=Failure.UNEXPECTED, why="The vehicle rebooted.")
    return find_link(watch, limits, now_s) or find_frozen(watch, limits, now_s) or find_battery(watch, now_s)


def too_many_glitches(watch: Watch) -> bool:
    return watch.glitches > _MOST_GLITCHES


def is_fresh(watch: Watch, now_s: float) -> bool:
    return watch.last is not None and now_s - watch.advanced_s < FRESH_S


def is_still(watch: Watch, now_s: float) -> bool:
    """Neither climbing nor sinking, as a fresh sample has it."""
    return watch.last is not None and is_fresh(watch, now_s) and abs(watch.last.climb_rate_m_s) < RESTING_M_S


def is_grounded(watch: Watch, now_s: float, ground_m: float) -> bool:
    """On the ground by height and by speed, as a fresh sample has it."""
    low = watch.last is not None and watch.last.altitude_m - ground_m < GROUND_M
    return low and watch.doubted is None and is_still(watch, now_s)


def is_airborne(watch: Watch, now_s: float, ground_m: float) -> bool:
    """Above the ground by height, as a fresh sample has it."""
    return watch.last is not None and is_fresh(watch, now_s) and watch.last.altitude_m - ground_m > GROUND_M


def _hear_position(
    watch: Watch, position: Position, now_s: float, limits: Limits
) -> tuple[Watch, tuple[Position, ...]]:
    newest = watch.doubted or watch.last
    if newest is not None and position.time_boot_s <= newest.time_boot_s:
        rebooted = position.time_boot_s < newest.time_boot_s - _REBOOT_S
        return replace(watch, rebooted=watch.rebooted or rebooted), ()
    watch = replace(watch, advanced_s=now_s, stuck_s=0.0)
    if watch.last is None or _follows(watch.last, position):
        lone = watch.doubted is not None
        watch = replace(watch, doubted=None, glitches=watch.glitches + lone)
        return _accept(watch, position, limits), (position,)
    if watch.doubted is None:
        return replace(watch, doubted=position), ()
    if _follows(watch.doubted, position):
        return _accept(replace(watch, doubted=None), position, limits), (watch.doubted, position)
    return replace(watch, doubted=position, glitches=watch.glitches + 1), ()


def _follows(one: Position, other: Position) -> bool:
    """Whether a vehicle can have come from one sample to the other."""
    elapsed_s = other.time_boot_s - one.time_boot_s
    expected_m = one.altitude_m + one.climb_rate_m_s * elapsed_s
    reach_m = _JUMP_M + 0.5 * _ACCELERATION_M_S2 * elapsed_s**2
    sudden = abs(other.climb_rate_m_s) > _JUMP_M_S >= abs(one.climb_rate_m_s)
    return abs(other.altitude_m - expected_m) <= reach_m and not sudden


def _accept(watch: Watch, position: Position, limits: Limits) -> Watch:
    above_m = position.altitude_m - limits.set_point_m
    side = watch.side if abs(above_m) <= limits.crossing_m else (1 if above_m > 0.0 else -1)
    crossed = watch.crossings + (side != watch.side)
    return replace(watch, last=position, origin=watch.origin or position, side=side, crossings=crossed)


def find_unexpected(
    watch: Watch, limits: Limits, modes: frozenset[str], blocks: frozenset[str] = frozenset()
) -> Finding | None:
    """`modes` and `blocks` are those that it may be in, empty where any will do."""
    if watch.rebooted:
        return Finding(failure=Failure.UNEXPECTED, why="The vehicle rebooted.")
    if not watch.armed:
        return Finding(failure=Failure.UNEXPECTED, why="The vehicle disarmed itself in the air.")
    if modes and watch.mode not in modes:
        return Finding(failure=Failure.UNEXPECTED, why=f"The vehicle went into mode {_named(watch, limits)}.")
    if blocks and watch.block and watch.block not in blocks:
        why = f"Its flight plan went to the block “{watch.block}”."
        return Finding(failure=Failure.UNEXPECTED, why=why)
    return None


def _named(watch: Watch, limits: Limits) -> str:
    return limits.mode_names.get(watch.mode, watch.mode)


def find_own_landing(watch: Watch, limits: Limits, ground_m: float, *, mode_known: bool) -> Finding | None:
    """For a vehicle that should fly. `mode_known`: its mode is not the one from before the command. So high up it is
    the vehicle's own ceiling, somewhat below ours, that was met."""
    why = ""
    if mode_known and watch.mode in limits.landing_modes - limits.flying_modes:
        why = f"It went into mode {_named(watch, limits)}."
    elif watch.block in limits.landing_blocks:
        why = f"Its flight plan went to the block “{watch.block}”."
    if not why or watch.last is None:
        return None
    if (height_m := watch.last.altitude_m - ground_m) > limits.ceiling_m - _OWN_CEILING_M:
        return Finding(failure=Failure.ENVELOPE, why=f"It was {height_m:.2f} m above the ground. {why}")
    return Finding(failure=Failure.OWN_LANDING, why=why)


def find_link(watch: Watch, limits: Limits, now_s: float) -> Finding | None:
    if now_s - watch.heard_s > limits.silent_s:
        return Finding(failure=Failure.LINK, why=f"Nothing was heard for {limits.silent_s:g} s.")
    if now_s - watch.heartbeat_s > _HEARTBEATS_MISSED * limits.heartbeat_s:
        return Finding(failure=Failure.LINK, why="Three heartbeats were missed.")
    return None


def find_envelope(watch: Watch, limits: Limits, ground_m: float, *, settling: bool) -> Finding | None:
    why = ""
    if watch.breached:
        why = "The vehicle's own fence was crossed."
    elif watch.last is not None and watch.origin is not None:
        last, origin = watch.last, watch.origin
        away_m = ((last.north_m - origin.north_m) ** 2 + (last.east_m - origin.east_m) ** 2) ** 0.5
        if (height_m := last.altitude_m - ground_m) > limits.ceiling_m:
            why = f"It flew at {height_m:.2f} m above the ground, over {limits.ceiling_m:g} m."
        elif abs(last.climb_rate_m_s) > limits.climb_rate_m_s:
            why = f"It flew at {last.climb_rate_m_s:+.1f} m/s, beyond {limits.climb_rate_m_s:g} m/s."
        elif away_m > limits.radius_m:
            why = f"It flew {away_m:.1f} m away from its start, over {limits.radius_m:g} m."
        elif settling and watch.crossings >= limits.crossings:
            why = f"It crossed its set point {watch.crossings} times, beyond ±{limits.crossing_m:g} m."
    return Finding(failure=Failure.ENVELOPE, why=why) if why else None


def find_frozen(watch: Watch, limits: Limits, now_s: float) -> Finding | None:
    if watch.stuck_s > limits.stuck_s:
        return Finding(failure=Failure.FROZEN, why=f"Its clock stood still for more than {limits.stuck_s:g} s.")
    return agreement.find_blind(watch.second, now_s, stuck_s=limits.stuck_s, silent_s=limits.silent_s)


def find_battery(watch: Watch, now_s: float) -> Finding | None:
    if watch.low_since_s is not None and now_s - watch.low_since_s > _LOW_BATTERY_S:
        return Finding(failure=Failure.BATTERY, why=f"The battery was at {watch.battery_v:.1f} V.")
    if now_s - watch.battery_s > _NO_BATTERY_S:
        return Finding(failure=Failure.BATTERY, why=f"No battery voltage was heard for {_NO_BATTERY_S:g} s.")
    return None
