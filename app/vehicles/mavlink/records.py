"""What a trial leaves: its samples as a trajectory, and in words how it ended."""

from collections.abc import Callable, Mapping, Sequence
from typing import Final, Literal, TypeVar

import numpy as np

from app.core.trajectory import Samples, Trajectory
from app.vehicles.base import Ending
from app.vehicles.mavlink.failures import RESPONSES, Failure
from app.vehicles.mavlink.machine import Trial
from app.vehicles.mavlink.signals import Keep

Scored = Literal["vehicle", "mocap"]
"""The source of altitude that is scored, where there are two."""

SOURCE: Final = "mavlink"
_Altitude = TypeVar("_Altitude", float, Samples)
_Value = TypeVar("_Value")
_SCORED: Final = "altitude_m"
_OTHER: Final = "altitude_2_m"


def channels_of(kept: Keep, datum_m: float, scored: Scored) -> dict[str, float]:
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
        channels |= _sources(own_m, kept.second_m - datum_m, scored)
    return channels


def trajectory_of(
    samples: Sequence[Keep],
    start_s: float,
    datum_m: float,
    *,
    scored: Scored = "vehicle",
    second_m: Callable[[Samples], Samples] | None = None,
) -> Trajectory:
    """By the vehicle's own clock, from the command on; channels that some samples lack are left out.

    `second_m` gives where a second source saw the vehicle (on its datum) at instants of the vehicle's clock: closer
    than what each sample holds, which is the last that had come.
    """
    rows = [channels_of(sample, datum_m, "vehicle") for sample in samples]
    names = [name for name in rows[-1] if all(name in row for row in rows)] if rows else []
    boot_s = np.array([sample.position.time_boot_s for sample in samples])
    channels = {name: np.array([row[name] for row in rows], dtype=np.float64) for name in names if name != _OTHER}
    if second_m is not None and rows:
        channels |= _sources(channels[_SCORED], second_m(boot_s) - datum_m, scored)
    return Trajectory(np.round(boot_s - start_s, 6), channels, SOURCE, "vehicle")


def seen_at(seen: Sequence[tuple[float, float]], offset_s: float) -> Callable[[Samples], Samples] | None:
    """Straight lines between sightings (our clock in s, m), by the vehicle's clock, which `offset_s` takes to ours;
    None without sightings."""
    if not seen:
        return None
    times_s, altitudes_m = np.array(sorted(seen)).T
    return lambda boot_s: np.interp(boot_s + offset_s, times_s, altitudes_m)


def _sources(own_m: _Altitude, second_m: _Altitude, scored: Scored) -> dict[str, _Altitude]:
    return {_SCORED: own_m, _OTHER: second_m} if scored == "vehicle" else {_SCORED: second_m, _OTHER: own_m}


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


def settings_of(options: Mapping[str, _Value]) -> dict[str, _Value]:
    """The options as a record tells them: without the secret among them."""
    return {name: value for name, value in options.items() if name != "signing_key"}
