"""Operations on trials for clients: people and scripts. The worker's side of a flight is in `app.flights.flight_rows`.

Every gain set passes the gate before it becomes a trial; an operator may overrule some of its refusals. What is
predicted for a trial is kept with it, also for gains that no proposal contains.
"""

from collections.abc import Collection
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import partial
from typing import Final

from sqlalchemy.orm import Session

from app.accounts.permissions import LOCAL_CLI, Permission, RequestContext
from app.autopilots.registry import evidence_of
from app.campaigns import history, proposals, repository
from app.campaigns import service as campaigns
from app.campaigns.definitions import definition_of
from app.campaigns.flight_predictions import TrialPredictor
from app.campaigns.history import set_flight_state, set_trial_state
from app.campaigns.schemas import Campaign, Variant
from app.campaigns.trials.schemas import Reopening, Trial, TrialEdit, TrialPlan
from app.campaigns.trials.views import trial_view, trial_views
from app.common.conflict_checks import check_action, check_version
from app.common.errors import ConflictError, GainlineError, InputError, Problem
from app.common.schemas import Gate, Page
from app.common.states import BUDGETED_TRIAL_STATES, CAMPAIGN_ACTIONS, TRIAL_ACTIONS, FlightState, TrialKind, TrialState
from app.core.definition import flight_seed
from app.core.errors import TrajectoryError
from app.core.policy import Gains
from app.core.tuning.gate import GateResult, check_policy, require_flyable
from app.core.tuning.stop_rules import describe_budget
from app.db.base import JsonObject, added
from app.db.models import CampaignRow, ProposalRow, TrialRow
from app.db.pages import Order, Part, page_of
from app.db.trajectories import pack
from app.fleet import service as fleet
from app.fleet.control import require_may
from app.vehicles.flight_end import not_begun
from app.vehicles.registry import get_kind


@dataclass(frozen=True, slots=True)
class GateDecision:
    """Gains that may fly, complete and in order.

    `gate` is the gate's result as stored; `overrule_reason` is why a refusal was overruled, empty if the gate passed.
    """

    gains: dict[str, float]
    gate: JsonObject
    overrule_reason: str


def check_own_gains(
    session: Session, campaign: CampaignRow, asked: Gains, *, overrule: str | None = None
) -> GateDecision:
    """Check custom gains, given what was known of the vehicle when the latest proposal was computed.

    Takes about 0.1 s. Raises GainsError that names what is refused and what would pass.
    """
    gains, gate = gated_gains(session, campaign, asked)
    return _judged(campaign, gains, gate, overrule)


def evaluate_gate(session: Session, campaign_id: int, asked: Gains) -> Gate:
    """The gate's result for gains that a person considers.

    Raises GainsError when they are not the campaign's gains, or no controller can hold them.
    """
    _, gate = gated_gains(session, campaigns.get_row(session, campaign_id), asked)
    return Gate.model_validate(proposals.gate_json(gate))


def gated_gains(session: Session, campaign: CampaignRow, asked: Gains) -> tuple[dict[str, float], GateResult]:
    """The gains, complete and in order, and the gate's result, whether or not they pass. Raises GainsError when they
    are not the campaign's gains."""
    definition = definition_of(campaign)
    evidence = evidence_of(definition, history.flights_of(session, campaign.id, recorded=()))
    gains = evidence.space.complete(asked)
    searched = definition.start.kind == "simplex" and not evidence.valid
    gate = check_policy(
        evidence,
        gains,
        start=proposals.stored_start(session, campaign) if searched else None,
        spread=proposals.stored_distribution(session, campaign, evidence.experiment),
    )
    return gains, gate


def _judged(campaign: CampaignRow, gains: dict[str, float], gate: GateResult, overrule: str | None) -> GateDecision:
    reason = require_flyable(gate, overrule=overrule or "", is_real=campaign.vehicle.is_real)
    if reason:
        get_kind(campaign.vehicle.kind).check_gains(fleet.options_of(campaign), gains)
    return GateDecision(gains, proposals.gate_json(gate), reason)


KINDS: Final[dict[Variant, TrialKind]] = {"smaller step": "shorter step", "repeat": "repeat", "baseline": "baseline"}


def cancel_trial(session: Session, trial_id: int) -> Trial:
    """Cancel a trial before its lift-off. Raises ConflictError when it is too late for that."""
    row = history.trial_row(session, trial_id)
    check_action(TRIAL_ACTIONS, "cancel", row.state, f"Flight {row.number}")
    flight = history.latest_flights(session, [trial_id]).get(trial_id)
    if flight is not None and flight.state == FlightState.REQUESTED:
        set_flight_state(flight, FlightState.CANCELLED, end=not_begun("the trial was cancelled"))
    set_trial_state(row, TrialState.CANCELLED, reason="cancelled by the operator")
    return trial_view(session, row)


def require_open(session: Session, campaign: CampaignRow, spent_by: Collection[TrialState]) -> None:
    """Raise ConflictError unless the campaign can take another trial now; trials in `spent_by` use up its budget."""
    check_action(CAMPAIGN_ACTIONS, "plan", campaign.state, f"Campaign {campaign.id}")
    trials = history.trials_of(session, campaign.id)
    most, open_until = definition_of(campaign).stop.max_flights, campaign.open_until_flight
    if sum(row.state in spent_by for row in trials) >= max(most, open_until):
        raise ConflictError(
            f"The budget of campaign {campaign.id}, {describe_budget(most, open_until)}, is flown or planned.",
            hint="Cancel a planned trial, or reopen the campaign once it is finished.",
        )
    if (waiting := history.find_unreviewed(trials)) is not None:
        raise ConflictError(
            f"Flight {waiting.number} needs a review.",
            hint="Mark it valid, aborted or invalid first; the next gains depend on it.",
        )


