"""A whole campaign without a database, by the same functions that the dashboard's jobs and flights use."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from app.core.definition import Definition, Flight, flight_seed
from app.core.errors import GainsError, Problem, TrajectoryError
from app.core.experiments import get_experiment
from app.core.experiments.base import Experiment
from app.core.gate import check_policy
from app.core.proposing import next_proposal
from app.core.stopping import StopVerdict, verdict
from app.core.strategies.base import Kind, Proposal
from app.vehicles.base import FlightOrder, FlightRecord, OptionValue, Sample
from app.vehicles.errors import VehicleError
from app.vehicles.open import open_vehicle

Outcome = Literal["valid", "aborted", "invalid"]


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadlessTrial:
    """One flown trial; `error` is None unless the flight was complete and could be scored."""

    number: int
    kind: Kind
    gains: Mapping[str, float]
    outcome: Outcome
    error: float | None
    predicted_error: float | None
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadlessCampaign:
    """All trials of a campaign, in their order, and why it ended."""

    trials: Sequence[HeadlessTrial]
    stopped_because: str

    @property
    def best(self) -> HeadlessTrial | None:
        scored = [(trial.error, trial.number, trial) for trial in self.trials if trial.error is not None]
        return min(scored)[2] if scored else None


@dataclass(frozen=True, slots=True, kw_only=True)
class Watcher:
    """What the caller wants to hear: a proposal before its flight, samples during it, the trial after it."""

    proposed: Callable[[int, Proposal], None] = field(default=lambda _number, _proposal: None)
    sampled: Callable[[Sample], None] = field(default=lambda _sample: None)
    landed: Callable[[HeadlessTrial], None] = field(default=lambda _trial: None)


def fly_campaign(
    definition: Definition, vehicle: str, options: Mapping[str, OptionValue], watcher: Watcher
) -> HeadlessCampaign:
    """Fly proposals as fast as possible until the campaign's own rule ends it.

    The definition must have been checked. Raises GainsError when the strategy proposes what the gate refuses, and
    VehicleError when the vehicle cannot fly.
    """
    experiment = get_experiment(definition.experiment)
    trials: list[HeadlessTrial] = []
    history: list[Flight] = []
    while True:
        number = len(trials) + 1
        proposal = next_proposal(definition, history)
        judged = _judge(definition, history, proposal)
        if judged.stop:
            return HeadlessCampaign(trials=tuple(trials), stopped_because=judged.why)
        if len(trials) >= definition.stop.max_flights:
            unscored = len(trials) - len(history)
            why = f"All {len(trials)} flights are flown; {unscored} of them could not be scored."
            return HeadlessCampaign(trials=tuple(trials), stopped_because=why)
        _require_flyable(definition, experiment, proposal, history)
        watcher.proposed(number, proposal)
        record = _fly(vehicle, options, experiment, definition, number, proposal, watcher)
        trial = _assess(experiment, number, proposal, record)
        trials.append(trial)
        watcher.landed(trial)
        if trial.outcome != "invalid":
            history.append(
                Flight(
                    number=number,
                    gains=proposal.gains,
                    trajectory=record.trajectory.as_stored(),
                    error=trial.error,
                    outcome=trial.outcome,
                )
            )


def _judge(definition: Definition, history: Sequence[Flight], proposal: Proposal) -> StopVerdict:
    return verdict(definition.stop, [flight.error for flight in history], proposal.kind)


def _require_flyable(
    definition: Definition, experiment: Experiment, proposal: Proposal, history: Sequence[Flight]
) -> None:
    space = experiment.space.narrowed(definition.bounds)
    gate = check_policy(definition, experiment, space, proposal.gains, history)
    if not gate.passed:
        failed = tuple(Problem(check.name, check.sentence) for check in gate.checks if not check.passed)
        raise GainsError(
            "The proposed gains were refused before flight.",
            problems=failed,
            hint="Widen the bounds or the step limit of the campaign, or start from other gains.",
        )


def _fly(
    vehicle: str,
    options: Mapping[str, OptionValue],
    experiment: Experiment,
    definition: Definition,
    number: int,
    proposal: Proposal,
    watcher: Watcher,
) -> FlightRecord:
    safe_gains = experiment.space.mapping(experiment.space.default)
    with open_vehicle(vehicle, options, safe_gains=safe_gains) as controlled:
        held = controlled.stage(proposal.gains)
        if held != proposal.gains:
            raise VehicleError(
                f"The vehicle holds {held} instead of {proposal.gains}; nothing was flown.",
                hint="Read its gains back by hand before flying it again.",
            )
        order = FlightOrder(seed=flight_seed(definition.seed, number))
        return controlled.fly(order, on_sample=watcher.sampled, should_abort=lambda: None)


def _assess(experiment: Experiment, number: int, proposal: Proposal, record: FlightRecord) -> HeadlessTrial:
    outcome: Outcome = "aborted" if record.ending == "aborted" else "valid"
    error: float | None = None
    reason = record.reason
    if outcome == "valid":
        try:
            error = experiment.error(record.trajectory.as_stored())
        except TrajectoryError as refused:
            outcome, reason = "invalid", str(refused)
    return HeadlessTrial(
        number=number,
        kind=proposal.kind,
        gains=proposal.gains,
        outcome=outcome,
        error=error,
        predicted_error=proposal.predicted_error,
        reason=reason,
    )
