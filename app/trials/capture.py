"""Capture of a flight: store its record, score it as stored, and classify it where the program may."""

from dataclasses import asdict

from sqlalchemy.orm import Session

from app.common.states import Ending, TrialState
from app.core.experiments import get_experiment
from app.core.glitches import find_glitches, repaired
from app.core.stopping import landing_battery_v
from app.core.trajectory import Trajectory
from app.db import trajectories
from app.db.models import CampaignRow, TrialRow
from app.fleet import service as fleet
from app.trials.lifecycle import set_trial_state
from app.trials.scoring import score


def capture(
    session: Session,
    campaign: CampaignRow,
    row: TrialRow,
    trajectory: Trajectory,
    *,
    ending: Ending = "completed",
    reason: str = "",
    on_request: bool = False,
) -> None:
    """Store a flight's record and classify the flight.

    An `aborted` flight is classified as that, with its `reason`; others are classified by the program where it may. A
    flight of a real vehicle stays captured until a person classifies it, with the reason as a suggestion where the
    measurement is `invalid`. A flight that can be scored but has glitches in its record stays captured too. A flight
    that was aborted `on_request` counts against its gains only once a person says that the vehicle behaved badly.
    Raises TrajectoryError when the record cannot be stored.
    """
    stored = trajectories.store_trajectory(session, trajectory)
    row.trajectory = stored
    recorded = trajectories.trajectory_of(session, stored.id)
    experiment = get_experiment(campaign.experiment)
    judged = score(experiment, recorded)
    glitches = find_glitches(experiment, recorded)
    row.glitches = [asdict(glitch) for glitch in glitches]
    row.repaired_error = (
        score(experiment, repaired(experiment, recorded, glitches), accept_gaps=True).error if glitches else None
    )
    row.overshoot_m, row.curve = judged.overshoot, judged.curve
    row.landing_battery_v = landing_battery_v(recorded)
    row.ending = ending
    if ending == "aborted":
        row.abort_cause = "operator" if on_request else "limit"
    if ending == "aborted" and row.state == TrialState.FLYING:
        set_trial_state(row, TrialState.ABORTED, reason=reason or "aborted")
        return
    set_trial_state(row, TrialState.CAPTURED, reason=reason if ending == "invalid" else "")
    if ending == "aborted":
        set_trial_state(row, TrialState.ABORTED, reason=reason or "aborted")
        return
    row.error = judged.error  # shown before a person classifies the flight, which scores it again
    if fleet.is_classed_automatically(campaign.vehicle):
        _classify(row, reason or "the measurement is no good" if ending == "invalid" else judged.refusal)


def _classify(row: TrialRow, refusal: str) -> None:
    if row.error is None or row.ending == "invalid":
        row.error = None
        set_trial_state(row, TrialState.INVALID, reason=refusal)
    elif not row.glitches:
        set_trial_state(row, TrialState.VALID)
