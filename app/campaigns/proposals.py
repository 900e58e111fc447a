"""Proposals: computed as a job from the stored history, and stored with that history's digest and the gate's result;
and the gains that may be flown instead: a smaller step, the best gains again, the first ones again.

For a worker: `read_history`, then `computation.compute` (pure, in any process), then `store_proposal`.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Final

import numpy as np
from pydantic import TypeAdapter
from sqlalchemy.orm import Session

from app.campaigns import history, repository
from app.campaigns.computation import CampaignHistory, ProposalComputation
from app.campaigns.definitions import definition_of, flown_evidence, frozen_digest
from app.campaigns.history import cancel_unflown, notify_rehearsed_campaign, set_campaign_state
from app.campaigns.schemas import ChoiceKind, Variant
from app.common.errors import ConflictError, NotFoundError
from app.common.states import UNFLOWN_TRIAL_STATES, CampaignState, Outcome, TrialState
from app.core.experiments.base import Check, Experiment, ParameterDistribution, prior_distribution
from app.core.policy import Gains
from app.core.tuning.gate import GateResult
from app.core.tuning.stop_rules import Reason, StopVerdict
from app.db.base import JsonObject, added, utc_now
from app.db.models import CampaignRow, ProposalRow, TrialRow
from app.db.trajectories import pack
from app.jobs import service as jobs

PROPOSAL_JOB: Final = "proposal"
_DISTRIBUTION: Final = TypeAdapter(ParameterDistribution)
_OUTCOMES: Final[dict[Reason, Outcome]] = {
    "aborted again": Outcome.STOPPED,
    "flight budget": Outcome.BUDGET,
    "not improving": Outcome.CONVERGED,
    "nothing better": Outcome.CONVERGED,
    "told from noise": Outcome.CONVERGED,
    "battery low": Outcome.BUDGET,
}


def read_history(session: Session, campaign_id: int) -> CampaignHistory:
    """The campaign's definition and its flights, with trajectories as stored. Raises NotFoundError."""
    row = repository.get_campaign(session, campaign_id)
    definition, trials = definition_of(row), history.trials_of(session, campaign_id)
    return CampaignHistory(
        definition=definition,
        flights=history.flights_of(session, campaign_id),
        digest=history.history_digest(session, row, definition, trials),
        donor=history.donor_of(session, definition),
        battery_v=history.last_battery_v(trials),
        open_until_flight=row.open_until_flight,
    )


def store_proposal(session: Session, campaign_id: int, computed: ProposalComputation) -> ProposalRow:
    """Store a proposal and update the campaign: a draft becomes ready; a campaign is finished when its stop rule says
    so, and reopened when the rule that finished it is no longer met.

    A proposal from an outdated history is stored as stale and does not update the campaign. Raises NotFoundError when
    the campaign has been deleted.
    """
    campaign = repository.get_campaign(session, campaign_id)
    proposal = computed.proposal
    row = ProposalRow(
        campaign_id=campaign_id,
        history_digest=computed.history_digest,
        kind=proposal.kind,
        gains=proposal.gains,
        predicted_error=proposal.predicted_error,
        predicted=None if proposal.predicted is None else pack(proposal.predicted),
        explanation=asdict(proposal.explanation),
        gate=gate_json(computed.gate),
        stop_verdict=asdict(computed.stop_verdict),
        interval=None if proposal.interval is None else asdict(proposal.interval),
        advice=asdict(computed.advice),
        spread={**asdict(computed.spread), "flights": list(computed.flights)},
    )
    added(session, row)
    trials = history.trials_of(session, campaign_id)
    if not is_stale(session, campaign, row, trials) and history.find_unreviewed(trials) is None:
        _apply_to_campaign(session, campaign, computed.stop_verdict)
    return row


def _apply_to_campaign(session: Session, campaign: CampaignRow, verdict: StopVerdict) -> None:
    if campaign.state == CampaignState.DRAFT:
        set_campaign_state(campaign, CampaignState.READY)
    elif campaign.state == CampaignState.DECIDING and verdict.reason is not None:
        end_campaign(session, campaign, _OUTCOMES[verdict.reason], verdict.why)
    elif campaign.state == CampaignState.FINISHED and campaign.outcome != Outcome.STOPPED:
        # Which flights count has changed; what an operator has stopped stays stopped.
        if verdict.reason is None:
            reopen(campaign)
        else:
            campaign.outcome, campaign.stop_reason = _OUTCOMES[verdict.reason], verdict.why


def request_proposal(session: Session, campaign: CampaignRow) -> None:
    """Request a job that computes the proposal, after a change of the history or on request."""
    if campaign.state != CampaignState.ARCHIVED:
        jobs.enqueue_job(session, PROPOSAL_JOB, campaign_id=campaign.id)


