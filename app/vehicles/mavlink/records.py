"""The record of a trial: its samples as a trajectory, with both sources of altitude where there are two, aligned, one
of them scored; and in words how it ended.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, Literal

import numpy as np

from app.core.errors import TrajectoryError
from app.core.records.alignment import Alignment, align, compare, resample
from app.core.records.metrics import MAX_GAP_S
from app.core.records.trajectory import Samples, Trajectory
from app.vehicles.base import Ending, OptionValue
from app.vehicles.mavlink.events import RecordSample
from app.vehicles.mavlink.failures import RESPONSES, Failure
from app.vehicles.mavlink.trial_machine import Trial

Scored = Literal["vehicle", "mocap"]
"""Whose altitude is scored."""

MAX_DIFFERENCE_M: Final = 0.3
"""Further apart than this, the sources are said to disagree."""
_STEPPED: Final = ("set_point_m",)
"""Channels that jump: between two samples the first holds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AlignedRecord:
    """`settings` tell delay and differences of the two sources, `remark` what a person has to know of them: empty when
    all is well."""

    trajectory: Trajectory
    settings: Mapping[str, OptionValue] = field(default_factory=dict)
    remark: str = ""


def add_secondary_altitude(
    trajectory: Trajectory, seen: Sequence[tuple[float, float]], *, name: str, zero_s: float, scored: Scored
) -> AlignedRecord:
    """The vehicle's own record with what the second source, `name`, saw of the flight: when each sighting was received,
    s, and the altitude, m, on any datum; `zero_s` is the record's time 0 on the clock of the receipts. Where `mocap` is
    scored the record runs on its times, and the vehicle's own altitude is `altitude_2_m`; else the other way round. A
    source that saw too little leaves the record as it is."""
    other_s, other_m = _rising(seen, zero_s)
    inside = (other_s >= trajectory.time_s[0]) & (other_s <= trajectory.time_s[-1])
    if np.count_nonzero(inside) < 2:
        unseen = f"Nothing was seen by {name}, the second source of altitude; the vehicle's own is scored."
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
        remarks.append(f"{name[0].upper()}{name[1:]} saw nothing for {gap[1]:.1f} s from {gap[0]:.1f} s on.")
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
    """Times and altitudes, each of shape (k,), without those that came later than they should."""
    received_s, altitude_m = np.array(seen, dtype=np.float64).reshape(-1, 2).T
    later = np.diff(np.maximum.accumulate(received_s), prepend=-np.inf) > 0.0
    return received_s[later] - zero_s, altitude_m[later]


def _aligned(trajectory: Trajectory, other_s: Samples, other_m: Samples) -> tuple[Alignment, list[str]]:
    """By what both saw of the flight; by their receipts, and said so, where that is too little."""
    time_s, altitude_m = trajectory.time_s, trajectory["altitude_m"]
    try:
        return align(time_s, altitude_m, other_s, other_m, rest_until_s=0.0), []
    except TrajectoryError as error:
        apart_m = np.interp(time_s, other_s, other_m) - altitude_m
        rested = time_s <= max(0.0, time_s[0])
        alignment = Alignment(delay_s=0.0, datum_m=float(np.median(apart_m[rested])))
        reasons = "; ".join(problem.reason for problem in error.problems)
        return alignment, [f"The second source of altitude was aligned by its receipt alone: {reasons}."]


def _longest_gap(other_s: Samples, trajectory: Trajectory) -> tuple[float, float] | None:
    """Begin and length of the longest time inside the record without a sample, where scoring would miss it."""
    first_s, last_s = trajectory.time_s[0], trajectory.time_s[-1]
    inside_s = other_s[(other_s > first_s) & (other_s < last_s)]
    marks_s = np.concatenate(([first_s], inside_s, [last_s]))
    gaps_s = np.diff(marks_s)
    longest = int(np.argmax(gaps_s))
    return (float(marks_s[longest]), float(gaps_s[longest])) if gaps_s[longest] > MAX_GAP_S else None


def _on_the_second_s_times(trajectory: Trajectory, second_s: Samples, second_m: Samples) -> Trajectory:
    """Every channel of the vehicle's on the times of the second source, as far as the vehicle's record goes."""
    inside = (second_s >= trajectory.time_s[0]) & (second_s <= trajectory.time_s[-1])
    time_s = np.round(second_s[inside], 6)
    before = np.searchsorted(trajectory.time_s, second_s[inside], side="right") - 1
    own = {
        name: values[before] if name in _STEPPED else np.interp(time_s, trajectory.time_s, values)
        for name, values in trajectory.channels.items()
    }
    channels = {**own, "altitude_m": second_m[inside], "altitude_2_m": own["altitude_m"]}
    return Trajectory(time_s, channels, trajectory.source, trajectory.clock)


SOURCE: Final = "mavlink"
_SCORED: Final = "altitude_m"
_OTHER: Final = "altitude_2_m"


def channels_of(kept: RecordSample, datum_m: float, scored: Scored) -> dict[str, float]:
    """A sample's channels; altitudes count from `datum_m` on the vehicle's own."""
    own_m = kept.position.altitude_m - datum_m
    channels = {
        _SCORED: own_m,
        "climb_rate_m_s": kept.position.climb_rate_m_s,
        "set_point_m": kept.set_point_m - datum_m,
    }
    if kept.battery_v is not None:
        channels["battery_v"] = kept.battery_v
    if kept.second_m is not None:
        second_m = kept.second_m - datum_m
        scored_m, other_m = (own_m, second_m) if scored == "vehicle" else (second_m, own_m)
        channels |= {_SCORED: scored_m, _OTHER: other_m}
    return channels


def trajectory_of(samples: Sequence[RecordSample], start_s: float, datum_m: float) -> Trajectory:
    """What the vehicle said, by its own clock, from the command on; channels that some samples lack are left out, and
    what a second source saw is not in it: each sample holds only the last that had come."""
    rows = [channels_of(replace(sample, second_m=None), datum_m, "vehicle") for sample in samples]
    names = [name for name in rows[-1] if all(name in row for row in rows)] if rows else []
    time_s = np.array([round(sample.position.time_boot_s - start_s, 6) for sample in samples])
    channels = {name: np.array([row[name] for row in rows], dtype=np.float64) for name in names}
    return Trajectory(time_s, channels, SOURCE, "vehicle")


def ending_of(trial: Trial) -> Ending:
    """What the record is worth, whatever became of the vehicle."""
    outcome = None if trial.failure is None else RESPONSES[trial.failure].outcome
    if outcome is None:
        return "completed"
    return "aborted" if outcome == "aborted" else "invalid"


def reason_of(trial: Trial) -> str:
    """Why the flight ended early or does not count, and what else is to be known of its record."""
    if trial.failure is None or trial.failure is Failure.OPERATOR:
        said = trial.why
    else:
        said = f"{RESPONSES[trial.failure].text} {trial.why}"
    dropped = trial.watch.glitches if trial.failure is not Failure.GLITCHES else 0
    flag = f"{dropped} of its samples jumped and were dropped." if dropped else ""
    return " ".join(part for part in (said, flag) if part)
