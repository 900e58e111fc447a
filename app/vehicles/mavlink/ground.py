"""Height of the ground under a vehicle between arming and the take-off command, as pure functions of a trial."""

import statistics
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final

from app.vehicles.mavlink import observation as watching
from app.vehicles.mavlink import secondary_altitude
from app.vehicles.mavlink.events import Position
from app.vehicles.mavlink.failures import GROUND_M, Failure, Finding
from app.vehicles.mavlink.trial_transitions import Trial

_IN_PLACE_M: Final = 0.3
_SHIFT_M: Final = 0.3
"""Greatest shift of the altitude on the ground as the motors start, unless the autopilot resets it then."""
_CLIMBED_M: Final = 0.1
"""A vehicle that has climbed by less than this, by its climb rate, has not moved."""


def measure(trial: Trial, now_s: float) -> Trial:
    """Return the trial with the ground where the vehicle stands now, because its altitude shifts as its motors start,
    and is reset by an autopilot that counts from the ground. If it may have moved, the ground is unchanged."""
    watch, plan, samples = trial.watch, trial.plan, trial.ground_samples
    stood = samples[len(samples) // 2 :]
    if not stood or watch.doubted or watching.is_said_to_fly(watch, now_s, plan.ground_m):
        return trial
    altitudes_m = [position.altitude_m for position in stood]
    is_still = max(altitudes_m) - min(altitudes_m) <= GROUND_M
    is_in_place = stood[-1].away_m(watch.origin or stood[-1]) <= _IN_PLACE_M
    shift_m = statistics.median(altitudes_m) - plan.ground_m
    may_shift = plan.climbs_from_ground or abs(shift_m) <= _SHIFT_M
    if not (is_still and is_in_place and may_shift and abs(_climbed_m(samples)) <= _CLIMBED_M):
        return trial
    return replace(
        trial,
        plan=plan.on_ground_at(plan.ground_m + shift_m),
        watch=watching.reset_altitude(watch),
        ground_shift_m=shift_m,
        ground_samples=(),
    )


def find_departure(trial: Trial) -> Finding | None:
    """Find that a vehicle without a take-off command may have left the ground, by its altitude."""
    last = trial.watch.last
    if last is None or abs(away_m := last.altitude_m - trial.plan.ground_m) <= GROUND_M:
        return None
    why = f"Its altitude changed by {away_m:+.2f} m before the take-off command, and it may have moved."
    return Finding(failure=Failure.LOST_POSITION, why=why)


def find_disagreement(trial: Trial, now_s: float) -> Finding | None:
    """Find a disagreement between the vehicle's altitude on the ground and the second source's last one before a
    shift."""
    secondary_m, last = secondary_altitude.current_altitude_m(trial.watch.second, now_s), trial.watch.last
    if secondary_m is None or last is None:
        return None
    apart_m = abs(secondary_m + trial.ground_shift_m - last.altitude_m)
    if apart_m <= secondary_altitude.MAX_DIFFERENCE_M:
        return None
    why = f"They were {apart_m:.2f} m apart before the take-off command."
    return Finding(failure=Failure.DISAGREEMENT, why=why)


def _climbed_m(samples: Sequence[Position]) -> float:
    """Return the climb by climb rate alone, m."""
    return sum(later.climb_rate_m_s * (later.time_boot_s - earlier.time_boot_s) for earlier, later in pairwise(samples))
