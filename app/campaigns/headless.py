"""Runs a whole campaign without a database, by the same functions as the dashboard's jobs and flights."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from app.core.definition import Definition, Flight, flight_seed, was_flown
from app.core.errors import InputError, Problem, TrajectoryError
from app.core.experiments import experiment_of
from app.core.experiments.base import Experiment
from app.core.policy import Gains
from app.core.records.glitches import find_glitches
from app.core.tuning.gate import check_policy, envelope_of, require_flyable
from app.core.tuning.predictions import prediction_of
from app.core.tuning.proposals import next_proposal
from app.core.tuning.stop_rules import evaluate_stop_rule, landing_battery_v
from app.core.tuning.strategy import Explanation, Interval, Kind, Proposal
from app.vehicles.base import FlightOptions, FlightRecord, OptionValue, SafeGainsError, Sample, Vehicle, VehicleError
from app.vehicles.registry import get_kind, open_vehicle

Outcome = Literal["valid", "aborted", "invalid"]


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadlessTrial:
    """One flown trial. `error` is None unless the flight was complete and could be scored.

    `overrule_reason` is why the trial was flown although the gate refused its gains.
    """

    number: int
    kind: Kind
    gains: Mapping[str, float]
    outcome: Outcome
    error: float | None
    predicted_error: float | None
    reason: str
    predicted_interval: Interval | None = None
    overrule_reason: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadlessCampaign:
    """All trials of a campaign in their order, and why it ended."""

    trials: Sequence[HeadlessTrial]
    stopped_because: str

    @property
    def best(self) -> HeadlessTrial | None:
        scored = [(trial.error, trial.number, trial) for trial in self.trials if trial.error is not None]
        return min(scored)[2] if scored else None


@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignListener:
    """Callbacks of a campaign.

    `proposed` before a flight, `sampled` during it, `landed` after it; `holding` whenever the gains on the vehicle
    change, with None while they are unknown.
    """

    proposed: Callable[[int, Proposal], None] = field(default=lambda _number, _proposal: None)
    sampled: Callable[[Sample], None] = field(default=lambda _sample: None)
    landed: Callable[[HeadlessTrial], None] = field(default=lambda _trial: None)
    holding: Callable[[Mapping[str, float] | None], None] = field(default=lambda _gains: None)


def fly_campaign(
    definition: Definition,
    vehicle: str,
    options: Mapping[str, OptionValue],
    watcher: CampaignListener,
    *,
    gains: Sequence[Gains] = (),
    overrule: str = "",
    trial_parameters: Path | None = None,
) -> HeadlessCampaign:
    """Fly proposals as fast as possible until the campaign's stop rule ends it; or fly `gains`, complete sets, until
    all are flown.

    `overrule` is the reason why gains that the gate refuses are flown nevertheless, on a simulated vehicle. A flight
    with glitches does not count, because no person reviews it. `trial_parameters` is as in `open_vehicle`.

    The definition must have been checked. Raises InputError for a warm start, whose donor is in a database, GainsError
    when the gate refuses the strategy's proposal, and VehicleError when the vehicle cannot fly.
    """
    _require_no_donor(definition)
    experiment = experiment_of(definition)
    is_real = get_kind(vehicle).is_real_with(options)
    trials: list[HeadlessTrial] = []
    history: list[Flight] = []
    battery_v: float | None = None
    while True:
        number = len(trials) + 1
        proposal = next_proposal(definition, history)
        if why := _stop_reason(definition, trials, history, proposal, battery_v):
            return HeadlessCampaign(trials=tuple(trials), stopped_because=why)
        if gains:
            if number > len(gains):
                return HeadlessCampaign(
                    trials=tuple(trials), stopped_because=f"All {len(gains)} given gain sets have been flown."
                )
            proposal = _manual_proposal(gains[number - 1], history)
        overruled = _require_flyable(definition, experiment, proposal, history, overrule, is_real)
        if overruled:
            get_kind(vehicle).check_gains(options, proposal.gains)
        watcher.proposed(number, proposal)
        record = _fly(vehicle, options, experiment, definition, number, proposal, watcher, trial_parameters)
        battery_v = landing_battery_v(record.trajectory.as_stored())
        trial = _assess(experiment, number, proposal, record, overruled)
        trials.append(trial)
        watcher.landed(trial)
        history.extend(_flight_of(trial, proposal, record))


def _manual_proposal(gains: Gains, history: Sequence[Flight]) -> Proposal:
    """Proposal for gains that a person or a script has chosen, without a prediction."""
    return Proposal(
        kind="repeat" if was_flown(gains, history) else "manual",
        gains=dict(gains),
        predicted=None,
        predicted_error=None,
        explanation=Explanation(summary="Given on the command line or in the campaign file."),
    )


def _stop_reason(
    definition: Definition,
    trials: Sequence[HeadlessTrial],
    history: Sequence[Flight],
    proposal: Proposal,
    battery_v: float | None,
) -> str:
    """Why the campaign ends; empty while it continues. `battery_v`: voltage at the end of the last trial."""
    judged = evaluate_stop_rule(definition, history, proposal, battery_v=battery_v)
    if judged.stop:
        return judged.why
    if len(trials) < definition.stop.max_flights:
        return ""
    return f"All {len(trials)} flights have been flown; {len(trials) - len(history)} of them could not be scored."


def _flight_of(trial: HeadlessTrial, proposal: Proposal, record: FlightRecord) -> tuple[Flight, ...]:
    """The trial as a flight of the history; empty if it does not count."""
    if trial.outcome == "invalid":
        return ()
    return (
        Flight(
            number=trial.number,
            gains=trial.gains,
            trajectory=record.trajectory.as_stored(),
            error=trial.error,
            outcome=trial.outcome,
            predicted=prediction_of(proposal),
        ),
    )


def _require_no_donor(definition: Definition) -> None:
    if definition.start.donor is not None or definition.start.kind == "campaign":
        raise InputError(
            "A campaign that starts from another campaign needs the database that contains that campaign.",
            problems=(Problem("definition.start.kind", "'campaign' needs the dashboard or the API"),),
            hint="Create it in the dashboard, or start from the other campaign's best gains as `given`.",
        )


def _require_flyable(
    definition: Definition,
    experiment: Experiment,
    proposal: Proposal,
    history: Sequence[Flight],
    overrule: str,
    is_real: bool,
) -> str:
    space = experiment.space.narrowed(definition.bounds)
    start = proposal.gains if proposal.kind == "start" else None
    gate = check_policy(definition, experiment, space, proposal.gains, history, start=start, spread=proposal.spread)
    return require_flyable(gate, overrule=overrule, is_real=is_real)


def _fly(
    vehicle: str,
    options: Mapping[str, OptionValue],
    experiment: Experiment,
    definition: Definition,
    number: int,
    proposal: Proposal,
    watcher: CampaignListener,
    trial_parameters: Path | None,
) -> FlightRecord:
    safe_gains = envelope_of(definition, experiment).safe_gains
    opened = False
    try:
        with open_vehicle(vehicle, options, safe_gains=safe_gains, trial_parameters=trial_parameters) as controlled:
            opened = True
            watcher.holding(None)
            return _flown(controlled, definition, number, proposal, watcher)
    except SafeGainsError:
        opened = False
        raise
    finally:
        if opened:
            watcher.holding(safe_gains)


def _flown(
    controlled: Vehicle, definition: Definition, number: int, proposal: Proposal, watcher: CampaignListener
) -> FlightRecord:
    held = controlled.stage(proposal.gains)
    if held != proposal.gains:
        raise VehicleError(
            f"The vehicle has the gains {held} instead of {proposal.gains}; nothing was flown.",
            hint="Read its gains back manually before it flies again.",
        )
    order = FlightOptions(seed=flight_seed(definition.seed, number))
    return controlled.fly(order, on_sample=watcher.sampled, should_stop=lambda: None)


def _assess(
    experiment: Experiment, number: int, proposal: Proposal, record: FlightRecord, overrule_reason: str
) -> HeadlessTrial:
    outcome: Outcome = "valid" if record.ending == "completed" else record.ending
    error: float | None = None
    reason = record.reason
    if outcome == "valid":
        stored = record.trajectory.as_stored()
        try:
            error = experiment.error(stored)
        except TrajectoryError as refused:
            outcome, reason = "invalid", str(refused)
        if error is not None and (glitches := find_glitches(experiment, stored)):
            outcome, error, reason = "invalid", None, " ".join(glitch.sentence for glitch in glitches)
    return HeadlessTrial(
        number=number,
        kind=proposal.kind,
        gains=proposal.gains,
        outcome=outcome,
        error=error,
        predicted_error=proposal.predicted_error,
        reason=reason,
        predicted_interval=proposal.interval,
        overrule_reason=overrule_reason,
    )
