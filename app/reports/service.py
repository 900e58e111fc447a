"""The content of a report as plain data, collected from the API's own views without computing anything new: the
campaign's frozen settings, anomalies in the order of the flights, notes and photos, limited to a file size that can
still be sent.
"""

import tomllib
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Final

from sqlalchemy.orm import Session

from app import __version__
from app.autopilots.registry import EXPERIMENTS
from app.campaigns import figure_data
from app.campaigns import service as campaigns
from app.campaigns.schemas import Campaign, Start, StopRule
from app.campaigns.statistics import CampaignStatistics, campaign_statistics
from app.campaigns.trials import service as trials_service
from app.campaigns.trials.photos import photos_of_campaign
from app.campaigns.trials.schemas import Trial
from app.common.states import FLOWN_TRIAL_STATES
from app.core.definition import Option, OptionValue, titled, with_defaults
from app.core.experiments.base import Experiment
from app.core.formatting import EXACT_DIGITS, format_gains, gain, setting_text, short, short_percent
from app.core.policy import Gain
from app.core.tuning.stop_rules import describe_budget
from app.core.tuning.strategies import STRATEGIES
from app.db.base import utc_now
from app.db.models import TrialPhotoRow
from app.db.pages import Part
from app.db.trajectories import damaged_trials
from app.figures import CAMPAIGN_FIGURES
from app.figures.base import Card, card_of
from app.fleet import service as fleet
from app.fleet.schemas import Vehicle
from app.fleet.views import acts_view, ledger_view
from app.vehicles.base import Identity
from app.vehicles.flight_end import FlightEnd, cause_text
from app.vehicles.registry import VEHICLE_KINDS

_ALL: Final = Part(limit=2**31)


@dataclass(frozen=True, slots=True)
class Fact:
    """One setting: title and value."""

    title: str
    value: str


@dataclass(frozen=True, slots=True)
class Anomaly:
    """An anomaly: its flight (None if it belongs to none), its kind, and a description."""

    flight: int | None
    kind: str
    sentence: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Remark:
    """Remarks on a trial: its note, the photos that fit into the report with their pictures loaded, and the number of
    those left out."""

    trial: Trial
    photos: tuple[TrialPhotoRow, ...]
    left_out: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """A campaign as the API returns it, with its settings described and its figures drawn for a light page.

    `flown` are the trials that left the ground; `remarks` are in the order of the trials, with at most `photo_bytes` of
    photos in all; `what` was tuned and `how`; `anomalies` are in the order of the flights; `made_at` is the time of
    creation, by program `version`.
    """

    campaign: Campaign
    statistics: CampaignStatistics
    flown: tuple[Trial, ...]
    experiment: Experiment
    what: tuple[Fact, ...]
    how: tuple[Fact, ...]
    cards: tuple[Card, ...]
    remarks: tuple[Remark, ...]
    photo_bytes: int
    anomalies: tuple[Anomaly, ...]
    version: str
    made_at: datetime


WORDS: Final[Mapping[str, Mapping[str, str]]] = tomllib.loads((Path(__file__).parent / "words.toml").read_text("utf-8"))
"""Words for values of the API, by kind."""


def describe_vehicle(
    campaign: Campaign, experiment: Experiment, identity: Identity | None, safe_gains: str
) -> tuple[Fact, ...]:
    """The vehicle, REAL or simulated, with its settings, and the experiment with its gains."""
    vehicle = campaign.vehicle
    known = [replace(each, title=each.label or each.title) for each in VEHICLE_KINDS[vehicle.kind].options]
    autopilot = vehicle.options.get("autopilot")
    foreign = {each.name for each in known if each.autopilots and autopilot not in each.autopilots}
    own = {name: value for name, value in vehicle.options.items() if name not in foreign}
    options = experiment.options
    return (
        Fact("Vehicle", vehicle.name if vehicle.name == vehicle.title else f"{vehicle.name} ({vehicle.title})"),
        Fact("Real or simulated", "REAL" if vehicle.is_real else "SIM: a simulation"),
        *(() if identity is None else (Fact("Autopilot", _autopilot(identity)),)),
        *_options(own, known),
        *((Fact("Safe gains", safe_gains),) if vehicle.can_fly else ()),
        Fact("Experiment", experiment.title),
        *_options(with_defaults(campaign.definition.experiment_options, options), options),
        *(Fact(f"Gain {each.name}", _range_of(each)) for each in experiment.space.gains),
    )


def _autopilot(identity: Identity) -> str:
    known = f"{identity.autopilot} {identity.version}".strip()
    hardware = f", hardware id {identity.uid}" if identity.uid else ""
    return f"{known}, system {identity.system_id}{hardware}"


