"""Records of trials, in and out: import of a log, capture of a flight, score, export.

A record is scored as it is stored, in single precision.
"""

import math
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final

import numpy as np
from sqlalchemy.orm import Session

from app.accounts.permissions import LOCAL_CLI, Permission, RequestContext
from app.autopilots.takeoffs import Takeoff
from app.campaigns import history, proposals, repository
from app.campaigns import service as campaigns
from app.campaigns.definitions import experiment_of_campaign
from app.campaigns.flight_predictions import TrialPredictor
from app.campaigns.history import set_trial_state
from app.campaigns.trials.record_doubts import (
    UNSCORABLE,
    Accepted,
    find_doubts,
    reason_of,
    unconfirmed,
)
from app.campaigns.trials.schemas import Trajectory as TrajectoryOut
from app.campaigns.trials.schemas import Trial, TrialPlan
from app.campaigns.trials.service import create_trial, gated_gains, require_open
from app.campaigns.trials.views import trial_view, units_of
from app.common.conflict_checks import check_action
from app.common.data_folder import log_of_trial, telemetry_log
from app.common.errors import ConflictError, InputError, NotFoundError, Problem, UnconfirmedError
from app.common.states import (
    CAMPAIGN_ACTIONS,
    HISTORY_TRIAL_STATES,
    TRIAL_ACTIONS,
    AbortCause,
    CampaignState,
    Ending,
    TrialState,
)
from app.core.errors import TrajectoryError
from app.core.experiments.base import Experiment
from app.core.formatting import EXACT_DIGITS, count, format_gains
from app.core.records.glitches import find_glitches, repaired
from app.core.records.metrics import StepResponse, step_response
from app.core.records.plausibility import Reading, find_readings, read_as
from app.core.records.trajectory import Trajectory, select_samples
from app.core.tuning.stop_rules import battery_v
from app.db.base import utc_now
from app.db.models import TrialRow
from app.db.trajectories import pack, unpack
from app.fleet import service as fleet
from app.fleet.control import require_may
from app.processes.calls import FILE, run_limited
from app.vehicles.flight_end import FlightEnd, Requester

CURVE_POINTS: Final = 48
_CAUSES: Final[Mapping[Requester | None, AbortCause]] = {None: "limit", Requester.PROGRAM_STOPPED: "something else"}
"""Causes of aborts that a person has not given: if Gainline was stopped, there is nothing to ask the operator."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """Score of a record. `error` is in the experiment's unit, or None with the reason in `refusal`."""

    error: float | None
    refusal: str
    response: StepResponse | None
    curve: list[list[float]]


def score(experiment: Experiment, trajectory: Trajectory, *, accept_gaps: bool = False) -> Score:
    """Score a record as stored. `accept_gaps`: a person has decided that its gaps are harmless."""
    error, refusal = None, ""
    try:
        error = experiment.error(trajectory, accept_gaps=accept_gaps)
    except TrajectoryError as found:
        named = {"time_s": "the record", experiment.output: f"the {experiment.output.partition('_')[0]}"}
        refusal = "; ".join(f"{named.get(each.field, each.field)} {each.reason}" for each in found.problems)
        refusal = refusal or found.message
    output = trajectory.channels.get(experiment.output)
    if output is None:
        return Score(error=error, refusal=refusal, response=None, curve=[])
    flown = trajectory.time_s >= 0.0
    time_s, values = trajectory.time_s[flown], output[flown]
    return Score(
        error=error,
        refusal=refusal,
        response=step_response(trajectory.time_s, output, experiment.set_point, float(experiment.grid_s[-1])),
        curve=[
            [round(float(time_s[index]), 3), round(float(values[index]), 4)]
            for index in select_samples(time_s, values, CURVE_POINTS)
        ],
    )


