"""Operations on trials for clients: people and scripts. The worker's side of a flight is in `flights`."""

from collections.abc import Collection
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from sqlalchemy.orm import Session

from app.accounts.permissions import LOCAL_CLI, Permission, RequestContext
from app.campaigns import proposing
from app.campaigns import service as campaigns
from app.campaigns.definitions import definition_of
from app.common.data_folder import log_of_trial, telemetry_log
from app.common.errors import ConflictError, NotFoundError
from app.common.schemas import Page, decode_cursor, encode_cursor
from app.common.state_machine import check_action, check_transition, check_version
from app.common.states import (
    BUDGETED_TRIAL_STATES,
    CAMPAIGN_ACTIONS,
    HISTORY_TRIAL_STATES,
    TRIAL_ACTIONS,
    TRIAL_TRANSITIONS,
    FlightState,
    TrialKind,
    TrialState,
)
from app.core.definition import flight_seed
from app.core.errors import GainlineError, InputError, Problem
from app.core.experiments import get_experiment
from app.core.policy import Gains
from app.db.models import CampaignRow, ProposalRow, TrialRow
from app.db.types import utc_now
from app.fleet import service as fleet
from app.fleet.control import require_may
from app.logs.takeoffs import Takeoff
from app.processes.sandbox import FILE, run_limited
from app.trials import history, repository
from app.trials.capture import capture
from app.trials.judging import GateDecision, check_own_gains, check_proposal
from app.trials.lifecycle import set_flight_state, set_trial_state
from app.trials.records import settle_gains
from app.trials.schemas import AbortJudgement, Classification, NewTrial, Trial, TrialEdit
from app.trials.schemas import Trajectory as TrajectoryOut
from app.trials.scoring import score
from app.trials.variants import KINDS, gains_of
from app.trials.views import trajectory_view, trial_view, trial_views


def cancel_trial(session: Session, trial_id: int) -> Trial:
    """Cancel a trial before its lift-off. Raises ConflictError when it is too late for that."""
    row = repository.get_one(session, trial_id)
    check_action(TRIAL_ACTIONS, "cancel", row.state, f"Trial {row.number}")
    flight = repository.latest_flights(session, [trial_id]).get(trial_id)
    if flight is not None and flight.state == FlightState.REQUESTED:
        set_flight_state(flight, FlightState.CANCELLED, problem="the trial was cancelled")
    set_trial_state(row, TrialState.CANCELLED, reason="cancelled by the operator")
    return trial_view(session, campaigns.get_row(session, row.campaign_id), row)


def require_open(session: Session, campaign: CampaignRow, spent_by: Collection[TrialState]) -> None:
    """Raise ConflictError unless the campaign can take another trial now; trials in `spent_by` use up its budget."""
    check_action(CAMPAIGN_ACTIONS, "plan", campaign.state, f"Campaign {campaign.id}")
    trials = history.trials_of(session, campaign.id)
    budget = definition_of(campaign).stop.max_flights
    if sum(row.state in spent_by for row in trials) >= budget:
        raise ConflictError(
            f"The budget of campaign {campaign.id}, {budget} flights, is flown or planned for.",
            hint="Cancel a trial that is only planned, or clone the campaign to fly on.",
        )
    if (waiting := history.find_unreviewed(trials)) is not None:
        raise ConflictError(
            f"Flight {waiting.number} waits for its class.",
            hint="Say first whether it is valid, aborted or invalid: the next gains depend on it.",
        )


def list_trials(session: Session, campaign_id: int, *, limit: int, cursor: str | None) -> Page[Trial]:
    """List trials by number. Raises NotFoundError, or InputError for a cursor of another list."""
    campaign = campaigns.get_row(session, campaign_id)
    after = 0 if cursor is None else decode_cursor("number", cursor, float)[1]
    rows, total = repository.page(session, campaign_id, after_number=after, limit=limit)
    following = encode_cursor("number", (0, rows[limit - 1].number)) if len(rows) > limit else None
    return Page(items=trial_views(session, campaign, rows[:limit]), total=total, next_cursor=following)


def get_trial(session: Session, trial_id: int) -> Trial:
    """Raises NotFoundError."""
    return _seen(session, repository.get_one(session, trial_id))


