"""The F-16 of the paper's first experiment: the true linear model under the pitch controller, in simulation."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from app.autopilots.autopilot import require_accepted
from app.core.definition import Option
from app.core.experiments.pitch_tracking import DETAIL_CHANNELS, OUTPUT, WINDOW_S, PitchTracking, named_channels
from app.core.models.f16 import (
    AMPLITUDE_RAD,
    DETAIL,
    MEMORY_SIZE,
    PITCH,
    RATE_HZ,
    REFERENCE,
    STATES,
    STEP_S,
    SYSTEM,
    rollout,
    transitions,
)
from app.core.policy import Gains, is_finite, shortened
from app.core.records.trajectory import Samples, Trajectory
from app.vehicles.base import FlightOptions, OptionValue, Sample, ShouldStop
from app.vehicles.flight_end import StopRequest
from app.vehicles.kinds import VehicleKind
from app.vehicles.simulated import CANNOT_HOLD, Pacer, StagedVehicle

GAIN_NAMES: Final = PitchTracking.space.names
LOG_NOISE: Final = np.array([3.0, math.radians(0.1), 0.5, math.radians(0.2), math.radians(0.1)])
"""Standard deviations of the recorded states (ft, rad, ft/s, rad, rad/s) at 50 Hz, with `log_noise` 1."""

_STEPS: Final = round(WINDOW_S * RATE_HZ) + 1
_RECOVERY_STEPS: Final = 10 * RATE_HZ
"""After an abort the wings stay level and the pitch returns to trim for ten seconds."""

_NO_BIAS: Final = np.empty((0, STATES))
_LARGEST_GAIN: Final = float(np.finfo(np.float32).max)


class LinearAircraft(StagedVehicle):
    """Simulated aircraft that holds the controller's six gains, and tracks the reference for a minute, from trim.

    A stop sets the safe gains and lets the pitch return to trim for ten seconds, which are part of the record. Once the
    pitch error has reached 10 rad the state is frozen.
    """

    def __init__(self, safe_gains: Gains, settings: Mapping[str, OptionValue]) -> None:
        super().__init__("lti", safe_gains, settings, _numbers)
        self._log_noise = float(settings["log_noise"])

    def _flown(
        self, order: FlightOptions, on_sample: Callable[[Sample], None], should_stop: ShouldStop
    ) -> tuple[Trajectory, StopRequest | None, bool]:
        tracking, noise = _TrackingRun(self._held, AMPLITUDE_RAD, _STEPS), _noise(self._log_noise, order.seed)
        detail = _flown(noise, tracking)
        flown_steps, stop = _send_samples(detail, Pacer(order.speed, order.clock), on_sample, should_stop)
        if stop is not None:
            returning = _TrackingRun(self.safe_gains, 0.0, _RECOVERY_STEPS if flown_steps else 1)
            detail = _flown(noise, replace(tracking, steps=flown_steps), returning)
        return _trajectory(detail), stop, flown_steps > 0


def whole_flight(gains: Gains, *, log_noise: float, seed: int) -> Trajectory:
    """Return the record of one whole flight, the same as from `LinearAircraft.fly`, in 1 ms instead of 40 ms."""
    return _trajectory(_flown(_noise(log_noise, seed), _TrackingRun(_numbers(gains), AMPLITUDE_RAD, _STEPS)))


@dataclass(frozen=True, slots=True)
class _TrackingRun:
    """Flight of `steps` steps along a reference of `amplitude_rad`."""

    gains: Gains
    amplitude_rad: float
    steps: int


def _noise(log_noise: float, seed: int) -> Samples:
    """Return the noise on the states of the longest record, shape (n, 5), in the source's units."""
    return log_noise * LOG_NOISE * np.random.default_rng(seed).standard_normal((_STEPS + _RECOVERY_STEPS, STATES))


def _flown(noise: Samples, *legs: _TrackingRun) -> Samples:
    """Fly the legs one after the other from trim; return the record's rows, shape (n, 8)."""
    memory, motion = np.zeros(MEMORY_SIZE), transitions(SYSTEM)
    detail, first = np.empty((sum(leg.steps for leg in legs), DETAIL)), 0
    for leg in legs:
        gains, rows = np.array([leg.gains[name] for name in GAIN_NAMES]), detail[first : first + leg.steps]
        rollout(memory, gains, motion, leg.amplitude_rad, _NO_BIAS, np.empty(len(rows)), rows)
        first += leg.steps
    detail[:, :STATES] += noise[: len(detail)]
    return detail


def _send_samples(
    detail: Samples, pacer: Pacer, on_sample: Callable[[Sample], None], should_stop: ShouldStop
) -> tuple[int, StopRequest | None]:
    """Send the samples of a flight at their time; return how many were sent, and the stop request if one came."""
    for i, row in enumerate(detail):
        if (stop := pacer.wait_until(i * STEP_S, should_stop)) is not None:
            return i, stop
        values: list[float] = row.tolist()
        watched = {name: values[column] * unit for name, (column, unit) in DETAIL_CHANNELS.items()}
        on_sample(Sample(i * STEP_S, {OUTPUT: values[REFERENCE] - values[PITCH]} | watched))
    return len(detail), None


def _trajectory(detail: Samples) -> Trajectory:
    time_s = np.arange(len(detail), dtype=np.float64) * STEP_S
    channels = named_channels(detail[:, REFERENCE] - detail[:, PITCH], detail)
    return Trajectory(time_s, channels, "lti", "simulation")


def _numbers(gains: Gains) -> dict[str, float]:
    require_accepted(gains, dict.fromkeys(GAIN_NAMES, _refusal), CANNOT_HOLD, " as finite numbers")
    return {name: float(gains[name]) for name in GAIN_NAMES}


def _refusal(value: float) -> str | None:
    if not is_finite(value) or abs(value) > _LARGEST_GAIN:
        return f"must be a finite number in single precision, got {shortened(value)}"
    return None


LTI: Final = VehicleKind(
    name="lti",
    title="F-16, longitudinal",
    line="The linear F-16 at 15 000 ft and 500 ft/s that serves as the true system in the paper's first experiment.",
    is_real=False,
    experiments=("pitch-tracking",),
    options=(
        Option(
            "log_noise",
            "Noise of the recorded states, as a multiple of 3 ft, 0.1°, 0.5 ft/s, 0.2°, 0.1 °/s at 50 Hz",
            0.0,
            "×",
            0.0,
            10.0,
        ),
    ),
    open=lambda options, safe_gains, _trial_parameters: LinearAircraft(safe_gains, options),
)
