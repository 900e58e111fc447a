"""Requests for flights, from the first to the operator's takeoff request: who may request which, and when. The rows of
flights are in `flight_rows`."""

from collections.abc import Callable
from contextlib import suppress

from sqlalchemy.orm import Session

from app.accounts.permissions import LOCAL_CLI, RequestContext
from app.campaigns import history, rehearsals
from app.campaigns.definitions import experiment_of_campaign
from app.campaigns.trials import service as trials
from app.campaigns.trials.schemas import AbortAnswer, FlightOrder, Trial
from app.campaigns.trials.views import trial_view
from app.common.conflict_checks import check_action
from app.common.errors import ConflictError, GainlineError, NotAllowedError
from app.common.states import (
    ACTIVE_FLIGHT_STATES,
    HISTORY_TRIAL_STATES,
    TRIAL_ACTIONS,
    ActKind,
    FlightMode,
    FlightState,
    TrialState,
)
from app.db.base import utc_now
from app.db.models import FlightRow, TrialRow, VehicleRow
from app.fleet import service as fleet
from app.fleet.control import (
    control_of,
    is_in_control,
    may_command,
    record_act,
    require_control,
    require_may_command,
    require_not_controlled_by_other,
)
from app.flights import flight_rows
from app.flights.readiness import Standing, TrialReadiness, readiness_of, require_ready
from app.live.hub import VehicleReport
from app.vehicles.flight_end import Landing, Requester, StopRequest, request_text, unstaged_text, withdrawn_by

ReportOf = Callable[[int], VehicleReport]
"""What is known of a vehicle at this moment, by its id."""


def warm_gate_cache(session: Session, trial_id: int) -> None:
    """Run the gate's simulations before the transaction of `fly_trial` needs the results."""
    with suppress(GainlineError):
        row = history.trial_row(session, trial_id)
        trials.check_own_gains(session, row.campaign, row.gains)


def fly_new_trial(session: Session, trial_id: int, order: FlightOrder, context: RequestContext = LOCAL_CLI) -> Trial:
    """Request the flight of a trial that was planned in the same transaction, whose gains have thus just passed the
    gate. Raises as `fly_trial` does."""
    row = history.trial_row(session, trial_id)
    _request_flight(session, row, context, mode="fly", speed=order.speed)
    return trial_view(session, row)


def fly_trial(
    session: Session, trial_id: int, context: RequestContext, *, mode: FlightMode = "fly", speed: float | None = None
) -> Trial:
    """Request the flight of a planned trial; the worker carries it out. Mode `stage`: a registered vehicle takes its
    gains and waits for its operator's takeoff request.

    Raises ConflictError for an unclassified flight, a spent budget, a campaign that is over or not ready, a vehicle
    that is not ready or under another operator's control; GainsError that names what the gate refuses, unless that was
    overruled; BusyError when the vehicle has a flight already; NotAllowedError when the client may not command the
    vehicle, and without staging for a real one.
    """
    row = history.trial_row(session, trial_id)
    check_action(TRIAL_ACTIONS, mode, row.state, f"Flight {row.number}")
    trials.require_open(session, row.campaign, HISTORY_TRIAL_STATES)
    judged = trials.check_own_gains(session, row.campaign, row.gains, overrule=row.overrule_reason or None)
    row.gate, row.overrule_reason = judged.gate, judged.overrule_reason
    _request_flight(session, row, context, mode=mode, speed=speed)
    return trial_view(session, row)


