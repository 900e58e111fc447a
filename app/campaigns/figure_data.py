"""Input data of the figures, loaded from the database as plain data."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import chain
from typing import Final, cast

import numpy as np
from sqlalchemy.orm import Session

from app.campaigns import history, repository
from app.campaigns.definitions import experiment_of_campaign, flown_evidence
from app.campaigns.proposals import is_stale
from app.common.states import FLOWN_TRIAL_STATES, TrialState
from app.core.experiments.base import Experiment, ModelledExperiment
from app.core.records.flight_events import flight_events, pinned_notes
from app.core.records.trajectory import CHANNEL_UNITS, Trajectory
from app.core.tuning.evidence import Evidence
from app.core.tuning.strategy import band_channels
from app.db import trajectories
from app.db.models import CampaignRow, ProposalRow, TrialRow
from app.figures import CAMPAIGN_FIGURES, FigureName
from app.figures.base import Card, card_of
from app.figures.data import (
    NO_CURVE,
    Band,
    Curve,
    FlightData,
    History,
    NextFlight,
    Noise,
    Outcome,
    Range,
    Repeats,
    curve_name,
)
from app.figures.flight import ChannelPanel, FlightFigure, FlightRecordData
from app.figures.overlays import select_individual_flights
from app.figures.theme import ThemeName
from app.vehicles.registry import get_kind

_TITLES: Final[Mapping[str, str]] = {"altitude_m": "Altitude", "pitch_error_rad": "Pitch error"}
_LIMITS: Final[Mapping[str, Range]] = {"thrust": Range(0.0, 1.0), "throttle": Range(0.0, 1.0)}
"""Limits of commands."""
_PANELS: Final[tuple[tuple[str, str, Mapping[str, str]], ...]] = (
    ("Climb rate (m/s)", "m/s", {"climb_rate_m_s": "Climb rate"}),
    (
        "Throttle (of full)",
        "",
        {
            "thrust": "Throttle",
            "throttle": "Reported throttle",
            "feed_forward": "Feed-forward",
            "feedback": "Feedback",
        },
    ),
    ("Battery (V)", "V", {"battery_v": "Battery"}),
    (
        "Pitch and elevator (rad)",
        "rad",
        {"pitch_rad": "Pitch", "pitch_reference_rad": "Pitch reference", "elevator_rad": "Elevator"},
    ),
)
"""Panels below the scored output in a flight's figure, where they were recorded: the axis title, the unit, and the
channels with their titles."""
_CONFIDENCE: Final = 0.9
_SPARSE_S: Final = 0.3
"""Interval of reports from which on the record's first samples after the command say nothing about it."""
_UNFLOWN: Final = frozenset({TrialState.PLANNED, TrialState.STAGED, TrialState.FLYING})


@dataclass(frozen=True, slots=True)
class FigureView:
    """View of a figure: the time range of the curves, s, None for all; the number of a flight to be drawn
    individually; and the number of the flight whose prediction is drawn, None for the next one."""

    window: Range | None = None
    chosen: int | None = None
    predicted: int | None = None


def campaign_figure(session: Session, campaign_id: int, name: FigureName, theme: ThemeName, view: FigureView) -> Card:
    """One of the campaign's figures. Raises NotFoundError for an unknown campaign."""
    past = history_of(session, campaign_id, view if name == "takeoffs" else None)
    return card_of(CAMPAIGN_FIGURES[name](past, theme_name=theme))


def flight_figure(session: Session, trial_id: int, theme: ThemeName) -> Card:
    """The figure of one flight. Raises NotFoundError for an unknown trial."""
    return card_of(FlightFigure(_flight_record(session, history.trial_row(session, trial_id)), theme_name=theme))


