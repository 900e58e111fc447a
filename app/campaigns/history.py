"""What is read of a campaign's trials: the flights that a proposal is computed from, the best trial, the stored
records; and the state changes of campaigns, trials and flights, only those in the transition tables.
"""

import hashlib
import json
import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from pydantic import TypeAdapter
from sqlalchemy import func, select
from sqlalchemy.orm import Session, defer

from app.autopilots.registry import experiment_of
from app.campaigns import repository
from app.common.conflict_checks import check_transition
from app.common.errors import ConflictError, NotFoundError, StorageError
from app.common.states import (
    ACTIVE_FLIGHT_STATES,
    CAMPAIGN_TRANSITIONS,
    FLIGHT_TRANSITIONS,
    FLOWN_TRIAL_STATES,
    HISTORY_TRIAL_STATES,
    NOT_AGAINST_GAINS,
    TRIAL_TRANSITIONS,
    UNFLOWN_TRIAL_STATES,
    CampaignState,
    FlightState,
    TrialState,
)
from app.core.definition import Definition, Flight, Interval, Prediction
from app.core.experiments.base import ModelledExperiment
from app.core.records.trajectory import Trajectory
from app.core.tuning.predictions import is_informative
from app.db import trajectories
from app.db.base import JsonObject, OptionsJson, existing, utc_now
from app.db.models import CampaignRow, FlightRow, TrajectoryRow, TrialRow
from app.vehicles.flight_end import FlightEnd, not_begun

_INTERVAL: Final = TypeAdapter(Interval)
_NOTHING: Final = Trajectory(np.empty(0), {}, "none", "none")


def trials_of(session: Session, *campaign_ids: int) -> Sequence[TrialRow]:
    """The trials of one or more campaigns, by campaign and number.

    Large columns that are seldom needed for all trials (gate result, curve, settings, read-back gains) are loaded on
    access.
    """
    return session.scalars(
        select(TrialRow)
        .where(TrialRow.campaign_id.in_(campaign_ids))
        .options(*(defer(column) for column in (TrialRow.gate, TrialRow.curve, TrialRow.settings, TrialRow.read_back)))
        .order_by(TrialRow.campaign_id, TrialRow.number)
    ).all()


def flights_of(session: Session, campaign_id: int, *, recorded: Collection[int] | None = None) -> tuple[Flight, ...]:
    """The valid and aborted flights with their trajectories as stored and their autopilot's parameters; of those not in
    `recorded`, without samples."""
    rows = in_history(trials_of(session, campaign_id))
    wanted = {
        row.number: row.trajectory_id
        for row in rows
        if row.trajectory_id is not None and (recorded is None or row.number in recorded)
    }
    records = trajectories.samples_of(session, wanted.values())
    settings = repository.settings(session, [row.id for row in rows])
    return tuple(
        _flight(
            row,
            _recorded(row, records[wanted[row.number]]) if row.number in wanted else _NOTHING,
            _numbers(settings[row.id]),
        )
        for row in rows
    )


def donor_of(session: Session, definition: Definition) -> Flight | None:
    """The flight that a warm start uses, None without one. Raises ConflictError when it has been deleted or changed.

    Valid and scored from its record, whatever its present class, because the computed start may depend on the record
    alone.
    """
    donor = definition.start.donor
    if donor is None:
        return None
    rows = [row for row in trials_of(session, donor.campaign_id) if row.number == donor.trial_number]
    if not rows or rows[0].trajectory is None or rows[0].trajectory.checksum != donor.checksum:
        raise ConflictError(
            f"The flight that this campaign starts from, {donor.trial_number} of campaign {donor.campaign_id}, has "
            "been deleted or changed.",
            hint="Choose another start, or select the campaign as the donor again.",
        )
    record = trajectories.trajectory_of(session, rows[0].trajectory.id)
    error = experiment_of(definition).error(record, accept_gaps=True)
    as_flown = _flight(rows[0], record, _numbers(rows[0].settings))
    return replace(as_flown, error=error, outcome="valid", predicted=None, against_gains=True)


def flown_gains(trials: Sequence[TrialRow]) -> tuple[Flight, ...]:
    """The flights without samples and parameters, for checks that look at gains only."""
    return tuple(_flight(row, _NOTHING, {}) for row in in_history(trials))


