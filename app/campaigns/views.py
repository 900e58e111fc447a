"""API views of campaigns and proposals."""

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from typing import Final

from pydantic import TypeAdapter
from sqlalchemy.orm import Session

from app.autopilots.registry import TUNED
from app.campaigns import history, repository
from app.campaigns.definitions import flown_evidence
from app.campaigns.proposals import PROPOSAL_JOB, choices_of, is_stale
from app.campaigns.rehearsals import is_rehearsal_satisfied, passed_rehearsals, rehearsal_of
from app.campaigns.schemas import (
    Campaign,
    CampaignSummary,
    FlightChoice,
    FlyingTrial,
    GainChange,
    NextFlight,
    Proposal,
    Rehearsal,
    SparkCurve,
    Standing,
    StopVerdict,
    TrialCounts,
    Winner,
)
from app.campaigns.statistics import best_trial
from app.common.conflict_checks import allowed
from app.common.schemas import Trouble
from app.common.states import CAMPAIGN_ACTIONS, FLOWN_TRIAL_STATES, CampaignState, JobState, TrialState, VehicleState
from app.core.definition import aborted_by_gains
from app.core.experiments.base import Experiment
from app.core.statistics.comparisons import Verdict
from app.core.tuning.evidence import Evidence
from app.core.tuning.proposals import Advice
from app.db.models import CampaignRow, FlightRow, ProposalRow, TrialRow
from app.fleet import service as fleet
from app.jobs import service as jobs

SPARKS: Final = 7
_ADVICE: Final = TypeAdapter(Advice)

_NEXT_ACTIONS: Final[Mapping[CampaignState, str]] = {
    CampaignState.DRAFT: "Wait for the first gains",
    CampaignState.FLYING: "Watch the flight",
    CampaignState.FINISHED: "View result",
    CampaignState.ARCHIVED: "",
}


_HINTS: Final[Mapping[CampaignState, str]] = {
    CampaignState.FINISHED: "Reopen the campaign to fly more.",
    CampaignState.ARCHIVED: "Clone the campaign to fly more.",
}


def campaign_view(session: Session, row: CampaignRow) -> Campaign:
    trials = history.trials_of(session, row.id)
    flight = history.flight_under_way(session, row.id)
    now = flown_evidence(row, trials)
    repeatable = now.within_bounds
    rehearsal, standing = rehearsal_of(session, row), _standing(row, repeatable)
    return Campaign.view_of(
        row,
        vehicle=fleet.campaign_vehicle(row),
        rehearsal=rehearsal,
        rehearses=repository.rehearsed_id(session, row.id),
        best=best_trial(trials, now),
        verdict=_verdict(now),
        winner=Winner(
            gains=dict(repeatable.winner.gains),
            trial_numbers=list(repeatable.winner.numbers),
            verdict=_verdict(repeatable),
        )
        if repeatable.groups
        else None,
        standing=standing,
        parameter_file=_parameter_file(row, standing),
        trials=_counts(trials),
        flying=None if flight is None else FlyingTrial(trial_id=flight.trial_id, trial_number=flight.trial.number),
        next_action=_next_action(row, trials, rehearsal),
        actions=_actions(session, row, flight),
    )


def summaries(session: Session, rows: Sequence[CampaignRow]) -> list[CampaignSummary]:
    """Summaries of several campaigns, with one query for all their trials."""
    by_campaign: Mapping[int, list[TrialRow]] = defaultdict(list)
    for trial in history.trials_of(session, *(row.id for row in rows)):
        by_campaign[trial.campaign_id].append(trial)
    sparking = {row.id: _sparking(by_campaign[row.id]) for row in rows}
    curves = repository.curves(session, [trial.id for trials in sparking.values() for trial in trials])
    passed = passed_rehearsals(session, [row.id for row in rows])
    return [
        _summary(
            row,
            by_campaign[row.id],
            rehearsal_of(session, row),
            _spark(sparking[row.id], curves),
            has_passed=row.id in passed,
        )
        for row in rows
    ]


