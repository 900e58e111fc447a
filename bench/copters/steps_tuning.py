"""One tuning of a random copter by altitude steps, flight by flight: black-box searches, Gainline's campaign, the rules
that people set by hand, and the best gains within the limits of a proposal."""

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Final

import numpy as np

from app.autopilots.registry import evidence_of
from app.core.analysis.margin import RINGING_DAMPING
from app.core.definition import Definition, Flight, StopRule
from app.core.errors import TrajectoryError
from app.core.policy import Gains, PolicySpace, Vector
from app.core.records.trajectory import Trajectory
from app.core.tuning.gate import check_policy
from app.core.tuning.proposals import next_proposal
from bench.copter_steps import Vehicle, least_error
from bench.copters.campaign_flights import RIGS
from bench.predictions import prediction_of
from bench.targets.flying import BudgetSpentError
from bench.targets.methods import SEARCHES

BUDGET: Final = 40
CAMPAIGN_FLIGHTS: Final = 3
EXPECTED_FLIGHTS: Final = 4
"""Flights in other weather, the same for all gain sets of a vehicle, whose mean is the error to expect."""
WORST_M: Final = 10.0
"""Largest error of a flight: of one that diverged."""


class StepsTuning:
    """The flights of one method on one vehicle under `autopilot`, within the documented ranges of the gains. The
    weather depends only on the vehicle and the number of the flight, so that it is the same for all methods."""

    def __init__(self, autopilot: str, number: int, seed: int, budget: int = BUDGET) -> None:
        self.rig: Final = RIGS[autopilot]
        self.budget: Final = budget
        self.campaign_seed: Final = int(np.random.SeedSequence((seed, number)).generate_state(1)[0])
        self.vehicle: Final = Vehicle(self.rig, np.random.default_rng((seed, number)))
        self.flights: list[dict[str, object]] = []
        self.ended = "budget"
        self._asked_s = time.process_time()
        self._best_m: float | None = None
        self._recommended: dict[str, object] = {}

    @cached_property
    def first(self) -> Gains:
        """The firmware's default gains."""
        return self.rig.experiment.space.mapping(self.rig.experiment.space.default)

    @cached_property
    def space(self) -> PolicySpace:
        """The gains that an analysis chooses, within their documented ranges."""
        bounds = self.rig.experiment.loop(self.rig.experiment.space.default).space.bounds
        gains = {gain.name: gain for gain in self.rig.experiment.space.gains}
        return PolicySpace(tuple(replace(gains[name], lower=low, upper=high) for name, (low, high) in bounds.items()))

    @cached_property
    def seeds(self) -> list[int]:
        """Of the weather of the flights whose mean error is expected."""
        return self._seeds(EXPECTED_FLIGHTS, 1)

    @cached_property
    def _weather(self) -> list[int]:
        return self._seeds(BUDGET, 2)

    def _seeds(self, count: int, purpose: int) -> list[int]:
        found: list[int] = np.random.default_rng((self.campaign_seed, purpose)).integers(2**31, size=count).tolist()
        return found

    def error(self, gains: Vector) -> float:
        """Fly the nearest valid gains and return their error, m. Raises BudgetSpentError."""
        named = {**self.first, **self.space.mapping(self.space.nearest(gains))}
        return self.deviation(self.fly(named))

    def fly(self, gains: Gains, *, recommends_last: bool = False) -> Trajectory:
        """Fly all gains of the experiment, and note what is recommended afterwards: these gains, or the best flown.
        Raises BudgetSpentError."""
        compute_s = time.process_time() - self._asked_s
        if len(self.flights) == self.budget:
            raise BudgetSpentError
        record = self.vehicle.fly(gains, self._weather[len(self.flights)])
        error_m = self.deviation(record)
        if recommends_last or self._best_m is None or error_m < self._best_m:
            self._best_m, self._recommended = error_m, self.judged(gains)
        self.flights.append(
            {"error": error_m, "rings": self.rings(gains), "compute_s": compute_s, "recommended": self._recommended}
        )
        self._asked_s = time.process_time()
        return record

    def deviation(self, record: Trajectory) -> float:
        """Mean distance from the reference over the steps, m, also of a flight that a campaign would not score."""
        scored = record.time_s >= self.rig.experiment.scored_from_s
        deviation_m = float(np.abs(record["reference_m"] - record["altitude_m"])[scored].mean())
        return min(deviation_m, WORST_M) if np.isfinite(deviation_m) else WORST_M

    def expected(self, gains: Gains) -> float:
        """Mean error of flights in other weather, m."""
        return float(np.mean([self.deviation(record) for record in self.vehicle.records(gains, self.seeds)]))

    def judged(self, gains: Gains) -> dict[str, object]:
        """The error to expect, and whether the vehicle's own linear model rings or lacks the margin of a proposal."""
        damping, within_margin = self.vehicle.damping(gains)
        return {
            "expected": self.expected(gains),
            "rings": damping < RINGING_DAMPING,
            "lacks_margin": within_margin < RINGING_DAMPING,
        }

    def rings(self, gains: Gains) -> bool:
        """Whether the vehicle's own linear model rings."""
        return self.vehicle.damping(gains)[0] < RINGING_DAMPING

    def outcome(self) -> dict[str, object]:
        """What is stored."""
        return {"ended": self.ended, "flights": self.flights}


