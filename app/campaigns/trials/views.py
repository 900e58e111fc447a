"""API views of trials, with the sentences that describe them and the comparison with the best before and the first,
given the scatter of repeated flights.
"""

from collections.abc import Iterable, Sequence
from typing import Final

from sqlalchemy.orm import Session

from app.campaigns import history
from app.campaigns.definitions import experiment_of_campaign, flown_evidence
from app.campaigns.rehearsals import is_rehearsal_satisfied, rehearsal_of
from app.campaigns.trials.schemas import FlightBrief, GroupBrief, RecordBrief, Trial, TrialComparison
from app.common.conflict_checks import allowed
from app.common.states import ACTIVE_FLIGHT_STATES, CAMPAIGN_ACTIONS, TRIAL_ACTIONS, FlightState, TrialState
from app.core.experiments.base import Experiment
from app.core.formatting import named_flights, percent_of, short
from app.core.records.metrics import MAX_GAP_S
from app.core.records.trajectory import CHANNEL_UNITS
from app.core.statistics.comparisons import compare
from app.core.tuning.evidence import Evidence
from app.db.models import CampaignRow, FlightRow, TrialRow
from app.fleet import service as fleet
from app.vehicles.flight_end import Requester, cause_text, end_text, is_worded, unstaged_text

CONFIDENCE: Final = 0.9


def comparisons(row: TrialRow, now: Evidence[Experiment], best_before: int | None) -> list[TrialComparison]:
    """Comparisons with the best flight before this one, then with the first; flights of the same gains are left out.

    Each side counts with all flights of its gains.
    """
    by_number = {number: group for group in now.groups for number in group.numbers}
    own = by_number.get(row.number)
    if own is None or best_before is None:
        return []
    others = {best_before: "best before"}
    others.setdefault(now.valid[0].number, "first")
    return [
        TrialComparison.view_of(
            compare(own, by_number[number], now.scatter, CONFIDENCE, plan_further=False),
            against=against,
            trial_number=number,
        )
        for number, against in others.items()
        if by_number[number].gains != own.gains
    ]


def trial_view(session: Session, row: TrialRow) -> Trial:
    """View of one trial; the errors of earlier trials are loaded for its verdict."""
    return trial_views(session, row.campaign, [row])[0]


def trial_views(session: Session, campaign: CampaignRow, rows: Sequence[TrialRow]) -> list[Trial]:
    """Views of some trials of a campaign."""
    flights = history.latest_flights(session, [row.id for row in rows])
    now = flown_evidence(campaign, history.trials_of(session, campaign.id))
    rehearsed = is_rehearsal_satisfied(rehearsal_of(session, campaign))
    return [_view(row, now, flights.get(row.id), rehearsed) for row in rows]


def _view(row: TrialRow, now: Evidence[Experiment], flight: FlightRow | None, rehearsed: bool) -> Trial:
    before = ((each.error, each.number) for each in now.valid if each.error is not None and each.number < row.number)
    best = min(before, default=None)
    predicted_error, interval = history.told_prediction(
        row.predicted_error, row.predicted_interval, corrected=best is not None
    )
    same = next((group for group in now.groups if group.gains == row.gains), None)
    again = [] if same is None else [number for number in same.numbers if number < row.number]
    return Trial.view_of(
        row,
        predicted_error=predicted_error,
        predicted_interval=interval,
        inside_interval=None
        if interval is None or row.error is None
        else interval.lower <= row.error <= interval.upper,
        group=None
        if same is None
        else GroupBrief(mean=same.mean, standard_error=same.known_error(now.scatter), n=same.size),
        comparisons=comparisons(row, now, best and best[1]),
        verdict=verdict(row, best, predicted_error, now.experiment.error_unit, again),
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


def verdict(
    row: TrialRow, best: tuple[float, int] | None, predicted_error: float | None, unit: str, again: Sequence[int]
) -> str:
    """Sentence that compares the flight with the `best` before it, its error and number, and with its prediction.

    A trial that repeats the gains of the flights `again` is not compared with the best.
    """
    match row.state:
        case TrialState.VALID if row.error is not None:
            compared = _compared(row.error, best, unit)
            outcome = f", repeating the gains of {named_flights(again)}" if again else f": {compared}"
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
