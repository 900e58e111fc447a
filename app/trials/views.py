"""How trials look from outside, and what they say of themselves."""

from collections.abc import Iterable, Sequence

from sqlalchemy.orm import Session

from app.campaigns.states import ACTIONS as CAMPAIGN_ACTIONS
from app.campaigns.statistics import standing_of
from app.core.confirming import Standing
from app.core.experiments import get_experiment
from app.core.trajectory import CHANNEL_UNITS, Trajectory
from app.db.models import CampaignRow, FlightRow, TrialRow
from app.fleet import service as fleet
from app.moves import allowed
from app.schemas import Gate, Interval
from app.trials import repository
from app.trials.comparisons import comparisons
from app.trials.schemas import FlightBrief, Glitch, GroupBrief, RecordBrief, Trial
from app.trials.schemas import Trajectory as TrajectoryOut
from app.trials.scoring import thinned
from app.trials.states import ACTIONS, UNDER_WAY, FlightState, TrialState

Scored = tuple[int, float]
"""Number and error of a valid trial."""


def trial_view(session: Session, campaign: CampaignRow, row: TrialRow) -> Trial:
    """One trial; the errors of those before it are needed for its verdict."""
    return trial_views(session, campaign, [row])[0]


def trial_views(session: Session, campaign: CampaignRow, rows: Sequence[TrialRow]) -> list[Trial]:
    """Some trials of a campaign."""
    session.flush()
    flights = repository.latest_flights(session, [row.id for row in rows])
    scored = repository.scored(session, campaign.id)
    now = standing_of(campaign, repository.of_campaigns(session, (campaign.id,)))
    return [_view(campaign, row, scored, flights.get(row.id), now) for row in rows]


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
        units=_units(trajectory.channels),
        time_s=trajectory.time_s[kept].tolist(),
        channels={name: values[kept].tolist() for name, values in trajectory.channels.items()},
    )


def _view(
    campaign: CampaignRow, row: TrialRow, scored: Sequence[Scored], flight: FlightRow | None, now: Standing | None
) -> Trial:
    interval = None if row.predicted_interval is None else Interval.model_validate(row.predicted_interval)
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
        predicted_interval=interval,
        inside_interval=_is_inside(interval, row),
        group=_group(row, now),
        comparisons=comparisons(row, scored, now),
        overshoot_m=row.overshoot_m,
        verdict=verdict(row, scored, get_experiment(campaign.experiment).error_unit, _flown_before(row, now)),
        reason=row.reason,
        note=row.note,
        gate=Gate.model_validate(row.gate),
        overrule_reason=row.overrule_reason,
        glitches=[Glitch.model_validate(glitch) for glitch in row.glitches or ()],
        repaired_error=row.repaired_error,
        record=_record(row),
        flight=_flight(flight),
        seed=row.seed,
        speed=flight.speed if flight else None,
        settings=row.settings or {},
        created_at=row.created_at,
        flown_at=row.flown_at,
        actions=_actions(campaign, row, flight),
    )


def _is_inside(interval: Interval | None, row: TrialRow) -> bool | None:
    if interval is None or row.error is None:
        return None
    return interval.lower <= row.error <= interval.upper


def _group(row: TrialRow, now: Standing | None) -> GroupBrief | None:
    if now is None:
        return None
    same = next((group for group in now.groups if group.gains == row.gains), None)
    if same is None:
        return None
    return GroupBrief(mean=same.mean, standard_error=same.standard_error(now.scatter), n=same.size)


def _flown_before(row: TrialRow, now: Standing | None) -> list[int]:
    """The earlier flights of a trial that repeats their gains on purpose; none for any other trial."""
    if now is None or row.kind not in {"baseline", "repeat"}:
        return []
    return [
        number for group in now.groups if group.gains == row.gains for number in group.numbers if number < row.number
    ]


