"""Computation time of one takeoff of the simulated AR.Drone, relative to JSBSim alone.

    ./dev exec python -m bench.jsbsim_takeoff

JSBSim alone is the bare stepping loop of the same aircraft over the same time, without other work in Python. The
takeoff is a complete flight as in the program, including loading the aircraft and settling on the ground. Times both in
turns and prints the best of each and their ratio; exits with 1 if the ratio is above 3.
"""

import sys
import time
from collections.abc import Callable
from typing import Final

from app.autopilots.registry import get_experiment
from app.vehicles.base import FlightOptions, Vehicle
from app.vehicles.jsbsim import new_aircraft
from app.vehicles.registry import open_vehicle
from app.vehicles.simulated import STEPS

ROUNDS: Final = 15
LIMIT: Final = 3.0
GAINS: Final = {"kp": 1600, "ki": 1023, "kd": 127}


def bare() -> float:
    run = new_aircraft().run
    start = time.perf_counter()
    for _ in range(STEPS):
        run()
    return time.perf_counter() - start


def takeoff(vehicle: Vehicle) -> float:
    vehicle.stage(GAINS)
    start = time.perf_counter()
    vehicle.fly(FlightOptions(seed=1), on_sample=lambda _: None, should_stop=lambda: None)
    return time.perf_counter() - start


def best(*runs: Callable[[], float]) -> list[float]:
    """Return the shortest time of each, s, measured in turns so that a busy machine affects all alike."""
    rounds = [[run() for run in runs] for _ in range(ROUNDS)]
    return [min(times) for times in zip(*rounds, strict=True)]


def main() -> int:
    space = get_experiment("takeoff").space
    with open_vehicle("jsbsim", {}, safe_gains=space.mapping(space.default)) as vehicle:
        takeoff(vehicle)  # compiles
        alone_s, flight_s = best(bare, lambda: takeoff(vehicle))
    ratio = flight_s / alone_s
    print(f"JSBSim alone, {STEPS} steps: {alone_s * 1e3:.1f} ms")
    print(f"One takeoff of {STEPS / 512:.1f} s:   {flight_s * 1e3:.1f} ms, {ratio:.2f} × that (limit {LIMIT:g})")
    return 0 if ratio <= LIMIT else 1


if __name__ == "__main__":
    sys.exit(main())
