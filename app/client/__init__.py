"""A small typed client of the REST API, for scripts, notebooks, and programs that fly vehicles of their own.

    with Client("http://127.0.0.1:8000") as gainline:
        campaign = gainline.create_campaign("My drone", vehicle="import")
        proposal = gainline.ask(campaign.id)
        trial = gainline.tell(campaign.id, proposal, {"time_s": [...], "altitude_m": [...]})

Every POST carries an idempotency key and is safely repeated when the connection breaks. A refusal by the server is
raised with the server's own message:

    GainlineError
    └── RefusedError              status, title, problems; str() says what happened and what to do
        ├── NotAllowedError       403: a token is missing, or not permitted from here
        ├── NotFoundError         404
        ├── ConflictError         409: not possible now, or another client changed it first
        ├── InvalidError          413, 415, 422: `problems` names the fields
        └── UnavailableError      503, or no connection: try again later
"""

import csv
import io
import time
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final, Literal, Self, TypeVar

import httpx2
from pydantic import BaseModel, ValidationError

from app.campaigns.schemas import Campaign, CampaignSummary, Definition, NewCampaign, NextFlight, Proposal
from app.campaigns.trials.schemas import (
    AbortAnswer,
    AbortJudgement,
    Classification,
    FlightOrder,
    NewTrial,
    Reopening,
    Trajectory,
    Trial,
)
from app.common.schemas import OptionValue, Page
from app.common.schemas import Problem as ProblemDetails
from app.common.states import UNFLOWN_TRIAL_STATES, FlightState, TrialState
from app.core.errors import GainlineError, Problem
from app.core.records.plausibility import Reading
from app.fleet.schemas import VehicleChoice

Record = Path | bytes | Mapping[str, Iterable[float]]
"""A flight's record: a log or CSV file, its content, or columns by name, including `time_s` and `altitude_m`."""

_ATTEMPTS: Final = 3
_PAUSE_S: Final = 0.2
_LANDED: Final = frozenset(TrialState) - UNFLOWN_TRIAL_STATES - {TrialState.FLYING}
_NOT_FLOWN: Final = frozenset({FlightState.FAILED, FlightState.CANCELLED})

M = TypeVar("M", bound=BaseModel)
T = TypeVar("T")


class RefusedError(GainlineError):
    """The server has refused the request; `status` and `title` are those of its response."""

    def __init__(
        self, message: str, *, hint: str, problems: tuple[Problem, ...] = (), status: int = 0, title: str = ""
    ) -> None:
        super().__init__(message, hint=hint, problems=problems)
        self.status = status
        self.title = title


class NotAllowedError(RefusedError):
    """Not permitted from there, or without a token for it."""


class NotFoundError(RefusedError):
    """There is no such object."""


class ConflictError(RefusedError):
    """Not possible in the present state, or based on an outdated version."""


class InvalidError(RefusedError):
    """The request has invalid content; `problems` names the fields."""


class UnavailableError(RefusedError):
    """The server cannot be reached, or cannot store anything at present."""


_REFUSALS: Final[Mapping[int, type[RefusedError]]] = {
    403: NotAllowedError,
    404: NotFoundError,
    409: ConflictError,
    413: InvalidError,
    415: InvalidError,
    422: InvalidError,
    503: UnavailableError,
}


