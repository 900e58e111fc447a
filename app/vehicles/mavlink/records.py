"""What a trial leaves: its samples as a trajectory, and in words how it ended."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from app.core.records.trajectory import Trajectory
from app.vehicles.base import Ending
from app.vehicles.mavlink.failures import RESPONSES, Failure
from app.vehicles.mavlink.machine import Trial
from app.vehicles.mavlink.signals import RecordSample
from app.vehicles.mocap.recording import Scored

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