def capture(
    row: TrialRow,
    trajectory: Trajectory,
    *,
    ending: Ending = "completed",
    end: FlightEnd | None = None,
    reason: str = "",
) -> None:
    """Store a flight's record and classify the flight. `end` is how it ended, if it was flown here; `reason` why the
    measurement of another is `invalid`.

    An `aborted` flight is classified as that; others are classified by the program where it may. A flight of a real
    vehicle stays captured until a person classifies it. A flight that can be scored but has glitches in its record
    stays captured too. A flight that was aborted on request counts against its gains only once a person says that the
    vehicle behaved badly. Raises TrajectoryError when the record cannot be stored.
    """
    row.trajectory = pack(trajectory)
    recorded = unpack(row.trajectory)
    experiment = experiment_of_campaign(row.campaign)
    judged = score(experiment, recorded)
    glitches = find_glitches(experiment, recorded)
    row.glitches = [asdict(glitch) for glitch in glitches]
    row.repaired_error = (
        score(experiment, repaired(experiment, recorded, glitches), accept_gaps=True).error if glitches else None
    )
    keep_response(row, judged.response)
    if ending != "completed":  # the record may go on through the landing
        row.settling_time_s = row.steady_state_error_m = None
        row.overshoot_m = row.overshoot_m or None
    row.curve = judged.curve
    row.landing_battery_v = battery_v(recorded, -1)
    row.ending, row.end = ending, end
    set_trial_state(row, TrialState.CAPTURED, reason=reason)
    if ending == "aborted":
        row.abort_cause = _CAUSES.get(end.requested_by if end else None, "operator")
        set_trial_state(row, TrialState.ABORTED)
        return
    row.error = judged.error  # shown before a person classifies the flight, which scores it again
    if not fleet.is_classed_automatically(row.campaign.vehicle):
        return
    if row.error is None or ending == "invalid":
        row.error = None
        set_trial_state(row, TrialState.INVALID, reason=reason if ending == "invalid" else judged.refusal)
    elif not glitches:
        set_trial_state(row, TrialState.VALID)


def keep_response(row: TrialRow, response: StepResponse | None) -> None:
    """Store a flight's step response with its trial."""
    if response is None:
        return
    row.rise_time_s, row.settling_time_s = response.rise_time_s, response.settling_time_s
    row.overshoot_m, row.steady_state_error_m = response.overshoot, response.steady_state_error


def read_upload(content: bytes, *, name: str, takeoff: int | None, companion: bytes | None) -> Takeoff:
    """Read a takeoff from an uploaded file, in a process with limits. Raises InputError when it exceeds them."""
    from app.autopilots.log_readers import read_content  # noqa: PLC0415 - imports every reader

    return run_limited(FILE, read_content, content, name=name, number=takeoff, companion=companion)


_FIRST_FLIGHTS: Final = datetime(2005, 1, 1, tzinfo=UTC)
"""No autopilot that is read is older; a clock that was not set shows 1970 or 1980."""
_CLOCKS_DIFFER: Final = timedelta(hours=14)
"""A log in local time is at most that much ahead of UTC."""

_SINGLE_PRECISION: Final = 1e-6
"""Logs store gains as single-precision numbers."""


def _settle_gains(session: Session, row: TrialRow, flown: Takeoff, *, confirmed: bool) -> None:
    """Set the trial's gains to those in the log; a CSV file, which contains none, leaves them as planned.

    Where the values differ and that is `confirmed`, the trial takes the gains that were flown and loses the prediction
    for the planned ones. Raises InputError for a log with other gains than those of the experiment or without their
    values, UnconfirmedError that names both sets, GainsError when the flown gains are outside the campaign's bounds.
    """
    if flown.gain_names and row.gains.keys() != set(flown.gain_names):
        raise InputError(
            f"The log has the gains {', '.join(flown.gain_names)}; this campaign tunes {', '.join(row.gains)}.",
            hint="Upload it to a campaign whose experiment has these gains.",
            problems=(Problem("file", "is a log of another autopilot"),),
        )
    if not flown.gain_names:
        return
    if not flown.gains:
        raise InputError(
            "The log does not say with which gains it was flown.",
            hint="Choose a log with the vehicle's parameters: for Paparazzi's .data file add the .log file of the same "
            "name; start a telemetry log before the ground station connects. Or upload the record as a CSV file; it "
            "is then taken as flown with the planned gains.",
            problems=(Problem("file", f"does not contain values of {', '.join(row.gains)}"),),
        )
    if all(
        math.isclose(value, flown.gains[name], rel_tol=_SINGLE_PRECISION, abs_tol=_SINGLE_PRECISION)
        for name, value in row.gains.items()
    ):
        row.read_back = row.read_back or dict(row.gains)
        return
    if not confirmed:
        held = format_gains(flown.gains, EXACT_DIGITS)
        raise UnconfirmedError(
            f"The log was flown with {held}, not with the planned {format_gains(row.gains, EXACT_DIGITS)}.",
            hint="Choose the log of this flight, or confirm that the trial takes the gains in the log.",
            problems=(Problem("confirm", f"the log was flown with {held}"),),
        )
    row.read_back = dict(flown.gains)
    row.gains, gate = gated_gains(session, row.campaign, flown.gains)
    row.gate, row.kind = proposals.gate_json(gate), "manual"
    row.predicted_error = row.predicted_interval = None
    if (curve := row.predicted) is not None:
        row.predicted = None
        session.delete(curve)