def history_of(session: Session, campaign_id: int, view: FigureView | None = None) -> History:
    """Input data of the campaign's figures, with the curves of a `view`; without one no record is read.

    Full records are read only for the flights that are drawn individually; the others have their coarse curves.
    """
    campaign = repository.get_campaign(session, campaign_id)
    rows = history.trials_of(session, campaign_id)
    evidence = flown_evidence(campaign, rows)
    definition, experiment = evidence.definition, evidence.experiment
    flown = [row for row in rows if row.state in FLOWN_TRIAL_STATES]
    set_point, reference = _goal(experiment)
    shown = view or FigureView()
    bare = History(
        output_title=_TITLES.get(experiment.output, experiment.output),
        output_unit=CHANNEL_UNITS[experiment.output],
        error_unit=experiment.error_unit,
        gains=experiment.space.gains,
        set_point=set_point,
        reference=reference,
        by_reference=experiment.target_channel is not None,
        flights=tuple(_flight(row, corrected=history.is_corrected(rows, row.number)) for row in flown),
        proposal=_predicted_flight(session, campaign, rows, experiment.output, shown.predicted),
        stop_improvement=definition.stop.improvement if definition.stop.kind == "paper" else None,
        noise=_noise(evidence),
        curves_title=experiment.curves_title,
        window=shown.window,
        chosen=shown.chosen,
        altitude_limit_m=get_kind(campaign.vehicle.kind).altitude_limit_m
        if experiment.output == "altitude_m"
        else None,
    )
    if view is None:
        return bare
    drawn = _curves(session, flown, select_individual_flights(bare), experiment.output)
    return replace(
        bare, flights=tuple(replace(flight, curve=drawn.get(flight.number, NO_CURVE)) for flight in bare.flights)
    )


def _flight(row: TrialRow, *, corrected: bool) -> FlightData:
    """A flight without its curve; `corrected`: whether a valid flight before it had corrected the model."""
    error, interval = history.told_prediction(row.predicted_error, row.predicted_interval, corrected=corrected)
    return FlightData(
        number=row.number,
        gains=row.gains,
        outcome="not yet reviewed" if row.state == TrialState.CAPTURED else cast("Outcome", row.state.value),
        error=row.error,
        predicted_error=error,
        interval=interval,
        glitches=_glitches(row),
    )


def _noise(now: Evidence[Experiment]) -> Noise | None:
    """Scatter of repeated flights, including the experiment's prior; None without a valid flight, while it is not
    known, and if there is none."""
    groups, scatter = now.groups, now.scatter
    if not groups or scatter.reported is None:
        return None
    best = now.winner
    half = scatter.half_width(1.0 + 1.0 / best.size, _CONFIDENCE)
    return Noise(
        sd=scatter.sigma,
        repeats=tuple(
            Repeats(group.numbers, group.mean, group.standard_error(scatter)) for group in groups if group.size > 1
        ),
        around_best=Range(best.mean - half, best.mean + half),
        best_numbers=best.numbers,
    )


def _glitches(row: TrialRow) -> tuple[Range, ...]:
    return tuple(Range(float(glitch["start_s"]), float(glitch["end_s"])) for glitch in row.glitches or [])


def _curves(session: Session, flown: Sequence[TrialRow], whole: Collection[int], output: str) -> dict[int, Curve]:
    """Scored output of each flight that has a record, by its number.

    At full rate for those in `whole` whose record is not damaged, else coarse.
    """
    recorded = [row for row in flown if row.trajectory_id is not None]
    records = trajectories.readable_of(
        session, [row.trajectory_id for row in recorded if row.trajectory_id is not None and row.number in whole]
    )
    coarse = repository.curves(session, [row.id for row in recorded if row.trajectory_id not in records])
    return {
        row.number: _curve(records[row.trajectory_id], output) if row.trajectory_id in records else _coarse(coarse, row)
        for row in recorded
    }


def _curve(trajectory: Trajectory, channel: str) -> Curve:
    return Curve(trajectory.time_s, trajectory[channel])


def _coarse(curves: Mapping[int, list[list[float]]], row: TrialRow) -> Curve:
    points = np.fromiter(chain.from_iterable(curves.get(row.id, [])), dtype=np.float64).reshape(-1, 2)
    return Curve(points[:, 0], points[:, 1])


@lru_cache
def _goal(experiment: Experiment) -> tuple[Curve, Curve | None]:
    """Set point over the window, and the reference if the model has one; neither depends on the gains."""
    grid = experiment.grid_s
    set_point = Curve(grid, experiment.set_point(grid))
    if not isinstance(experiment, ModelledExperiment):
        return set_point, None
    model = experiment.simulate(experiment.space.default, experiment.nominal_model)
    return set_point, Curve(model.time_s, model["reference_m"]) if "reference_m" in model.channels else None


