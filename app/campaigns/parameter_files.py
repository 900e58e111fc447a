"""The best gains of a finished campaign as a file that the vehicle's ground station or airframe takes."""

from collections.abc import Mapping, Sequence
from typing import Final

from sqlalchemy.orm import Session

from app.autopilots.autopilot import GainSet
from app.autopilots.registry import TUNED
from app.campaigns import history, repository
from app.campaigns.definitions import flown_evidence
from app.campaigns.views import campaign_view
from app.common.errors import ConflictError
from app.core.formatting import named_flights
from app.core.policy import Gains
from app.fleet.service import can_fly

_LOAD: Final = "Load on the ground; fly first at a safe height, ready to take over."


def parameter_file(session: Session, campaign_id: int) -> tuple[str, str]:
    """Name and content of the file: the best gains by the vehicle's own names and in its units, the first flight's as
    comments. Raises ConflictError if the campaign found none that are better, or tunes no autopilot's."""
    row = repository.get_campaign(session, campaign_id)
    campaign = campaign_view(session, row)
    if campaign.parameter_file is None or campaign.winner is None:
        raise ConflictError(
            f"Campaign {row.id} has no better gains to load into an autopilot.",
            hint="Finish a campaign on an autopilot's gains, whose best gains are not those of its first flight.",
        )
    autopilot, trials = TUNED[row.experiment], history.trials_of(session, row.id)
    reported = repository.settings(
        session, [trial.id for trial in trials if trial.number in campaign.winner.trial_numbers]
    )
    gain_set = _gain_set(autopilot.logged_gains, {name for settings in reported.values() for name in settings})
    first = flown_evidence(row, trials).within_bounds.baseline.gains
    where = f"{row.vehicle.name}{', a simulation' if can_fly(row.vehicle) and not row.vehicle.is_real else ''}"
    flights = named_flights(campaign.winner.trial_numbers)
    heading = f"Gainline, campaign {row.id}, {row.name}: {campaign.standing} gains of {flights} ({where}). {_LOAD}"
    system = int((row.vehicle.identity or {}).get("system_id", 1))
    old, new = (_named(gains, gain_set) for gains in (first, campaign.winner.gains))
    return campaign.parameter_file, autopilot.parameter_file.content(heading, old, new, system)


def _gain_set(sets: Sequence[GainSet], reported: set[str]) -> GainSet:
    """The gains by the names of the vehicle's release, as its flights reported them, else by those of the oldest."""
    return next((each for each in sets if reported & {gain.parameter for gain in each}), sets[0])


def _named(gains: Gains, gain_set: GainSet) -> Mapping[str, float]:
    """The vehicle's values by its names."""
    return {each.parameter: float(f"{gains[each.gain] * each.factor:.7g}") for each in gain_set}