def _dated(flown: Takeoff) -> tuple[datetime, Takeoff]:
    """When the takeoff was flown, and the takeoff whose record's source says from where that is known: from its log, if
    the date there is possible, else it is taken for the present time."""
    at, now = flown.began_at, utc_now()
    if at is None:
        return now, flown
    is_possible = _FIRST_FLIGHTS <= at <= now + _CLOCKS_DIFFER
    basis = "date by the log's clock, taken as UTC" if is_possible else f"date unknown: {at:%Y-%m-%d} in the log"
    source = f"{flown.trajectory.source}; {basis}"
    return at if is_possible else now, replace(flown, trajectory=replace(flown.trajectory, source=source))


def _capture_import(row: TrialRow, flown: Takeoff, accepted: Accepted) -> None:
    """Capture the record, as an invalid one if it begins at lift-off or is implausible. Unless that is accepted, raises
    UnconfirmedError for such a record, and for one that cannot be scored, or, of a flight flown elsewhere, has gaps."""
    experiment = experiment_of_campaign(row.campaign)
    expected = None if row.state == TrialState.LOST or not flown.is_commanded else experiment.expected
    record = read_as(flown.trajectory, accepted.reads_as)
    unscorable = score(experiment, record, accept_gaps=expected is None).refusal
    doubts = find_doubts(expected, record, unscorable, is_commanded=flown.is_commanded)
    if doubts and not accepted.invalid:
        readings = () if expected is None else find_readings(expected, record)
        is_in_si = bool(flown.gain_names)  # an autopilot's log, in which only the datum may be another
        raise unconfirmed(doubts, readings if not is_in_si or readings == (Reading.OTHER_DATUM,) else ())
    ending: Ending = "completed" if not doubts or doubts[0].code == UNSCORABLE else "invalid"
    capture(row, record, ending=ending, reason=reason_of(doubts))


def import_record(
    session: Session,
    trial_id: int,
    flown: Takeoff,
    context: RequestContext = LOCAL_CLI,
    *,
    accepted: Accepted | None = None,
) -> Trial:
    """Import the record of a flight flown elsewhere, or the recovered record of a lost flight; score and classify it.

    Raises ConflictError when the trial takes no record, UnconfirmedError when the log was flown with other gains, or
    the record cannot be scored or is implausible, and that is not `accepted`, TrajectoryError when the record cannot be
    stored, NotAllowedError when the client may not command a real vehicle.
    """
    row, accepted = history.trial_row(session, trial_id), accepted or Accepted()
    campaign = row.campaign
    require_may(Permission.REVIEW, campaign.vehicle, context)
    check_action(TRIAL_ACTIONS, "upload", row.state, f"Flight {row.number}")
    if row.state == TrialState.LOST:
        check_action(CAMPAIGN_ACTIONS, "judge", campaign.state, f"Campaign {campaign.id}")
        _settle_gains(session, row, flown, confirmed=accepted.confirm)
        _capture_import(row, flown, accepted)
        proposals.history_changed(session, campaign)
        return trial_view(session, row)
    if fleet.can_fly(campaign.vehicle):
        raise ConflictError(
            f"This campaign is flown from here, by {campaign.vehicle.title}; it accepts no records of other flights.",
            hint="Fly it, or choose a campaign whose vehicle is “Flown elsewhere”.",
        )
    require_open(session, campaign, HISTORY_TRIAL_STATES)
    _settle_gains(session, row, flown, confirmed=accepted.confirm)
    proposals.start_flying(campaign)
    row.flown_at, flown = _dated(flown)
    _capture_import(row, flown, accepted)
    proposals.finish_flying(session, campaign)
    return trial_view(session, row)


