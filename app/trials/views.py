"""How trials look from outside, and what they say of themselves."""

from collections.abc import Mapping, Sequence

from sqlalchemy.orm import Session

from app.core.experiments import get_experiment
from app.core.trajectory import CHANNEL_UNITS, Trajectory
from app.db.models import CampaignRow, FlightRow, TrajectoryRow, TrialRow
from app.fleet import service as fleet
from app.moves import allowed
from app.schemas import Gate
from app.trials import history, repository
from app.trials.schemas import FlightBrief, RecordBrief, Trial
from app.trials.schemas import Trajectory as TrajectoryOut
from app.trials.scoring import thinned
from app.trials.states import ACTIONS, UNDER_WAY, TrialState


def trial_view(session: Session, campaign: CampaignRow, row: TrialRow) -> Trial:
    """One trial; the trials before it are needed for its verdict."""
    session.flush()
    flights = repository.latest_flights(session, [row.id])
    return _view(campaign, row, history.trials_of(session, campaign.id), flights)


def trial_views(session: Session, campaign: CampaignRow) -> list[Trial]:
    """All trials of a campaign in the order of their numbers."""
    rows = history.trials_of(session, campaign.id)
    flights = repository.latest_flights(session, [row.id for row in rows])
    return [_view(campaign, row, rows, flights) for row in rows]


def trajectory_view(campaign: CampaignRow, row: TrialRow, trajectory: Trajectory, points: int) -> TrajectoryOut:
    """A record thinned to at most `points` samples, chosen so that the scored output keeps its peaks."""
    assert row.trajectory is not None
    output = get_experiment(campaign.experiment).output
    leading = trajectory.channels.get(output, trajectory.time_s)
    kept = thinned(trajectory.time_s, leading, points)
    return TrajectoryOut(
        trial_id=row.id,
        source=trajectory.source,
        clock=trajectory.clock,
        checksum=row.trajectory.checksum,
        samples=len(trajectory),
        units={name: CHANNEL_UNITS.get(name, "") for name in trajectory.channels},
        time_s=trajectory.time_s[kept].tolist(),
        channels={name: values[kept].tolist() for name, values in trajectory.channels.items()},
    )


def _view(campaign: CampaignRow, row: TrialRow, trials: Sequence[TrialRow], flights: Mapping[int, FlightRow]) -> Trial:
    flight = flights.get(row.id)
    return Trial(
        id=row.id,
        version=row.version,
        campaign_id=row.campaign_id,
        number=row.number,
        state=row.state,
        kind=row.kind,
        gains=row.gains,
        read_back=row.read_back,
        proposal_id=row.proposal_id,
        error=row.error,
        predicted_error=row.predicted_error,
        overshoot_m=row.overshoot_m,
        verdict=verdict(row, trials, get_experiment(campaign.experiment).error_unit),
        reason=row.reason,
        note=row.note,
        gate=Gate.model_validate(row.gate),
        record=_record(row.trajectory),
        flight=_flight(flight),
        seed=row.seed,
        speed=flight.speed if flight else None,
        created_at=row.created_at,
        flown_at=row.flown_at,
        actions=_actions(campaign, row, flight),
    )


def verdict(row: TrialRow, trials: Sequence[TrialRow], unit: str) -> str:
    """The flight against the best before it and against its prediction, in a sentence."""
    match row.state:
        case TrialState.VALID if row.error is not None:
            before = history.best_of([other for other in trials if other.number < row.number])
            return f"{row.error:.3f} {unit}: {_compared(row.error, before, unit)}{_against_prediction(row, unit)}."
        case TrialState.ABORTED:
            return f"Aborted: {row.reason}"
        case TrialState.INVALID:
            return f"Does not count: {row.reason}"
        case TrialState.LOST:
            return f"Lost: {row.reason}"
        case TrialState.CAPTURED:
            return "Landed and recorded; somebody has to say whether it counts."
        case _:
            return ""


def _compared(error: float, before: TrialRow | None, unit: str) -> str:
    if before is None or before.error is None:
        return "the first valid flight"
    gain = before.error - error
    word = "better than" if gain > 0 else "worse than"
    share = abs(gain) / before.error if before.error else 0.0
    than = f"the best before it (flight {before.number}, {before.error:.3f} {unit})"
    return f"as good as {than}" if gain == 0 else f"{abs(gain):.3f} {unit} ({share:.0%}) {word} {than}"


def _against_prediction(row: TrialRow, unit: str) -> str:
    return "" if row.predicted_error is None else f"; {row.predicted_error:.3f} {unit} was predicted"


def _record(row: TrajectoryRow | None) -> RecordBrief | None:
    if row is None:
        return None
    return RecordBrief(
        samples=row.samples,
        duration_s=row.duration_s,
        source=row.source,
        clock=row.clock,
        channels=row.columns[1:],
        checksum=row.checksum,
    )


def _flight(row: FlightRow | None) -> FlightBrief | None:
    return None if row is None else FlightBrief(id=row.id, state=row.state, problem=row.problem)


def _actions(campaign: CampaignRow, row: TrialRow, flight: FlightRow | None) -> list[str]:
    """The states' table, narrowed by what the vehicle can do and by a flight that is under way."""
    can_fly = fleet.can_fly(campaign.vehicle)
    under_way = flight is not None and flight.state in UNDER_WAY
    impossible = set()
    if under_way or not can_fly:
        impossible.add("fly")
    if can_fly and row.state == TrialState.PLANNED:
        impossible.add("upload")
    possible = [action for action in allowed(ACTIONS, row.state) if action not in impossible]
    return [*possible, "abort"] if under_way and "abort" not in possible else possible