def fresh_proposal(session: Session, campaign: CampaignRow, proposal_id: int) -> ProposalRow:
    """A proposal of this campaign that is not stale. Raises NotFoundError, or ConflictError when it is stale."""
    row = session.get(ProposalRow, proposal_id)
    if row is None or row.campaign_id != campaign.id:
        raise NotFoundError("proposal", proposal_id, hint="Reload the page, then decide again.")
    if is_stale(session, campaign, row, history.trials_of(session, campaign.id)):
        raise ConflictError(
            "This proposal is out of date: the campaign's flights or settings have changed.",
            hint="Wait for the new proposal, then decide again.",
        )
    return row


def require_fresh_proposal(session: Session, campaign: CampaignRow) -> ProposalRow:
    """The latest proposal. Raises ConflictError when there is none for the present flights."""
    if (row := _latest_fresh(session, campaign)) is None:
        raise ConflictError(
            f"The next gains of campaign {campaign.id} have not been computed yet.",
            hint="Wait until they are computed, then try again.",
        )
    return row


def _latest_fresh(session: Session, campaign: CampaignRow) -> ProposalRow | None:
    """The latest proposal, if it is for the present flights."""
    row = repository.latest_proposal(session, campaign.id)
    is_fresh = row is not None and not is_stale(session, campaign, row, history.trials_of(session, campaign.id))
    return row if is_fresh else None


def is_stale(session: Session, campaign: CampaignRow, row: ProposalRow, trials: Sequence[TrialRow]) -> bool:
    """Whether the campaign's history has changed since the proposal was computed."""
    return row.history_digest != history.history_digest(session, campaign, definition_of(campaign), trials)


def cancel_outdated(session: Session, campaign: CampaignRow) -> None:
    """Cancel the unflown trials of stale proposals."""
    trials = history.trials_of(session, campaign.id)
    waiting = (row for row in trials if row.state in UNFLOWN_TRIAL_STATES)
    outdated = [
        row for row in waiting if row.proposal is not None and is_stale(session, campaign, row.proposal, trials)
    ]
    reason = "its proposal is outdated: the campaign's flights have changed"
    cancel_unflown(outdated, history.flight_under_way(session, campaign.id), reason)


def stored_start(session: Session, campaign: CampaignRow) -> Gains:
    """The start gains, from the first proposal; their search takes too long for a transaction.

    Raises ConflictError while they are not known.
    """
    latest = _latest_fresh(session, campaign)
    if latest is None or latest.kind != "start":
        raise ConflictError(
            f"The start gains of campaign {campaign.id} have not been computed yet; the step limits of custom gains "
            "are measured from them.",
            hint="Wait until they are computed, then try again.",
        )
    return latest.gains


def stored_distribution(session: Session, campaign: CampaignRow, experiment: Experiment) -> ParameterDistribution:
    """What was known of the vehicle when the latest proposal was computed; a fit takes too long for a transaction.

    A distribution from before the latest flights is still used: it only knows less. The data sheet (the prior) is used
    before the first one, and when it was fitted to a flight that no longer counts. Early databases do not store the
    flights of a distribution: then the proposal is computed again, and the data sheet is used until it is there.
    """
    latest = repository.latest_proposal(session, campaign.id)
    if latest is None or latest.spread is None:
        return prior_distribution(experiment)
    if (shown_by := latest.spread.get("flights")) is None:
        request_proposal(session, campaign)
        return prior_distribution(experiment)
    valid = {row.number for row in history.trials_of(session, campaign.id) if row.state == TrialState.VALID}
    if not valid.issuperset(shown_by):
        return prior_distribution(experiment)
    return _DISTRIBUTION.validate_python(latest.spread)


def end_campaign(session: Session, campaign: CampaignRow, outcome: Outcome, reason: str) -> None:
    """Finish a campaign, and cancel its unflown trials."""
    set_campaign_state(campaign, CampaignState.FINISHED)
    campaign.outcome, campaign.stop_reason = outcome, reason
    notify_rehearsed_campaign(session, campaign)
    flight = history.flight_under_way(session, campaign.id)
    cancel_unflown(history.trials_of(session, campaign.id), flight, "the campaign was finished")


def reopen(campaign: CampaignRow) -> None:
    """Continue a finished campaign."""
    set_campaign_state(campaign, CampaignState.DECIDING)
    campaign.outcome, campaign.stop_reason = None, ""


def gate_json(gate: GateResult) -> JsonObject:
    """The gate's result as stored; infinite and undefined numbers become null."""
    checks = [asdict(check) | {"worst": check.worst if math.isfinite(check.worst) else None} for check in gate.checks]
    return {"passed": gate.passed, "checks": checks}


