"""Checks of the limits of a trial against the observation of the vehicle; each returns the finding or None."""

from typing import Final

from app.vehicles.mavlink.failures import GROUND_M, HEARTBEATS_MISSED, Failure, Finding, Limits
from app.vehicles.mavlink.observation import (
    DRIFT_M,
    FRESH_S,
    MAX_DIFFERENCE_M,
    SecondaryAltitude,
    TrialObservation,
    has_unreliable_position,
    is_behind_climb_rate,
    is_disarmed,
    is_fresh,
    mode_of,
    secondary_altitude_m,
    stands_by_own_account,
)

_IN_TURN: Final = 0.8
"""Minimum interval of one vehicle's heartbeats, in periods; closer ones are of two vehicles."""
_OWN_CEILING_M: Final = 0.5
"""Maximum distance of a vehicle's own ceiling below ours."""
_APART_S: Final = 0.3
_LOW_BATTERY_S: Final = 1.0
_NO_BATTERY_S: Final = 10.0
_IMPACT_BELOW_M: Final = 0.5
_JUMP_ENDS_RECORD_M: Final = 0.5
"""A single false sample near the ground causes smaller jumps."""
_UNCHANGED_S: Final = 1.0
"""In recordings of all three autopilots, no three consecutive estimates are equal in altitude and climb rate."""
_CONTRADICTED_S: Final = 8.0
"""Longer than an autopilot takes to detect its landing."""
_SINKING_M_S: Final = 0.3
"""A vehicle that is faster than this swings."""
_STEPPED_S: Final = 0.3
"""A greater step of the clock is not one of the latency."""
_LEANING: Final = 0.5
_OSCILLATES: Final = "It leaned by more than 20° most of the time: its attitude oscillates. Tune its attitude first."
_CLIMBED_WITHIN_M: Final = 1.0
"""PX4 hovers from 0.8 m below its set point on (NAV_MC_ALT_RAD)."""


def find_on_ground(watch: TrialObservation, limits: Limits, now_s: float) -> Finding | None:
    """Return the most severe failure of a vehicle before the takeoff command, if any."""
    if watch.rebooted:
        return Finding(failure=Failure.UNEXPECTED, why="The vehicle rebooted.")
    if watch.leaning > _LEANING:
        return Finding(failure=Failure.ENVELOPE, why=_OSCILLATES)
    return (
        find_duplicate(watch)
        or find_link(watch, limits, now_s)
        or find_frozen(watch, limits, now_s)
        or find_lost_position(watch, limits, now_s)
        or find_battery(watch, now_s)
    )


def find_taken_over(watch: TrialObservation, limits: Limits) -> Finding | None:
    """Find that a pilot flies the vehicle now."""
    mode = mode_of(watch, limits)
    if not watch.armed or not limits.is_manual(mode):
        return None
    return Finding(failure=Failure.TAKEN_OVER, why=f"The vehicle entered mode {named(mode, limits)}.")


def find_interruption(before: TrialObservation, watch: TrialObservation, limits: Limits) -> Finding | None:
    """Find a manual mode that only the last heartbeat of the observation `before` reported and the next one did not,
    unless it arrived between two heartbeats of the vehicle."""
    was_by_hand = before.armed and limits.is_manual(before.mode)
    in_turn_s = _IN_TURN * limits.heartbeat_s
    is_in_turn = min(before.heartbeat_gap_s, watch.heartbeat_gap_s) >= in_turn_s
    if not (was_by_hand and is_in_turn) or limits.is_manual(watch.mode):
        return None
    return Finding(failure=Failure.INTERRUPTED, why=f"One heartbeat reported mode {named(before.mode, limits)}.")


def find_unexpected(
    watch: TrialObservation, limits: Limits, modes: frozenset[str], blocks: frozenset[str] = frozenset()
) -> Finding | None:
    """Find a reboot, a disarming, or a mode or block that is not allowed; `modes` and `blocks` are the allowed ones,
    empty if any is."""
    why, mode = "", mode_of(watch, limits)
    if watch.rebooted:
        why = "The vehicle rebooted."
    elif is_disarmed(watch, limits):
        why = "The vehicle disarmed itself in the air."
    elif modes and mode and mode not in modes:
        why = f"The vehicle entered mode {named(mode, limits)}."
    elif blocks and watch.block and watch.block not in blocks:
        why = f"Its flight plan entered the block “{watch.block}”."
    return Finding(failure=Failure.UNEXPECTED, why=why) if why else None


