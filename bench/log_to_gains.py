"""From the log of one flight with the autopilot's default gains to the second flight, on random vehicles.

    ./dev exec python -m bench.log_to_gains                    a few vehicles, against the limits
    ./dev exec python -m bench.log_to_gains --vehicles 200 --searches     the figures of docs/benchmarks.md
    ./dev exec python -m bench.log_to_gains --gusts 0.6 0.04              in turbulence within a row of the log

Every vehicle has more physics than the model (bench/copters/simulation.py). An error is the mean of flights of the same
steps in other weather. The best gains are the best of a grid that keep the limits of a proposal, the margin on the
vehicle's own linear model. `--searches` tunes each vehicle by black-box searches too. Exits with 1 beyond the limits,
which are loose because the vehicles are few.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Final

import numpy as np

from app.core.analysis.analysis import Assessment, analyze
from app.core.analysis.loop import AltitudeLoop
from app.core.analysis.margin import RINGING_DAMPING, damping_within_margin, least_damping
from app.core.analysis.proposal import LARGEST_ACTIVITY
from app.core.errors import TrajectoryError
from app.core.records.trajectory import Samples
from bench.copters.black_box import BUDGET, SEARCHES, best_of
from bench.copters.rigs import RIGS, Rig
from bench.copters.simulation import SimulatedCopter

SEED: Final = 20261125
QUICK_VEHICLES: Final = 6
FLIGHTS: Final = 6
FLIGHTS_OF_THE_GRID: Final = 3
PROPOSED: Final = "Proposed"
SEARCHED_FLIGHTS: Final = (2, 5, 10, BUDGET)
LIMITS: Final[Mapping[str, float]] = {"worse": 0.0, "unsafe": 0.0, "covered": 0.6, "near": 0.6}


@dataclass(frozen=True, slots=True)
class Result:
    """What became of a vehicle: errors, m, by gain set, the least of the grid, whether the proposal's interval
    contains each of its flights, and the gain sets that rang."""

    errors_m: Mapping[str, float]
    best_m: float
    covered: Sequence[bool]
    predicted: Sequence[tuple[float, float]]
    rang: frozenset[str]
    refused: str | None
    searched: Mapping[str, "Searched"]


@dataclass(frozen=True, slots=True)
class Searched:
    """A black-box search: the error of its best gains, m, after each number of flights, flights that rang, and whether
    the best gains of all keep the margin."""

    errors_m: Mapping[int, float]
    rang: int
    keeps_margin: bool


def judge(number: int, *, rig: Rig, searches: bool = False) -> Result:
    """Fly, analyse, and fly what is proposed, what people would set, and what `searches` find."""
    random = np.random.default_rng((SEED, number))
    copter = rig.sample(random)
    loop = rig.first_loop(copter)
    seeds = random.integers(2**31, size=FLIGHTS + 1).tolist()
    first = rig.fly(copter, loop, seeds[0])
    try:
        analysis = analyze(first.log)
    except TrajectoryError as error:
        return Result({}, np.nan, (), (), frozenset(), str(error), {})
    best_m = least_error(rig, copter, seeds[1:])
    searched = search(rig, copter, seeds[1:]) if searches else {}
    errors_m: dict[str, float] = {}
    covered: list[bool] = []
    predicted: list[tuple[float, float]] = []
    rang: set[str] = set()
    for each in sets(analysis.proposed, analysis.assessments):
        flights = [rig.fly(copter, loop.with_gains(each.gains), seed) for seed in seeds[1:]]
        errors_m[each.name] = float(np.mean([flight.error_m for flight in flights]))
        predicted.append((each.prediction.error_m, errors_m[each.name]))
        if rings(copter, loop.with_gains(each.gains)):
            rang.add(each.name)
        if each.name == PROPOSED:
            within = (each.prediction.low_m, each.prediction.high_m)
            covered = [within[0] <= flight.error_m <= within[1] for flight in flights]
    why = None if analysis.why_none is None else analysis.why_none.code.key
    return Result(errors_m, best_m, covered, predicted, frozenset(rang), why, searched)


def rings(copter: SimulatedCopter, loop: AltitudeLoop) -> bool:
    """Whether the loop rings, by the vehicle's own linear model."""
    return least_damping(loop, copter.linear) < RINGING_DAMPING


def keeps_margin(copter: SimulatedCopter, loop: AltitudeLoop) -> bool:
    """Whether the loop has the margin of a proposal, by the vehicle's own linear model."""
    return damping_within_margin(loop, copter.linear) >= RINGING_DAMPING


def search(rig: Rig, copter: SimulatedCopter, seeds: Sequence[int]) -> dict[str, Searched]:
    """What the black-box searches find from the gains of the first flight on, every flight in other weather."""
    loop = rig.first_loop(copter)
    found = {}
    for name, run in SEARCHES.items():
        weather = iter(np.random.default_rng(seeds[0]).integers(2**31, size=BUDGET).tolist())
        trials = run(
            loop.space,
            loop.gains,
            lambda gains, weather=weather: rig.fly(copter, loop.with_gains(gains), next(weather)).error_m,
            seed=seeds[0],
        )
        last = loop.with_gains(best_of(trials).gains)
        best = {number: loop.with_gains(best_of(trials[:number]).gains) for number in SEARCHED_FLIGHTS}
        found[name] = Searched(
            errors_m={
                number: float(np.mean([rig.fly(copter, each, seed).error_m for seed in seeds]))
                for number, each in best.items()
            },
            rang=sum(rings(copter, loop.with_gains(trial.gains)) for trial in trials),
            keeps_margin=keeps_margin(copter, last),
        )
    return found


