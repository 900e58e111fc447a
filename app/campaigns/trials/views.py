"""API views of trials, with the sentences that describe them and the comparison with the best before and the first,
given the scatter of repeated flights.
"""

from bisect import bisect_left
from collections.abc import Iterable, Mapping, Sequence
from itertools import accumulate
from typing import Final

from sqlalchemy.orm import Session

from app.autopilots.registry import get_experiment
from app.campaigns import history
from app.campaigns.definitions import experiment_of_campaign
from app.campaigns.rehearsals import is_rehearsal_satisfied, rehearsal_of
from app.campaigns.trials.schemas import FlightBrief, GroupBrief, RecordBrief, Trial, TrialComparison
from app.common.conflict_checks import allowed
from app.common.states import ACTIVE_FLIGHT_STATES, CAMPAIGN_ACTIONS, TRIAL_ACTIONS, FlightState, TrialState
from app.core.definition import Flight, Interval
from app.core.experiments.base import Scatter
from app.core.formatting import named_flights, percent_of, short
from app.core.policy import Gains
from app.core.records.metrics import MAX_GAP_S
from app.core.records.trajectory import CHANNEL_UNITS
from app.core.statistics.comparisons import Group, PooledScatter, compare, groups_of, pool_scatter
from app.db.models import CampaignRow, FlightRow, TrialRow
from app.fleet import service as fleet
from app.vehicles.flight_end import Requester, cause_text, end_text, is_worded, unstaged_text

CONFIDENCE: Final = 0.9


class ReferenceFlights:
    """The valid flights that a campaign's trials are compared with, indexed for constant or logarithmic lookup.

    `valid` are the flights in their order, `prior` is the experiment's scatter. `numbers` are those of the flights that
    have an error; `by_number` and `by_gains` hold all flights with the gains of one.
    """

    def __init__(self, valid: Sequence[Flight], prior: Scatter) -> None:
        groups = groups_of(valid)
        scored = [(flight.error, flight.number) for flight in valid if flight.error is not None]
        self.numbers: Final = [number for _, number in scored]
        self._best_so_far = list(accumulate(scored, min))
        self.by_number: Final[Mapping[int, Group]] = {number: group for group in groups for number in group.numbers}
        self.by_gains: Final[Mapping[object, Group]] = {_key(group.gains): group for group in groups}
        self.scatter: Final[PooledScatter | None] = pool_scatter(groups, prior) if groups else None

    def best_before(self, number: int) -> tuple[float, int] | None:
        """Error and number of the best flight before the given one."""
        before = bisect_left(self.numbers, number)
        return self._best_so_far[before - 1] if before else None

    def told_prediction(self, row: TrialRow) -> tuple[float | None, Interval | None]:
        """The predicted error of a flight and its interval; both None if they said nothing."""
        is_corrected = self.best_before(row.number) is not None
        return history.told_prediction(row.predicted_error, row.predicted_interval, corrected=is_corrected)


def comparisons(row: TrialRow, field: ReferenceFlights) -> list[TrialComparison]:
    """Comparisons with the best flight before this one, then with the first; flights of the same gains are left out.

    Each side counts with all flights of its gains.
    """
    own, best = field.by_number.get(row.number), field.best_before(row.number)
    if own is None or field.scatter is None or best is None:
        return []
    others = {best[1]: "best before"}
    others.setdefault(field.numbers[0], "first")
    return [
        TrialComparison.view_of(
            compare(own, field.by_number[number], field.scatter, CONFIDENCE, plan_further=False),
            against=against,
            trial_number=number,
        )
        for number, against in others.items()
        if field.by_number[number].gains != own.gains
    ]


def _key(gains: Gains) -> object:
    return tuple(sorted(gains.items()))


def trial_view(session: Session, row: TrialRow) -> Trial:
    """View of one trial; the errors of earlier trials are loaded for its verdict."""
    return trial_views(session, row.campaign, [row])[0]


def trial_views(session: Session, campaign: CampaignRow, rows: Sequence[TrialRow]) -> list[Trial]:
    """Views of some trials of a campaign."""
    flights = history.latest_flights(session, [row.id for row in rows])
    field = ReferenceFlights(history.valid_flights(session, campaign.id), experiment_of_campaign(campaign).scatter)
    rehearsed = is_rehearsal_satisfied(rehearsal_of(session, campaign))
    return [_view(row, field, flights.get(row.id), rehearsed) for row in rows]


