"""The set points of a flight at the times at which they took effect, and Paparazzi's own reference for them, which it
does not send: the replica of its loop computes it."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from app.core.control.vertical_guidance import RATE_HZ, STEP_S
from app.core.experiments.step_sequence import REFERENCE
from app.core.models.set_points import SetPoints, on_step
from app.core.models.vertical_batch import reference_altitude
from app.core.records.trajectory import Samples, Trajectory
from app.vehicles.mavlink.monitors.commanded import SetPointChange

Reference = Callable[[SetPoints, Samples], Samples]
"""The autopilot's own reference for these set points, at these times."""


def simulate_reference(set_points: SetPoints, ground_m: float, time_s: Samples, until_s: float) -> Samples:
    """Paparazzi's reference at each of these times, from the ground at the takeoff command on: same shape.

    Altitudes are the record's; one computation reaches to `until_s`, and is kept for the next call.
    """
    above_ground_m = tuple(altitude_m - ground_m for altitude_m in set_points.altitudes_m)
    samples = round(until_s * RATE_HZ) + 1
    above = reference_altitude(SetPoints(set_points.times_s, above_ground_m), samples)
    return np.asarray(ground_m + np.interp(time_s, np.arange(samples) * STEP_S, above))


def at_last_times(takeoff: SetPoints, changes: Sequence[SetPointChange]) -> SetPoints:
    """The set points, each from the last time at which it may have taken effect."""
    return _appended(takeoff, [(change.times_s[-1], change.altitude_m) for change in changes])


def with_flown_set_points(
    trajectory: Trajectory,
    takeoff: SetPoints,
    changes: Sequence[SetPointChange],
    *,
    ground_m: float,
    reference: Reference | None,
) -> Trajectory:
    """Return the record with its set points from when they took effect, and with the `reference`, if there is one.
    `ground_m` is the set point of a landing.

    A set point whose message was repeated took effect at the one of its times from which the reference is closest to
    the altitude. A record that contains a landing, whose reference is not known, gets none.
    """
    time_s, channels = trajectory.time_s, trajectory.channels
    flown = takeoff
    for number, change in enumerate(changes):
        until_s = changes[number + 1].times_s[0] if number + 1 < len(changes) else time_s[-1]
        flown = _closest(trajectory, flown, change, until_s, reference)
    after = time_s > 0.0
    flies = after & (channels["set_point_m"] != ground_m)
    changed = {**channels, "set_point_m": np.where(flies, flown.at(time_s), channels["set_point_m"])}
    if reference is not None:
        computed = {REFERENCE: reference(flown, time_s)} if np.array_equal(flies, after) else {}
        changed = {name: values for name, values in changed.items() if name != REFERENCE} | computed
    return replace(trajectory, channels=changed)


def _closest(
    trajectory: Trajectory, before: SetPoints, change: SetPointChange, until_s: float, reference: Reference | None
) -> SetPoints:
    candidates = [_appended(before, [(time_s, change.altitude_m)]) for time_s in change.times_s]
    if reference is None or len(candidates) == 1:
        return candidates[-1]
    window = (trajectory.time_s >= change.times_s[0]) & (trajectory.time_s < until_s)
    time_s, altitude = trajectory.time_s[window], trajectory["altitude_m"][window]
    return min(candidates, key=lambda each: float(np.abs(reference(each, time_s) - altitude).mean()))


def _appended(set_points: SetPoints, changes: Sequence[tuple[float, float]]) -> SetPoints:
    times_s, altitudes_m = list(set_points.times_s), list(set_points.altitudes_m)
    for time_s, altitude_m in changes:
        times_s.append(max(on_step(time_s), times_s[-1] + STEP_S))
        altitudes_m.append(altitude_m)
    return SetPoints(tuple(times_s), tuple(altitudes_m))