def list_trials(session: Session, campaign_id: int, part: Part) -> Page[Trial]:
    """List trials by number. Raises NotFoundError, or InputError for a cursor of another list."""
    campaign = campaigns.get_row(session, campaign_id)
    by_number = Order("number", TrialRow.number.expression)
    wanted = repository.trials_wanted(campaign_id)
    return page_of(session, wanted, by_number, part, partial(trial_views, session, campaign))


def get_trial(session: Session, trial_id: int) -> Trial:
    """Raises NotFoundError."""
    return trial_view(session, history.trial_row(session, trial_id))


def prepare_trial(session: Session, campaign_id: int, new: TrialPlan, predictor: TrialPredictor) -> None:
    """Run the gate's simulations, whose results are kept, and predict the trial before the transaction of
    `create_trial`. Problems with the trial are reported by `create_trial`."""
    with suppress(GainlineError):
        judged, _ = _chosen(session, campaigns.get_row(session, campaign_id), new)
        if new.proposal_id is None:
            predictor.prepare(session, campaign_id, judged.gains)


def create_trial(
    session: Session,
    campaign_id: int,
    new: TrialPlan,
    context: RequestContext = LOCAL_CLI,
    *,
    predictor: TrialPredictor | None = None,
) -> Trial:
    """Plan a trial. Without a `predictor`, only the gains of a proposal have a prediction.

    Raises ConflictError for a stale proposal, an unclassified flight, a spent budget, a campaign that is over or not
    ready; GainsError that names what the gate refuses, unless that is overruled; and NotAllowedError when the client
    may not command a real vehicle.
    """
    campaign = campaigns.get_row(session, campaign_id)
    require_may(Permission.REVIEW, campaign.vehicle, context)
    require_open(session, campaign, BUDGETED_TRIAL_STATES)
    judged, proposal = _chosen(session, campaign, new)
    gains = judged.gains
    number = repository.next_number(session, campaign_id)
    row = TrialRow(
        campaign_id=campaign_id,
        number=number,
        state=TrialState.PLANNED,
        gains=gains,
        kind=_kind(session, campaign, gains, proposal) if new.variant is None else KINDS[new.variant],
        gate=judged.gate,
        overrule_reason=judged.overrule_reason,
        note=new.note,
        seed=flight_seed(definition_of(campaign).seed, number),
    )
    found = None if proposal is not None or predictor is None else predictor.predict(session, campaign, gains)
    if proposal is not None:
        row.proposal_id = proposal.id
        row.predicted_error, row.predicted_interval = proposal.predicted_error, proposal.interval
    elif found is not None:
        row.predicted_error = found.predicted_error
        row.predicted_interval = None if found.interval is None else asdict(found.interval)
        with suppress(TrajectoryError):  # a curve that single precision cannot hold is not drawn
            row.predicted = None if found.predicted is None else pack(found.predicted)
    return trial_view(session, added(session, row))


def reopen_campaign(
    session: Session,
    campaign_id: int,
    asked: Reopening,
    context: RequestContext,
    *,
    predictor: TrialPredictor | None = None,
) -> Campaign:
    """Reopen a finished campaign, and plan trials. Raises what `create_trial` and `campaigns.reopen_campaign` raise."""
    campaigns.reopen_campaign(session, campaign_id, asked.flights, context)
    for variant in asked.plan:
        create_trial(session, campaign_id, TrialPlan(variant=variant), context, predictor=predictor)
    return campaigns.get_campaign(session, campaign_id)


def edit_trial(session: Session, trial_id: int, edit: TrialEdit) -> Trial:
    """Change a trial's note. Raises ConflictError when another client changed the trial first."""
    row = history.trial_row(session, trial_id)
    check_version(edit.version, row.version, f"Flight {row.number}", {"note": (row.note, edit.note)})
    row.note = edit.note
    row.version += 1
    return trial_view(session, row)


def _chosen(session: Session, campaign: CampaignRow, new: TrialPlan) -> tuple[GateDecision, ProposalRow | None]:
    """The gains that may fly, and the proposal that they come from, if any."""
    own = new.gains if new.variant is None else None
    if sum(given is not None for given in (new.proposal_id, own, new.variant)) != 1:
        raise InputError(
            "A trial flies a proposal, custom gains or a variant.",
            hint="Send exactly one of them.",
            problems=(Problem("proposal_id", "or gains or variant: exactly one is required"),),
        )
    if new.proposal_id is None:
        asked = own if new.variant is None else _of_variant(session, campaign, new.variant, new.gains)
        assert asked is not None
        return check_own_gains(session, campaign, asked, overrule=new.overrule), None
    proposal = proposals.fresh_proposal(session, campaign, new.proposal_id)
    # Its stored gate result was computed on the same history.
    return _judged(campaign, proposal.gains, proposals.gate_of(proposal.gate), new.overrule), proposal


def _of_variant(session: Session, campaign: CampaignRow, variant: Variant, shown: Gains | None) -> Gains:
    """The variant's gains. Raises ConflictError when they are not those that the client has shown."""
    gains = proposals.variant_gains(session, campaign, variant)
    if shown is not None and dict(shown) != gains:
        raise ConflictError(
            f"The gains of the {variant} have changed since they were shown.",
            hint="Check the new gains, then request the flight again.",
        )
    return gains


def _kind(session: Session, campaign: CampaignRow, gains: Gains, proposal: ProposalRow | None) -> TrialKind:
    if proposal is not None and proposal.kind != "none":
        return proposal.kind
    flown = history.in_history(history.trials_of(session, campaign.id))
    return "repeat" if any(row.gains == gains for row in flown) else "manual"