def find_interrupted_climb(watch: TrialObservation, limits: Limits, climb_to_m: float) -> Finding | None:
    """Find a vehicle that hovers before it has been near its first set point: its failsafe or a person has stopped
    it."""
    mode = mode_of(watch, limits)
    if mode not in limits.hovering_modes or watch.highest_m >= climb_to_m - _CLIMBED_WITHIN_M:
        return None
    why = f"The vehicle entered mode {named(mode, limits)} before it had climbed."
    return Finding(failure=Failure.UNEXPECTED, why=why)


def find_incomplete_climb(watch: TrialObservation, climb_to_m: float) -> Finding | None:
    """Find at the end of a record that the vehicle has never been near its first set point. Its gains may have kept it
    low, or a change of mode that no heartbeat reported."""
    if watch.highest_m >= climb_to_m - _CLIMBED_WITHIN_M:
        return None
    why = (
        f"It did not come within {_CLIMBED_WITHIN_M:g} m of its set point, because of its gains or of a change of mode "
        "that no heartbeat reported."
    )
    return Finding(failure=Failure.INTERRUPTED, why=why)


def named(mode: str, limits: Limits) -> str:
    """Return the display name of a mode."""
    return limits.mode_names.get(mode, mode)


def find_own_landing(watch: TrialObservation, limits: Limits, ground_m: float, *, mode_known: bool) -> Finding | None:
    """Find a landing of a vehicle that should fly. `mode_known`: its mode is not the one before the command. Close
    below our ceiling, the vehicle's own ceiling is the cause, and the failure is that of the envelope."""
    why = ""
    if mode_known and (mode := mode_of(watch, limits)) in limits.landing_modes - limits.flying_modes:
        why = f"It entered mode {named(mode, limits)}."
    elif watch.block in limits.landing_blocks:
        why = f"Its flight plan entered the block “{watch.block}”."
    if not why or watch.last is None:
        return None
    if (height_m := watch.last.altitude_m - ground_m) > limits.ceiling_m - _OWN_CEILING_M:
        return Finding(failure=Failure.ENVELOPE, why=f"It was {height_m:.2f} m above the ground. {why}")
    return Finding(failure=Failure.OWN_LANDING, why=why)


def find_duplicate(watch: TrialObservation) -> Finding | None:
    return Finding(failure=Failure.DUPLICATE, why=watch.duplicate_reason) if watch.duplicate_reason else None


def find_link(watch: TrialObservation, limits: Limits, now_s: float) -> Finding | None:
    if now_s - watch.received_s > limits.silent_s:
        return Finding(failure=Failure.LINK, why=f"Nothing was received for more than {limits.silent_s:g} s.")
    if now_s - watch.heartbeat_s > HEARTBEATS_MISSED * limits.heartbeat_s:
        return Finding(failure=Failure.LINK, why="Three heartbeats were missed.")
    return None


def find_envelope(watch: TrialObservation, limits: Limits, ground_m: float, *, settling: bool) -> Finding | None:
    why = ""
    if watch.breached:
        why = f"The vehicle's own fence was crossed: {watch.breached}."
    elif watch.last is not None and watch.origin is not None:
        last, away_m = watch.last, watch.last.away_m(watch.origin)
        if (height_m := last.altitude_m - ground_m) > limits.ceiling_m:
            why = f"It was {height_m:.2f} m above the ground; the limit is {limits.ceiling_m:g} m."
        elif abs(last.climb_rate_m_s) > limits.climb_rate_m_s:
            why = f"Its climb rate was {last.climb_rate_m_s:+.1f} m/s; the limit is ±{limits.climb_rate_m_s:g} m/s."
        elif away_m > limits.radius_m:
            why = f"It was {away_m:.1f} m from its start; the limit is {limits.radius_m:g} m."
        elif settling and watch.crossings >= limits.crossings:
            why = f"It crossed its set point {watch.crossings} times by more than ±{limits.crossing_m:g} m."
    if not why and watch.leaning > _LEANING:
        why = _OSCILLATES
    return Finding(failure=Failure.ENVELOPE, why=why) if why else None


