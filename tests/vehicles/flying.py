"""Short ways to fly, for the tests of vehicles."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from app.core.clock import REAL_TIME, Clock
from app.core.experiments.base import Experiment
from app.core.experiments.pitch_tracking import PitchTracking
from app.core.experiments.takeoff import Takeoff
from app.core.records.trajectory import Trajectory
from app.vehicles.base import FlightOptions, FlightRecord, OptionValue, Sample, ShouldStop, Vehicle
from app.vehicles.flight_end import StopRequest
from app.vehicles.registry import VEHICLE_KINDS, open_vehicle

TAKEOFF: Final = Takeoff()
SAFE: Final = {"kp": 283, "ki": 13, "kd": 82}
TUNED: Final = {"kp": 1600, "ki": 1023, "kd": 127}
PITCH: Final = PitchTracking()
HAND: Final = PITCH.space.mapping(PITCH.space.default)
TRACKING: Final = PITCH.space.mapping(np.array([-20.0, -50.0, -57.3, -14.796, -4.21, -0.008]))
CAN_FLY: Final = tuple(name for name, kind in VEHICLE_KINDS.items() if kind.can_fly and not kind.is_real)
"""In this process. Vehicles at the other end of a link have tests of their own, in `mavlink/`."""

TAKES_OFF: Final = tuple(name for name in CAN_FLY if "takeoff" in VEHICLE_KINDS[name].experiments)


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile:
    """How a kind of vehicle is flown in tests: what it flies, gains that it holds when safe and that fly well, between
    which errors these fly, and options under which flights differ."""

    experiment: Experiment = TAKEOFF
    safe: Mapping[str, float] = field(default_factory=lambda: SAFE)
    tuned: dict[str, float] = field(default_factory=lambda: dict(TUNED))
    tuned_error: tuple[float, float] = (0.08, 0.15)
    scored_until_s: float = 32.6
    scattered: Mapping[str, OptionValue]


PROFILES: Final[Mapping[str, Profile]] = {
    "jsbsim": Profile(scattered={"gust_m_s": 0.5, "altitude_noise_m": 0.005}),
    "twin": Profile(scattered={"scatter": 1.0}),
    "lti": Profile(
        experiment=PITCH,
        safe=HAND,
        tuned=TRACKING,
        tuned_error=(0.2045, 0.2049),
        scored_until_s=60.0,
        scattered={"log_noise": 1.0},
    ),
}


def never() -> StopRequest | None:
    return None


def unwatched(_sample: Sample) -> None:
    pass


def fly(
    vehicle: Vehicle,
    gains: Mapping[str, float] | None = None,
    *,
    seed: int = 1,
    speed: float | None = None,
    on_sample: Callable[[Sample], None] = unwatched,
    should_stop: ShouldStop = never,
    clock: Clock = REAL_TIME,
) -> FlightRecord:
    """With the kind's tuned gains where none are given."""
    vehicle.stage(PROFILES[vehicle.kind].tuned if gains is None else gains)
    return vehicle.fly(FlightOptions(seed=seed, speed=speed, clock=clock), on_sample=on_sample, should_stop=should_stop)


def flown(
    kind: str, options: Mapping[str, OptionValue], gains: Mapping[str, float] | None = None, seed: int = 1
) -> Trajectory:
    """The trajectory of one flight of a vehicle opened for it alone."""
    with open_vehicle(kind, options, safe_gains=PROFILES[kind].safe) as vehicle:
        return fly(vehicle, gains, seed=seed).trajectory


class Watcher:
    """Collects telemetry, and wants an abort once it has seen `abort_at_s` of it."""

    def __init__(self, abort_at_s: float = float("inf")) -> None:
        self.samples: list[Sample] = []
        self._abort_at_s = abort_at_s

    def see(self, sample: Sample) -> None:
        self.samples.append(sample)

    def decide(self) -> StopRequest | None:
        late = bool(self.samples) and self.samples[-1].time_s >= self._abort_at_s
        return StopRequest("the operator pressed Abort") if late else None
