"""Rehearsals: whether a campaign on a real vehicle was first flown on a simulation with the same definition."""

from collections.abc import Collection, Sequence
from typing import Final

from sqlalchemy.orm import Session

from app.campaigns import repository
from app.campaigns.definitions import definition_of
from app.campaigns.schemas import Rehearsal, RehearsalState
from app.common.errors import ConflictError
from app.common.states import FLOWN_TRIAL_STATES, Outcome, TrialState
from app.core.formatting import count
from app.db.models import CampaignRow
from app.fleet import service as fleet

FLIGHTS: Final = 3
"""Number of valid flights that passes a rehearsal, unless the campaign's own rule ends it earlier."""
_FAILED_STATES: Final = frozenset({TrialState.ABORTED, TrialState.INVALID, TrialState.LOST})


def rehearsal_result(trials: Sequence[repository.GatedTrial], outcome: Outcome | None) -> tuple[RehearsalState, str]:
    """State of a rehearsal by its flights, and the reason. `outcome` is None until its campaign is finished.

    Passed: at least FLIGHTS valid flights, or as many as the campaign's own rule took to end it; none of them aborted,
    invalid or lost, and none with gains that the gate refused.
    """
    flown = [trial for trial in trials if trial.state in FLOWN_TRIAL_STATES]
    if (spoilt := next((trial for trial in flown if trial.state in _FAILED_STATES), None)) is not None:
        return (
            "failed",
            f"flight {spoilt.number} {'was' if spoilt.state == TrialState.ABORTED else 'is'} {spoilt.state}",
        )
    if (refused := next((trial for trial in flown if not trial.gate_passed), None)) is not None:
        return "failed", f"the gate refused the gains of flight {refused.number} and was overruled"
    valid = sum(trial.state == TrialState.VALID for trial in flown)
    ended_by_rule = outcome is not None and outcome != Outcome.STOPPED
    if valid >= FLIGHTS or (valid and ended_by_rule):
        return "passed", f"{count(valid, 'valid flight')}, nothing aborted, invalid or refused"
    if outcome is not None:
        when = f"after {count(valid, 'valid flight')}" if valid else "before a valid flight"
        return "failed", f"it was stopped {when}; {FLIGHTS} are required"
    return "under way", f"{valid} of {FLIGHTS} valid flights"


def rehearsal_of(session: Session, campaign: CampaignRow) -> Rehearsal:
    """State of a campaign's latest rehearsal with exactly the same definition, safe gains included.

    After the campaign's first flight both are frozen, so later safe gains of the vehicle need no other rehearsal.
    """
    if not fleet.needs_staging(campaign.vehicle):
        return Rehearsal(state="not needed", campaign_id=None, reason="")
    held = repository.rehearsals(session, campaign.id)
    wanted = definition_of(campaign).digest()
    flown = (row for row in held if not row.vehicle.is_real and definition_of(row).digest() == wanted)
    row = next(flown, None)
    if row is not None:
        state, reason = rehearsal_result(repository.gated(session, row.id), row.outcome)
        return Rehearsal(state=state, campaign_id=row.id, reason=reason)
    if campaign.definition_digest is not None:
        return Rehearsal(state="not needed", campaign_id=None, reason="it flew before rehearsals were required")
    changed = "its definition, or its vehicle's safe gains, have changed since the last rehearsal"
    return Rehearsal(
        state="missing", campaign_id=None, reason=changed if held else "it has not been flown on a simulation"
    )


def passed_rehearsals(session: Session, campaign_ids: Collection[int]) -> set[int]:
    """Ids of those campaigns that are the rehearsal of another one and let it fly."""
    rehearsed = repository.rehearsed_ids(session, campaign_ids)
    found = (rehearsal_of(session, repository.get_campaign(session, real_id)) for real_id in set(rehearsed.values()))
    passed = {result.campaign_id for result in found if result.state == "passed"}
    return {rehearsal_id for rehearsal_id in rehearsed if rehearsal_id in passed}


def is_rehearsal_satisfied(rehearsal: Rehearsal) -> bool:
    return rehearsal.state in {"not needed", "passed"}


def require_rehearsed(session: Session, campaign: CampaignRow) -> None:
    """Raise ConflictError while a campaign on a real vehicle has no rehearsal that passed."""
    result = rehearsal_of(session, campaign)
    if not is_rehearsal_satisfied(result):
        where = "on its simulation" if result.campaign_id is None else f"in campaign {result.campaign_id}"
        raise ConflictError(
            f"{campaign.vehicle.name} is a real vehicle, and campaign {campaign.id} has not passed its rehearsal "
            f"({result.reason}).",
            hint=f"Rehearse it {where} first: fly {FLIGHTS} valid flights, or fly it until its stop rule "
            "ends it, with no flight aborted, invalid or lost and no gains refused by the gate.",
        )