def create_trial(session: Session, campaign_id: int, new: NewTrial, context: RequestContext = LOCAL_CLI) -> Trial:
    """Plan a trial; `fly` is not read here.

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
        proposal_id=None if proposal is None else proposal.id,
        predicted_error=None if proposal is None else proposal.predicted_error,
        predicted_interval=None if proposal is None else proposal.interval,
        gate=judged.gate,
        overrule_reason=judged.overrule_reason,
        note=new.note,
        seed=flight_seed(definition_of(campaign).seed, number),
    )
    session.add(row)
    session.flush()
    return trial_view(session, campaign, row)


def warm_gate_cache_for_new(session: Session, campaign_id: int, new: NewTrial) -> None:
    """Run the gate's simulations before the transaction of `create_trial` needs the results, which are cached.

    Problems with the trial are reported by `create_trial`.
    """
    with suppress(GainlineError):
        _chosen(session, campaigns.get_row(session, campaign_id), new)


def edit_trial(session: Session, trial_id: int, edit: TrialEdit) -> Trial:
    """Change a trial's note. Raises ConflictError when another client changed the trial first."""
    row = repository.get_one(session, trial_id)
    check_version(edit.version, row.version, f"Trial {row.number}", {"note": (row.note, edit.note)})
    row.note = edit.note
    row.version += 1
    return _seen(session, row)


def classify_trial(session: Session, trial_id: int, said: Classification, context: RequestContext = LOCAL_CLI) -> Trial:
    """Classify a flight by a person's decision; the next gains are computed again from what counts now.

    Raises ConflictError when the transition is not in the table or another client changed the trial first, InputError
    when a flight without a usable record is to count, NotAllowedError when the client may not command a real vehicle.
    """
    row = repository.get_one(session, trial_id)
    campaign = campaigns.get_row(session, row.campaign_id)
    require_may(Permission.REVIEW, campaign.vehicle, context)
    outcome = TrialState(said.outcome)
    check_version(
        said.version,
        row.version,
        f"Trial {row.number}",
        {"outcome": (row.state, outcome), "reason": (row.reason, said.reason)},
    )
    check_action(TRIAL_ACTIONS, "classify", row.state, f"Trial {row.number}")
    check_transition(TRIAL_TRANSITIONS, row.state, outcome, f"Trial {row.number}")
    check_action(CAMPAIGN_ACTIONS, "judge", campaign.state, f"Campaign {campaign.id}")
    row.error = _counted_error(session, campaign, row) if outcome == TrialState.VALID else None
    set_trial_state(row, outcome, reason=said.reason)
    row.version += 1
    campaigns.history_changed(session, campaign)
    return trial_view(session, campaign, row)


def judge_abort(session: Session, trial_id: int, said: AbortJudgement, context: RequestContext = LOCAL_CLI) -> Trial:
    """Record why the operator aborted a flight; the next gains are computed again from what counts now.

    Raises ConflictError when the trial is not aborted, when the program aborted it for a limit, or when another client
    changed the trial first; NotAllowedError when the client may not command a real vehicle.
    """
    row = repository.get_one(session, trial_id)
    campaign = campaigns.get_row(session, row.campaign_id)
    require_may(Permission.REVIEW, campaign.vehicle, context)
    check_version(said.version, row.version, f"Trial {row.number}", {"cause": (row.abort_cause or "", said.cause)})
    check_action(TRIAL_ACTIONS, "judge abort", row.state, f"Trial {row.number}")
    check_action(CAMPAIGN_ACTIONS, "judge", campaign.state, f"Campaign {campaign.id}")
    if row.abort_cause == "limit":
        raise ConflictError(
            f"Trial {row.number} was broken off by the program, for a limit: it counts against its gains.",
            hint="If the measurement is no good, mark it invalid.",
        )
    row.abort_cause = said.cause
    row.version += 1
    campaigns.history_changed(session, campaign)
    return trial_view(session, campaign, row)


