"""Short ways to fly, for the tests of vehicles."""

from collections.abc import Callable, Mapping
from typing import Final

from app.core.experiments.takeoff import Takeoff
from app.core.trajectory import Trajectory
from app.vehicles.base import FlightOrder, FlightRecord, OptionValue, Sample, Vehicle
from app.vehicles.open import VEHICLE_KINDS, open_vehicle

TAKEOFF: Final = Takeoff()
SAFE: Final = {"kp": 283, "ki": 13, "kd": 82}
TUNED: Final = {"kp": 1600, "ki": 1023, "kd": 127}
CAN_FLY: Final = tuple(name for name, kind in VEHICLE_KINDS.items() if kind.can_fly)


def never() -> str | None:
    return None


def unwatched(_sample: Sample) -> None:
    pass


def fly(
    vehicle: Vehicle,
    gains: Mapping[str, float] = TUNED,
    *,
    seed: int = 1,
    speed: float | None = None,
    on_sample: Callable[[Sample], None] = unwatched,
    should_abort: Callable[[], str | None] = never,
) -> FlightRecord:
    vehicle.stage(gains)
    return vehicle.fly(FlightOrder(seed=seed, speed=speed), on_sample=on_sample, should_abort=should_abort)


def flown(
    kind: str, options: Mapping[str, OptionValue], gains: Mapping[str, float] = TUNED, seed: int = 1
) -> Trajectory:
    """The trajectory of one flight of a vehicle opened for it alone."""
    with open_vehicle(kind, options, safe_gains=SAFE) as vehicle:
        return fly(vehicle, gains, seed=seed).trajectory


class Watcher:
    """Collects telemetry, and wants an abort once it has seen `abort_at_s` of it."""

    def __init__(self, abort_at_s: float = float("inf")) -> None:
        self.samples: list[Sample] = []
        self._abort_at_s = abort_at_s

    def see(self, sample: Sample) -> None:
        self.samples.append(sample)

    def decide(self) -> str | None:
        late = bool(self.samples) and self.samples[-1].time_s >= self._abort_at_s
        return "the operator pressed Abort" if late else None