def _summary(
    row: CampaignRow, trials: Sequence[TrialRow], rehearsal: Rehearsal, spark: list[SparkCurve], *, has_passed: bool
) -> CampaignSummary:
    now = flown_evidence(row, trials)
    best = [trial for trial in trials if trial.number in now.winner.numbers] if now.groups else []
    return CampaignSummary.view_of(
        row,
        vehicle=fleet.campaign_vehicle(row),
        flights=_counts(trials).flown,
        best=best_trial(best, now),
        first_error=now.baseline.mean if now.groups else None,
        verdict=_verdict(now),
        rehearsal=rehearsal.state,
        has_passed_as_rehearsal=has_passed,
        next_action=_next_action(row, trials, rehearsal, has_passed=has_passed),
        spark=spark,
    )


def next_flight_view(session: Session, row: CampaignRow) -> NextFlight:
    """State of the next proposal, which is computed in the background: fresh, stale, being computed, or impossible."""
    trials = history.trials_of(session, row.id)
    latest = repository.latest_proposal(session, row.id)
    shown = None if latest is None else proposal_view(session, row, latest, trials)
    if (waiting := history.find_unreviewed(trials)) is not None:
        return NextFlight(
            state="none",
            proposal=shown,
            problem=Trouble(
                title=f"Flight {waiting.number} needs a review.",
                detail="The next gains depend on whether it counts.",
                hint="Mark it valid, aborted or invalid.",
            ),
        )
    job = jobs.latest_job(session, row.id, PROPOSAL_JOB)
    if job is not None and job.state in {JobState.QUEUED, JobState.RUNNING}:
        return NextFlight(state="computing", proposal=shown, problem=None)
    if shown is not None and not shown.stale:
        return NextFlight(state="ready", proposal=shown, problem=None)
    if job is not None and job.state == JobState.FAILED:
        return NextFlight(state="failed", proposal=shown, problem=jobs.job_problem(job))
    cancelled = job is not None and job.state == JobState.CANCELLED
    return NextFlight(
        state="none",
        proposal=shown,
        problem=Trouble(
            title="There is no proposal for the current flights.",
            detail="Its computation was cancelled." if cancelled else f"The campaign is {row.state}.",
            hint=_HINTS.get(row.state, "Compute it again."),
        ),
    )


def proposal_view(session: Session, campaign: CampaignRow, row: ProposalRow, trials: Sequence[TrialRow]) -> Proposal:
    now = _present_gains(campaign, trials)
    stop = row.stop_verdict
    verdict = StopVerdict(
        stop=stop["stop"], reason=stop["reason"] or "", sentence=stop["why"], threshold=stop["threshold"]
    )
    advice = (
        Advice(kind="stop" if verdict.stop else "step", gains=row.gains, why=verdict.sentence)
        if row.advice is None  # a row of a release without advice
        else _ADVICE.validate_python(row.advice)
    )
    is_doubtful = row.kind == "start" and bool(aborted_by_gains(history.flown_gains(trials), row.gains))
    predicted_error, interval = history.told_prediction(
        row.predicted_error, row.interval, corrected=history.is_corrected(trials)
    )
    return Proposal.view_of(
        row,
        recommended=advice.kind,
        advice=advice,
        changes={
            name: GainChange(now=now.get(name, value), next=value, delta=value - now.get(name, value))
            for name, value in row.gains.items()
        },
        choices=[
            FlightChoice(
                kind=kind,
                gains=gains,
                proposed=gains == row.gains,
                recommended=advice.kind != "stop" and gains == advice.gains and not is_doubtful,
            )
            for kind, gains in choices_of(campaign, row, trials).items()
        ],
        predicted_error=predicted_error,
        interval=interval,
        stop_verdict=verdict,
        stale=is_stale(session, campaign, row, trials),
    )


