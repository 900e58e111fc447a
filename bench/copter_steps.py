"""What the second flight of a campaign of altitude steps is worth on random copters, under ArduCopter and PX4.

    ./dev exec python -m bench.copter_steps                   a few vehicles, against limits
    ./dev exec python -m bench.copter_steps --vehicles 100    the figures of docs/benchmarks.md

Every vehicle has more physics than the model (bench/copters/simulation.py), gusts, and an estimator that wanders. It
flies the default gains and then the proposal of `calibrated`, through the campaign's own path: record, score, fit,
proposal, gate. Errors of gain sets are means of further flights in other weather. The best gains are the best of a grid
that keep the limits of a proposal, the margin on the vehicle's own linear model. Exits with 1 beyond the limits, which
are loose because the vehicles are few.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import Final

import numpy as np

from app.autopilots.registry import evidence_of
from app.core.analysis.margin import RINGING_DAMPING, damping_within_margin, least_damping
from app.core.analysis.proposal import LARGEST_ACTIVITY
from app.core.definition import Definition, Flight
from app.core.errors import TrajectoryError
from app.core.models.copter import filtered, motor_filter
from app.core.policy import Gains
from app.core.records.trajectory import Trajectory
from app.core.tuning.gate import check_policy
from app.core.tuning.proposals import next_proposal
from bench.copters.campaign_flights import RIGS, CampaignRig
from bench.copters.rigs import RIGS as GRIDS
from bench.copters.simulation import SimulatedCopter

SEED: Final = 20261129
QUICK_VEHICLES: Final = 4
FLIGHTS: Final = 4
ATTEMPTS: Final = 5
FLIGHTS_OF_THE_GRID: Final = 2
PROPOSED: Final = "second flight"
_SLOW_S: Final = 1.0 / (2.0 * np.pi * 2.0)
LIMITS: Final[Mapping[str, float]] = {"worse": 0.0, "unsafe": 0.0, "covered": 0.5, "near": 0.5}


@dataclass(frozen=True, slots=True)
class Result:
    """What became of a vehicle: errors, m, and numbers of flights that could not be scored, by gain set; the least
    error of the grid; the kind of the second proposal, and its refusals by the gate; whether its interval contains each
    flight; the gain sets that ring, and those that lack the margin."""

    errors_m: Mapping[str, float]
    unscored: Mapping[str, int]
    best_m: float
    kind: str
    refused: int
    covered: Sequence[bool]
    predicted_m: float
    rang: frozenset[str]
    lacks_margin: frozenset[str]
    failure: str


class Vehicle:
    """A random copter under an autopilot, and its flights."""

    def __init__(self, rig: CampaignRig, random: np.random.Generator) -> None:
        self._rig = rig
        self.copter: SimulatedCopter = rig.sample(random)
        self.parameters = rig.parameters(self.copter)

    def fly(self, gains: Gains, seed: int) -> Trajectory:
        """The stored record of a flight."""
        return self._rig.fly(self._rig.experiment, self.copter, {**self.parameters, **gains}, seed)

    def records(self, gains: Gains, seeds: Sequence[int]) -> list[Trajectory]:
        """The records of several flights."""
        return [self.fly(gains, seed) for seed in seeds]

    def errors(self, records: Sequence[Trajectory]) -> list[float]:
        """Errors of the flights that can be scored."""
        found = []
        for each in records:
            with suppress(TrajectoryError):
                found.append(self._rig.experiment.error(each))
        return found

    def error(self, records: Sequence[Trajectory]) -> float:
        """Mean error of the flights that can be scored; infinite if none can."""
        errors = self.errors(records)
        return float(np.mean(errors)) if errors else np.inf

    def flight(self, number: int, gains: Gains, seed: int) -> Flight:
        """A valid flight of a campaign."""
        record = self.fly(gains, seed)
        return Flight(
            number=number,
            gains=dict(gains),
            trajectory=record,
            error=self._rig.experiment.error(record),
            outcome="valid",
            parameters={**self.parameters, **gains},
        )

    def first_flight(self, gains: Gains, seed: int) -> Flight:
        """The first flight that can be scored: one that cannot is flown again, as in a campaign."""
        for attempt in range(ATTEMPTS):
            with suppress(TrajectoryError):
                return self.flight(1, gains, seed + attempt)
        raise TrajectoryError(f"None of {ATTEMPTS} flights could be scored.", hint="")

    def activity(self, gains: Gains, seeds: Sequence[int], records: Sequence[Trajectory]) -> float:
        """Throttle activity of flights as in the analysis, from the first step on."""
        calm = replace(self.copter, gust_m_s2=0.0, noise_m_s2=0.0, wander_m_s=0.0, wander_m=0.0)
        step_s = self._rig.experiment.loop(self._rig.experiment.space.default).step_s
        steps_s = np.arange(0.0, records[0].time_s[-1], step_s)
        low_pass = motor_filter(_SLOW_S, step_s)
        found = []
        for seed, record in zip(seeds, records, strict=True):
            moved = record["throttle"]
            if not self._rig.counts_reference:
                still = self._rig.fly(self._rig.experiment, calm, {**self.parameters, **gains}, seed)
                moved = moved - still["throttle"]
            slow = np.interp(record.time_s, steps_s, filtered(np.interp(steps_s, record.time_s, moved), low_pass))
            found.append(float(np.std((moved - slow)[record.time_s >= self._rig.experiment.scored_from_s])))
        return float(np.mean(found))

    def damping(self, gains: Gains) -> tuple[float, float]:
        """Least damping of the vehicle's own linear model, as it is and within the margin."""
        experiment = self._rig.experiment.under(self.parameters)
        loop, copter = experiment.loop(experiment.space.vector(gains)), self.copter.linear
        return least_damping(loop, copter), damping_within_margin(loop, copter)