def read_record(
    stream: BinaryIO, *, name: str = "", takeoff: int | None = None, companion: BinaryIO | None = None
) -> Takeoff:
    """Read a takeoff from a log of any format.

    Raises TrajectoryError; where the log holds several takeoffs, it names them.
    """
    from app.logs.readers import read_takeoff  # noqa: PLC0415 - imports every reader

    return read_takeoff(stream, name=name, number=takeoff, companion=companion)


def read_upload(content: bytes, *, name: str, takeoff: int | None, companion: bytes | None) -> Takeoff:
    """Read a takeoff from an uploaded file, in a process with limits. Raises InputError when it exceeds them."""
    from app.logs.readers import read_content  # noqa: PLC0415 - imports every reader

    return run_limited(FILE, read_content, content, name=name, number=takeoff, companion=companion)


def import_record(
    session: Session, trial_id: int, flown: Takeoff, context: RequestContext = LOCAL_CLI, *, confirmed: bool = False
) -> Trial:
    """Import the record of a flight made elsewhere, or the recovered record of a lost flight; score and classify it.

    Raises ConflictError when the trial takes no record, UnconfirmedError when the log was flown with other gains and
    that is not `confirmed`, TrajectoryError when the record cannot be stored, NotAllowedError when the client may not
    command a real vehicle.
    """
    row = repository.get_one(session, trial_id)
    campaign = campaigns.get_row(session, row.campaign_id)
    require_may(Permission.REVIEW, campaign.vehicle, context)
    check_action(TRIAL_ACTIONS, "upload", row.state, f"Trial {row.number}")
    if row.state == TrialState.LOST:
        check_action(CAMPAIGN_ACTIONS, "judge", campaign.state, f"Campaign {campaign.id}")
        settle_gains(session, campaign, row, flown, confirmed=confirmed)
        capture(session, campaign, row, flown.trajectory)
        campaigns.history_changed(session, campaign)
        return trial_view(session, campaign, row)
    if fleet.can_fly(campaign.vehicle):
        raise ConflictError(
            f"Trial {row.number} is flown from here, by {campaign.vehicle.title}.",
            hint="Fly it; records are uploaded to campaigns whose vehicle is `import`.",
        )
    require_open(session, campaign, HISTORY_TRIAL_STATES)
    settle_gains(session, campaign, row, flown, confirmed=confirmed)
    campaigns.start_flying(campaign)
    row.flown_at = utc_now()
    capture(session, campaign, row, flown.trajectory)
    campaigns.finish_flying(session, campaign)
    return trial_view(session, campaign, row)


def import_into_campaign(
    session: Session, campaign: str, flown: Takeoff, *, number: int | None, confirmed: bool
) -> Trial:
    """Import a record for the trial of the given number, else for the one that waits for a record.

    If no trial waits, one is planned from the proposal first. `campaign` is an id or a name. Raises NotFoundError,
    InputError when several campaigns or trials match, and what `import_record` raises.
    """
    campaign_id = campaigns.find_by_id_or_name(session, campaign)
    row = campaigns.get_row(session, campaign_id)
    trials = history.trials_of(session, campaign_id)
    if number is not None:
        chosen = [trial for trial in trials if trial.number == number]
        if not chosen:
            raise NotFoundError("trial", number, hint=f"Campaign {campaign_id} has {len(trials)} trials.")
    else:
        waits = {TrialState.LOST} if fleet.can_fly(row.vehicle) else TRIAL_ACTIONS["upload"]
        chosen = [trial for trial in trials if trial.state in waits]
    if len(chosen) > 1:
        raise InputError(
            f"{len(chosen)} trials of campaign {campaign_id} wait for a record.",
            hint="Say which one is meant, by its number: --trial.",
            problems=tuple(Problem("trial", f"{trial.number}: {trial.state}") for trial in chosen),
        )
    if chosen:
        return import_record(session, chosen[0].id, flown, confirmed=confirmed)
    proposal = proposing.require_fresh_proposal(session, row)
    planned = create_trial(session, campaign_id, NewTrial(proposal_id=proposal.id))
    return import_record(session, planned.id, flown, confirmed=confirmed)


