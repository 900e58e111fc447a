"""The model's error around a campaign's gains, computed as a job for one proposal and stored as that job's result.

For a worker: `read_proposed`, then `plan` and `app.core.tuning.landscape` (pure, in any process), then store the result
of `as_json`. Only the newest landscape of a campaign is kept.
"""

from dataclasses import asdict
from typing import Final

from pydantic import TypeAdapter
from sqlalchemy.orm import Session

from app.autopilots.registry import experiment_of
from app.campaigns import history, repository
from app.campaigns.computation import CampaignHistory
from app.campaigns.definitions import definition_of
from app.campaigns.figure_data import history_of
from app.campaigns.proposals import is_stale, read_history
from app.common.states import JobState
from app.core.experiments.base import ModelledExperiment
from app.core.formatting import percent
from app.core.policy import Gains
from app.core.tuning.landscape import Landscape, LandscapeGrid, free_gains, plan_grid
from app.db.base import JsonObject
from app.db.models import CampaignRow, JobRow, ProposalRow
from app.figures.base import Card, card_of
from app.figures.landscape import LandscapeFigure
from app.figures.theme import ThemeName
from app.jobs import service as jobs

LANDSCAPE_JOB: Final = "landscape"

_STORED: Final = TypeAdapter(Landscape)


def landscape_card(session: Session, campaign_id: int, theme: ThemeName) -> tuple[Card, bool]:
    """The landscape of the latest proposal, or why there is none; and whether a job still has to be requested for it.

    Raises NotFoundError for an unknown campaign.
    """
    campaign = repository.get_campaign(session, campaign_id)
    proposal = repository.latest_proposal(session, campaign_id)
    definition = definition_of(campaign)
    experiment = experiment_of(definition)
    if not isinstance(experiment, ModelledExperiment):
        return _waiting("There is no model of this vehicle's controller, so no landscape can be computed.")
    if free_gains(experiment.space.narrowed(definition.bounds)) < 2:
        return _waiting("The campaign's bounds leave fewer than two gains free; a landscape needs two.")
    if proposal is None:
        return _waiting("The landscape appears here once the first gains are proposed.")
    job = _job(session, proposal)
    if job is None or job.result is None:
        return _not_yet(session, campaign, proposal, job)
    found, drawn = _STORED.validate_python(job.result["landscape"]), history_of(session, campaign_id)
    tried = [step["gains"] for step in proposal.explanation.get("ladder", ())]
    return card_of(LandscapeFigure(drawn, found, tried, theme_name=theme)), False


def request_landscape(session: Session, campaign_id: int) -> None:
    """Request a job that computes the landscape of the latest proposal, unless there is one or a person cancelled
    it."""
    proposal = repository.latest_proposal(session, campaign_id)
    if proposal is None or not _is_wanted(_job(session, proposal)):
        return
    order: JsonObject = {"name": f"campaign {campaign_id}", "proposal_id": proposal.id}
    job = jobs.enqueue_job(session, LANDSCAPE_JOB, campaign_id=campaign_id, order=order)
    job.order = order  # a job that still waits may be for an outdated proposal


def read_proposed(session: Session, campaign_id: int, order: JsonObject) -> tuple[CampaignHistory, ProposalRow]:
    """Read the job's proposal and what it was computed from. Raises SupersededError when the campaign's flights have
    changed since."""
    past = read_history(session, campaign_id)
    proposal = session.get_one(ProposalRow, order["proposal_id"])
    if proposal.history_digest != past.digest:
        raise jobs.SupersededError(
            "The campaign's flights have changed since these gains were proposed.",
            hint="No action is needed: the landscape of the next proposal replaces it.",
        )
    return past, proposal


def plan(past: CampaignHistory, proposed: Gains, base_flight: int | None) -> LandscapeGrid | None:
    """Return the model and the grid, for a compute process; None without a model, or with fewer than two free gains.

    Its slices contain the gains of all flights and the proposed ones, and go through those of the flight from which
    the proposal starts, else through the proposed ones.
    """
    flown = {flight.number: flight.gains for flight in past.flights}
    centre = proposed if base_flight is None else flown.get(base_flight, proposed)
    return plan_grid(past.evidence, centre, [*flown.values(), proposed])


def as_json(landscape: Landscape, order: JsonObject) -> JsonObject:
    """The job's result as JSON."""
    return {"proposal_id": order["proposal_id"], "landscape": asdict(landscape)}


def _not_yet(session: Session, campaign: CampaignRow, proposal: ProposalRow, job: JobRow | None) -> tuple[Card, bool]:
    if is_stale(session, campaign, proposal, history.trials_of(session, campaign.id)):
        return _waiting("The next gains are being computed. Their landscape follows.")
    wanted = _is_wanted(job)
    if job is not None and not wanted and job.state in {JobState.FAILED, JobState.CANCELLED}:
        problem = jobs.job_problem(job)
        why = "It was cancelled." if problem is None else f"{problem.title} {problem.hint}"
        return _waiting(f"The landscape could not be computed. {why} Retry it on the Jobs page.")
    reason = (
        "The model is being evaluated at several hundred gain sets around the flown and the proposed ones. This "
        "takes a few seconds, or half a minute with the calibrated model. The landscape appears here automatically."
    )
    if job is not None and job.state == JobState.RUNNING and job.done_share:
        reason = f"{percent(job.done_share)} done: {job.doing}. The landscape appears here automatically."
    return _waiting(reason, wanted=wanted)


def _waiting(reason: str, *, wanted: bool = False) -> tuple[Card, bool]:
    title = "Error landscape of the model"
    return Card(name=LandscapeFigure.name, title=title, state="waiting", reason=reason), wanted


def _job(session: Session, proposal: ProposalRow) -> JobRow | None:
    """The campaign's newest landscape job, if it is for that proposal."""
    job = jobs.latest_job(session, proposal.campaign_id, LANDSCAPE_JOB)
    return job if job is not None and (job.order or {}).get("proposal_id") == proposal.id else None


def _is_wanted(job: JobRow | None) -> bool:
    """Whether a job has to be requested, given the newest one."""
    return job is None or jobs.is_withdrawn(job)