class Client:
    """A connection to one server. Pass an `http` client of your own for special needs (proxies, tests).

    `token` is what `gainline unlock --script` prints: needed for real vehicles, and on another device for every change.
    """

    def __init__(
        self,
        address: str = "http://127.0.0.1:8000",
        *,
        token: str = "",
        timeout_s: float = 30.0,
        http: httpx2.Client | None = None,
    ) -> None:
        self._http = http or httpx2.Client(base_url=address, timeout=timeout_s)
        if token:
            self._http.headers["Authorization"] = f"Bearer {token}"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self._http.close()

    def campaigns(self, *, search: str = "") -> Iterator[CampaignSummary]:
        """All campaigns whose names contain `search`, newest first, loaded page by page."""
        return self._pages("/api/campaigns", Page[CampaignSummary], {"search": search})

    def campaign(self, campaign_id: int) -> Campaign:
        return self._get(f"/api/campaigns/{campaign_id}", Campaign)

    def create_campaign(
        self,
        name: str,
        *,
        vehicle: str = "jsbsim",
        options: Mapping[str, OptionValue] | None = None,
        definition: Definition | None = None,
    ) -> Campaign:
        """Create a campaign, with working defaults for omitted arguments."""
        new = NewCampaign(
            name=name,
            vehicle=VehicleChoice(kind=vehicle, options=dict(options or {})),
            definition=definition or Definition(),
        )
        return self._post("/api/campaigns", Campaign, new)

    def finish(self, campaign_id: int) -> Campaign:
        """Finish a campaign between flights."""
        return self._post(f"/api/campaigns/{campaign_id}/finish", Campaign)

    def reopen(self, campaign_id: int, *, flights: int = 3) -> Campaign:
        """Reopen a finished campaign for more flights, for instance to confirm its best gains."""
        return self._post(f"/api/campaigns/{campaign_id}/reopen", Campaign, Reopening(flights=flights))

    def ask(self, campaign_id: int, *, timeout_s: float = 60.0) -> Proposal:
        """The next gain set for the flights so far; waits while it is computed.

        `recommended` is `stop` once the campaign's own rule has ended it. Raises ConflictError when there can be none
        (an unclassified flight blocks it), RefusedError when its computation failed, UnavailableError after
        `timeout_s`.
        """

        def ready() -> Proposal | None:
            found = self._get(f"/api/campaigns/{campaign_id}/proposal", NextFlight)
            if found.problem is not None:
                kind = RefusedError if found.state == "failed" else ConflictError
                raise kind(f"{found.problem.title} {found.problem.detail}".strip(), hint=found.problem.hint)
            return found.proposal if found.state == "ready" else None

        return _wait(
            ready,
            timeout_s,
            f"There is no proposal for campaign {campaign_id} after {timeout_s:g} s.",
            "Check that a worker is running (GET /api/health), then ask again.",
        )

    def tell(
        self,
        campaign_id: int,
        flown: Proposal | Mapping[str, float],
        record: Record,
        *,
        note: str = "",
        invalid: bool = False,
        reads_as: Iterable[Reading] = (),
    ) -> Trial:
        """Upload a flight flown elsewhere, with the gains it was flown with; returns it scored and classified.

        `invalid` accepts a record that cannot be scored or shows no such flight, `reads_as` what it may be read as.
        Without them the trial stays planned, and ConflictError is raised.
        """
        trial = self._plan(campaign_id, flown, note=note, fly=None)
        return self.upload(trial.id, record, invalid=invalid, reads_as=reads_as)

    def upload(
        self,
        trial_id: int,
        record: Record,
        *,
        takeoff: int | None = None,
        confirm: bool = False,
        invalid: bool = False,
        reads_as: Iterable[Reading] = (),
    ) -> Trial:
        """Upload the record of a planned trial, or the recovered record of a lost flight.

        `takeoff` chooses one of a log with several takeoffs. `confirm` accepts a log that was flown with other gains;
        the trial then has those. `invalid` accepts a record that cannot be scored, or shows no flight of the campaign,
        as an invalid flight; `reads_as` reads it in other units, with the other sign, above another datum. Raises
        InvalidError that lists the takeoffs, ConflictError that names both gain sets, or why the record does not count
        and, as the `code` of problems with the field `reads_as`, with what it would.
        """
        query: dict[str, str | Sequence[str]] = {"reads_as": tuple(reads_as)}
        query |= {} if takeoff is None else {"takeoff": str(takeoff)}
        query |= {name: "true" for name, accepted in (("confirm", confirm), ("invalid", invalid)) if accepted}
        return self._request(
            "POST",
            f"/api/trials/{trial_id}/trajectory",
            Trial.model_validate_json,
            content=_content(record),
            kind="application/octet-stream",
            query=query,
        )

    def fly(
        self, campaign_id: int, gains: Proposal | Mapping[str, float], *, speed: float | None = None, note: str = ""
    ) -> Trial:
        """Request a flight of a simulated vehicle. `speed` is simulated time over wall-clock time; None: as fast as
        possible."""
        return self._plan(campaign_id, gains, note=note, fly=FlightOrder(speed=speed))

    def wait(self, trial_id: int, *, timeout_s: float = 120.0) -> Trial:
        """Wait until a trial's flight is over, and return the trial.

        Raises RefusedError when it was not flown, UnavailableError after `timeout_s`.
        """

        def landed() -> Trial | None:
            trial = self.trial(trial_id)
            flight = trial.flight
            if trial.state not in _LANDED and flight is not None and flight.state in _NOT_FLOWN:
                raise RefusedError(
                    f"Trial {trial.number} was not flown: {flight.problem}",
                    hint="It is planned again: fly it or cancel it.",
                )
            return trial if trial.state in _LANDED else None

        return _wait(
            landed,
            timeout_s,
            f"Trial {trial_id} has not landed after {timeout_s:g} s.",
            "Check that a worker is running (GET /api/health), then wait again.",
        )

    def abort(self, trial_id: int) -> AbortAnswer:
        """End a flight now."""
        return self._post(f"/api/trials/{trial_id}/abort", AbortAnswer)

    def trials(self, campaign_id: int) -> Iterator[Trial]:
        """All trials by number, loaded page by page."""
        return self._pages(f"/api/campaigns/{campaign_id}/trials", Page[Trial], {})

    def trial(self, trial_id: int) -> Trial:
        return self._get(f"/api/trials/{trial_id}", Trial)

    def classify(self, trial: Trial, classification: Classification) -> Trial:
        """Classify a flight; whatever was computed from it is recomputed."""
        return self._post(f"/api/trials/{trial.id}/classify", Trial, classification)

    def judge_abort(self, trial: Trial, cause: Literal["behaved badly", "something else"]) -> Trial:
        """Record why a flight was aborted; it counts against its gains only if the vehicle behaved badly."""
        judgement = AbortJudgement(version=trial.version, cause=cause)
        return self._post(f"/api/trials/{trial.id}/judge-abort", Trial, judgement)

    def trajectory(self, trial_id: int, *, points: int = 1000) -> Trajectory:
        """The record, thinned to at most `points` samples."""
        return self._get(f"/api/trials/{trial_id}/trajectory", Trajectory, {"points": str(points)})

    def trajectory_csv(self, trial_id: int) -> bytes:
        """The full record as CSV."""
        return self._request("GET", f"/api/trials/{trial_id}/trajectory.csv", bytes)

    def _plan(
        self, campaign_id: int, gains: Proposal | Mapping[str, float], *, note: str, fly: FlightOrder | None
    ) -> Trial:
        asked = (
            NewTrial(proposal_id=gains.id, note=note, fly=fly)
            if isinstance(gains, Proposal)
            else NewTrial(gains=dict(gains), note=note, fly=fly)
        )
        return self._post(f"/api/campaigns/{campaign_id}/trials", Trial, asked)

    def _pages(self, path: str, kind: type[Page[T]], query: Mapping[str, str]) -> Iterator[T]:
        asked = {**query, "limit": "200"}
        while True:
            page = self._get(path, kind, asked)
            yield from page.items
            if page.next_cursor is None:
                return
            asked["cursor"] = page.next_cursor

    def _get(self, path: str, kind: type[M], query: Mapping[str, str] | None = None) -> M:
        return self._request("GET", path, kind.model_validate_json, query=query)

    def _post(self, path: str, kind: type[M], body: BaseModel | None = None) -> M:
        content = b"" if body is None else body.model_dump_json().encode()
        return self._request("POST", path, kind.model_validate_json, content=content)

    def _request(
        self,
        method: str,
        path: str,
        read: Callable[[bytes], T],
        *,
        content: bytes = b"",
        kind: str = "application/json",
        query: Mapping[str, str | Sequence[str]] | None = None,
    ) -> T:
        headers = {"Content-Type": kind, "Idempotency-Key": uuid.uuid4().hex} if method == "POST" else {}
        for left in reversed(range(_ATTEMPTS)):
            try:
                answer = self._http.request(method, path, content=content or None, headers=headers, params=query)
            except httpx2.TransportError as error:
                if not left:
                    raise UnavailableError(
                        f"{self._http.base_url} cannot be reached: {error}.",
                        title="No connection",
                        hint="Start the dashboard (`gainline serve`), or check the address.",
                    ) from error
                time.sleep(_PAUSE_S)
            else:
                if answer.is_success:
                    return read(answer.content)
                raise _refusal(answer)
        raise AssertionError("the last attempt answers or raises")


def _refusal(answer: httpx2.Response) -> RefusedError:
    kind = _REFUSALS.get(answer.status_code, RefusedError)
    try:
        details = ProblemDetails.model_validate_json(answer.content)
    except ValidationError:
        return kind(
            f"The server answered {answer.status_code} {answer.reason_phrase}.",
            status=answer.status_code,
            hint="Check that the address belongs to a Gainline server of this version.",
        )
    problems = tuple(
        Problem(problem.field, problem.reason, problem.offer, problem.code) for problem in details.problems
    )
    hint = details.script_hint or details.hint
    return kind(details.detail, hint=hint, problems=problems, status=details.status, title=details.title)


def _content(record: Record) -> bytes:
    if isinstance(record, Path):
        return record.read_bytes()
    if isinstance(record, bytes):
        return record
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(record)
    writer.writerows(zip(*record.values(), strict=True))
    return text.getvalue().encode()


def _wait(ready: Callable[[], T | None], timeout_s: float, happened: str, hint: str) -> T:
    deadline_s = time.monotonic() + timeout_s
    while (found := ready()) is None:
        if time.monotonic() > deadline_s:
            raise UnavailableError(happened, hint=hint, title="Timed out")
        time.sleep(_PAUSE_S)
    return found