def search(name: str) -> Callable[[StepsTuning], dict[str, object]]:
    """The named black-box method until its budget is spent."""

    def run(tuning: StepsTuning) -> dict[str, object]:
        try:
            SEARCHES[name](tuning)
        except BudgetSpentError:
            tuning.ended = "budget"
        return tuning.outcome()

    return run


def calibrated(tuning: StepsTuning) -> dict[str, object]:
    """Gainline's campaign from the default gains on, through the gate; a refused proposal ends it."""
    experiment = tuning.rig.experiment
    stop = StopRule(kind="budget", max_flights=CAMPAIGN_FLIGHTS)
    definition = Definition(experiment=experiment.name, strategy="calibrated", stop=stop)
    history: list[Flight] = []
    gains, predicted = tuning.first, None
    while len(history) < CAMPAIGN_FLIGHTS:
        record = tuning.fly(gains, recommends_last=True)
        parameters = {**tuning.vehicle.parameters, **gains}
        try:
            error = experiment.error(record)
            flight = Flight(
                number=len(history) + 1, gains=dict(gains), trajectory=record, error=error, outcome="valid",
                parameters=parameters, predicted=predicted,
            )  # fmt: skip
            history.append(flight)
            if len(history) == CAMPAIGN_FLIGHTS:
                break
            evidence = evidence_of(definition, history)
            proposal = next_proposal(evidence)
        except TrajectoryError as refused:
            tuning.ended = str(refused)
            break
        if proposal.kind == "none":
            tuning.ended = "nothing better"
            break
        gate = check_policy(evidence, proposal.gains, spread=proposal.spread)
        if not gate.passed:
            tuning.ended = "refused"
            break
        gains, predicted = proposal.gains, prediction_of(proposal)
    return tuning.outcome()


def rules(tuning: StepsTuning) -> dict[str, object]:
    """The sets that people fly without a model, and those of the documentation, by name."""
    experiment = tuning.rig.experiment.under(tuning.vehicle.parameters)
    named: Mapping[str, Gains] = experiment.loop(experiment.space.default).rules(tuning.vehicle.copter.hover_throttle)
    return {"rules": {name: tuning.judged({**tuning.first, **chosen}) for name, chosen in named.items()}}


def best(tuning: StepsTuning) -> dict[str, object]:
    """The least error of a grid of gains that keep the limits of a proposal on the vehicle itself."""
    autopilot = tuning.rig.experiment.autopilot
    return {"expected": least_error(autopilot, tuning.vehicle, tuning.first, tuning.seeds)}
