"""Record of a trial: its samples as a trajectory, with both sources of altitude, aligned, if there are two, one of
which is scored; its set points at the times at which they took effect, and Paparazzi's own reference for them, which it
does not send: the replica of its loop computes it; and how it ended.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, Literal

import numpy as np

from app.core.control.vertical_guidance import RATE_HZ, STEP_S
from app.core.errors import TrajectoryError
from app.core.experiments.step_sequence import REFERENCE, SETTLED_FOR_S
from app.core.formatting import capitalised, count
from app.core.models.set_points import SetPoints, on_step
from app.core.models.vertical_batch import reference_altitude
from app.core.records.alignment import Alignment, align, compare, resample
from app.core.records.metrics import MAX_GAP_S
from app.core.records.trajectory import Samples, Trajectory
from app.vehicles.base import Ending, OptionValue
from app.vehicles.flight_end import FlightEnd, GainsLeft
from app.vehicles.mavlink.events import RecordSample
from app.vehicles.mavlink.failures import RESPONSES, Failure
from app.vehicles.mavlink.monitors.altitude import MAX_DIFFERENCE_M
from app.vehicles.mavlink.monitors.commanded import SetPointChange
from app.vehicles.mavlink.trial_state import State, Trial

Scored = Literal["vehicle", "mocap"]
"""Source of the scored altitude."""
Reference = Callable[[SetPoints, Samples], Samples]
"""The autopilot's own reference for these set points, at these times."""

