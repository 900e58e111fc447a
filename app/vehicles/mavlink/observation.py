"""What is remembered of a vehicle during a trial, and what may be believed of it: a pure memory.

One message decides nothing that leaves the vehicle alone. That it disarmed, changed its mode or rebooted is believed
of two witnesses that are apart in time, with none between them that says otherwise; a position that cannot follow from
the one before, or whose clock cannot, is doubted until more of its kind have come and none of the others.
"""

from dataclasses import dataclass, replace
from typing import Final

from app.vehicles.mavlink import secondary_altitude
from app.vehicles.mavlink.events import (
    Battery,
    BlockEntered,
    FenceBreach,
    Heartbeat,
    LandedState,
    Measurement,
    Position,
    SecondaryAltitudeReceived,
)
from app.vehicles.mavlink.failures import GROUND_M, Limits
from app.vehicles.mavlink.secondary_altitude import SecondaryAltitude

RESTING_M_S: Final = 0.1
FRESH_S: Final = 0.5
"""A sample older than this says nothing about where the vehicle is now."""
AGREED_S: Final = 1.0
"""For how long every witness has to have seen the vehicle on the ground before its motors may be stopped."""

_ATTENDED_S: Final = 0.1
"""The most that one packet tells of the time before it: what a stall delayed may come in any order."""
_JUMP_M: Final = 0.3
_JUMP_M_S: Final = 6.0
_ACCELERATION_M_S2: Final = 20.0
_MAX_GLITCHES: Final = 3
_DOUBTED_LIMIT: Final = 10.0
_RESTLESS_DRAINS_S: Final = 5.0
"""Doubted samples a second that are borne; ten more than that, and the position jumps to and fro."""
_AHEAD_S: Final = 2.0
"""By how much the vehicle's clock may gain on ours between two packets: the second may have come the quicker way."""
_BACK_S: Final = 1.0
"""A clock that falls back by less is a packet that came late."""
_SAME_CLOCK_S: Final = 0.5
_REBOOTED_S: Final = 0.4
BEHIND_M: Final = 0.5
"""An altitude that has stayed so far behind the climb rate does not follow it."""
_DRIFT_M: Final = 1.0
"""How far off an altitude may be that drifted while it flew."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherClock:
    """Positions by another clock than that of the record: from `first_s` on (ours), the last one at `last_s`."""

    first_s: float
    last_s: float
    last: Position


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialObservation:
    """What was heard so far. Times in s by the ground's clock, apart from those inside a Position.

    `heard_s`: any packet; `advanced_s`: a position with a new time stamp; `accepted_s`: one that was not doubted.
    `armed` and `mode` are as the last heartbeat has them, and since when all of them agree. `leapt`: the altitude once
    went on from somewhere else than where it was.
    """

    heard_s: float
    heartbeat_s: float
    advanced_s: float
    accepted_s: float
    battery_s: float
    heartbeat_gap_s: float = 0.0
    """Between the last two heartbeats."""
    battery_v: float | None = None
    low_since_s: float | None = None
    stuck_s: float = 0.0
    last: Position | None = None
    origin: Position | None = None
    doubted: Position | None = None
    other: OtherClock | None = None
    glitches: int = 0
    restless: float = 0.0
    leapt: bool = False
    side: int = -1
    crossings: int = 0
    armed: bool = False
    armed_since_s: float = 0.0
    mode: str = ""
    mode_since_s: float = 0.0
    block: str = ""
    block_s: float = 0.0
    landed: bool | None = None
    landed_s: float = 0.0
    grounded_since_s: float | None = None
    highest_m: float = float("-inf")
    """Of its altitudes since the command."""
    lifted: bool = False
    """Whether it was ever above the ground."""
    behind_m: float = 0.0
    """How far its altitude stayed behind its climb rate, before it was first above the ground."""
    second: SecondaryAltitude | None = None
    rebooted: bool = False
    breached: str = ""
    """Which limit of its own fence it has crossed; empty while none."""
    doubled: str = ""
    """Why it is believed that two speak under its id; empty while one does."""


def begin(
    now_s: float, *, last: Position | None = None, battery_v: float | None = None, stood_s: float = 0.0
) -> TrialObservation:
    """Nothing is late yet. `last` is where the vehicle stands, and was watched standing for `stood_s`."""
    return TrialObservation(
        heard_s=now_s,
        heartbeat_s=now_s,
        advanced_s=now_s,
        accepted_s=now_s,
        battery_s=now_s,
        battery_v=battery_v,
        last=last,
        origin=last,
        grounded_since_s=None if last is None else now_s - stood_s,
    )


def reset_altitude(watch: TrialObservation) -> TrialObservation:
    """The memory of a vehicle on the ground whose altitude begins anew: what it was before says nothing any more."""
    second = None if watch.second is None else replace(watch.second, apart_m=0.0, apart_since_s=None)
    return replace(watch, leapt=False, lifted=False, behind_m=0.0, side=-1, crossings=0, second=second)


def update(
    watch: TrialObservation, measurement: Measurement | None, now_s: float, limits: Limits
) -> tuple[TrialObservation, tuple[Position, ...]]:
    """The memory after one packet (None: one that measures nothing), and the positions that it makes certain."""
    stuck_s = watch.stuck_s + min(now_s - watch.heard_s, _ATTENDED_S)
    watch = replace(watch, heard_s=now_s, stuck_s=stuck_s)
    match measurement:
        case Position():
            return _hear_position(watch, measurement, now_s, limits)
        case Heartbeat():
            watch = _hear_heartbeat(watch, measurement, now_s)
        case Battery(voltage_v=float(volts)):
            low = volts < limits.min_battery_v
            since = (watch.low_since_s if watch.low_since_s is not None else now_s) if low else None
            watch = replace(watch, battery_v=volts, battery_s=now_s, low_since_s=since)
        case FenceBreach(limit=limit):
            watch = replace(watch, breached=limit or "some limit")
        case LandedState(on_ground=landed):
            watch = replace(watch, landed=landed, landed_s=now_s)
        case BlockEntered(number=number):
            watch = replace(watch, block=limits.blocks.get(number, str(number)), block_s=now_s)
        case _:
            pass
    return watch, ()


def sight(watch: TrialObservation, sighted: SecondaryAltitudeReceived) -> TrialObservation:
    """The memory after the second source of altitude spoke."""
    second = watch.second or SecondaryAltitude(heard_s=sighted.now_s)
    vehicle_m = watch.last.altitude_m if watch.last is not None and is_fresh(watch, sighted.now_s) else None
    return replace(watch, second=secondary_altitude.update(second, sighted, vehicle_m))


def settle(watch: TrialObservation, now_s: float, ground_m: float) -> TrialObservation:
    """Note since when every witness has it on the ground: its own position by height and speed, what it says of itself,
    and the second source. A lone sample that jumps says nothing either way."""
    if watch.doubted is not None and is_fresh(watch, now_s):
        return watch
    watch = replace(watch, lifted=watch.lifted or is_airborne(watch, now_s, ground_m))
    since_s = watch.grounded_since_s if watch.grounded_since_s is not None else now_s
    grounded = is_grounded(watch, now_s, ground_m) and not is_said_to_fly(watch, now_s, ground_m)
    return replace(watch, grounded_since_s=since_s if grounded else None)


# ---- what may be believed


def too_many_glitches(watch: TrialObservation) -> bool:
    return watch.glitches > _MAX_GLITCHES


def has_unreliable_position(watch: TrialObservation) -> bool:
    return watch.restless > _DOUBTED_LIMIT


def is_fresh(watch: TrialObservation, now_s: float) -> bool:
    return watch.last is not None and now_s - watch.accepted_s < FRESH_S


def is_still(watch: TrialObservation, now_s: float, ground_m: float, *, within_m: float = _DRIFT_M) -> bool:
    """Neither climbing nor sinking so near to the ground, as a fresh sample has it."""
    last = watch.last
    low = last is not None and last.altitude_m - ground_m < within_m
    return low and last is not None and is_fresh(watch, now_s) and abs(last.climb_rate_m_s) < RESTING_M_S


def is_grounded(watch: TrialObservation, now_s: float, ground_m: float) -> bool:
    """On the ground by height and by speed, as a fresh sample has it."""
    return watch.doubted is None and is_still(watch, now_s, ground_m, within_m=GROUND_M)


def is_airborne(watch: TrialObservation, now_s: float, ground_m: float) -> bool:
    """Above the ground by height, as a fresh sample has it."""
    return watch.last is not None and is_fresh(watch, now_s) and watch.last.altitude_m - ground_m > GROUND_M


def is_said_to_fly(watch: TrialObservation, now_s: float, ground_m: float) -> bool:
    """By what it says of itself, or by where the second source sees it, whatever its altitude."""
    says_so = watch.landed is False and now_s - watch.landed_s < AGREED_S
    seen_m = secondary_altitude.current_altitude_m(watch.second, now_s)
    return says_so or (seen_m is not None and seen_m - ground_m > GROUND_M)


def is_behind_climb_rate(watch: TrialObservation) -> bool:
    """Whether its altitude stands still while it rises, by its climb rate."""
    return watch.behind_m > BEHIND_M


def is_disarmed(watch: TrialObservation, limits: Limits) -> bool:
    """By two heartbeats at least, and none between them that says otherwise."""
    return not watch.armed and watch.heartbeat_s - watch.armed_since_s >= limits.confirmation_s


def mode_of(watch: TrialObservation, limits: Limits) -> str:
    """The mode that heartbeats agree upon; empty while they do not."""
    return watch.mode if watch.heartbeat_s - watch.mode_since_s >= limits.confirmation_s else ""


def may_stop_motors(watch: TrialObservation, now_s: float) -> bool:
    """Whether its motors may be stopped without a person's word."""
    return not find_doubt_of_ground(watch, now_s)


