"""The next gain set, computed from a campaign's frozen definition and its flights: a pure function. With it, the next
action that is recommended to the operator, and the prediction of a flight with any gains by the same model.
"""

from dataclasses import dataclass, replace
from typing import Literal

from app.core.definition import Flight, LogEvidence, aborted_by_gains
from app.core.experiments.base import Experiment, ModelledExperiment
from app.core.formatting import format_gains, named_flights, short
from app.core.policy import Gains
from app.core.statistics.comparisons import Group
from app.core.tuning.calibration import fitted_flights
from app.core.tuning.campaign_models import FITTED, changed_parameters, known_distribution
from app.core.tuning.corrected_model import correct_by_bias, start_gains, uncorrected_model
from app.core.tuning.evidence import Evidence, has_model
from app.core.tuning.gate import check_policy
from app.core.tuning.predictions import is_informative, repeat_proposal, track_record, with_interval
from app.core.tuning.stop_rules import TUNE_FIRST, StopVerdict, confirm, describe_step
from app.core.tuning.strategies import STRATEGIES
from app.core.tuning.strategies.manual import propose as by_hand
from app.core.tuning.strategy import Explanation, Kind, Predictor, Proposal, proposal_of
from app.core.tuning.transfer import transfer

_ORIGIN = {
    "default": "the vehicle's default gains",
    "simplex": "the nominal model's optimum, found by Nelder–Mead from the default gains",
    "given": "the gains given in the campaign's definition",
    "campaign": "the best gains of the campaign that this one starts from",
}


def next_proposal(campaign: Evidence[Experiment]) -> Proposal:
    """Compute the next proposal. The same definition and flights give the same proposal, bit for bit on one machine.

    Trajectories are used as stored, in single precision. Without a valid flight the start gains are proposed.
    Every proposal that predicts an error has an interval and a band; without a model there is no prediction. Under the
    stop rule `noise` the proposal may repeat the winner or the first gains, or be of kind `none` once no further step
    can be distinguished from noise.
    """
    if not has_model(campaign):
        return _manual_proposal(campaign)
    warm = transfer(campaign)
    evidence = warm.evidence
    if not evidence.valid:
        return _start(evidence)
    strategy = STRATEGIES[evidence.definition.strategy]
    proposal = strategy.propose(evidence)
    number = proposal.explanation.base_flight if strategy.corrects_model else None
    base = next((flight for flight in evidence.flights if flight.number == number), None)
    return _with_notes(_confirmed(evidence, with_interval(evidence, proposal, base=base)), evidence, warm.sentence)


def _manual_proposal(evidence: Evidence[Experiment]) -> Proposal:
    """Without a model: propose the start gains, then the operator's own; nothing is predicted."""
    if evidence.valid:
        return _confirmed(evidence, by_hand(evidence))
    gains = start_gains(evidence)
    summary = (
        f"{_describe_start(evidence, gains)}; there is no model of this vehicle's controller, so there is no "
        "prediction."
    )
    lesson = "The result of these gains, as a reference for the others."
    return proposal_of("start", gains, None, Explanation(summary=summary, lesson=lesson))


def _start(evidence: Evidence[ModelledExperiment]) -> Proposal:
    experiment, log, donor = evidence.experiment, evidence.definition.start.log, evidence.donor
    gains = start_gains(evidence)
    predicted = model_of(evidence).predict(evidence.space.vector(gains))
    uncorrected = "the nominal model" if log is None else "the model of the vehicle in that log"
    source = f"{uncorrected}, not yet corrected by any flight," if donor is None else "the other vehicle's flight"
    lesson = (
        "How much this vehicle deviates from the model." if donor is None else "Whether the two vehicles are similar."
    )
    start = proposal_of("start", gains, predicted, Explanation(summary="", lesson=lesson))
    start = with_interval(evidence, start, base=None)
    outlook = (
        f"predicts {short(predicted.error)} {experiment.error_unit}"
        if is_informative(start.interval, corrected=False)
        else "is too uncertain to predict its error"
    )
    summary = f"{_describe_start(evidence, gains)}; {source} {outlook}."
    notes = () if log is None else (_describe_log(log),)
    return replace(start, explanation=replace(start.explanation, summary=summary, notes=notes))


