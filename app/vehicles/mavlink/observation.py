"""Observation of a vehicle during a trial, and plausibility of its messages, as pure functions.

No single message may end the control of the vehicle. A disarming, a change of mode or a reboot counts only if two
messages apart in time confirm it and none between them contradicts. A position that cannot follow from the previous
one, by itself or by its clock, is doubted until more of the same kind have arrived and none of the previous kind.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, TypeVar

from app.autopilots.measurements import (
    Attitude,
    Battery,
    BlockEntered,
    FenceBreach,
    Heartbeat,
    InvalidPosition,
    LandedState,
    Measurement,
    Position,
)
from app.vehicles.mavlink.boot_clock import (
    AHEAD_S,
    BACK_S,
    EARLY_S,
    RESTARTED_S,
    STEPPED_S,
    OtherClock,
    may_have_begun,
    unwrapped,
)
from app.vehicles.mavlink.events import SecondaryAltitudeReceived
from app.vehicles.mavlink.failures import GROUND_M, Limits
from app.vehicles.mavlink.states import replace

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Record = TypeVar("Record", bound="DataclassInstance")

RESTING_M_S: Final = 0.1
FRESH_S: Final = 0.5
"""Greatest age of a sample, since it was sent, that counts as the current position."""
AGREED_S: Final = 1.0
"""Time for which every source must show the vehicle on the ground before its motors may be stopped."""

_ATTENDED_S: Final = 0.1
"""Longest time before a packet or a sample that it accounts for: delayed by a stall, they may arrive at once, in any
order."""
_JUMP_M: Final = 0.3
_JUMP_M_S: Final = 6.0
_ACCELERATION_M_S2: Final = 20.0
_ACCELERATING_S: Final = 0.3
"""Longest time for which such an acceleration lasts in one direction."""
_UNSEEN_M_S: Final = 1.5
"""Further change of altitude per second of a longer gap, as in a landing. A faster one, unseen, is a jump."""
_CLOCK_DRIFT: Final = 0.1
"""Share by which the vehicle's clock may be slower than ours."""
_MAX_GLITCHES: Final = 3
_DOUBTED_LIMIT: Final = 10.0
_DOUBT_DECAY_1_S: Final = 5.0
"""Tolerated doubted samples per second; with `_DOUBTED_LIMIT` more than that, the position is unreliable."""
BEHIND_M: Final = 0.5
"""An altitude that has fallen behind the integrated climb rate by more than this does not follow it."""
DRIFT_M: Final = 1.0
"""Greatest drift of an altitude during a flight."""
_DRIFT_M_S: Final = 0.5
"""Greatest rate of such a drift on the ground; 0.36 m/s were recorded under PX4."""
_STANDS_S: Final = 3.0
"""Time for which the landed state of a vehicle that was not commanded to take off is believed."""
_LEAN_RAD: Final = math.radians(20.0)
_LEANING_OVER_S: Final = 1.5
_LONGEST_LEAN_S: Final = 0.5
"""Longest time for which one report of its attitude counts."""
MAX_DIFFERENCE_M: Final = 0.3
"""Greatest difference between the second source of altitude and the vehicle's own."""
_MAX_SECONDARY_AGE_S: Final = 0.5


@dataclass(frozen=True, kw_only=True)
class SecondaryAltitude:
    """State of the second source; times in s by the ground's clock. `altitude_m` is on the vehicle's datum, None before
    the first valid sample; `blind_s` is the time for which its samples have not been new."""

    received_s: float
    altitude_m: float | None = None
    blind_s: float = 0.0
    apart_m: float = 0.0
    apart_since_s: float | None = None


