"""From a record to a classed trial: stored once, scored as stored, classed by the program where it may."""

from sqlalchemy.orm import Session

from app.core.experiments import get_experiment
from app.core.trajectory import Trajectory
from app.db.models import CampaignRow, TrialRow
from app.fleet import service as fleet
from app.trials import history
from app.trials.lifecycle import move_trial
from app.trials.scoring import score
from app.trials.states import TrialState


def capture(
    session: Session, campaign: CampaignRow, row: TrialRow, trajectory: Trajectory, *, aborted: str | None = None
) -> None:
    """Store a flight's record and class it: `aborted` with its reason, else by the program where it may.

    A flight of a real vehicle stays captured until a person has classed it. Raises TrajectoryError when the
    record cannot be stored.
    """
    stored = history.store_trajectory(session, trajectory)
    row.trajectory = stored
    judged = score(get_experiment(campaign.experiment), history.trajectory_of(session, stored.id))
    row.overshoot_m, row.curve = judged.overshoot, judged.curve
    row.ending = "completed" if aborted is None else "aborted"
    if aborted is not None and row.state == TrialState.FLYING:
        move_trial(row, TrialState.ABORTED, reason=aborted)
        return
    move_trial(row, TrialState.CAPTURED, reason="")
    if aborted is not None:
        move_trial(row, TrialState.ABORTED, reason=aborted)
    elif fleet.classed_by_program(campaign.vehicle):
        _classify(row, judged.error, judged.refusal)


def _classify(row: TrialRow, error: float | None, refusal: str) -> None:
    if error is None:
        move_trial(row, TrialState.INVALID, reason=refusal)
    else:
        row.error = error
        move_trial(row, TrialState.VALID)