def _describe_log(log: LogEvidence) -> str:
    return (
        f"In {log.file_name} the altitude deviated by {1e3 * log.error_m:.1f} mm from its reference on average, in "
        "another manoeuvre: the errors of this campaign are not compared with it. Fly these gains only if the log is "
        "of this vehicle as it is now."
    )


def _describe_start(evidence: Evidence[Experiment], gains: Gains) -> str:
    """Source of the start gains, without a full stop; first the flights with these gains that were aborted."""
    definition, flights, log = evidence.definition, evidence.flights, evidence.definition.start.log
    origin = _ORIGIN[definition.start.kind] if log is None else f"the gains proposed from {log.file_name}"
    source = f"{origin} ({format_gains(gains)})"
    numbers = [flight.number for flight in aborted_by_gains(flights, gains)]
    if numbers:
        aborted = f"{named_flights(numbers).capitalize()} {'was' if len(numbers) == 1 else 'were'} aborted"
        return (
            f"{aborted} because of the vehicle's behaviour with these gains: {source}. {TUNE_FIRST}. Fly them again "
            "only if you know the cause; otherwise use custom gains"
        )
    return f"The {'next' if flights else 'first'} flight uses {source}"


def _confirmed(evidence: Evidence[Experiment], proposal: Proposal) -> Proposal:
    """Apply the stop rule `noise` to the strategy's proposal.

    The proposal is kept if a step is still worth a flight. Otherwise it is replaced by the flight that the confirmation
    requires, or by kind `none` if the gate refuses that flight.
    """
    now = evidence.within_bounds
    if evidence.definition.stop.kind != "noise" or not now.groups:
        return proposal
    wanted = confirm(evidence, proposal)
    if wanted.phase == "step":
        notes = (*proposal.explanation.notes, *filter(None, (wanted.why,)))
        return replace(proposal, explanation=replace(proposal.explanation, notes=notes))
    spread = known_distribution(evidence) if proposal.spread is None else proposal.spread

    def again(group: Group, kind: Kind, why: Explanation) -> Proposal:
        why = replace(why, fitted=proposal.explanation.fitted)
        return replace(repeat_proposal(now, group, kind, why), spread=spread)

    if wanted.phase == "decided":
        return again(now.winner, "none", Explanation(summary=wanted.why))
    group = now.winner if wanted.phase == "repeat" else now.baseline
    gate = check_policy(evidence, group.gains, spread=spread)
    if not gate.passed:
        refused = (
            f"The best gains cannot be confirmed: {format_gains(group.gains)} cannot be flown again, because the gate "
            f"refuses them: {' '.join(check.sentence for check in gate.refusals)}"
        )
        return again(now.winner, "none", Explanation(summary=refused))
    lesson = "Whether the best gains are better than the first."
    return again(group, wanted.phase, Explanation(summary=wanted.why, base_flight=group.numbers[0], lesson=lesson))


def _with_notes(proposal: Proposal, evidence: Evidence[ModelledExperiment], taken: str) -> Proposal:
    """The proposal with notes on what was `taken` from another vehicle, changed parameters, and the track record."""
    record = track_record(evidence.flights)
    further = (
        taken,
        changed_parameters(evidence),
        record.sentence if record.of or record.agreeing or record.disagreeing else "",
    )
    notes = (*proposal.explanation.notes, *filter(None, further))
    return replace(proposal, explanation=replace(proposal.explanation, notes=notes))


AdviceKind = Literal["step", "repeat", "baseline", "stop"]