def in_history(trials: Sequence[TrialRow]) -> list[TrialRow]:
    """The valid and the aborted trials."""
    return [row for row in trials if row.state in HISTORY_TRIAL_STATES]


def last_battery_v(trials: Sequence[TrialRow]) -> float | None:
    """Battery voltage, V, at the end of the most recently flown trial, whatever its class; None when it was not
    measured.

    Trials need not fly in the order of their numbers.
    """
    flown = (row for row in trials if row.state in FLOWN_TRIAL_STATES and row.flown_at is not None)
    last = max(flown, key=lambda row: (row.flown_at, row.number), default=None)
    return None if last is None else last.landing_battery_v


def history_digest(session: Session, campaign: CampaignRow, definition: Definition, trials: Sequence[TrialRow]) -> str:
    """SHA-256 over everything that a proposal is computed from, including the checksums of the trials' records.

    Whether an abort counts against its gains is included only where it does not count, a reopening only where there
    was one, and the autopilot's parameters only where the model depends on them, so that digests made before these were
    recorded stay the same.
    """
    checksums = repository.checksums(session, campaign.id)
    rows = in_history(trials)
    parameters = _loop_parameters(session, definition, rows)
    flights = [
        [
            row.number,
            row.gains,
            row.state,
            row.error,
            checksums.get(row.id),
            row.predicted_error,
            row.predicted_interval,
            *(() if _is_against_gains(row) else ("not against the gains",)),
            *((parameters[row.id],) if parameters.get(row.id) else ()),
        ]
        for row in rows
    ]
    battery = [] if definition.stop.min_battery_v is None else [last_battery_v(trials)]
    reopened = [] if not campaign.open_until_flight else [["open until flight", campaign.open_until_flight]]
    content = json.dumps([definition.digest(), flights, *battery, *reopened], sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(content.encode()).hexdigest()


def _loop_parameters(
    session: Session, definition: Definition, rows: Sequence[TrialRow]
) -> Mapping[int, Mapping[str, float]]:
    """The parameters of each flight on which the model depends, by trial id."""
    experiment = experiment_of(definition)
    if not isinstance(experiment, ModelledExperiment):
        return {}
    settings = repository.settings(session, [row.id for row in rows])
    return {row_id: experiment.loop_parameters(_numbers(found)) for row_id, found in settings.items()}


def flight_under_way(session: Session, campaign_id: int | None = None) -> FlightRow | None:
    """The flight of the campaign, or without one of any, that is requested or running."""
    wanted = select(FlightRow).where(FlightRow.state.in_(ACTIVE_FLIGHT_STATES)).order_by(FlightRow.id).limit(1)
    return session.scalar(wanted if campaign_id is None else wanted.where(FlightRow.campaign_id == campaign_id))


def trial_row(session: Session, trial_id: int) -> TrialRow:
    """Raises NotFoundError."""
    return existing(session, TrialRow, trial_id, "trial")


def latest_flights(session: Session, trial_ids: Collection[int]) -> Mapping[int, FlightRow]:
    """The latest flight of each of these trials that has one, by trial id."""
    last = select(func.max(FlightRow.id)).where(FlightRow.trial_id.in_(trial_ids)).group_by(FlightRow.trial_id)
    return {row.trial_id: row for row in session.scalars(select(FlightRow).where(FlightRow.id.in_(last)))}


def best_of(trials: Sequence[TrialRow]) -> TrialRow | None:
    """The valid trial with the lowest error; the earliest one of equal errors."""
    valid = (row for row in trials if row.state == TrialState.VALID and row.error is not None)
    return min(valid, key=lambda row: (row.error, row.number), default=None)


def is_corrected(trials: Sequence[TrialRow], number: float = math.inf) -> bool:
    """Whether a flight had corrected the model before this flight; by default, before the next one."""
    return any(row.state == TrialState.VALID and row.number < number for row in trials)


def told_prediction(
    error: float | None, stored: JsonObject | None, *, corrected: bool
) -> tuple[float | None, Interval | None]:
    """The stored error and interval of a prediction; both None if they say nothing. `corrected`: whether a flight had
    corrected the model before."""
    interval = _interval(stored)
    if not is_informative(interval, corrected=corrected):
        return None, None
    return error, interval


def find_unreviewed(trials: Sequence[TrialRow]) -> TrialRow | None:
    """The captured trial that waits for its review, which blocks the next proposal."""
    return next((row for row in trials if row.state == TrialState.CAPTURED), None)


def record_of(session: Session, row: TrialRow) -> Trajectory:
    """Full record of a trial. Raises NotFoundError when it has none, StorageError when it is damaged."""
    if row.trajectory_id is None:
        raise NotFoundError("record of trial", row.id, hint=f"The trial is {row.state}; only flights leave a record.")
    return _recorded(row, trajectories.samples_of(session, [row.trajectory_id])[row.trajectory_id])


def _recorded(row: TrialRow, record: TrajectoryRow) -> Trajectory:
    """Unpack a trial's record. Raises StorageError that names the trial when the record is damaged."""
    try:
        return trajectories.unpack(record)
    except StorageError as error:
        raise StorageError(
            f"The record of trial {row.number} of campaign {row.campaign_id} cannot be read: {error.message}",
            hint=error.hint,
        ) from error


def _flight(row: TrialRow, trajectory: Trajectory, parameters: Mapping[str, float]) -> Flight:
    return Flight(
        number=row.number,
        gains=row.gains,
        trajectory=trajectory,
        error=row.error,
        outcome="valid" if row.state == TrialState.VALID else "aborted",
        predicted=None
        if row.predicted_error is None
        else Prediction(error=row.predicted_error, interval=_interval(row.predicted_interval)),
        against_gains=_is_against_gains(row),
        parameters=parameters,
    )


def _interval(stored: JsonObject | None) -> Interval | None:
    """A stored interval; from a bundle it may have further fields."""
    return None if stored is None else _INTERVAL.validate_python(stored)


def _numbers(settings: OptionsJson) -> dict[str, float]:
    """The numbers among a flight's settings, with the parameters of its autopilot."""
    return {
        name: float(value)
        for name, value in settings.items()
        if isinstance(value, int | float) and not isinstance(value, bool)
    }


def _is_against_gains(row: TrialRow) -> bool:
    """Whether an aborted trial counts against its gains; True for every other trial."""
    return row.state != TrialState.ABORTED or row.abort_cause not in NOT_AGAINST_GAINS


def set_campaign_state(row: CampaignRow, to: CampaignState) -> None:
    """Change a campaign's state. Raises ConflictError when the transition is not in the table."""
    row.state = check_transition(CAMPAIGN_TRANSITIONS, row.state, to, f"Campaign {row.id}")


def notify_rehearsed_campaign(session: Session, rehearsal: CampaignRow) -> None:
    """Mark the campaign that this one rehearses as updated, so that its clients load it again."""
    if (campaign_id := repository.rehearsed_id(session, rehearsal.id)) is not None:
        repository.get_campaign(session, campaign_id).updated_at = utc_now()


def set_trial_state(row: TrialRow, to: TrialState, *, reason: str | None = None) -> None:
    """Change a trial's state; a given reason replaces the previous one.

    Raises ConflictError when the transition is not in the table.
    """
    row.state = check_transition(TRIAL_TRANSITIONS, row.state, to, f"Flight {row.number}")
    if reason is not None:
        row.reason = reason


def set_flight_state(row: FlightRow, to: FlightState, *, end: FlightEnd | None = None) -> None:
    """Change a flight's state. Raises ConflictError when the transition is not in the table."""
    row.state = check_transition(FLIGHT_TRANSITIONS, row.state, to, f"Flight {row.id}")
    row.end = end
    if to not in ACTIVE_FLIGHT_STATES:
        row.finished_at = utc_now()


def cancel_unflown(trials: Iterable[TrialRow], flight: FlightRow | None, reason: str) -> None:
    """Cancel all trials that have not flown, and `flight` if it belongs to one of them and is not claimed yet.

    A worker that has claimed the flight finds its trial cancelled before lift-off and stands down.
    """
    for row in trials:
        if row.state in UNFLOWN_TRIAL_STATES:
            set_trial_state(row, TrialState.CANCELLED, reason=reason)
            if flight is not None and flight.trial_id == row.id and flight.state == FlightState.REQUESTED:
                set_flight_state(flight, FlightState.CANCELLED, end=not_begun(reason))