def _request_flight(
    session: Session, row: TrialRow, context: RequestContext, *, mode: FlightMode, speed: float | None
) -> None:
    """Add the flight row that the worker claims. Raises as `fly_trial` does."""
    campaign, vehicle = row.campaign, row.campaign.vehicle
    if mode == "stage" and not vehicle.registered:
        raise ConflictError(
            f"{vehicle.name} is flown without staging.", hint="Fly it directly; only registered vehicles are staged."
        )
    require_may_command(vehicle, context)
    if mode == "fly" and fleet.needs_staging(vehicle):
        raise NotAllowedError(
            f"{vehicle.name} is a real vehicle: only its operator can start the takeoff, in the browser.",
            hint="Stage the trial; its operator then starts the takeoff on the fly screen.",
        )
    rehearsals.require_rehearsed(session, campaign)
    fleet.require_window_fits(vehicle, experiment_of_campaign(campaign).window_s)
    fleet.require_ready(session, vehicle, mode)
    by = require_not_controlled_by_other(vehicle, context)
    flight = flight_rows.add_flight(session, row.id, mode=mode, speed=speed)
    _record_command(session, flight, ActKind.STAGE if mode == "stage" else ActKind.TAKE_OFF, by=by)


def trial_readiness(session: Session, trial_id: int, context: RequestContext, report_of: ReportOf) -> TrialReadiness:
    """How far the flight of a trial has come and what takes that back, for who asks. Raises NotFoundError."""
    row = history.trial_row(session, trial_id)
    vehicle = row.campaign.vehicle
    flight = history.latest_flights(session, [row.id]).get(row.id)
    active = flight if flight is not None and flight.state in ACTIVE_FLIGHT_STATES else None
    has_control = is_in_control(vehicle, context)
    standing = Standing(
        trial=row.state,
        vehicle=vehicle.state,
        has_link=vehicle.registered,
        has_control=has_control,
        is_controlled_by_other=not has_control and control_of(vehicle) is not None,
        may_command=may_command(vehicle, context),
        min_battery_v=float(vehicle.options.get("min_battery_v", 0.0)),
        take_off_requested=active is not None and active.take_off_at is not None,
        standing_down=active is not None and bool(active.stand_down),
        abort_cause_open=row.abort_cause == "operator",
        failed_checks=tuple(str(check["title"]) for check in vehicle.checks or () if not check["passed"]),
        was_lost_in_flight=_was_lost_in_flight(row, flight),
        has_not_landed=row.ending is not None
        and row.end is not None
        and row.end.landed in {Landing.FELL, Landing.UNKNOWN},
        flown_for_s=0.0 if row.flown_at is None else (utc_now() - row.flown_at).total_seconds(),
    )
    return readiness_of(standing, report_of(vehicle.id))


def _was_lost_in_flight(row: TrialRow, flight: FlightRow | None) -> bool:
    """Whether the vehicle was not heard again after a flight that no person has reviewed."""
    if flight is None or row.ending != "invalid" or flight.restored is not None or not flight.vehicle.registered:
        return False
    return row.state == TrialState.CAPTURED or fleet.is_classed_automatically(flight.vehicle)


def take_off_trial(session: Session, trial_id: int, context: RequestContext, report_of: ReportOf) -> Trial:
    """Request the takeoff of a staged vehicle: the operator's own act.

    For a real vehicle the request has to come from Gainline's own page in an unlocked browser on this computer, with
    the token of the operator in control. Raises ConflictError when nothing is staged, the takeoff was requested
    already, another operator is in control, the rehearsal is no longer satisfied, or the vehicle is no longer ready;
    NotAllowedError otherwise.
    """
    row = history.trial_row(session, trial_id)
    check_action(TRIAL_ACTIONS, "take-off", row.state, f"Flight {row.number}")
    flight = _staged(session, row)
    if flight.take_off_at is not None:
        raise ConflictError(f"The takeoff of trial {row.number} has already been requested.", hint="Watch the flight.")
    vehicle = flight.vehicle
    if fleet.needs_staging(vehicle):
        by = require_control(vehicle, context)
        rehearsals.require_rehearsed(session, row.campaign)  # again: a flight of it may be reclassified while staged
    else:
        require_may_command(vehicle, context)
        by = require_not_controlled_by_other(vehicle, context)
    require_ready(trial_readiness(session, trial_id, context, report_of))
    flight.take_off_at = utc_now()
    _record_command(session, flight, ActKind.TAKE_OFF, by=by)
    return trial_view(session, row)