@dataclass(frozen=True, kw_only=True)
class TrialObservation:
    """State of a vehicle by its messages so far. Times are in s by the ground's clock, except inside a Position.

    Times of the last packet (`received_s`), of the last position with a new time stamp (`advanced_s`) and of the last
    one that was not doubted (`accepted_s`), which was sent at `sent_s` if its latency above the least one is delay.
    `armed` and `mode` are from the last heartbeat, `armed_since_s` and `mode_since_s` since when all heartbeats agree
    with it. `jumped_m` is the greatest jump after which the altitude has continued from another value, `stepped_s` the
    greatest step ahead of the vehicle's clock. `unchanged_s` is the time by that clock in which neither altitude nor
    climb rate has changed at all, `leaning` the recent share of time in which it has leaned by more than 20°.
    """

    received_s: float
    heartbeat_s: float
    advanced_s: float
    accepted_s: float
    sent_s: float
    battery_s: float
    heartbeat_gap_s: float = 0.0
    """Time between the last two heartbeats."""
    battery_v: float | None = None
    low_since_s: float | None = None
    stuck_s: float = 0.0
    last: Position | None = None
    origin: Position | None = None
    doubted: Position | None = None
    other: OtherClock | None = None
    glitches: int = 0
    doubt_level: float = 0.0
    jumped_m: float = 0.0
    stepped_s: float = 0.0
    unchanged_s: float = 0.0
    leaning: float = 0.0
    attitude_s: float | None = None
    least_offset_s: float | None = None
    """Our clock less the vehicle's, by the position with the least latency."""
    late_since_s: float | None = None
    """Since when all positions have been too late to be fresh."""
    side: int = -1
    crossings: int = 0
    may_overshoot: bool = False
    """Whether its next crossing is the overshoot after a change of the set point, which does not count."""
    armed: bool = False
    armed_since_s: float = 0.0
    mode: str = ""
    mode_since_s: float = 0.0
    block: str = ""
    block_s: float = 0.0
    landed: bool | None = None
    landed_s: float = 0.0
    landed_since_s: float = 0.0
    """Since when its landed state has been the same."""
    grounded_since_s: float | None = None
    contradicted_since_s: float | None = None
    """Since when it reports that it flies while its position is on the ground."""
    highest_m: float = float("-inf")
    """Greatest altitude since the command."""
    lifted: bool = False
    """Whether it has been above the ground."""
    unseen_m: float | None = None
    """Altitude that it may have reached while no position of it was received, unless it has been above the ground
    since."""
    behind_m: float = 0.0
    """How far its altitude is behind its integrated climb rate, until it is first above the ground."""
    second: SecondaryAltitude | None = None
    rebooted: bool = False
    breached: str = ""
    """Limit of its own fence that it has crossed; empty if none."""
    duplicate_reason: str = ""
    """Evidence that two vehicles use its system id; empty without evidence."""


def begin(
    now_s: float,
    *,
    last: Position | None = None,
    battery_v: float | None = None,
    stood_s: float = 0.0,
    reports_landing: bool = False,
) -> TrialObservation:
    """Begin an observation with all times now. `last` is the position at which the vehicle has stood for `stood_s`;
    `reports_landing`: it has sent its landed state before, without which a landing is then not believed."""
    return TrialObservation(
        received_s=now_s,
        heartbeat_s=now_s,
        advanced_s=now_s,
        accepted_s=now_s,
        sent_s=now_s,
        battery_s=now_s,
        battery_v=battery_v,
        last=last,
        origin=last,
        grounded_since_s=None if last is None else now_s - stood_s,
        landed=True if reports_landing else None,
        landed_s=-math.inf,
    )


def reset_altitude(watch: TrialObservation) -> TrialObservation:
    """Return the observation of a vehicle on the ground whose altitude was reset, without its earlier altitudes."""
    second = None if watch.second is None else replace(watch.second, apart_m=0.0, apart_since_s=None)
    return replace(watch, jumped_m=0.0, lifted=False, unseen_m=None, behind_m=0.0, side=-1, crossings=0, second=second)


def change_set_point(watch: TrialObservation, set_point_m: float) -> TrialObservation:
    """Return the observation of a vehicle that is to fly to another set point, on whose one side it is now."""
    is_above = watch.last is not None and watch.last.altitude_m > set_point_m
    return replace(watch, side=1 if is_above else -1, may_overshoot=True)