def judge(number: int, *, name: str) -> Result:
    """Fly, propose, and fly what is proposed and what people would set."""
    rig, random = RIGS[name], np.random.default_rng((SEED, number))
    vehicle, experiment = Vehicle(rig, random), rig.experiment
    seeds = random.integers(2**31, size=FLIGHTS + 2).tolist()
    definition = Definition(experiment=experiment.name, strategy="calibrated")
    try:
        first = vehicle.first_flight(experiment.space.mapping(experiment.space.default), seeds[0])
        evidence = evidence_of(definition, [first])
        proposal = next_proposal(evidence)
    except TrajectoryError as error:
        return Result({}, {}, np.nan, "failed", 0, (), np.nan, frozenset(), frozenset(), str(error))
    gate = check_policy(evidence, proposal.gains, spread=proposal.spread)
    loop = experiment.under(vehicle.parameters).loop(experiment.space.default)
    rules = loop.rules(vehicle.copter.hover_throttle)
    sets = {
        PROPOSED: proposal.gains,
        **{rule: {**first.gains, **gains} for rule, gains in rules.items()},
    }
    records = {each: vehicle.records(gains, seeds[2:]) for each, gains in sets.items()}
    damping = {each: vehicle.damping(gains) for each, gains in sets.items()}
    interval = proposal.interval
    unscored = {each: len(some) - len(vehicle.errors(some)) for each, some in records.items()}
    return Result(
        errors_m={each: vehicle.error(some) for each, some in records.items()},
        unscored=unscored,
        best_m=least_error(name, vehicle, first.gains, seeds[2:]),
        kind=proposal.kind,
        refused=len(gate.refusals),
        covered=[interval is not None and error in interval for error in vehicle.errors(records[PROPOSED])],
        predicted_m=proposal.predicted_error or np.nan,
        rang=frozenset(each for each, (own, _) in damping.items() if own < RINGING_DAMPING),
        lacks_margin=frozenset(each for each, (_, within) in damping.items() if within < RINGING_DAMPING),
        failure="",
    )


