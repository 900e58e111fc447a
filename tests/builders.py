"""What tests build with: flights with known errors, campaigns over HTTP, and a worker's steps done by hand."""

import hashlib
import json
import pickle
import sqlite3
from collections.abc import Callable, Mapping
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx2
import numpy as np
from numpy.typing import NDArray
from sqlalchemy import text

from app.autopilots.registry import REPLACEMENTS
from app.campaigns import computation, proposals
from app.campaigns import service as campaigns
from app.campaigns.computation import CampaignHistory, ProposalComputation
from app.campaigns.schemas import Definition
from app.core.records.trajectory import Trajectory
from app.db.session import Database
from app.fleet.schemas import VehicleChoice
from app.flights import flight_rows
from app.flights.process_messages import FlightRequest
from app.jobs import service as jobs
from app.vehicles.base import Ending, FlightRecord
from app.vehicles.flight_end import Failure, FlightEnd, StopRequest

Json = dict[str, Any]

WINDOW_S = 32.6
WORKER = "test worker"


def create_climb(settling_s: float = 1.0, *, rate_hz: float = 50.0, until_s: float = 33.0) -> Trajectory:
    """3 m · (1 − exp(−t/τ)): its error over the 32.6 s window is `climb_error(τ)`."""
    time_s = np.arange(round(until_s * rate_hz) + 1) / rate_hz
    return Trajectory(time_s, {"altitude_m": 3.0 - 3.0 * np.exp(-time_s / settling_s)}, "test", "vehicle")


def climb_error(settling_s: float) -> float:
    """∫₀ᵀ 3·exp(−t/τ) dt / T."""
    return 3.0 * settling_s * (1.0 - float(np.exp(-WINDOW_S / settling_s))) / WINDOW_S


def create_record(
    settling_s: float = 1.0,
    *,
    ending: Ending = "completed",
    reason: str = "",
    until_s: float = 33.0,
    on_request: bool = False,
) -> FlightRecord:
    """What a vehicle leaves behind; `reason` are the words of who asked that it ends, or a remark."""
    climb = create_climb(settling_s, until_s=until_s)
    end = FlightEnd(remarks=(reason,) if reason else ())
    if on_request:
        end = FlightEnd(failure=Failure.OPERATOR, request=StopRequest(reason))
    return FlightRecord(trajectory=climb, ending=ending, end=end)


def csv_of(columns: Mapping[str, NDArray[np.float64]]) -> bytes:
    """A flight's record as it is uploaded."""
    lines = [
        ",".join(columns),
        *(",".join(f"{number:.9g}" for number in row) for row in zip(*columns.values(), strict=True)),
    ]
    return ("\n".join(lines) + "\n").encode()


def create_csv(settling_s: float = 1.0, *, until_s: float = 33.0) -> bytes:
    climb = create_climb(settling_s, until_s=until_s)
    return csv_of({"time_s": climb.time_s, **climb.channels})


def create_campaign(client: httpx2.Client, *, vehicle: str = "twin", **fields: object) -> Json:
    """A draft, of the strategy that computes fastest and the paper's stop rule unless `definition` names others."""
    given = fields.pop("definition", {})
    assert isinstance(given, Mapping)
    fastest = {"strategy": "gradient"} if given.get("experiment", "takeoff") == "takeoff" else {}
    definition = {**fastest, **given, "stop": {"kind": "paper", **given.get("stop", {})}}
    wanted = {"name": "Test", "vehicle": {"kind": vehicle}, "definition": definition, **fields}
    answer = client.post("/api/campaigns", json=wanted)
    assert answer.status_code == 201, answer.text
    campaign: Json = answer.json()
    return campaign


def store_campaign(database: Database, vehicle: str, definition: Mapping[str, object]) -> int:
    """A draft of an earlier version: its experiment may be one that is no longer offered. Returns its id."""
    asked = Definition.model_validate(definition)
    with database.write() as session:
        choice = VehicleChoice(kind=vehicle)
        return campaigns.add_campaign(session, "Test", asked, choice, continues=asked.experiment).id


def create_ready_campaign(
    client: httpx2.Client, database: Database, *, vehicle: str = "twin", **fields: object
) -> Json:
    """A campaign whose first gains are known."""

    def make() -> Json:
        definition = fields.get("definition", {})
        assert isinstance(definition, Mapping)
        if definition.get("experiment") in REPLACEMENTS:
            campaign_id = store_campaign(database, vehicle, definition)
        else:
            campaign_id = create_campaign(client, vehicle=vehicle, **fields)["id"]
        run_jobs(database)
        ready: Json = get(client, f"/api/campaigns/{campaign_id}")
        return ready

    return made_once(database, json.dumps(["ready", vehicle, fields], sort_keys=True), make)


def made_once(database: Database, what: str, make: Callable[[], Json]) -> Json:
    """What `make` puts into the database, and its answer. What a test begins with, in an empty database, is made once
    for all tests of a process that begin with the same, and copied for the others.
    """
    if not _is_empty(database):
        return make()
    if (made := _MADE.get(what)) is None:
        answer = make()
        made = _MADE[what] = _Made(json.dumps(answer), sqlite3.connect(":memory:", check_same_thread=False))
        _copy(database.file, made.database)
    else:
        _copy(made.database, database.file)
    copied: Json = json.loads(made.answer)
    return copied


@dataclass(frozen=True, slots=True)
class _Made:
    """An answer, as JSON, and the database that it is about."""

    answer: str
    database: sqlite3.Connection