def update(
    watch: TrialObservation, measurement: Measurement | None, now_s: float, limits: Limits
) -> tuple[TrialObservation, tuple[Position, ...]]:
    """Return the observation after one packet (None: one without a measurement), and the positions that it confirms."""
    stuck_s = watch.stuck_s + min(now_s - watch.received_s, _ATTENDED_S)
    watch = replace(watch, received_s=now_s, stuck_s=stuck_s)
    match measurement:
        case Position():
            return _add_position(watch, measurement, now_s, limits)
        case InvalidPosition(time_boot_s=time_boot_s):
            is_new = watch.last is None or time_boot_s > watch.last.time_boot_s
            watch = replace(watch, advanced_s=now_s, stuck_s=0.0) if is_new else watch
        case Attitude(lean_rad=lean_rad):
            watch = _add_attitude(watch, lean_rad, now_s)
        case Heartbeat():
            watch = _add_heartbeat(watch, measurement, now_s)
        case Battery(voltage_v=float(volts)):
            low = volts < limits.min_battery_v
            since = (watch.low_since_s if watch.low_since_s is not None else now_s) if low else None
            watch = replace(watch, battery_v=volts, battery_s=now_s, low_since_s=since)
        case FenceBreach(limit=limit):
            watch = replace(watch, breached=limit or "some limit")
        case LandedState(on_ground=landed):
            since_s = watch.landed_since_s if landed == watch.landed else now_s
            watch = replace(watch, landed=landed, landed_s=now_s, landed_since_s=since_s)
        case BlockEntered(number=number):
            watch = replace(watch, block=limits.blocks.get(number, str(number)), block_s=now_s)
        case _:
            pass
    return watch, ()


def update_secondary(watch: TrialObservation, sample: SecondaryAltitudeReceived) -> TrialObservation:
    """Return the observation after a sample of the second source of altitude."""
    second = watch.second or SecondaryAltitude(received_s=sample.now_s)
    vehicle_m = watch.last.altitude_m if watch.last is not None and is_fresh(watch, sample.now_s) else None
    return replace(watch, second=_add_secondary(second, sample, vehicle_m))


def settle(
    watch: TrialObservation, now_s: float, ground_m: float, limits: Limits, *, commanded: bool
) -> TrialObservation:
    """Note since when every source shows it on the ground: its position by height and speed, the landed state that it
    reports, and the second source of altitude. A single sample that jumps is ignored. Before it is `commanded` to take
    off, its landed state or its block is believed rather than an altitude that drifts."""
    if watch.doubted is not None and is_fresh(watch, now_s):
        return watch
    stands = not commanded and stands_by_own_account(watch, now_s, ground_m, limits)
    airborne = is_airborne(watch, now_s, ground_m) and not stands
    since_s = watch.grounded_since_s if watch.grounded_since_s is not None else now_s
    grounded, said_to_fly = stands or is_grounded(watch, now_s, ground_m), is_said_to_fly(watch, now_s, ground_m)
    contradicts = grounded and _reports_flight(watch, now_s)
    unseen_high = watch.unseen_m is not None and watch.unseen_m - ground_m > GROUND_M
    flying_since_s = watch.contradicted_since_s if watch.contradicted_since_s is not None else now_s
    return with_changes(
        watch,
        lifted=watch.lifted or airborne,
        unseen_m=watch.unseen_m if unseen_high and not airborne else None,
        grounded_since_s=since_s if grounded and not said_to_fly else None,
        contradicted_since_s=flying_since_s if contradicts else None,
    )


def with_changes(record: Record, **changes: object) -> Record:
    """Return the record with other values; itself if it has them, as after most of the events of a trial."""
    if all(getattr(record, name) == value for name, value in changes.items()):
        return record
    return replace(record, **changes)


# ---- conclusions


def too_many_glitches(watch: TrialObservation) -> bool:
    return watch.glitches > _MAX_GLITCHES


def has_unreliable_position(watch: TrialObservation) -> bool:
    return watch.doubt_level > _DOUBTED_LIMIT


def is_fresh(watch: TrialObservation, now_s: float) -> bool:
    return watch.last is not None and now_s - watch.sent_s < FRESH_S


def is_still(watch: TrialObservation, now_s: float, ground_m: float, *, within_m: float = DRIFT_M) -> bool:
    """Whether it neither climbs nor sinks within `within_m` of the ground, by a fresh sample."""
    last = watch.last
    low = last is not None and last.altitude_m - ground_m < within_m
    return low and last is not None and is_fresh(watch, now_s) and abs(last.climb_rate_m_s) < RESTING_M_S


def is_grounded(watch: TrialObservation, now_s: float, ground_m: float) -> bool:
    """Whether it is on the ground by height and speed, by a fresh sample."""
    return watch.doubted is None and is_still(watch, now_s, ground_m, within_m=GROUND_M)


def is_airborne(watch: TrialObservation, now_s: float, ground_m: float) -> bool:
    """Whether it is above the ground, by the altitude of a fresh sample."""
    return watch.last is not None and is_fresh(watch, now_s) and watch.last.altitude_m - ground_m > GROUND_M