def find_doubt_of_ground(watch: TrialObservation, now_s: float) -> str:
    """Why it may not be on the ground; empty once every witness has had it there for a second, and where it is has
    never leapt."""
    since_s = watch.grounded_since_s
    if watch.doubled:
        return "two vehicles may be speaking under its system id"
    if watch.rebooted:
        return "it rebooted during the flight"
    if watch.leapt:
        return "its altitude leapt during the flight"
    if is_behind_climb_rate(watch):
        return "its altitude did not follow its climb rate"
    if since_s is None or now_s - since_s < AGREED_S:
        return f"not every witness has had it on the ground for {AGREED_S:g} s"
    return ""


# ---- positions and heartbeats


def _hear_heartbeat(watch: TrialObservation, heartbeat: Heartbeat, now_s: float) -> TrialObservation:
    return replace(
        watch,
        heartbeat_s=now_s,
        heartbeat_gap_s=now_s - watch.heartbeat_s,
        armed=heartbeat.armed,
        armed_since_s=watch.armed_since_s if heartbeat.armed == watch.armed else now_s,
        mode=heartbeat.mode,
        mode_since_s=watch.mode_since_s if heartbeat.mode == watch.mode else now_s,
    )


def _hear_position(
    watch: TrialObservation, position: Position, now_s: float, limits: Limits
) -> tuple[TrialObservation, tuple[Position, ...]]:
    last, doubted = watch.last, watch.doubted
    newest = doubted or last
    if newest is not None:
        gained_s = position.time_boot_s - newest.time_boot_s
        if gained_s <= 0.0 or gained_s > now_s - watch.advanced_s + _AHEAD_S:
            return _hear_other_clock(watch, position, now_s, newest), ()
    quiet_s = now_s - watch.advanced_s
    restless = max(watch.restless - _RESTLESS_DRAINS_S * quiet_s, 0.0)
    watch = replace(watch, advanced_s=now_s, stuck_s=0.0, restless=restless)
    if last is None or _follows(last, position):
        lone = doubted is not None
        watch = replace(watch, doubted=None, glitches=watch.glitches + lone)
        return _accept(watch, position, now_s, limits), (position,)
    watch = replace(watch, restless=watch.restless + 1.0)
    if doubted is None:
        return replace(watch, doubted=position), ()
    if _follows(doubted, position):
        leapt = replace(watch, doubted=None, leapt=watch.leapt or _leaps(last, doubted))
        return _accept(leapt, position, now_s, limits), (doubted, position)
    return replace(watch, doubted=position, glitches=watch.glitches + 1), ()