def find_frozen(watch: TrialObservation, limits: Limits, now_s: float) -> Finding | None:
    why = ""
    if watch.stuck_s > limits.stuck_s and watch.other is not None and watch.other.advances and watch.last is not None:
        gained_s = watch.other.last.time_boot_s - watch.last.time_boot_s
        why = f"Its clock jumped by {gained_s - (watch.other.last_s - watch.accepted_s):+.1f} s."
    elif watch.stuck_s > limits.stuck_s:
        why = f"Its clock stood still for more than {limits.stuck_s:g} s."
    elif watch.stepped_s > _STEPPED_S:
        why = f"Its clock jumped ahead by {watch.stepped_s:.1f} s."
    elif watch.unchanged_s > _UNCHANGED_S:
        why = f"Its altitude stood still for more than {_UNCHANGED_S:g} s while its clock ran."
    if why:
        return Finding(failure=Failure.FROZEN, why=why)
    return _find_blind(watch.second, now_s, stuck_s=limits.stuck_s, silent_s=limits.silent_s)


def _find_blind(second: SecondaryAltitude | None, now_s: float, *, stuck_s: float, silent_s: float) -> Finding | None:
    """Find a source whose samples have not been new for `stuck_s`, or that has sent none for `silent_s`."""
    why = ""
    if second is not None and second.blind_s > stuck_s:
        why = f"The second source of altitude did not track it for more than {stuck_s:g} s."
    elif second is not None and now_s - second.received_s > silent_s:
        why = f"Nothing was received from the second source of altitude for {silent_s:g} s."
    return Finding(failure=Failure.FROZEN, why=why) if why else None


def find_disagreement(second: SecondaryAltitude | None) -> Finding | None:
    if second is None or second.apart_since_s is None or second.received_s - second.apart_since_s <= _APART_S:
        return None
    why = f"They were {second.apart_m:.2f} m apart; more than {MAX_DIFFERENCE_M:g} m for {_APART_S:g} s is not allowed."
    return Finding(failure=Failure.DISAGREEMENT, why=why)


def find_departure(watch: TrialObservation, limits: Limits, ground_m: float, now_s: float) -> Finding | None:
    """Find that a vehicle without a takeoff command may have left the ground, by its altitude, or that its altitude
    drifts while it reports that it stands."""
    if watch.last is None or abs(away_m := watch.last.altitude_m - ground_m) <= GROUND_M:
        return None
    stands = stands_by_own_account(watch, now_s, ground_m, limits)
    what = "although it stood on the ground: wait until its estimate has settled" if stands else "and it may have moved"
    why = f"Its altitude changed by {away_m:+.2f} m before the takeoff command, {what}."
    return Finding(failure=Failure.LOST_POSITION, why=why)


def find_disagreement_on_ground(watch: TrialObservation, ground_shift_m: float, now_s: float) -> Finding | None:
    """Find a disagreement between the vehicle's altitude on the ground and the second source's last one before a
    shift."""
    secondary_m = secondary_altitude_m(watch.second, now_s)
    if secondary_m is None or watch.last is None:
        return None
    apart_m = abs(secondary_m + ground_shift_m - watch.last.altitude_m)
    if apart_m <= MAX_DIFFERENCE_M:
        return None
    why = f"They were {apart_m:.2f} m apart before the takeoff command."
    return Finding(failure=Failure.DISAGREEMENT, why=why)