def may_have_stayed(watch: TrialObservation, ground_m: float, since_s: float) -> bool:
    """Whether its landed state has always been that it stands since then, and its altitude has not been higher than one
    may shift as the motors start."""
    stood = watch.landed is True and watch.landed_since_s <= since_s
    return stood and watch.highest_m - ground_m <= DRIFT_M


def is_said_to_fly(watch: TrialObservation, now_s: float, ground_m: float) -> bool:
    """Whether its own landed state or the second source shows it in the air, independent of its altitude."""
    secondary_m = secondary_altitude_m(watch.second, now_s)
    return _reports_flight(watch, now_s) or (secondary_m is not None and secondary_m - ground_m > GROUND_M)


def _reports_flight(watch: TrialObservation, now_s: float) -> bool:
    return watch.landed is False and now_s - watch.landed_s < AGREED_S


def reports_landing(watch: TrialObservation, now_s: float) -> bool:
    """Whether it now reports that it is on the ground."""
    return watch.landed is True and now_s - watch.landed_s < AGREED_S


def has_reported_landing(watch: TrialObservation, now_s: float, landed_blocks: frozenset[str]) -> bool:
    """Whether it has reported for a second that it is on the ground, by its landed state or the block of its plan."""
    if watch.block in landed_blocks:
        return now_s - watch.block_s >= AGREED_S
    return reports_landing(watch, now_s) and now_s - watch.landed_since_s >= AGREED_S


def stands_by_own_account(watch: TrialObservation, now_s: float, ground_m: float, limits: Limits) -> bool:
    """Whether it reports that it is on the ground, or in a block of its plan that has no thrust, and its altitude has
    not drifted further than one may, nor faster. To be called for a vehicle that was not commanded to take off."""
    last = watch.last
    drifts = last is None or (abs(last.altitude_m - ground_m) <= DRIFT_M and abs(last.climb_rate_m_s) <= _DRIFT_M_S)
    says_so = watch.landed is True and now_s - watch.landed_s < _STANDS_S
    return drifts and (says_so or watch.block in limits.arming_blocks)


def secondary_altitude_m(second: SecondaryAltitude | None, now_s: float) -> float | None:
    """Return the source's altitude; None while its samples are not new, or none arrive."""
    if second is None or second.blind_s > 0.0 or now_s - second.received_s > _MAX_SECONDARY_AGE_S:
        return None
    return second.altitude_m


def is_behind_climb_rate(watch: TrialObservation) -> bool:
    """Whether its altitude does not follow its climb rate."""
    return watch.behind_m > BEHIND_M


def is_disarmed(watch: TrialObservation, limits: Limits) -> bool:
    """Whether it is disarmed by at least two heartbeats with none between them that contradicts."""
    return not watch.armed and watch.heartbeat_s - watch.armed_since_s >= limits.confirmation_s


def mode_of(watch: TrialObservation, limits: Limits) -> str:
    """Return the mode in which heartbeats agree; empty while they do not."""
    return watch.mode if watch.heartbeat_s - watch.mode_since_s >= limits.confirmation_s else ""


def find_doubt_of_ground(watch: TrialObservation, now_s: float) -> str:
    """Return why it may not be on the ground; empty once every source has shown it there for a second, if its altitude
    has never jumped."""
    since_s = watch.grounded_since_s
    if watch.duplicate_reason:
        return "two vehicles may be using its system id"
    if watch.rebooted:
        return "it rebooted during the flight"
    if watch.jumped_m:
        return "its altitude jumped during the flight"
    if is_behind_climb_rate(watch):
        return "its altitude did not follow its climb rate"
    if since_s is None or now_s - since_s < AGREED_S:
        return f"not every source has shown it on the ground for {AGREED_S:g} s"
    return ""


# ---- positions, heartbeats and the second source


def _add_secondary(
    second: SecondaryAltitude, sample: SecondaryAltitudeReceived, vehicle_m: float | None
) -> SecondaryAltitude:
    """Return the state after a sample of the source, with the vehicle's own altitude `vehicle_m` (None: unknown)."""
    waited_s = min(max(sample.now_s - second.received_s, 0.0), _ATTENDED_S)
    second = replace(second, received_s=max(sample.now_s, second.received_s))
    if not sample.is_new:
        return replace(second, blind_s=second.blind_s + waited_s)
    apart_m = 0.0 if vehicle_m is None else abs(sample.altitude_m - vehicle_m)
    since_s = (
        (second.apart_since_s if second.apart_since_s is not None else sample.now_s)
        if apart_m > MAX_DIFFERENCE_M
        else None
    )
    return replace(second, altitude_m=sample.altitude_m, blind_s=0.0, apart_m=apart_m, apart_since_s=since_s)