_MADE: dict[str, _Made] = {}


def _is_empty(database: Database) -> bool:
    with database.read() as session:
        return not any(session.scalars(text("SELECT seq FROM sqlite_sequence")))


def _copy(source: sqlite3.Connection | Path, target: sqlite3.Connection | Path) -> None:
    with ExitStack() as stack:
        taken, given = (
            stack.enter_context(closing(sqlite3.connect(each))) if isinstance(each, Path) else each
            for each in (source, target)
        )
        given.execute("PRAGMA synchronous = OFF")
        taken.backup(given)


def create_trial(client: httpx2.Client, campaign_id: int, **fields: object) -> Json:
    """A trial of the proposal, unless gains or a variant are given."""
    if not fields.keys() & {"gains", "proposal_id", "variant"}:
        fields["proposal_id"] = get(client, f"/api/campaigns/{campaign_id}/proposal")["proposal"]["id"]
    answer = client.post(f"/api/campaigns/{campaign_id}/trials", json=fields)
    assert answer.status_code == 201, answer.text
    trial: Json = answer.json()
    return trial


def fly_trial(
    client: httpx2.Client, database: Database, campaign_id: int, record: FlightRecord, **fields: object
) -> Json:
    """A trial as `create_trial` makes it, landed with this record."""
    trial = create_trial(client, campaign_id, fly={"speed": None}, **fields)
    land(database, lift_off(database), record)
    landed: Json = get(client, f"/api/trials/{trial['id']}")
    return landed


def create_flown_trial(client: httpx2.Client, database: Database, campaign_id: int, settling_s: float = 1.0) -> Json:
    """A trial of the proposal that landed with a known error, and the next proposal computed."""
    trial = fly_trial(client, database, campaign_id, create_record(settling_s))
    run_jobs(database)
    flown: Json = get(client, f"/api/trials/{trial['id']}")
    return flown


def create_flown_campaign(
    client: httpx2.Client, database: Database, *settling_s: float, definition: Json | None = None
) -> Json:
    """A campaign with flights of known errors, one unless more are given, and the gains for the next; as it was before
    them."""

    def make() -> Json:
        campaign = create_ready_campaign(client, database, definition=definition or {})
        for each_s in settling_s or (1.0,):
            create_flown_trial(client, database, campaign["id"], each_s)
        return campaign

    return made_once(database, json.dumps(["flown", settling_s, definition], sort_keys=True), make)


def create_imported_trial(
    client: httpx2.Client, campaign_id: int, content: bytes | None = None, *, invalid: bool = False
) -> Json:
    """A trial of the proposal with an uploaded record; `invalid` accepts one that cannot be scored."""
    trial = create_trial(client, campaign_id)
    answer = upload(client, trial["id"], create_csv() if content is None else content, invalid=invalid)
    assert answer.status_code == 201, answer.text
    imported: Json = answer.json()
    return imported


def upload(
    client: httpx2.Client, trial_id: int, content: bytes, kind: str = "text/csv", *, invalid: bool = False
) -> httpx2.Response:
    path = f"/api/trials/{trial_id}/trajectory{'?invalid=true' if invalid else ''}"
    return client.post(path, content=content, headers={"Content-Type": kind})


def get(client: httpx2.Client, path: str) -> Any:
    answer = client.get(path)
    assert answer.status_code == 200, answer.text
    return answer.json()


def problems_of(answer: httpx2.Response) -> dict[str, str]:
    """The refused fields of a problem document and why."""
    return {problem["field"]: problem["reason"] for problem in answer.json()["problems"]}


def run_jobs(database: Database) -> int:
    """Carry out every waiting proposal job as a worker does; how many there were."""
    for count in range(1000):
        with database.write() as session:
            job = jobs.claim_job(session, worker=WORKER, kinds=(proposals.PROPOSAL_JOB,), lease_s=30.0)
            if job is None:
                return count
            job_id, campaign_id = job.id, job.campaign_id
        assert campaign_id is not None
        with database.read() as session:
            past = proposals.read_history(session, campaign_id)
        computed = compute(past)
        with database.write() as session:
            if jobs.finish_job(session, job_id, worker=WORKER):
                proposals.store_proposal(session, campaign_id, computed)
    raise AssertionError("jobs make jobs for ever")


def compute(past: CampaignHistory) -> ProposalComputation:
    """Once for all tests of a process: the same history gives the same proposal, as `test_recomputing` sees."""
    key = hashlib.sha256(pickle.dumps(past)).digest()
    if key not in _COMPUTED:
        _COMPUTED[key] = computation.compute(past)
    return _COMPUTED[key]


_COMPUTED: dict[bytes, ProposalComputation] = {}


def claim(database: Database) -> FlightRequest:
    """The flight that waits."""
    with database.write() as session:
        task = flight_rows.claim_flight(session, WORKER)
    assert task is not None
    return task


def stage(database: Database) -> FlightRequest:
    """Claim the flight that waits and have the vehicle take its gains."""
    task = claim(database)
    with database.write() as session:
        flight_rows.record_staged(session, task.flight_id, dict(task.gains))
    return task


def lift_off(database: Database) -> FlightRequest:
    """Claim, stage and begin the flight that waits."""
    task = stage(database)
    with database.write() as session:
        flight_rows.record_lift_off(session, task.flight_id)
    return task


def land(database: Database, task: FlightRequest, record: FlightRecord) -> None:
    with database.write() as session:
        flight_rows.record_outcome(session, task.flight_id, flight_rows.FlightOutcome(record=record))