def _range_of(one: Gain) -> str:
    unit = f" ({one.unit})" if one.unit else ""
    return f"{one.title}{unit}, {gain(one.lower)} … {gain(one.upper)}"


def describe_method(campaign: Campaign, experiment: Experiment) -> tuple[Fact, ...]:
    """Strategy, start, bounds and stop rule, each with its settings."""
    definition = campaign.definition
    strategy = STRATEGIES[definition.strategy]
    first, later = short_percent(definition.first_step_fraction), short_percent(definition.step_fraction)
    has_ceiling = experiment.output == "altitude_m"
    has_seed = campaign.vehicle.can_fly and not campaign.vehicle.registered
    return (
        Fact("Strategy", strategy.title),
        *_options(definition.options, strategy.options),
        Fact("Start", _start(definition.start)),
        *(Fact(f"Bounds of {name}", f"{gain(low)} … {gain(high)}") for name, (low, high) in definition.bounds.items()),
        Fact("Maximum step", f"{first} of each gain's range until a flight is valid, then {later}"),
        *((Fact("Gate ceiling", f"{definition.ceiling_m:g} m"),) if has_ceiling else ()),
        Fact("Stop rule", _stop(definition.stop, campaign.open_until_flight)),
        *((Fact("Seed", str(definition.seed)),) if has_seed else ()),
    )


def _options(chosen: Mapping[str, OptionValue], known: Iterable[Option]) -> Iterator[Fact]:
    described = titled(chosen, known)
    return (Fact(title, setting_text(value, unit)) for title, unit, value in described if value != "")


def _start(start: Start) -> str:
    origin = WORDS["starts"][start.kind]
    if start.donor is not None:
        origin = f"flight {start.donor.trial_number} of campaign {start.donor.campaign_id}"
    if start.log is not None:
        origin = f"the gains proposed from {start.log.file_name}"
    return origin if start.gains is None else f"{origin}: {format_gains(start.gains)}"


def _stop(stop: StopRule, open_until_flight: int) -> str:
    most = f"at most {describe_budget(stop.max_flights, open_until_flight)}, invalid ones not counted"
    match stop.kind:
        case "paper":
            rule = f"two consecutive flights less than {short_percent(stop.improvement)} better than the best; {most}"
        case "noise":
            sure = short_percent(stop.confidence)
            rule = f"no resolvable improvement at {sure} confidence; {most}"
        case _:
            rule = most
    return rule if stop.min_battery_v is None else f"{rule}; or a flight that ends below {stop.min_battery_v:g} V"


def flight_anomalies(trials: Iterable[Trial], error_unit: str) -> Iterator[Anomaly]:
    """Flights that do not count, glitches, overruled gates, deviating read-backs, and failed flight requests."""
    for trial in trials:
        if (kind := WORDS["endings"].get(trial.state)) is not None:
            reason = trial.given_reason or _end_beside(trial.state, trial.end) or "No reason was given."
            counting = (
                f" {WORDS['causes'][trial.abort_cause]}" if trial.state == "aborted" and trial.abort_cause else ""
            )
            yield Anomaly(trial.number, kind, f"{reason}{counting}")
        if trial.overrule_reason:
            refused = " ".join(check.sentence for check in trial.gate.checks if not check.passed)
            yield Anomaly(trial.number, "Gate overruled", f"{trial.overrule_reason} Refused by the gate: {refused}")
        if trial.read_back is not None and trial.read_back != trial.gains:
            planned, held = (format_gains(gains, EXACT_DIGITS) for gains in (trial.gains, trial.read_back))
            sentence = f"Planned {planned}; read back from the vehicle: {held}."
            yield Anomaly(trial.number, "Different gains read back", sentence)
        for glitch in trial.glitches:
            yield Anomaly(trial.number, "Glitch in the record", glitch.sentence)
        if trial.glitches and trial.repaired_error is not None:
            repaired = f"Without the glitches the error would be {short(trial.repaired_error)} {error_unit}."
            yield Anomaly(trial.number, "Glitch in the record", repaired)
        if trial.flight is not None and trial.flight.problem and (trial.given_reason or not kind):
            kind = WORDS["endings"].get(trial.flight.state)
            end = trial.flight.problem if kind is None else _end_beside(trial.flight.state, trial.flight.end)
            yield Anomaly(trial.number, kind or "Vehicle problem", end)


_DAMAGED_RECORD: Final = (
    "The stored record does not match its checksum. The curve shown is the coarse copy made at landing, and the error "
    "is the one computed then. Restore the record from an earlier backup."
)