def _add_heartbeat(watch: TrialObservation, heartbeat: Heartbeat, now_s: float) -> TrialObservation:
    return replace(
        watch,
        heartbeat_s=now_s,
        heartbeat_gap_s=now_s - watch.heartbeat_s,
        armed=heartbeat.armed,
        armed_since_s=watch.armed_since_s if heartbeat.armed == watch.armed else now_s,
        mode=heartbeat.mode,
        mode_since_s=watch.mode_since_s if heartbeat.mode == watch.mode else now_s,
    )


def _add_attitude(watch: TrialObservation, lean_rad: float, now_s: float) -> TrialObservation:
    passed_s = 0.0 if watch.attitude_s is None else min(now_s - watch.attitude_s, _LONGEST_LEAN_S)
    weight = -math.expm1(-passed_s / _LEANING_OVER_S)
    leaning = watch.leaning + weight * ((abs(lean_rad) > _LEAN_RAD) - watch.leaning)
    return replace(watch, leaning=leaning, attitude_s=now_s)


def _add_position(
    watch: TrialObservation, position: Position, now_s: float, limits: Limits
) -> tuple[TrialObservation, tuple[Position, ...]]:
    last, doubted = watch.last, watch.doubted
    newest = doubted or last
    position = unwrapped(position, newest)
    if newest is not None:
        early_s = _early_s(watch, position, now_s, newest)
        if position.time_boot_s <= newest.time_boot_s or early_s > EARLY_S:
            return _add_other_clock(watch, position, now_s, newest), ()
    watch = _with_latency(watch, position, now_s)
    quiet_s = now_s - watch.advanced_s
    doubt_level = max(watch.doubt_level - _DOUBT_DECAY_1_S * quiet_s, 0.0)
    watch = replace(watch, advanced_s=now_s, stuck_s=0.0, doubt_level=doubt_level)
    if last is None or _follows(last, position):
        is_single = doubted is not None
        watch = replace(watch, doubted=None, glitches=watch.glitches + is_single)
        return _accept(watch, position, now_s, limits), (position,)
    watch = replace(watch, doubt_level=watch.doubt_level + 1.0)
    if doubted is None:
        return replace(watch, doubted=position), ()
    if _follows(doubted, position):
        jumped_m = abs(_off_m(last, doubted)) if _jumps(last, doubted) else 0.0
        watch = replace(watch, doubted=None, jumped_m=max(watch.jumped_m, jumped_m))
        return _accept(watch, position, now_s, limits), (doubted, position)
    return replace(watch, doubted=position, glitches=watch.glitches + 1), ()


def _add_other_clock(watch: TrialObservation, position: Position, now_s: float, newest: Position) -> TrialObservation:
    """Process a position whose time is late, repeated or ahead. Only if further ones continue from there, and no more
    by the previous clock arrive, has the vehicle's clock stepped ahead, or the vehicle rebooted."""
    other = watch.other
    goes_on = other is not None and other.goes_on(position, now_s)
    first_s = other.first_s if other is not None and goes_on else now_s
    is_alone = watch.accepted_s <= first_s and watch.advanced_s <= first_s
    early_s = _early_s(watch, position, now_s, newest)
    fell_back = position.time_boot_s < newest.time_boot_s - BACK_S
    watch = replace(watch, other=OtherClock(first_s=first_s, last_s=now_s, last=position))
    if not (is_alone and goes_on):
        return watch
    if EARLY_S < early_s <= AHEAD_S and now_s - first_s >= STEPPED_S:
        step_s = max(watch.stepped_s, early_s)
        return replace(watch, stepped_s=step_s, least_offset_s=now_s - position.time_boot_s, advanced_s=now_s)
    if not (fell_back and may_have_begun(position.time_boot_s, first_s - watch.advanced_s)):
        return watch
    if now_s - first_s < RESTARTED_S:
        return replace(watch, stuck_s=0.0)
    watch = replace(watch, rebooted=True, last=position, doubted=None, least_offset_s=None)
    return replace(watch, advanced_s=now_s, accepted_s=now_s, sent_s=now_s)


