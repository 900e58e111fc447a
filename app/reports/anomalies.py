"""Anomalies of a campaign, in the order of the flights."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Final

from app.campaigns.schemas import Campaign
from app.campaigns.trials.schemas import Trial
from app.common.states import AbortCause
from app.fleet.schemas import GivenGains, Vehicle, VehicleAct
from app.reports.content import Anomaly
from app.reports.wording import gains, number

_ENDINGS = {"aborted": "Aborted", "invalid": "Not counted", "lost": "Lost"}
_CAUSES: Final[Mapping[AbortCause, str]] = {
    "limit": "(A limit was met: it counts against the gains.)",
    "operator": "(Broken off by the operator, who has not said why: it does not count against the gains.)",
    "behaved badly": "(The vehicle behaved badly, says the operator: it counts against the gains.)",
    "something else": "(The operator had another reason: it does not count against the gains.)",
}


def of_flights(trials: Iterable[Trial], error_unit: str) -> Iterator[Anomaly]:
    """Flights that do not count, glitches, overruled gates, deviating read-backs, and failed flight requests."""
    for trial in trials:
        if (kind := _ENDINGS.get(trial.state)) is not None:
            yield Anomaly(trial.number, kind, f"{trial.reason or 'No reason was given.'}{_counting(trial)}")
        if trial.overrule_reason:
            refused = " ".join(check.sentence for check in trial.gate.checks if not check.passed)
            yield Anomaly(trial.number, "Gate overruled", f"{trial.overrule_reason} The gate had said: {refused}")
        if trial.read_back is not None and trial.read_back != trial.gains:
            sentence = f"Planned {gains(trial.gains)}; the vehicle read back {gains(trial.read_back)}."
            yield Anomaly(trial.number, "Other gains read back", sentence)
        for glitch in trial.glitches:
            yield Anomaly(trial.number, "Glitch in the record", glitch.sentence)
        if trial.glitches and trial.repaired_error is not None:
            repaired = f"Without the glitches the error would be {number(trial.repaired_error)} {error_unit}."
            yield Anomaly(trial.number, "Glitch in the record", repaired)
        if trial.flight is not None and trial.flight.problem:
            yield Anomaly(trial.number, "Trouble with the vehicle", trial.flight.problem)


def of_records(damaged: Iterable[int]) -> Iterator[Anomaly]:
    """Flights, by number, whose stored record does not match its checksum."""
    for number_of_flight in damaged:
        yield Anomaly(
            number_of_flight,
            "Damaged record",
            "Its stored record does not fit its checksum. Its curve here is the coarse one that was made at its "
            "landing, and its error is the one computed then; take the record from an earlier backup.",
        )


def _counting(trial: Trial) -> str:
    """Whether an aborted flight counts against its gains, if that is known."""
    if trial.state != "aborted" or trial.abort_cause is None:
        return ""
    return f" {_CAUSES[trial.abort_cause]}"


def of_vehicle(
    campaign: Campaign,
    vehicle: Vehicle,
    acts: Iterable[VehicleAct],
    ledger: Iterable[GivenGains],
    trials: Iterable[Trial],
) -> Iterator[Anomaly]:
    """Safe gains that could not be verified after a flight, quarantine, and releases from it during the campaign."""
    numbers = {trial.id: trial.number for trial in trials}
    for line in ledger:
        if line.purpose == "restore after flight" and line.campaign_id == campaign.id and line.outcome == "failed":
            sentence = f"Safe gains {gains(line.asked)} were not read back after the flight."
            flight = None if line.trial_id is None else numbers.get(line.trial_id)
            yield Anomaly(flight, "Safe gains not verified", sentence)
    if vehicle.state == "quarantined":
        yield Anomaly(None, "Quarantine", f"{vehicle.name} is quarantined: {vehicle.concern}")
    for act in acts:
        if act.kind == "release" and campaign.created_at <= act.requested_at <= campaign.updated_at:
            by = f" by {act.by}" if act.by else ""
            yield Anomaly(None, "Quarantine", f"Released{by} during the campaign: {act.reason}")