def _end_beside(state: str, end: FlightEnd | None) -> str:
    """How a flight ended, beside the word for its state."""
    return "" if end is None else cause_text(end, "" if state == "aborted" else "aborted")


def vehicle_anomalies(
    session: Session, campaign: Campaign, vehicle: Vehicle, trials: Iterable[Trial]
) -> Iterator[Anomaly]:
    """Safe gains that could not be verified after a flight, quarantine, and releases from it during the campaign."""
    numbers = {trial.id: trial.number for trial in trials}
    for line in ledger_view(session, vehicle.id, _ALL).items:
        if line.purpose == "restore after flight" and line.campaign_id == campaign.id and line.outcome == "failed":
            sentence = f"Safe gains {format_gains(line.asked)} were not read back after the flight."
            flight = None if line.trial_id is None else numbers.get(line.trial_id)
            yield Anomaly(flight, "Safe gains not verified", sentence)
    if vehicle.state == "quarantined":
        yield Anomaly(None, "Quarantine", f"{vehicle.name} is quarantined: {vehicle.concern}")
    for act in acts_view(session, vehicle.id, _ALL).items:
        if act.kind == "release" and campaign.created_at <= act.requested_at <= campaign.updated_at:
            by = f" by {act.by}" if act.by else ""
            yield Anomaly(None, "Quarantine", f"Released{by} during the campaign: {act.reason}")


MAX_PHOTO_BYTES: Final = 24 * 2**20
"""Limit for all photos together, in original size; they take a third more in the file."""


def remarks_on(session: Session, campaign_id: int, trials: Sequence[Trial]) -> Iterator[Remark]:
    """Remarks of the trials that have any, in order."""
    sizes, room = dict(photos_of_campaign(session, campaign_id)), MAX_PHOTO_BYTES
    by_trial = defaultdict[int, list[TrialPhotoRow]](list)
    for row in sizes:
        by_trial[row.trial_id].append(row)
    kept = set[TrialPhotoRow]()
    # The first photo of each trial comes before the second of any.
    for row in sorted(sizes, key=lambda row: (by_trial[row.trial_id].index(row), row.id)):
        if sizes[row] <= room:
            session.refresh(row, ["data"])
            kept.add(row)
            room -= sizes[row]
    for trial in trials:
        own = by_trial[trial.id]
        shown = tuple(row for row in own if row in kept)
        if trial.note or own:
            yield Remark(trial=trial, photos=shown, left_out=len(own) - len(shown))


def report_of(session: Session, campaign_id: int) -> Report:
    """Collect all data of a campaign, as for one reader. Raises NotFoundError."""
    campaign = campaigns.get_campaign(session, campaign_id)
    statistics = campaign_statistics(session, campaign_id)
    trials = trials_service.list_trials(session, campaign_id, _ALL).items
    definition = campaign.definition
    experiment = EXPERIMENTS[definition.experiment].configured(definition.experiment_options)
    vehicle = fleet.get_vehicle(session, campaign.vehicle.id)
    frozen = campaigns.get_row(session, campaign_id).safe_gains
    safe_gains = format_gains(vehicle.safe_gains)
    if frozen is not None and frozen != vehicle.safe_gains:
        safe_gains = f"{format_gains(frozen)} at the first flight, now {safe_gains}"
    past = figure_data.history_of(session, campaign_id, figure_data.FigureView())
    return Report(
        campaign=campaign,
        statistics=statistics,
        flown=tuple(trial for trial in trials if trial.state in FLOWN_TRIAL_STATES),
        experiment=experiment,
        what=describe_vehicle(campaign, experiment, vehicle.identity, safe_gains),
        how=describe_method(campaign, experiment),
        cards=tuple(card_of(figure(past)) for figure in CAMPAIGN_FIGURES.values()),
        remarks=tuple(remarks_on(session, campaign_id, trials)),
        photo_bytes=MAX_PHOTO_BYTES,
        anomalies=tuple(_anomalies(session, campaign, vehicle, trials, statistics.error_unit)),
        version=__version__,
        made_at=utc_now(),
    )


def _anomalies(
    session: Session, campaign: Campaign, vehicle: Vehicle, trials: Sequence[Trial], unit: str
) -> Iterator[Anomaly]:
    yield from flight_anomalies(trials, unit)
    yield from (Anomaly(row.number, "Damaged record", _DAMAGED_RECORD) for row in damaged_trials(session, campaign.id))
    if vehicle.registered:
        yield from vehicle_anomalies(session, campaign, vehicle, trials)