def _predicted_flight(
    session: Session, campaign: CampaignRow, rows: Sequence[TrialRow], output: str, number: int | None
) -> NextFlight | None:
    """The trial with that number; without one, the trial that is planned or flying, else the fresh proposal for the
    trial after the last one. None if there is none. Where the prediction says nothing, the model's curve stays."""
    is_asked = (lambda row: row.state in _UNFLOWN) if number is None else (lambda row: row.number == number)
    trial = next((row for row in rows if is_asked(row)), None)
    if trial is not None:
        planned: TrialRow | ProposalRow = trial
        at, stored, curve_id = trial.number, trial.predicted_interval, _curve_id(trial)
    else:
        proposal = None if number is not None else repository.latest_proposal(session, campaign.id)
        if proposal is None or campaign.outcome is not None or is_stale(session, campaign, proposal, rows):
            return None
        at = max((row.number for row in rows), default=0) + 1
        planned, stored, curve_id = proposal, proposal.interval, proposal.predicted_id
    corrected = history.is_corrected(rows, at)
    error, interval = history.told_prediction(planned.predicted_error, stored, corrected=corrected)
    curve, band = _predicted(session, curve_id, output)
    return NextFlight(
        number=at,
        gains=planned.gains,
        curve=curve,
        predicted_error=error,
        band=None if error is None else band,
        interval=interval,
    )


def _curve_id(row: TrialRow) -> int | None:
    """The stored curve with which a trial was planned: its proposal's, else its own. None where its record has shown
    that it was flown with other gains."""
    if row.proposal is None:
        return row.predicted_id
    return row.proposal.predicted_id if row.proposal.gains == row.gains else None


def _predicted(session: Session, curve_id: int | None, output: str) -> tuple[Curve, Band | None]:
    """A stored predicted curve and its band, where there are any."""
    predicted = None if curve_id is None else trajectories.readable_of(session, [curve_id]).get(curve_id)
    if predicted is None:
        return NO_CURVE, None
    lower, upper = band_channels(output)
    has_band = lower in predicted.channels and upper in predicted.channels
    band = Band(lower=_curve(predicted, lower), upper=_curve(predicted, upper)) if has_band else None
    return _curve(predicted, output), band


def _flight_record(session: Session, row: TrialRow) -> FlightRecordData:
    trials = history.trials_of(session, row.campaign_id)
    experiment = experiment_of_campaign(row.campaign)
    set_points = experiment.set_points
    set_point, modelled = _goal(experiment)
    record = None if row.trajectory_id is None else trajectories.trajectory_of(session, row.trajectory_id)
    best = history.best_of(trials)
    glitches = _glitches(row)
    glitches_s = [glitch.low for glitch in glitches]
    other = best if best is not None and best.id != row.id and best.trajectory_id is not None else None
    predicted, band = _predicted(session, _curve_id(row), experiment.output)
    predicts = _flight(row, corrected=history.is_corrected(trials, row.number)).predicted_error is not None
    return FlightRecordData(
        number=row.number,
        output_title=_TITLES.get(experiment.output, experiment.output),
        output_unit=CHANNEL_UNITS[experiment.output],
        set_point=set_point,
        reference=modelled if record is None or "reference_m" not in record.channels else _curve(record, "reference_m"),
        curve=NO_CURVE if record is None else _curve(record, experiment.output),
        predicted=predicted,
        predicted_name=curve_name(predicts=predicts),
        band=band if predicts else None,
        glitches=glitches,
        best=None if other is None else _curve(history.record_of(session, other), experiment.output),
        best_number=None if other is None else other.number,
        panels=() if record is None else tuple(_panels(record)),
        events=()
        if record is None or experiment.output != "altitude_m"
        else flight_events(record, glitches_s, () if set_points is None else set_points.pushes),
        notes=pinned_notes(row.note),
        is_over=row.state in FLOWN_TRIAL_STATES,
        by_reference=experiment.target_channel is not None,
    )


def _throttle(record: Trajectory) -> Curve:
    """The throttle, without the samples after the command that hold a sparse report from before it."""
    curve = _curve(record, "throttle")
    reported_s = curve.time_s[1:][(np.diff(curve.values) != 0.0) & (curve.time_s[1:] > 0.0)]
    if len(reported_s) < 2 or np.diff(reported_s).min() < _SPARSE_S:
        return curve
    return curve.part((curve.time_s <= 0.0) | (curve.time_s >= reported_s[0]))


def _panels(record: Trajectory) -> Iterator[ChannelPanel]:
    """The further channels; of a real flight also the interval between samples, which shows losses of the link."""
    for title, unit, channels in _PANELS:
        recorded = [name for name in channels if name in record.channels]
        if recorded:
            yield ChannelPanel(
                title=title,
                unit=unit,
                curves={
                    channels[name]: _throttle(record) if name == "throttle" else _curve(record, name)
                    for name in recorded
                },
                limits=_LIMITS.get(recorded[0]),
            )
    if record.clock != "simulation" and len(record.time_s) > 1:
        interval = Curve(record.time_s[1:], np.diff(record.time_s))
        yield ChannelPanel(title="Interval (s)", unit="s", curves={"Since the previous sample": interval})
