"""Donor of a warm start: a flight of another campaign, looked up when the campaign is defined."""

from sqlalchemy.orm import Session

from app.campaigns import repository
from app.campaigns.schemas import Definition, Donor, Start
from app.common.errors import NotFoundError
from app.common.states import TrialState
from app.core.errors import InputError, Problem
from app.db.models import TrialRow
from app.trials import history


def fill_in_donor(session: Session, asked: Definition) -> Definition:
    """Return the definition with the donor's trial number, checksum and gains filled in; unchanged without a donor.

    The donor is the best valid flight of its campaign unless a trial is named. Its record and gains are fixed from then
    on, whatever class the trial gets later. Raises InputError when there is no such flight, it belongs to another
    experiment, or its record does not match the checksum in the definition.
    """
    named = asked.start.donor
    if named is None or asked.start.kind != "campaign":
        return asked
    trial = _trial(session, asked, named)
    assert trial.trajectory is not None
    checksum = trial.trajectory.checksum
    if named.checksum and named.checksum != checksum:
        raise _refused("checksum", f"does not belong to the record of flight {trial.number}: leave it out")
    donor = Donor(campaign_id=named.campaign_id, trial_number=trial.number, checksum=checksum)
    return asked.model_copy(update={"start": Start(kind="campaign", gains=dict(trial.gains), donor=donor)})


def _trial(session: Session, asked: Definition, named: Donor) -> TrialRow:
    try:
        campaign = repository.get_one(session, named.campaign_id)
    except NotFoundError as error:
        raise _refused("campaign_id", f"there is no campaign {named.campaign_id}") from error
    if campaign.experiment != asked.experiment:
        reason = f"campaign {campaign.id} flies {campaign.experiment!r}, this one {asked.experiment!r}"
        raise _refused("campaign_id", reason)
    trials = history.trials_of(session, campaign.id)
    if named.trial_number is None:
        found = history.best_of(trials)
    else:
        found = next((row for row in trials if row.number == named.trial_number), None)
    if found is None or found.trajectory is None or (not named.checksum and found.state != TrialState.VALID):
        which = "flight" if named.trial_number is None else f"flight {named.trial_number}"
        raise _refused("trial_number", f"campaign {campaign.id} has no valid {which}")
    return found


def _refused(field: str, reason: str) -> InputError:
    return InputError(
        "This campaign cannot start from the other one.",
        problems=(Problem(f"definition.start.donor.{field}", reason),),
        hint="Name a campaign of the same experiment with a valid flight, or choose another start.",
    )