def _present_gains(campaign: CampaignRow, trials: Sequence[TrialRow]) -> Mapping[str, float]:
    """The gains that a step starts from: the best within the bounds, else the best, else the vehicle's safe ones."""
    within = flown_evidence(campaign, trials).within_bounds
    if within.groups:
        return within.winner.gains
    best = history.best_of(trials)
    return campaign.vehicle.safe_gains if best is None else best.gains


def _verdict(now: Evidence[Experiment]) -> Verdict | None:
    return None if now.comparison is None else now.comparison.verdict


def _standing(row: CampaignRow, now: Evidence[Experiment]) -> Standing | None:
    if row.outcome is None or now.comparison is None:
        return None
    if not now.looks:
        return "candidate"
    return "confirmed" if now.comparison.verdict == "better" else "not confirmed"


def _parameter_file(row: CampaignRow, standing: Standing | None) -> str | None:
    is_better = standing in {"candidate", "confirmed"} and row.experiment in TUNED
    return f"campaign-{row.id}{TUNED[row.experiment].parameter_file.suffix}" if is_better else None


def _counts(trials: Sequence[TrialRow]) -> TrialCounts:
    states = Counter(trial.state for trial in trials)
    return TrialCounts(
        total=len(trials),
        flown=sum(states[state] for state in FLOWN_TRIAL_STATES),
        valid=states[TrialState.VALID],
        aborted=states[TrialState.ABORTED],
        invalid=states[TrialState.INVALID],
        lost=states[TrialState.LOST],
    )


def _next_action(
    row: CampaignRow, trials: Sequence[TrialRow], rehearsal: Rehearsal, *, has_passed: bool = False
) -> str:
    """One recommended action, in a few words. `has_passed`: it is a rehearsal that lets its campaign fly."""
    if row.state in _NEXT_ACTIONS:
        return _NEXT_ACTIONS[row.state]
    if (waiting := history.find_unreviewed(trials)) is not None:
        return f"Review flight {waiting.number}"
    if row.vehicle.state is VehicleState.QUARANTINED:
        return "Inspect and release the vehicle"
    if has_passed:
        return "Fly the campaign on the real vehicle"
    if not is_rehearsal_satisfied(rehearsal):
        return "Continue the rehearsal" if rehearsal.state == "under way" else "Rehearse on a simulation"
    which = "first" if row.state == CampaignState.READY else "next"
    return f"Fly the {which} flight" if fleet.can_fly(row.vehicle) else f"Upload the record of the {which} flight"


def _actions(session: Session, row: CampaignRow, flight: FlightRow | None) -> list[str]:
    """Allowed actions: those of the state table, less what an active flight rules out, and deletion once a flight was
    begun."""
    ruled_out = (
        (flight is not None, {"plan", "define", "delete", "finish"}),
        (repository.has_claimed_flight(session, row.id), {"delete"}),
        (repository.rehearsed_id(session, row.id) is not None, {"reopen"}),
    )
    return allowed(CAMPAIGN_ACTIONS, row.state, ruled_out)


def _spark(trials: Sequence[TrialRow], curves: Mapping[int, list[list[float]]]) -> list[SparkCurve]:
    best = history.best_of(trials)
    return [
        SparkCurve(
            trial_number=trial.number,
            best=trial is best,
            time_s=[time_s for time_s, _ in curves[trial.id]],
            values=[value for _, value in curves[trial.id]],
        )
        for trial in trials
        if trial.id in curves
    ]


def _sparking(trials: Sequence[TrialRow]) -> list[TrialRow]:
    """The first flight, the best and the latest, in their order."""
    recorded = [trial for trial in trials if trial.trajectory_id is not None]
    flown = [trial for trial in recorded if trial.state in {TrialState.VALID, TrialState.CAPTURED}]
    best = history.best_of(flown)
    chosen = {trial.number for trial in (*flown[:1], *([best] if best is not None else []))}
    chosen |= {trial.number for trial in flown[-(SPARKS - len(chosen)) :]}
    return [trial for trial in flown if trial.number in chosen]