def get_trajectory(session: Session, trial_id: int, points: int) -> TrajectoryOut:
    """Thinned record of a trial. Raises NotFoundError when there is none, StorageError when it is damaged."""
    row = repository.get_one(session, trial_id)
    return trajectory_view(campaigns.get_row(session, row.campaign_id), row, history.record_of(session, row), points)


@dataclass(frozen=True, slots=True)
class Export:
    """A full record as CSV."""

    file_name: str
    csv: str
    checksum: str


def export_trajectory(session: Session, trial_id: int) -> Export:
    """Export every sample with nine digits, which restore the stored single-precision number exactly."""
    row = repository.get_one(session, trial_id)
    record = history.record_of(session, row)
    assert row.trajectory is not None
    table = np.column_stack([record.time_s, *record.channels.values()])
    lines = [",".join(["time_s", *record.channels]), *(",".join(f"{number:.9g}" for number in line) for line in table)]
    return Export(
        f"campaign-{row.campaign_id}-trial-{row.number}.csv", "\n".join(lines) + "\n", row.trajectory.checksum
    )


@dataclass(frozen=True, slots=True)
class TelemetryLog:
    """A flight's .tlog and its file name for download."""

    file: Path
    name: str


def find_telemetry_log(session: Session, trial_id: int, data_dir: Path) -> TelemetryLog:
    """Telemetry log of the trial's last flight that has one, else the one imported with the trial.

    Raises NotFoundError when there is none.
    """
    row = repository.get_one(session, trial_id)
    flown = [telemetry_log(data_dir, flight_id) for flight_id in repository.flight_ids(session, trial_id)]
    for file in (*flown, log_of_trial(data_dir, trial_id)):
        if file.is_file():
            return TelemetryLog(file, f"campaign-{row.campaign_id}-trial-{row.number}.tlog")
    raise NotFoundError(
        "telemetry log of trial", trial_id, hint="Only flights of vehicles that are flown over a link leave one."
    )


def _seen(session: Session, row: TrialRow) -> Trial:
    return trial_view(session, campaigns.get_row(session, row.campaign_id), row)


def _chosen(session: Session, campaign: CampaignRow, new: NewTrial) -> tuple[GateDecision, ProposalRow | None]:
    """The gains that may fly, and the proposal that they come from, if any."""
    if sum(given is not None for given in (new.proposal_id, new.gains, new.variant)) != 1:
        raise InputError(
            "A trial flies a proposal, gains of one's own, or a variant.",
            hint="Send exactly one of the three.",
            problems=(Problem("proposal_id", "or gains or variant, exactly one of the three, must be given"),),
        )
    if new.proposal_id is None:
        asked = new.gains if new.variant is None else gains_of(session, campaign, new.variant)
        assert asked is not None
        return check_own_gains(session, campaign, asked, overrule=new.overrule), None
    proposal = proposing.fresh_proposal(session, campaign, new.proposal_id)
    return check_proposal(campaign, proposal, overrule=new.overrule), proposal


def _kind(session: Session, campaign: CampaignRow, gains: Gains, proposal: ProposalRow | None) -> TrialKind:
    if proposal is not None and proposal.kind != "none":
        return proposal.kind
    flown = history.in_history(history.trials_of(session, campaign.id))
    return "repeat" if any(row.gains == gains for row in flown) else "manual"


def _counted_error(session: Session, campaign: CampaignRow, row: TrialRow) -> float:
    """Error of a flight that a person counts in spite of its gaps. Raises InputError for an aborted or unscorable
    flight."""
    if row.ending == "aborted":
        raise InputError(
            f"Trial {row.number} cannot count: its record ends where the flight was broken off.",
            hint="Class it as aborted or leave it invalid, and fly the gains again.",
            problems=(Problem("outcome", "cannot be valid: the flight was broken off"),),
        )
    judged = (
        None
        if row.trajectory_id is None
        else score(get_experiment(campaign.experiment), history.record_of(session, row), accept_gaps=True)
    )
    if judged is None or judged.error is None:
        reason = judged.refusal if judged is not None else "it left no record"
        raise InputError(
            f"Trial {row.number} cannot count: it cannot be scored.",
            hint="Leave it invalid and fly the gains again.",
            problems=(Problem("outcome", reason),),
        )
    return judged.error