def _early_s(watch: TrialObservation, position: Position, now_s: float, newest: Position) -> float:
    """Return how far the position's time is ahead of the vehicle's clock: by how much it arrived before the least
    latency, or, while that is not known, beyond AHEAD_S what the clock can have gained."""
    if watch.least_offset_s is None:
        return position.time_boot_s - newest.time_boot_s - (now_s - watch.advanced_s) - AHEAD_S
    return watch.least_offset_s - (now_s - position.time_boot_s)


def _follows(one: Position, other: Position) -> bool:
    """Whether a vehicle can have moved from one sample to the other."""
    sudden = abs(other.climb_rate_m_s) > _JUMP_M_S >= abs(one.climb_rate_m_s)
    return not (sudden or _jumps(one, other))


def _jumps(one: Position, other: Position) -> bool:
    """Whether the altitudes differ by more than the climb rates and possible accelerations between them explain."""
    elapsed_s = other.time_boot_s - one.time_boot_s
    brief_s = min(elapsed_s, _ACCELERATING_S)
    possible_m = 0.5 * _ACCELERATION_M_S2 * brief_s**2 + _UNSEEN_M_S * (elapsed_s - brief_s)
    return abs(_off_m(one, other)) > _JUMP_M + possible_m


def _off_m(one: Position, other: Position) -> float:
    """Return how far the other altitude is above the one that the mean of both climb rates leads to, m."""
    elapsed_s = other.time_boot_s - one.time_boot_s
    return other.altitude_m - one.altitude_m - 0.5 * (one.climb_rate_m_s + other.climb_rate_m_s) * elapsed_s


def _with_latency(watch: TrialObservation, position: Position, now_s: float) -> TrialObservation:
    """Update the least latency, and since when positions are late."""
    offset_s, least_s = now_s - position.time_boot_s, watch.least_offset_s
    if least_s is None:
        return replace(watch, least_offset_s=offset_s, late_since_s=None)
    least_s = min(offset_s, least_s + _CLOCK_DRIFT * (now_s - watch.advanced_s))
    since_s = watch.late_since_s if watch.late_since_s is not None else now_s
    return replace(watch, least_offset_s=least_s, late_since_s=since_s if offset_s - least_s >= FRESH_S else None)


def _accept(watch: TrialObservation, position: Position, now_s: float, limits: Limits) -> TrialObservation:
    above_m = position.altitude_m - limits.set_point_m
    side = watch.side if abs(above_m) <= limits.crossing_m else (1 if above_m > 0.0 else -1)
    has_crossed = side != watch.side
    return replace(
        watch,
        unchanged_s=_unchanged_s(watch, position),
        behind_m=_behind_m(watch, position),
        unseen_m=_unseen_m(watch, position),
        highest_m=max(watch.highest_m, position.altitude_m),
        accepted_s=now_s,
        sent_s=now_s if watch.least_offset_s is None else position.time_boot_s + watch.least_offset_s,
        last=position,
        origin=watch.origin or position,
        side=side,
        crossings=watch.crossings + (has_crossed and not watch.may_overshoot),
        may_overshoot=watch.may_overshoot and not has_crossed,
        other=None,
    )


def _unseen_m(watch: TrialObservation, position: Position) -> float | None:
    last = watch.last
    if last is None or (unseen_s := position.time_boot_s - last.time_boot_s) <= FRESH_S:
        return watch.unseen_m
    reached_m = last.altitude_m + max(last.climb_rate_m_s, 0.0) * unseen_s
    return reached_m if watch.unseen_m is None else max(watch.unseen_m, reached_m)


def _unchanged_s(watch: TrialObservation, position: Position) -> float:
    last = watch.last
    if last is None or (last.altitude_m, last.climb_rate_m_s) != (position.altitude_m, position.climb_rate_m_s):
        return 0.0
    return watch.unchanged_s + position.time_boot_s - last.time_boot_s


def _behind_m(watch: TrialObservation, position: Position) -> float:
    last = watch.last
    if last is None or watch.lifted or is_behind_climb_rate(watch):
        return watch.behind_m
    mean_m_s = 0.5 * (last.climb_rate_m_s + position.climb_rate_m_s)
    climbed_m = (mean_m_s if abs(mean_m_s) > RESTING_M_S else 0.0) * (position.time_boot_s - last.time_boot_s)
    return watch.behind_m + climbed_m - (position.altitude_m - last.altitude_m)