_OTHER_KINDS: dict[Kind, AdviceKind] = {"start": "baseline", "repeat": "repeat", "baseline": "baseline"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Advice:
    """What to do next, with which gains, and why. Kind `baseline` is the first flight, or a repeat with its gains."""

    kind: AdviceKind
    gains: dict[str, int | float]
    why: str


def advise(evidence: Evidence[Experiment], proposal: Proposal, verdict: StopVerdict) -> Advice:
    """Recommend the next action.

    Under the stop rule `noise` the proposal already contains the recommendation. Under the other rules it is the
    strategy's step until the rule stops, with a note where flights cannot distinguish its effect from noise. Without a
    step, or in a campaign that was reopened after its rule had stopped it, the advice is to confirm the best gains.
    With any rule it is to stop once a flight was aborted because of the start gains, and none is valid. Only gains
    within the bounds are recommended, except when one of the other rules stops the campaign: that advice names the best
    of all flights.
    """
    tells_noise = evidence.definition.stop.kind == "noise"
    is_reopened = len(evidence.flights) < evidence.open_until_flight
    now = evidence if verdict.stop and not tells_noise else evidence.within_bounds
    if verdict.stop:
        return Advice(kind="stop", gains=dict(now.winner.gains) if now.groups else proposal.gains, why=verdict.why)
    if now.groups and proposal.kind == "none" and tells_noise:
        shows = "Flying the best gains again shows whether their error stays the same."
        return Advice(kind="repeat", gains=dict(now.winner.gains), why=f"{proposal.explanation.summary} {shows}")
    if not now.groups or tells_noise or not (proposal.kind == "none" or is_reopened):
        is_refuted = proposal.kind == "start" and bool(aborted_by_gains(evidence.flights, proposal.gains))
        kind = "stop" if is_refuted else _OTHER_KINDS.get(proposal.kind, "step")
        effect = describe_step(evidence, proposal) if now.groups and not tells_noise else ""
        return Advice(kind=kind, gains=proposal.gains, why=effect or proposal.explanation.summary)
    confirmation = confirm(evidence, proposal)
    kind = "stop" if confirmation.phase == "decided" else confirmation.phase
    chosen = {"step": proposal.gains, "repeat": now.winner.gains, "baseline": now.baseline.gains}
    return Advice(kind=kind, gains=dict(chosen.get(kind, now.winner.gains)), why=confirmation.why)


_UNEXPLAINED = Explanation(summary="")


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightPredictor:
    """The campaign's model, fitted once and asked for many gain sets.

    `base` is the flight whose bias corrects the model, None for an uncorrected one.
    """

    evidence: Evidence[ModelledExperiment]
    model: Predictor
    base: Flight | None

    def predict(self, gains: Gains) -> Proposal:
        """Predict a flight with a complete set of gains: its curve with a band, and its error with an interval."""
        predicted = self.model.predict(self.evidence.space.vector(gains))
        return with_interval(self.evidence, proposal_of("manual", gains, predicted, _UNEXPLAINED), base=self.base)


def flight_predictor(campaign: Evidence[Experiment]) -> FlightPredictor | None:
    """The predictor after these flights, with the model that `next_proposal` uses for them; None without a model.

    A fit takes up to half a second; a prediction some milliseconds, or a tenth of a second under ArduCopter.
    """
    if not has_model(campaign):
        return None
    evidence = transfer(campaign).evidence
    is_corrected = bool(evidence.valid) and STRATEGIES[evidence.definition.strategy].corrects_model
    base = evidence.best if is_corrected else None
    return FlightPredictor(evidence=evidence, model=model_of(evidence), base=base)


def model_of(evidence: Evidence[ModelledExperiment]) -> Predictor:
    """The strategy's model; before the first valid flight the nominal one, or the one corrected by the donor's."""
    if evidence.valid:
        return STRATEGIES[evidence.definition.strategy].model(evidence)
    experiment, donor = evidence.experiment, evidence.donor
    return uncorrected_model(experiment) if donor is None else correct_by_bias(experiment, donor)


def modelled_flights(evidence: Evidence[Experiment]) -> frozenset[int]:
    """Numbers of the flights whose records `flight_predictor` needs."""
    valid = evidence.valid
    used = fitted_flights(valid) if valid and isinstance(evidence.experiment, FITTED) else valid
    return frozenset(flight.number for flight in (*valid[:1], *used))


def predict_repeat(evidence: Evidence[Experiment], gains: Gains) -> Proposal | None:
    """Predict another flight of gains that were flown: the mean of their flights; None if no valid flight had them.

    Only the flights with these gains need their records.
    """
    group = next((each for each in evidence.groups if each.gains == gains), None)
    return None if group is None else repeat_proposal(evidence, group, "repeat", _UNEXPLAINED)