def verdict(row: TrialRow, scored: Sequence[Scored], unit: str, again: Sequence[int] = ()) -> str:
    """The flight against the best before it and against its prediction, in a sentence. One that repeats the gains of
    the flights `again` was not to be better than any, so it is not held against the best."""
    match row.state:
        case TrialState.VALID if row.error is not None:
            before = min(((error, number) for number, error in scored if number < row.number), default=None)
            said = f" {_once_more(again)}" if again else f": {_compared(row.error, before, unit)}"
            return f"{row.error:.3f} {unit}{said}{_against_prediction(row, unit)}."
        case TrialState.ABORTED:
            return f"Aborted: {row.reason}"
        case TrialState.INVALID:
            return f"Does not count: {row.reason}"
        case TrialState.LOST:
            return f"Lost: {row.reason}"
        case TrialState.CAPTURED:
            doubt = f"; the measurement is in doubt: {row.reason}" if row.reason else ""
            return f"Landed and recorded{_glitches(row)}{doubt}; somebody has to say whether it counts."
        case _:
            return ""


def _once_more(again: Sequence[int]) -> str:
    return f"with the gains of flight{'s' if len(again) > 1 else ''} {', '.join(map(str, again))} once more"


def _glitches(row: TrialRow) -> str:
    """What a person has to look at before classing the flight."""
    if not row.glitches:
        return ""
    return f", with {len(row.glitches)} {'glitch' if len(row.glitches) == 1 else 'glitches'} in its record"


def _compared(error: float, before: tuple[float, int] | None, unit: str) -> str:
    if before is None:
        return "the first valid flight"
    best, number = before
    than = f"the best before it (flight {number}, {best:.3f} {unit})"
    if f"{error:.3f}" == f"{best:.3f}":
        return f"the same as {than}"
    gain = best - error
    word = "lower than" if gain > 0 else "higher than"
    share = f" ({100 * abs(gain) / best:.0f} %)" if best else ""
    return f"{abs(gain):.3f} {unit}{share} {word} {than}"


def _against_prediction(row: TrialRow, unit: str) -> str:
    return "" if row.predicted_error is None else f"; {row.predicted_error:.3f} {unit} was predicted"


def _record(trial: TrialRow) -> RecordBrief | None:
    row = trial.trajectory
    if row is None:
        return None
    return RecordBrief(
        ending=trial.ending or "completed",
        samples=row.samples,
        duration_s=row.duration_s,
        source=row.source,
        clock=row.clock,
        channels=row.columns[1:],
        units=_units(row.columns[1:]),
        checksum=row.checksum,
    )


def _units(channels: Iterable[str]) -> dict[str, str]:
    return {name: CHANNEL_UNITS.get(name, "") for name in channels}


def _flight(row: FlightRow | None) -> FlightBrief | None:
    if row is None:
        return None
    return FlightBrief(
        id=row.id,
        state=row.state,
        mode=row.mode,
        take_off_at=row.take_off_at,
        standing_down=row.stand_down,
        problem=row.problem,
        battery=row.battery,
        battery_v_before=row.battery_v_before,
        battery_v_after=row.battery_v_after,
    )


def _actions(campaign: CampaignRow, row: TrialRow, flight: FlightRow | None) -> list[str]:
    """The states' table, narrowed by what the vehicle can do and by a flight that is under way."""
    vehicle = campaign.vehicle
    under_way = flight is not None and flight.state in UNDER_WAY
    impossible = set()
    if under_way or not fleet.can_fly(vehicle):
        impossible |= {"fly", "stage"}
    if fleet.needs_staging(vehicle):
        impossible.add("fly")
    if not vehicle.registered:
        impossible.add("stage")
    if flight is None or flight.mode != "stage" or flight.state != FlightState.RUNNING or flight.stand_down:
        impossible |= {"take-off", "unstage"}
    elif flight.take_off_at is not None:
        impossible.add("take-off")
    if fleet.can_fly(vehicle) and row.state == TrialState.PLANNED:
        impossible.add("upload")
    if campaign.state not in CAMPAIGN_ACTIONS["judge"]:
        impossible |= {"classify", "upload"}
    possible = [action for action in allowed(ACTIONS, row.state) if action not in impossible]
    return [*possible, "abort"] if under_way and "abort" not in possible else possible
