"""How well the log of one takeoff predicts another one, on random vehicles with more physics than the model.

    ./dev exec python -m bench.takeoff_logs                    a few vehicles, against the limits
    ./dev exec python -m bench.takeoff_logs --vehicles 200     the figures of docs/benchmarks.md

Each vehicle flies the default gains, and its log is analysed; it flies the proposed gains, and that log is analysed
too. Counted is whether an error lies in the 90 % interval of the other flight's analysis: of the proposed gains in that
of the default ones (forward), and of the default gains in that of the proposed ones (backward). Exits with 1 beyond the
limits, which are loose because the vehicles are few.
"""

import argparse
import sys
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from typing import Final, Literal

from app.core.errors import TrajectoryError
from app.core.experiments.takeoff import Takeoff
from app.core.policy import Gains
from app.core.tuning.logged_takeoffs import AssessedGains, LoggedTakeoff, TakeoffAnalysis, analyze_takeoffs
from bench.targets.vehicles import SampledVehicle, fly, population

SEED: Final = 20261126
QUICK_VEHICLES: Final = 8
LEAST_WITHIN: Final = 0.6

Place = Literal["within", "below", "above", "no answer"]


def main() -> int:
    parser = argparse.ArgumentParser(prog="bench.takeoff_logs")
    parser.add_argument("--vehicles", type=int, default=QUICK_VEHICLES)
    count: int = parser.parse_args().vehicles
    with ProcessPoolExecutor() as pool:
        found = list(pool.map(judge, population("further-physics", count, SEED)))
    shares = []
    for way, places in zip(("forward", "backward"), zip(*found, strict=True), strict=True):
        counted = Counter(places)
        answered = len(places) - counted["no answer"]
        shares.append(counted["within"] / max(answered, 1))
        print(
            f"{way}: {counted['within']} of {answered} within ({shares[-1]:.0%}), {counted['below']} below, "
            f"{counted['above']} above, {counted['no answer']} without an answer"
        )
    return int(min(shares) < LEAST_WITHIN)


def judge(vehicle: SampledVehicle) -> tuple[Place, Place]:
    """Where the errors of the proposed and of the default gains lie in the intervals of the other's analysis."""
    default = Takeoff.space.mapping(Takeoff.space.default)
    try:
        first = analyze(vehicle, default, seed=2 * vehicle.number)
        if first.proposed is None:
            return "no answer", "no answer"
        second = analyze(vehicle, first.proposed.gains, seed=2 * vehicle.number + 1)
    except TrajectoryError:
        return "no answer", "no answer"
    again = next(each for each in second.assessments if each.gains == default)
    return place(second.best.error, first.proposed), place(first.best.error, again)


def analyze(vehicle: SampledVehicle, gains: Gains, *, seed: int) -> TakeoffAnalysis:
    return analyze_takeoffs([LoggedTakeoff(number=1, gains=gains, trajectory=fly(vehicle, gains, seed))])


def place(error_m: float | None, predicted: AssessedGains) -> Place:
    if error_m is None:
        return "no answer"
    if error_m < predicted.interval.lower:
        return "below"
    return "above" if error_m > predicted.interval.upper else "within"


if __name__ == "__main__":
    sys.exit(main())