def gate_of(stored: JsonObject) -> GateResult:
    """The gate's result from its stored form."""
    return GateResult(
        tuple(
            Check(**check | {"worst": math.inf if check["worst"] is None else check["worst"]})
            for check in stored["checks"]
        )
    )


def start_flying(row: CampaignRow) -> None:
    """Enter state flying, at a lift-off or an imported record; at the first one the definition is frozen."""
    if row.definition_digest is None:
        row.safe_gains = row.safe_gains or dict(row.vehicle.safe_gains)
        row.definition_digest = frozen_digest(row)
    set_campaign_state(row, CampaignState.FLYING)


def finish_flying(session: Session, row: CampaignRow) -> None:
    """Leave state flying once the trial has ended, however it ended, and request the next proposal."""
    if row.state == CampaignState.FLYING:
        set_campaign_state(row, CampaignState.DECIDING)
    history_changed(session, row)


def history_changed(session: Session, row: CampaignRow) -> None:
    """Update everything computed from the flights, after a change of which flights count."""
    row.updated_at = utc_now()
    notify_rehearsed_campaign(session, row)
    cancel_outdated(session, row)
    request_proposal(session, row)


def safe_gains_changed(session: Session, vehicle_id: int) -> None:
    """Request new proposals for the vehicle's unflown campaigns, which start from its safe gains."""
    for row in repository.of_vehicle(session, vehicle_id):
        if row.definition_digest is None:
            cancel_outdated(session, row)
            request_proposal(session, row)


_CHOICE_KINDS: Final[Mapping[str, ChoiceKind]] = {
    "start": "baseline",
    "step": "step",
    "shorter step": "step",
    "repeat": "repeat",
    "baseline": "baseline",
}
_CHOICE_ORDER: Final[tuple[ChoiceKind, ...]] = ("step", "smaller step", "repeat", "baseline")


def variant_gains(session: Session, campaign: CampaignRow, variant: Variant) -> dict[str, float]:
    """Gains of a variant.

    `repeat`: the best gains by all their flights; `baseline`: the first flight's; `smaller step`: half way from the
    best to the present proposal. Like the advice, it ignores flights outside the campaign's bounds. Raises
    ConflictError before the first valid flight inside the bounds, and where half a step rounds to none.
    """
    trials = history.trials_of(session, campaign.id)
    proposed = require_fresh_proposal(session, campaign).gains if variant == "smaller step" else None
    found = _variants(campaign, trials, proposed)
    if not found:
        raise ConflictError(
            f"A {variant} needs a valid flight inside the bounds; campaign {campaign.id} has none yet.",
            hint="Fly the first proposal.",
        )
    if variant not in found:
        raise ConflictError(
            "The proposed step cannot be made smaller: half of it is less than one count.",
            hint="Fly the proposal, or repeat the best gains.",
        )
    return found[variant]


def choices_of(
    campaign: CampaignRow, proposal: ProposalRow, trials: Sequence[TrialRow]
) -> dict[ChoiceKind, dict[str, float]]:
    """The gain sets that the next flight may use, each once, in a fixed order; the proposal's are among them."""
    variants = _variants(campaign, trials, proposal.gains)
    flown: tuple[Variant, ...] = ("repeat", "baseline")
    # Proposals of kind `none` and `manual` were flown, unless the bounds have moved them.
    again = next((kind for kind in flown if variants.get(kind) == proposal.gains), None)
    own: ChoiceKind = _CHOICE_KINDS.get(proposal.kind, again or "step")
    others: dict[ChoiceKind, dict[str, float]] = {
        kind: gains
        for kind, gains in variants.items()
        if kind != own and gains != proposal.gains and (kind != "smaller step" or own == "step")
    }
    if others.get("baseline") == variants.get("repeat"):
        others.pop("baseline", None)
    found = {own: dict(proposal.gains), **others}
    return {kind: found[kind] for kind in _CHOICE_ORDER if kind in found}


def _variants(
    campaign: CampaignRow, trials: Sequence[TrialRow], proposed: Gains | None
) -> dict[Variant, dict[str, float]]:
    """Every variant that there is; none before the first valid flight inside the bounds."""
    now = flown_evidence(campaign, trials).within_bounds
    if not now.groups:
        return {}
    best = dict(now.winner.gains)
    found: dict[Variant, dict[str, float]] = {"repeat": best, "baseline": dict(now.baseline.gains)}
    if proposed is not None:
        space = now.space
        target = space.vector(proposed)
        half = space.mapping(space.nearest((space.vector(best) + target) / 2.0))
        if half != best and not np.array_equal(space.vector(half), target):
            found["smaller step"] = half
    return found