def _hear_other_clock(watch: TrialObservation, position: Position, now_s: float, newest: Position) -> TrialObservation:
    """Late, repeated, or ahead: out of order. Only a clock that fell back and goes on from there by itself, with
    nothing more from the one before, is that of a vehicle that has rebooted."""
    other = watch.other
    goes_on = other is not None and _is_same_clock(other, position, now_s)
    first_s = other.first_s if other is not None and goes_on else now_s
    is_alone = watch.accepted_s <= first_s and watch.advanced_s <= first_s
    fell_back = position.time_boot_s < newest.time_boot_s - _BACK_S
    watch = replace(watch, other=OtherClock(first_s=first_s, last_s=now_s, last=position))
    if not (fell_back and is_alone and goes_on):
        return watch
    if now_s - first_s < _REBOOTED_S:
        return replace(watch, stuck_s=0.0)
    return replace(watch, rebooted=True, last=position, doubted=None, advanced_s=now_s, accepted_s=now_s)


def _is_same_clock(other: OtherClock, position: Position, now_s: float) -> bool:
    gained_s = position.time_boot_s - other.last.time_boot_s
    return gained_s > 0.0 and abs(gained_s - (now_s - other.last_s)) < _SAME_CLOCK_S


def _follows(one: Position, other: Position) -> bool:
    """Whether a vehicle can have come from one sample to the other."""
    sudden = abs(other.climb_rate_m_s) > _JUMP_M_S >= abs(one.climb_rate_m_s)
    return not (sudden or _leaps(one, other))