def _view(row: TrialRow, field: ReferenceFlights, flight: FlightRow | None, rehearsed: bool) -> Trial:
    predicted_error, interval = field.told_prediction(row)
    same = field.by_gains.get(_key(row.gains))
    again = [] if same is None else [number for number in same.numbers if number < row.number]
    return Trial.view_of(
        row,
        predicted_error=predicted_error,
        predicted_interval=interval,
        inside_interval=None
        if interval is None or row.error is None
        else interval.lower <= row.error <= interval.upper,
        group=None
        if same is None or field.scatter is None
        else GroupBrief(mean=same.mean, standard_error=same.known_error(field.scatter), n=same.size),
        comparisons=comparisons(row, field),
        verdict=verdict(row, field, get_experiment(row.campaign.experiment).error_unit, again),
        glitches=row.glitches or [],
        record=None
        if row.trajectory is None
        else RecordBrief.view_of(
            row.trajectory,
            ending=row.ending or "completed",
            channels=row.trajectory.columns[1:],
            units=units_of(row.trajectory.columns[1:]),
        ),
        may_be_valid=_may_be_valid(row),
        flight=None
        if flight is None
        else FlightBrief.view_of(
            flight,
            problem=end_text(flight.end),
            standing_down=unstaged_text(Requester(flight.stand_down)) if flight.stand_down else "",
            safe_gains_restored=None if flight.restored is None else flight.restored == flight.safe_gains,
        ),
        speed=flight.speed if flight else None,
        settings=row.settings or {},
        reason=reason_of(row),
        given_reason=row.reason,
        actions=_actions(row, flight, rehearsed),
    )


def verdict(row: TrialRow, field: ReferenceFlights, unit: str, again: Sequence[int] = ()) -> str:
    """Sentence that compares the flight with the best before it and with its prediction.

    A trial that repeats the gains of the flights `again` is not compared with the best.
    """
    match row.state:
        case TrialState.VALID if row.error is not None:
            compared = _compared(row.error, field.best_before(row.number), unit)
            outcome = f", repeating the gains of {named_flights(again)}" if again else f": {compared}"
            predicted_error, _ = field.told_prediction(row)
            forecast = "" if predicted_error is None else f"; {short(predicted_error)} {unit} was predicted"
            return f"{short(row.error)} {unit}{outcome}{forecast}."
        case TrialState.ABORTED:
            return _ended("Aborted", row)
        case TrialState.INVALID:
            return f"Does not count: {reason_of(row)}"
        case TrialState.LOST:
            return _ended("Lost", row)
        case TrialState.CAPTURED:
            reason, found = reason_of(row), len(row.glitches or [])
            glitches = f", with {found} {'glitch' if found == 1 else 'glitches'} in its record" if found else ""
            doubt = f"; the measurement is doubtful: {reason.removesuffix('.')}" if reason else ""
            return f"Landed and recorded{glitches}{doubt}. Review the flight."
        case _:
            return ""


def reason_of(row: TrialRow) -> str:
    """Reason for the trial's state: of a person or an import, else of the end of its flight."""
    return row.reason or ("" if row.ending == "completed" else end_text(row.end))


def _ended(word: str, row: TrialRow) -> str:
    """`Aborted: too high`; `Aborted by the operator` for a request without words."""
    if row.reason or row.end is None or row.end.request is None or is_worded(row.end.request):
        return f"{word}: {reason_of(row)}"
    return cause_text(row.end, word)


def _compared(error: float, before: tuple[float, int] | None, unit: str) -> str:
    if before is None:
        return "the first valid flight"
    best, number = before
    than = f"the best before it (flight {number}, {short(best)} {unit})"
    if short(error) == short(best):
        return f"the same as {than}"
    gain = best - error
    relation = "lower than" if gain > 0 else "higher than"
    share = percent_of(gain, best)
    return f"{short(abs(gain))} {unit}{share and f' ({share})'} {relation} {than}"


def _may_be_valid(row: TrialRow) -> bool:
    """Whether a person may mark the flight valid. Without its record, which is large: its last time is in the curve."""
    if row.state not in {TrialState.CAPTURED, TrialState.INVALID} or row.ending == "aborted" or not row.curve:
        return row.state == TrialState.VALID
    return row.curve[-1][0] >= float(experiment_of_campaign(row.campaign).grid_s[-1]) - MAX_GAP_S


def units_of(channels: Iterable[str]) -> dict[str, str]:
    """The unit of each channel, empty where it has none."""
    return {name: CHANNEL_UNITS.get(name, "") for name in channels}


def _actions(row: TrialRow, flight: FlightRow | None, rehearsed: bool) -> list[str]:
    """Allowed actions: those of the state table, less what the vehicle cannot do, what an active flight rules out, and
    what a missing rehearsal of a real vehicle rules out."""
    vehicle = row.campaign.vehicle
    under_way = flight is not None and flight.state in ACTIVE_FLIGHT_STATES
    waits = flight is not None and flight.mode == "stage" and flight.state == FlightState.RUNNING
    ruled_out = (
        (under_way or not fleet.can_fly(vehicle), {"fly", "stage"}),
        (fleet.needs_staging(vehicle), {"fly"}),
        (not vehicle.registered or not rehearsed, {"stage"}),
        (flight is None or not waits or flight.stand_down, {"take-off", "unstage"}),
        (flight is not None and flight.take_off_at is not None, {"take-off"}),
        (fleet.can_fly(vehicle) and row.state == TrialState.PLANNED, {"upload"}),
        (row.campaign.state not in CAMPAIGN_ACTIONS["judge"], {"classify", "upload", "judge abort"}),
        (row.abort_cause == "limit", {"judge abort"}),
    )
    possible = allowed(TRIAL_ACTIONS, row.state, ruled_out)
    return [*possible, "abort"] if under_way and "abort" not in possible else possible
