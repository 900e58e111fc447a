"""A person's decision on a flight: valid or not, and whether an abort counts against its gains."""

from sqlalchemy.orm import Session

from app.accounts.permissions import LOCAL_CLI, Permission, RequestContext
from app.campaigns import history, proposals
from app.campaigns.definitions import experiment_of_campaign
from app.campaigns.history import set_trial_state
from app.campaigns.trials.records import Score, keep_response, score
from app.campaigns.trials.schemas import AbortJudgement, Classification, Trial
from app.campaigns.trials.views import reason_of, trial_view
from app.common.conflict_checks import check_action, check_transition, check_version
from app.common.errors import ConflictError, InputError, Problem
from app.common.states import CAMPAIGN_ACTIONS, TRIAL_ACTIONS, TRIAL_TRANSITIONS, TrialState
from app.db.models import TrialRow
from app.fleet.control import require_may


def classify_trial(
    session: Session, trial_id: int, classification: Classification, context: RequestContext = LOCAL_CLI
) -> Trial:
    """Classify a flight by a person's decision. The next gains are computed again from what counts now; a campaign that
    its stop rule has finished is reopened if the rule is no longer met.

    Raises ConflictError when the transition is not in the table or another client changed the trial first, InputError
    when a flight without a usable record is to count, NotAllowedError when the client may not command a real vehicle.
    """
    row = history.trial_row(session, trial_id)
    require_may(Permission.REVIEW, row.campaign.vehicle, context)
    outcome = TrialState(classification.outcome)
    check_version(
        classification.version,
        row.version,
        f"Flight {row.number}",
        {"outcome": (row.state, outcome), "reason": (reason_of(row), classification.reason)},
    )
    check_action(TRIAL_ACTIONS, "classify", row.state, f"Flight {row.number}")
    check_transition(TRIAL_TRANSITIONS, row.state, outcome, f"Flight {row.number}")
    check_action(CAMPAIGN_ACTIONS, "judge", row.campaign.state, f"Campaign {row.campaign_id}")
    row.error = None
    if outcome == TrialState.VALID:
        counted = _counted_score(session, row)
        row.error = counted.error
        keep_response(row, counted.response)
    set_trial_state(row, outcome, reason=classification.reason)
    row.version += 1
    proposals.history_changed(session, row.campaign)
    return trial_view(session, row)


def judge_abort(
    session: Session, trial_id: int, judgement: AbortJudgement, context: RequestContext = LOCAL_CLI
) -> Trial:
    """Record why the operator aborted a flight; the next gains are computed again from what counts now.

    Raises ConflictError when the trial is not aborted, when the program aborted it for a limit, or when another client
    changed the trial first; NotAllowedError when the client may not command a real vehicle.
    """
    row = history.trial_row(session, trial_id)
    require_may(Permission.REVIEW, row.campaign.vehicle, context)
    check_version(
        judgement.version, row.version, f"Flight {row.number}", {"cause": (row.abort_cause or "", judgement.cause)}
    )
    check_action(TRIAL_ACTIONS, "judge abort", row.state, f"Flight {row.number}")
    check_action(CAMPAIGN_ACTIONS, "judge", row.campaign.state, f"Campaign {row.campaign_id}")
    if row.abort_cause == "limit":
        raise ConflictError(
            f"Flight {row.number} was aborted automatically because a limit was exceeded: it counts against its gains.",
            hint="If the measurement is wrong, mark it invalid.",
        )
    row.abort_cause = judgement.cause
    row.version += 1
    proposals.history_changed(session, row.campaign)
    return trial_view(session, row)


def _counted_score(session: Session, row: TrialRow) -> Score:
    """Score of a flight that a person counts in spite of its gaps. Raises InputError for an aborted or unscorable
    flight."""
    if row.ending == "aborted":
        raise InputError(
            f"Flight {row.number} cannot be valid: its record ends at the abort.",
            hint="Mark it aborted or leave it invalid, and fly the gains again.",
            problems=(Problem("outcome", "cannot be valid: the flight was aborted"),),
        )
    judged = (
        None
        if row.trajectory_id is None
        else score(experiment_of_campaign(row.campaign), history.record_of(session, row), accept_gaps=True)
    )
    if judged is None or judged.error is None:
        reason = judged.refusal if judged is not None else "it has no record"
        raise InputError(
            f"Flight {row.number} cannot be valid: it cannot be scored.",
            hint="Leave it invalid and fly the gains again.",
            problems=(Problem("outcome", reason),),
        )
    return judged