def _leaps(one: Position, other: Position) -> bool:
    """Whether the other is farther from where the first one's speed leads than a vehicle can accelerate."""
    elapsed_s = other.time_boot_s - one.time_boot_s
    off_m = other.altitude_m - (one.altitude_m + one.climb_rate_m_s * elapsed_s)
    return abs(off_m) > _JUMP_M + 0.5 * _ACCELERATION_M_S2 * elapsed_s**2


def _accept(watch: TrialObservation, position: Position, now_s: float, limits: Limits) -> TrialObservation:
    above_m = position.altitude_m - limits.set_point_m
    side = watch.side if abs(above_m) <= limits.crossing_m else (1 if above_m > 0.0 else -1)
    crossed = watch.crossings + (side != watch.side)
    return replace(
        watch,
        behind_m=_behind_m(watch, position),
        highest_m=max(watch.highest_m, position.altitude_m),
        accepted_s=now_s,
        last=position,
        origin=watch.origin or position,
        side=side,
        crossings=crossed,
        other=None,
    )


def _behind_m(watch: TrialObservation, position: Position) -> float:
    last = watch.last
    if last is None or watch.lifted or is_behind_climb_rate(watch):
        return watch.behind_m
    climb_rate_m_s = position.climb_rate_m_s if abs(position.climb_rate_m_s) > RESTING_M_S else 0.0
    climbed_m = climb_rate_m_s * (position.time_boot_s - last.time_boot_s)
    return watch.behind_m + climbed_m - (position.altitude_m - last.altitude_m)