_STEPPED: Final = ("set_point_m", "throttle")
"""Channels that jump: between two samples the first one is held."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AlignedRecord:
    """A trajectory with both sources. `settings` contain their delay and differences, `remark` what the user must know
    about them; empty without problems."""

    trajectory: Trajectory
    settings: Mapping[str, OptionValue] = field(default_factory=dict)
    remark: str = ""


def add_secondary_altitude(
    trajectory: Trajectory, seen: Sequence[tuple[float, float]], *, name: str, zero_s: float, scored: Scored
) -> AlignedRecord:
    """Add the altitude of the second source, `name`, to the vehicle's own record.

    `seen` are the times of measurement, s, and altitudes, m, on any datum; `zero_s` is the record's time 0 on the clock
    of these times. If `mocap` is scored, the record has the times of the second source and the vehicle's own altitude
    is `altitude_2_m`; otherwise vice versa. If the source has fewer than two samples in the record, it is unchanged.
    """
    other_s, other_m = _rising(seen, zero_s)
    inside = (other_s >= trajectory.time_s[0]) & (other_s <= trajectory.time_s[-1])
    if np.count_nonzero(inside) < 2:
        unseen = f"No altitudes came from {name}, the second source; the vehicle's own altitude is scored."
        return AlignedRecord(trajectory=trajectory, remark=unseen)
    alignment, remarks = _aligned(trajectory, other_s, other_m)
    second_m = resample(trajectory.time_s, other_s, other_m, alignment)
    covered = (trajectory.time_s + alignment.delay_s >= other_s[0]) & (
        trajectory.time_s + alignment.delay_s <= other_s[-1]
    )
    apart = compare(trajectory.time_s[covered], trajectory["altitude_m"][covered], second_m[covered])
    if apart.largest_m > MAX_DIFFERENCE_M:
        remarks.append(
            f"The vehicle and {name} disagree: up to {apart.largest_m:.2f} m, at {apart.at_s:.1f} s "
            f"({apart.rms_m:.2f} m root mean square)."
        )
    if gap := _longest_gap(other_s - alignment.delay_s, trajectory):
        remarks.append(f"{capitalised(name)} has no samples for {gap[1]:.1f} s from {gap[0]:.1f} s on.")
    both = (
        _on_the_second_s_times(trajectory, other_s - alignment.delay_s, other_m - alignment.datum_m)
        if scored == "mocap"
        else replace(trajectory, channels={**trajectory.channels, "altitude_2_m": second_m})
    )
    settings = {
        "second_delay_s": round(alignment.delay_s, 4),
        "second_largest_m": round(apart.largest_m, 4),
        "second_rms_m": round(apart.rms_m, 4),
    }
    return AlignedRecord(trajectory=both, settings=settings, remark=" ".join(remarks))


def _rising(seen: Sequence[tuple[float, float]], zero_s: float) -> tuple[Samples, Samples]:
    """Return times and altitudes, each of shape (k,), without samples that are out of order."""
    received_s, altitude_m = np.array(seen, dtype=np.float64).reshape(-1, 2).T
    later = np.diff(np.maximum.accumulate(received_s), prepend=-np.inf) > 0.0
    return received_s[later] - zero_s, altitude_m[later]


def _aligned(trajectory: Trajectory, other_s: Samples, other_m: Samples) -> tuple[Alignment, list[str]]:
    """Align the second source with the record by the flight itself, or, with a remark, by the times of receipt if it
    has too few samples."""
    time_s, altitude_m = trajectory.time_s, trajectory["altitude_m"]
    try:
        return align(time_s, altitude_m, other_s, other_m, rest_until_s=0.0), []
    except TrajectoryError as error:
        apart_m = np.interp(time_s, other_s, other_m) - altitude_m
        rested = time_s <= max(0.0, time_s[0])
        alignment = Alignment(delay_s=0.0, datum_m=float(np.median(apart_m[rested])))
        reasons = "; ".join(problem.reason for problem in error.problems)
        return alignment, [f"The second source of altitude was aligned by its time of receipt alone: {reasons}."]


def _longest_gap(other_s: Samples, trajectory: Trajectory) -> tuple[float, float] | None:
    """Return begin and length of the longest gap between samples in the record, s, if it exceeds the scoring limit."""
    first_s, last_s = trajectory.time_s[0], trajectory.time_s[-1]
    inside_s = other_s[(other_s > first_s) & (other_s < last_s)]
    marks_s = np.concatenate(([first_s], inside_s, [last_s]))
    gaps_s = np.diff(marks_s)
    longest = int(np.argmax(gaps_s))
    return (float(marks_s[longest]), float(gaps_s[longest])) if gaps_s[longest] > MAX_GAP_S else None


def _on_the_second_s_times(trajectory: Trajectory, second_s: Samples, second_m: Samples) -> Trajectory:
    """Resample the vehicle's channels at the times of the second source within the vehicle's record."""
    inside = (second_s >= trajectory.time_s[0]) & (second_s <= trajectory.time_s[-1])
    time_s = np.round(second_s[inside], 6)
    before = np.searchsorted(trajectory.time_s, second_s[inside], side="right") - 1
    own = {
        name: values[before] if name in _STEPPED else np.interp(time_s, trajectory.time_s, values)
        for name, values in trajectory.channels.items()
    }
    channels = {**own, "altitude_m": second_m[inside], "altitude_2_m": own["altitude_m"]}
    return replace(trajectory, time_s=time_s, channels=channels)


SOURCE: Final = "mavlink"


def channels_of(sample: RecordSample, datum_m: float, scored: Scored) -> dict[str, float]:
    """Return a sample's channels; altitudes count from `datum_m` on the vehicle's own datum."""
    own_m = sample.position.altitude_m - datum_m
    channels = {
        "altitude_m": own_m,
        "climb_rate_m_s": sample.position.climb_rate_m_s,
        "set_point_m": sample.set_point_m - datum_m,
    }
    reference_m = None if sample.reference_m is None else sample.reference_m - datum_m
    further = {"battery_v": sample.battery_v, "throttle": sample.throttle, REFERENCE: reference_m}
    channels |= {name: value for name, value in further.items() if value is not None}
    if sample.second_m is not None:
        second_m = sample.second_m - datum_m
        scored_m, other_m = (own_m, second_m) if scored == "vehicle" else (second_m, own_m)
        channels |= {"altitude_m": scored_m, "altitude_2_m": other_m}
    return channels


def trajectory_of(
    samples: Sequence[RecordSample], start_s: float, datum_m: float, *, referred_from_s: float = math.inf
) -> Trajectory:
    """Return the vehicle's own samples as a trajectory by its clock from `start_s` on. Channels that some samples lack
    are omitted, and so is the second source, of which each sample contains only the last value received.

    If any sample has the autopilot's reference, it is the altitude where it is unknown earlier than `referred_from_s`
    after the start, as on the ground; later, a gap no longer than that of a record may be is interpolated, or the
    last one held.
    """
    referred = _with_references(samples, start_s + referred_from_s)
    rows = [channels_of(replace(sample, second_m=None), datum_m, "vehicle") for sample in referred]
    names = [name for name in rows[-1] if all(name in row for row in rows)] if rows else []
    time_s = np.array([round(sample.position.time_boot_s - start_s, 6) for sample in samples])
    channels = {name: np.array([row[name] for row in rows], dtype=np.float64) for name in names}
    return Trajectory(time_s, channels, SOURCE, "vehicle")


def _with_references(samples: Sequence[RecordSample], begin_s: float) -> Sequence[RecordSample]:
    """Return the samples with the references that follow from the others, if any has one."""
    known = [(sample.position.time_boot_s, sample.reference_m) for sample in samples if sample.reference_m is not None]
    if not known:
        return samples
    known_s, known_m = np.array(known).T

    def reference_m(time_s: float, altitude_m: float) -> float | None:
        after = int(np.searchsorted(known_s, time_s))
        next_s = known_s[after] if after < len(known_s) else time_s
        if after and next_s - known_s[after - 1] <= MAX_GAP_S:
            return float(np.interp(time_s, known_s, known_m))
        return altitude_m if time_s < begin_s else None

    return [
        sample
        if sample.reference_m is not None
        else replace(sample, reference_m=reference_m(sample.position.time_boot_s, sample.position.altitude_m))
        for sample in samples
    ]


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


def ending_of(trial: Trial) -> Ending:
    """Return the ending of the record, independent of a quarantine of the vehicle."""
    if trial.failure is None:
        return "completed"
    return "aborted" if RESPONSES[trial.failure].outcome == "aborted" else "invalid"


def hover_throttle_of(trajectory: Trajectory, *, until_s: float) -> float | None:
    """Return the mean throttle over the 2 s until then, in which the vehicle is at rest; None if it was not recorded
    there."""
    at_rest = (trajectory.time_s >= until_s - SETTLED_FOR_S) & (trajectory.time_s < until_s)
    throttle = trajectory.channels.get("throttle")
    if throttle is None or not at_rest.any() or not np.isfinite(throttle[at_rest]).all():
        return None
    return float(throttle[at_rest].mean())


def end_of(trial: Trial, *notes: str) -> FlightEnd:
    """Return how the trial ended, with `notes` on its record. A vehicle that its pilot took over still has the gains of
    the flight: nothing was sent to it."""
    dropped = trial.watch.positions.glitches if trial.failure is not Failure.GLITCHES else 0
    flag = f"{count(dropped, 'sample')} jumped and {'was' if dropped == 1 else 'were'} dropped." if dropped else ""
    was_left_alone = trial.failure is Failure.TAKEN_OVER and trial.state is State.QUARANTINE
    return FlightEnd(
        failure=trial.failure,
        request=trial.request,
        remarks=tuple(filter(None, (*trial.remarks, flag, *notes))),
        gains_left=GainsLeft.FLIGHT if was_left_alone else GainsLeft.UNKNOWN,
        landed=trial.contact,
    )