def sets(proposed: Assessment | None, others: Sequence[Assessment]) -> list[Assessment]:
    """The gain sets to fly: what is proposed, and the others but for the gains of the flight, which are defaults."""
    return [*([proposed] if proposed else []), *others[1:]]


def least_error(rig: Rig, copter: SimulatedCopter, seeds: Sequence[int]) -> float:
    """Least error, m, of the gains of the grid that keep the limits of a proposal."""
    first = rig.first_loop(copter)
    usual = np.mean([rig.fly(copter, first, seed).activity for seed in seeds])
    candidates = []
    for values in product(*rig.grid):
        loop = first.with_gains(dict(zip(first.space.bounds, values, strict=True)))
        if not keeps_margin(copter, loop):
            continue
        flights = [rig.fly(copter, loop, seed) for seed in seeds[:FLIGHTS_OF_THE_GRID]]
        if np.mean([flight.activity for flight in flights]) <= LARGEST_ACTIVITY * usual:
            candidates.append((float(np.mean([flight.error_m for flight in flights])), loop))
    best = min(candidates, key=lambda each: each[0])[1]
    return float(np.mean([rig.fly(copter, best, seed).error_m for seed in seeds]))


def print_sets(answered: Sequence[Result]) -> None:
    """A line for each gain set of the analysis."""
    best_m = np.array([each.best_m for each in answered])
    for name in answered[0].errors_m if answered else ():
        errors_m = np.array([each.errors_m[name] for each in answered])
        print(f"{name:28} {described(errors_m, best_m)}; ring {sum(name in each.rang for each in answered)}")


def print_searches(answered: Sequence[Result]) -> None:
    """Lines for each black-box search."""
    best_m = np.array([each.best_m for each in answered])
    for name in answered[0].searched if answered else ():
        found = [each.searched[name] for each in answered]
        for number in SEARCHED_FLIGHTS:
            errors_m = np.array([each.errors_m[number] for each in found])
            print(f"{f'{name}, {number} flights':28} {described(errors_m, best_m)}")
        print(
            f"{name:28} {np.mean([each.rang for each in found]):.1f} flights of a vehicle ring; "
            f"{np.mean([each.keeps_margin for each in found]):.0%} of the best gains keep the margin"
        )


def described(errors_m: Samples, best_m: Samples) -> str:
    """Errors of one gain set for each vehicle, and how far they are from the best, shape (k,) each."""
    ratios = errors_m / best_m
    return (
        f"error {1e3 * np.median(errors_m):5.1f} mm (median), {1e3 * np.quantile(errors_m, 0.95):5.1f} (95 %); "
        f"of the best {np.median(ratios):.2f}; within 10 % {np.mean(ratios <= 1.1):.0%}"
    )


def _sample_in_gusts(rig: Rig, gust_m_s2: float, gust_s: float, random: np.random.Generator) -> SimulatedCopter:
    return replace(rig.sample(random), gust_m_s2=gust_m_s2, gust_s=gust_s)


def main() -> int:
    parser = argparse.ArgumentParser(prog="bench.log_to_gains")
    parser.add_argument("--vehicles", type=int, default=QUICK_VEHICLES)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--searches", action="store_true", help="tune by black-box searches too")
    parser.add_argument("--autopilot", choices=RIGS, default="ArduCopter")
    parser.add_argument(
        "--gusts", type=float, nargs=2, metavar=("M_S2", "S"), help="of every vehicle: strength, duration"
    )
    options = parser.parse_args()
    rig = RIGS[options.autopilot]
    if options.gusts:
        rig = replace(rig, sample=partial(_sample_in_gusts, rig, *options.gusts))
    with ProcessPoolExecutor(options.processes) as pool:
        results = list(pool.map(partial(judge, rig=rig, searches=options.searches), range(options.vehicles)))
    refused = [each for each in results if each.refused]
    answered = [each for each in results if PROPOSED in each.errors_m]
    print(
        f"{len(results)} vehicles, {len(answered)} with a proposal, {len(refused)} told that the log does not suffice"
    )
    print_sets(answered)
    print_searches(answered)
    pairs = np.array([pair for each in answered for pair in each.predicted])
    shares = {
        "worse": float(
            np.mean(
                [each.errors_m[PROPOSED] > each.errors_m[f"{options.autopilot}'s default gains"] for each in answered]
            )
        ),
        "unsafe": float(np.mean([PROPOSED in each.rang for each in answered])),
        "covered": float(np.mean([inside for each in answered for inside in each.covered])),
        "near": float(np.mean([each.errors_m[PROPOSED] <= 1.1 * each.best_m for each in answered])),
    }
    print(f"predicted over flown: median {np.median(pairs[:, 0] / pairs[:, 1]):.2f}")
    print(f"worse than the defaults {shares['worse']:.1%} (limit {LIMITS['worse']:.0%})")
    print(f"ringing {shares['unsafe']:.1%} (limit {LIMITS['unsafe']:.0%})")
    print(f"flights inside the 90 % interval {shares['covered']:.0%} (at least {LIMITS['covered']:.0%})")
    print(f"within 10 % of the best {shares['near']:.0%} (at least {LIMITS['near']:.0%})")
    kept = shares["covered"] >= LIMITS["covered"] and shares["near"] >= LIMITS["near"]
    return 0 if kept and shares["worse"] <= LIMITS["worse"] and shares["unsafe"] <= LIMITS["unsafe"] else 1


if __name__ == "__main__":
    sys.exit(main())
