"""The gate before a trial, for a person's own gains and for proposals, and refusals that an operator overrules."""

from dataclasses import dataclass

from sqlalchemy.orm import Session

from app.campaigns import proposing
from app.campaigns.definitions import definition_of
from app.core.experiments import experiment_of
from app.core.gate import GateResult, check_policy, require_flyable
from app.core.policy import Gains
from app.db.models import CampaignRow, JsonObject, ProposalRow
from app.fleet import service as fleet
from app.trials import history
from app.vehicles.open import get_kind


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
    """Check a person's own gains, given what was known of the vehicle when the latest proposal was computed.

    Takes about 0.1 s. Raises GainsError that names what is refused and what would pass.
    """
    gains, gate = _asked(session, campaign, asked)
    return _judged(campaign, gains, gate, overrule)


def check_flown_gains(session: Session, campaign: CampaignRow, flown: Gains) -> GateDecision:
    """Check gains that were flown elsewhere; returns the gate's result whether or not they pass.

    Raises GainsError when they are not the campaign's gains.
    """
    gains, gate = _asked(session, campaign, flown)
    return GateDecision(gains, proposing.gate_json(gate), "")


def _asked(session: Session, campaign: CampaignRow, asked: Gains) -> tuple[dict[str, float], GateResult]:
    """The gains, complete and in order, and the gate's result."""
    definition = definition_of(campaign)
    experiment, space = experiment_of(definition), proposing.space_of(definition)
    gains = space.complete(asked)
    flown = history.flown_gains(history.trials_of(session, campaign.id))
    searched = definition.start.kind == "simplex" and not any(flight.outcome == "valid" for flight in flown)
    gate = check_policy(
        definition,
        experiment,
        space,
        gains,
        flown,
        start=proposing.stored_start(session, campaign) if searched else None,
        spread=proposing.stored_distribution(session, campaign, experiment),
    )
    return gains, gate


def check_proposal(campaign: CampaignRow, proposal: ProposalRow, *, overrule: str | None = None) -> GateDecision:
    """Decide on a fresh proposal by its stored gate result, which was computed on the same history.

    Raises GainsError as `check_own_gains` does.
    """
    return _judged(campaign, proposal.gains, proposing.gate_of(proposal.gate), overrule)


def _judged(campaign: CampaignRow, gains: dict[str, float], gate: GateResult, overrule: str | None) -> GateDecision:
    reason = require_flyable(gate, overrule=overrule or "", is_real=campaign.vehicle.is_real)
    if reason:
        get_kind(campaign.vehicle.kind).check_gains(fleet.options_of(campaign), gains)
    return GateDecision(gains, proposing.gate_json(gate), reason)