def plan_and_import(
    session: Session,
    campaign_id: int,
    plan: TrialPlan,
    flown: Takeoff,
    context: RequestContext = LOCAL_CLI,
    *,
    accepted: Accepted,
    predictor: TrialPredictor | None = None,
) -> Trial:
    """Plan a trial and import its record. Raises what `create_trial` and `import_record` raise."""
    planned = create_trial(session, campaign_id, plan, context, predictor=predictor)
    return import_record(session, planned.id, flown, context, accepted=accepted)


def import_into_campaign(
    session: Session, campaign: str, flown: Takeoff, *, number: int | None, accepted: Accepted
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
            raise NotFoundError("trial", number, hint=f"Campaign {campaign_id} has {count(len(trials), 'trial')}.")
    else:
        waits = {TrialState.LOST} if fleet.can_fly(row.vehicle) else TRIAL_ACTIONS["upload"]
        chosen = [trial for trial in trials if trial.state in waits]
    if len(chosen) > 1:
        raise InputError(
            f"{len(chosen)} trials of campaign {campaign_id} are waiting for a record.",
            hint="Specify the trial with --trial.",
            problems=tuple(Problem("trial", f"{trial.number}: {trial.state}") for trial in chosen),
        )
    if chosen:
        return import_record(session, chosen[0].id, flown, accepted=accepted)
    if row.state == CampaignState.FINISHED:
        raise ConflictError(
            f"Campaign {campaign_id} has ended.", hint="Reopen it on its page to import another flight, then try again."
        )
    proposal = proposals.require_fresh_proposal(session, row)
    plan = TrialPlan(proposal_id=proposal.id)
    return plan_and_import(session, campaign_id, plan, flown, accepted=accepted)


def get_trajectory(session: Session, trial_id: int, points: int) -> TrajectoryOut:
    """Record of a trial, thinned to at most `points` samples such that the scored output keeps its peaks.

    Raises NotFoundError when there is none, StorageError when it is damaged.
    """
    row = history.trial_row(session, trial_id)
    record = history.record_of(session, row)
    leading = record.channels.get(experiment_of_campaign(row.campaign).output, record.time_s)
    chosen = select_samples(record.time_s, leading, points)
    return TrajectoryOut.view_of(
        row.trajectory,
        trial_id=row.id,
        units=units_of(record.channels),
        time_s=record.time_s[chosen].tolist(),
        channels={name: values[chosen].tolist() for name, values in record.channels.items()},
    )


def export_trajectory(session: Session, trial_id: int) -> tuple[str, str, str]:
    """File name, CSV and checksum of a full record: every sample with nine digits, which restore the stored
    single-precision number exactly."""
    row = history.trial_row(session, trial_id)
    record = history.record_of(session, row)
    assert row.trajectory is not None
    table = np.column_stack([record.time_s, *record.channels.values()])
    lines = [",".join(["time_s", *record.channels]), *(",".join(f"{number:.9g}" for number in line) for line in table)]
    name = f"campaign-{row.campaign_id}-trial-{row.number}.csv"
    return name, "\n".join(lines) + "\n", row.trajectory.checksum


def telemetry_logs(session: Session, trial_ids: Collection[int], data_dir: Path) -> Mapping[int, Path]:
    """By trial id, the telemetry log of the trial's last flight that has one, else the one imported with the trial."""
    flights = repository.flight_ids(session, trial_ids)
    found: dict[int, Path] = {}
    for trial_id in trial_ids:
        flown = [telemetry_log(data_dir, flight_id) for flight_id in flights.get(trial_id, ())]
        if file := next(filter(Path.is_file, (*flown, log_of_trial(data_dir, trial_id))), None):
            found[trial_id] = file
    return found


def find_telemetry_log(session: Session, trial_id: int, data_dir: Path) -> tuple[Path, str]:
    """Telemetry log of the trial, and its name for download. Raises NotFoundError when there is none."""
    row = history.trial_row(session, trial_id)
    if (file := telemetry_logs(session, [trial_id], data_dir).get(trial_id)) is None:
        raise NotFoundError("telemetry log of trial", trial_id, hint="Only flights of vehicles with a link have one.")
    return file, f"campaign-{row.campaign_id}-trial-{row.number}.tlog"