def find_lost_position(watch: TrialObservation, limits: Limits, now_s: float) -> Finding | None:
    """Find a lost position; to be called after `find_link`, because silence is a lost link."""
    why = ""
    if now_s - watch.accepted_s > limits.lost_s and watch.received_s - watch.accepted_s > limits.lost_s:
        why = f"None of its positions was plausible for {limits.lost_s:g} s."
    elif watch.late_since_s is not None and watch.advanced_s - watch.late_since_s > limits.lost_s:
        why = (
            f"Its positions arrive more than {FRESH_S:g} s late, or its clock is slower than the clock speed in its "
            "settings."
        )
    elif has_unreliable_position(watch):
        why = "Its position jumps back and forth."
    return Finding(failure=Failure.LOST_POSITION, why=why) if why else None


def find_jump(watch: TrialObservation) -> Finding | None:
    """Find a jump of the altitude in flight: it, or the earlier altitude, is not the vehicle's."""
    if watch.jumped_m <= _JUMP_ENDS_RECORD_M:
        return None
    return Finding(failure=Failure.LOST_POSITION, why=f"Its altitude jumped by {watch.jumped_m:.1f} m.")


def find_drift(watch: TrialObservation, now_s: float, ground_m: float, *, has_landed: bool) -> Finding | None:
    """Find that the altitude of a flown vehicle has drifted: it is below the ground, or above it where the vehicle
    reports that it has landed."""
    if watch.last is None or watch.doubted is not None or not is_fresh(watch, now_s):
        return None
    off_m = watch.last.altitude_m - ground_m
    if off_m >= -DRIFT_M and not (off_m > DRIFT_M and has_landed):
        return None
    return Finding(failure=Failure.LOST_POSITION, why=f"Its altitude has drifted: it was {off_m:+.1f} m on the ground.")


def find_contradiction(watch: TrialObservation, now_s: float) -> Finding | None:
    """Find that a vehicle has reported for long that it flies while its altitude shows the ground."""
    since_s = watch.contradicted_since_s
    if since_s is None or now_s - since_s <= _CONTRADICTED_S:
        return None
    return Finding(failure=Failure.LOST_POSITION, why="It reports that it flies, but its altitude is the ground's.")


def find_sunken(watch: TrialObservation, lowest_m: float, ground_m: float) -> Finding | None:
    """Find at the end of a record that the vehicle, or its altitude alone, has sunk to less than half of the lowest set
    point, where it had been near that."""
    had_climbed = watch.highest_m >= lowest_m - _CLIMBED_WITHIN_M
    height_m = 0.0 if watch.last is None else watch.last.altitude_m - ground_m
    swings = watch.last is not None and abs(watch.last.climb_rate_m_s) > _SINKING_M_S
    if swings or not had_climbed or height_m >= 0.5 * (lowest_m - ground_m):
        return None
    why = f"At the end of the record it was {height_m:.1f} m above the ground: it, or its altitude alone, has sunk."
    return Finding(failure=Failure.LOST_POSITION, why=why)


def find_altitude_behind(watch: TrialObservation) -> Finding | None:
    """Find that a vehicle commanded to climb is on the ground by its altitude but climbs by its climb rate."""
    if not is_behind_climb_rate(watch):
        return None
    why = f"According to its climb rate it rose {watch.behind_m:.1f} m more than its altitude shows."
    return Finding(failure=Failure.LOST_POSITION, why=why)


def find_battery(watch: TrialObservation, now_s: float) -> Finding | None:
    if watch.low_since_s is not None and now_s - watch.low_since_s > _LOW_BATTERY_S:
        return Finding(failure=Failure.BATTERY, why=f"The battery voltage was low: {watch.battery_v:.1f} V.")
    if now_s - watch.battery_s > _NO_BATTERY_S:
        return Finding(failure=Failure.BATTERY, why=f"No battery voltage was received for {_NO_BATTERY_S:g} s.")
    return None


def find_fall(watch: TrialObservation, limits: Limits, ground_m: float) -> Finding | None:
    """Find ground contact at a speed above that of any landing."""
    last = watch.last
    if last is None or watch.doubted is not None:
        return None
    near = last.altitude_m - ground_m < _IMPACT_BELOW_M
    if not near or last.climb_rate_m_s >= -limits.impact_m_s:
        return None
    return Finding(failure=Failure.FALL, why=f"It hit the ground at {-last.climb_rate_m_s:.1f} m/s.")