def unstage_trial(session: Session, trial_id: int, context: RequestContext = LOCAL_CLI) -> Trial:
    """Request that a staged vehicle's safe gains are restored; its trial is then planned again, with the origin of the
    request as the reason.

    Raises ConflictError when nothing is staged.
    """
    row = history.trial_row(session, trial_id)
    check_action(TRIAL_ACTIONS, "unstage", row.state, f"Flight {row.number}")
    requester = _requester(row.campaign.vehicle, context)
    flight = _staged(session, row)
    flight.stand_down = requester
    operator = control_of(flight.vehicle) if is_in_control(flight.vehicle, context) else None
    by = "" if operator is None else operator.operator
    _record_command(session, flight, ActKind.UNSTAGE, by=by, reason="" if by else unstaged_text(requester))
    return trial_view(session, row)


def _requester(vehicle: VehicleRow, context: RequestContext) -> Requester:
    """Who makes a request that is open to everyone."""
    if is_in_control(vehicle, context):
        return Requester.OPERATOR
    if context.caller.is_elsewhere:
        return Requester.DEVICE
    return Requester.BROWSER if context.from_our_page else Requester.SCRIPT


def _staged(session: Session, row: TrialRow) -> FlightRow:
    flight = history.latest_flights(session, [row.id]).get(row.id)
    if flight is None or flight.mode != "stage" or flight.state != FlightState.RUNNING:
        raise ConflictError(f"Flight {row.number} flies without staging.", hint="Watch it, or abort it.")
    if flight.stand_down:
        raise ConflictError(
            f"Flight {row.number} is being unstaged: {unstaged_text(Requester(flight.stand_down))}.",
            hint="Wait until it is planned again.",
        )
    return flight


def withdraw_flight(session: Session, trial_id: int, words: str) -> AbortAnswer:
    """Abort a flight that no worker has claimed; a flight that is over is left as it is.

    Raises ConflictError when no flight was requested, or when the worker that flies it does not answer.
    """
    row = history.trial_row(session, trial_id)
    flight = history.latest_flights(session, [trial_id]).get(trial_id)
    if flight is None:
        raise ConflictError(
            f"Flight {row.number} is {row.state}: there is no flight to abort.", hint="Reload the trial."
        )
    if flight.state == FlightState.RUNNING:
        raise ConflictError(
            f"Flight {row.number} is {row.state}, and the worker that flies it is not responding.",
            hint="Abort again. If a vehicle is in the air, use its own remote control now.",
        )
    sentence = "The flight has already ended."
    if flight.state == FlightState.REQUESTED:
        history.set_flight_state(flight, FlightState.CANCELLED, end=withdrawn_by(StopRequest(words)))
        record_abort(session, trial_id, StopRequest(words))
        sentence = "The flight had not started; it was withdrawn."
    return AbortAnswer(trial_id=trial_id, accepted=True, sentence=sentence)


def _record_command(session: Session, flight: FlightRow, kind: ActKind, *, by: str, reason: str = "") -> None:
    """Record a command to the vehicle of a flight, which has its outcome; `by` is the operator in control, empty if the
    request came from elsewhere. Shared simulations have no log."""
    if flight.vehicle.registered:
        named = f"flight {flight.trial.number} of {flight.campaign.name}"
        record_act(
            session,
            flight.vehicle,
            kind,
            by=by,
            reason=f"{named}: {reason}" if reason else named,
            result={"flight_id": flight.id},
        )


def record_abort(session: Session, trial_id: int, request: StopRequest) -> None:
    """Record an abort, which everyone may request. Raises NotFoundError."""
    history.trial_row(session, trial_id)
    if (flight := history.latest_flights(session, [trial_id]).get(trial_id)) is not None:
        _record_command(session, flight, ActKind.ABORT, by="", reason=request_text(request))