def least_error(name: str, vehicle: Vehicle, first: Gains, seeds: Sequence[int]) -> float:
    """Least error, m, of the gains of the grid that keep the limits of a proposal."""
    some = seeds[:FLIGHTS_OF_THE_GRID]
    usual = vehicle.activity(first, some, vehicle.records(first, some))
    names = GRIDS[name].first_loop(vehicle.copter).space.bounds
    candidates = []
    for values in product(*GRIDS[name].grid):
        gains = {**first, **dict(zip(names, values, strict=True))}
        if gains.get("PSC_ACCZ_I", 1.0) < gains.get("PSC_ACCZ_P", 0.0):
            continue
        if vehicle.damping(gains)[1] < RINGING_DAMPING:
            continue
        records = vehicle.records(gains, some)
        if vehicle.activity(gains, some, records) <= LARGEST_ACTIVITY * usual:
            candidates.append((vehicle.error(records), gains))
    best = min(candidates, key=lambda each: each[0])[1]
    return vehicle.error(vehicle.records(best, seeds))


def print_sets(answered: Sequence[Result]) -> None:
    """A line for each gain set."""
    best_m = np.array([each.best_m for each in answered])
    for name in answered[0].errors_m:
        errors_m = np.array([each.errors_m[name] for each in answered])
        ratio = errors_m / best_m
        with np.errstate(invalid="ignore"):
            most_m = np.quantile(errors_m, 0.95)
        print(
            f"{name:40} median {1e3 * np.median(errors_m):.1f} mm, 95 % below "
            f"{1e3 * most_m:.1f} mm; of the best: median {np.median(ratio):.2f}, within 10 % "
            f"{np.mean(ratio <= 1.1):.0%}; ring "
            f"{sum(name in each.rang for each in answered)}, lack the margin "
            f"{sum(name in each.lacks_margin for each in answered)}, not scored "
            f"{sum(each.unscored[name] for each in answered)} of {FLIGHTS * len(answered)} flights"
        )


def measure(name: str, count: int, processes: int) -> bool:
    """Judge vehicles under an autopilot, print what became of them; whether the limits hold."""
    with ProcessPoolExecutor(processes) as pool:
        results = list(pool.map(partial(judge, name=name), range(count)))
    answered = [each for each in results if not each.failure]
    print(f"\n{name}: {len(answered)} of {count} vehicles fitted", flush=True)
    for each in results:
        if each.failure:
            print(f"    {each.failure}")
    defaults = list(answered[0].errors_m)[1]
    print_sets(answered)
    best_m = np.array([each.best_m for each in answered])
    print(f"{'best of the grid':40} median {1e3 * np.median(best_m):.1f} mm")
    second = np.array([each.errors_m[PROPOSED] for each in answered])
    usual = np.array([each.errors_m[defaults] for each in answered])
    found = {
        "worse": float(np.mean(second > usual)),
        "unsafe": float(np.mean([PROPOSED in each.rang for each in answered])),
        "covered": float(np.mean([covered for each in answered for covered in each.covered])),
        "near": float(np.mean(second <= 1.1 * best_m)),
    }
    kinds = [each.kind for each in answered]
    print(f"proposals: {', '.join(f'{kinds.count(kind)} {kind}' for kind in sorted(set(kinds)))}")
    print(f"refused by the gate: {sum(each.refused > 0 for each in answered)}")
    print(f"worse than the default gains {found['worse']:.0%}; flights inside the 90 % interval {found['covered']:.0%}")
    bias = second / np.array([each.predicted_m for each in answered])
    low, high = np.quantile(bias, (0.05, 0.95)).tolist()
    print(f"flown over predicted: median {np.median(bias):.2f}, 5 … 95 % {low:.2f} … {high:.2f}")
    return all(
        found[what] <= limit if what in ("worse", "unsafe") else found[what] >= limit for what, limit in LIMITS.items()
    )


def main() -> int:
    parser = argparse.ArgumentParser(prog="bench.copter_steps")
    parser.add_argument("--vehicles", type=int, default=QUICK_VEHICLES)
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--autopilot", choices=list(RIGS), default=None)
    chosen = parser.parse_args()
    names = [chosen.autopilot] if chosen.autopilot else list(RIGS)
    passed = [measure(name, chosen.vehicles, chosen.processes) for name in names]
    return int(not all(passed))


if __name__ == "__main__":
    sys.exit(main())
