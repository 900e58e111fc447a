"""Records that show no flight of the campaign: asked about, with what they may be read as, and not stored meanwhile."""

from datetime import UTC, datetime, timedelta, timezone
from typing import Final

import numpy as np
import pytest
from fastapi.testclient import TestClient

from app.autopilots.takeoffs import Takeoff
from app.campaigns.trials import records
from app.common.errors import UnconfirmedError
from app.common.states import TrialState
from app.core.errors import InputError
from app.core.records.trajectory import Samples, Trajectory
from app.db.base import utc_now
from app.db.models import TrialRow
from app.db.session import Database
from app.jobs import service as jobs
from tests.builders import (
    WORKER,
    Json,
    climb_error,
    create_climb,
    create_ready_campaign,
    create_trial,
    csv_of,
    get,
    run_jobs,
)

CLIMB: Final = create_climb()
TIME_S: Final = CLIMB.time_s
CLIMB_M: Final = CLIMB["altitude_m"]
KEPT: Final = (TIME_S < 12.0) | (TIME_S >= 13.0)


@pytest.fixture
def campaign(client: TestClient, database: Database) -> Json:
    return create_ready_campaign(client, database, vehicle="import")


@pytest.fixture
def trial(client: TestClient, campaign: Json) -> Json:
    return create_trial(client, campaign["id"])


def send(client: TestClient, trial: Json, content: bytes, **accepted: bool | list[str]) -> tuple[int, Json]:
    answer = client.post(
        f"/api/trials/{trial['id']}/trajectory", content=content, params=accepted, headers={"Content-Type": "text/csv"}
    )
    return answer.status_code, answer.json()


def csv(altitude_m: object, time_s: object = TIME_S) -> bytes:
    return csv_of({"time_s": np.asarray(time_s), "altitude_m": np.asarray(altitude_m)})


def offered(answer: Json) -> tuple[list[str], list[str]]:
    """The readings and the codes of what is wrong."""
    codes: dict[str, list[str]] = {"reads_as": [], "invalid": []}
    for problem in answer["problems"]:
        codes[problem["field"]].append(problem["code"])
    return codes["reads_as"], codes["invalid"]


KINDS: Final = {
    "constant 3 m": (csv(np.full_like(TIME_S, 3.0)), [], ["constant", "off ground", "too low"]),
    "never took off": (csv(0.02 * np.sin(TIME_S)), [], ["too low"]),
    "begins in hover": (csv(3.0 + 0.02 * np.sin(TIME_S)), [], ["off ground", "too low"]),
    "a gap": (csv(CLIMB_M[KEPT], TIME_S[KEPT]), [], ["unscorable"]),
    "centimetres": (csv(100.0 * CLIMB_M), ["centimetres"], ["too high"]),
    "feet": (csv(CLIMB_M / 0.3048), ["feet"], ["too high"]),
    "down-positive": (csv(-CLIMB_M), ["down-positive"], ["too low"]),
    "above sea level": (csv(CLIMB_M + 432.1), ["other-datum"], ["off ground", "too high"]),
    "an offset of 0.4 m": (csv(CLIMB_M + 0.4), ["other-datum"], ["off ground"]),
    "feet above sea level": (csv(CLIMB_M / 0.3048 + 1417.0), ["feet", "other-datum"], ["off ground", "too high"]),
    "milliseconds": (csv(CLIMB_M, 1e3 * TIME_S), ["milliseconds"], ["unscorable"]),
    "microseconds": (csv(CLIMB_M, 1e6 * TIME_S), ["microseconds"], ["unscorable"]),
}


@pytest.mark.parametrize("kind", KINDS)
def test_what_shows_no_takeoff_is_refused_and_leaves_the_trial_open(
    client: TestClient, database: Database, trial: Json, kind: str
) -> None:
    content, readings, codes = KINDS[kind]
    status, refusal = send(client, trial, content)
    assert (status, refusal["title"]) == (409, "Confirmation needed")
    assert offered(refusal) == (readings, codes)
    with database.read() as session:
        row = session.get_one(TrialRow, trial["id"])
        assert (row.state, row.trajectory_id, row.flown_at, row.error) == (TrialState.PLANNED, None, None, None)
    if readings:
        status, flown = send(client, trial, content, reads_as=readings)
        assert (status, flown["state"]) == (201, "valid")
        assert flown["error"] == pytest.approx(climb_error(1.0), abs=1e-3)
        assert flown["record"]["source"].startswith("csv; read with ")
        return
    assert send(client, trial, csv(CLIMB_M))[1]["state"] == "valid"


@pytest.mark.parametrize(
    ("altitude_m", "readings"),
    [(CLIMB_M * 3.0, set()), (CLIMB_M + 12.0, {"other-datum"})],
    ids=["flown to 9 m", "datum"],
)
def test_an_autopilots_log_is_in_metres(
    database: Database, trial: Json, altitude_m: Samples, readings: set[str]
) -> None:
    gains = {"kp": 283.0, "ki": 13.0, "kd": 82.0}
    record = Trajectory(TIME_S, {"altitude_m": altitude_m}, "log", "vehicle")
    flown = Takeoff(
        number=1, start_s=0.0, begins_with="the command", trajectory=record, gains=gains, gain_names=tuple(gains)
    )
    with database.write() as session, pytest.raises(UnconfirmedError) as refused:
        records.import_record(session, trial["id"], flown)
    assert {problem.code for problem in refused.value.problems if problem.field == "reads_as"} == readings


def test_a_reading_that_does_not_explain_the_record_is_refused_too(client: TestClient, trial: Json) -> None:
    content = KINDS["feet above sea level"][0]
    status, refusal = send(client, trial, content, reads_as=["other-datum"])
    assert (status, offered(refusal)) == (409, (["feet"], ["too high"]))
    status, refusal = send(client, trial, csv(CLIMB_M), reads_as=["feet"])
    assert (status, offered(refusal)) == (409, ([], ["too low"]))
    assert send(client, trial, content, reads_as=["furlongs"])[0] == 422
    assert get(client, f"/api/trials/{trial['id']}")["state"] == "planned"


def test_a_person_may_store_it_as_an_invalid_flight_and_decide_later(client: TestClient, trial: Json) -> None:
    status, stored = send(client, trial, KINDS["begins in hover"][0], invalid=True)
    assert (status, stored["state"], stored["error"], stored["may_be_valid"]) == (201, "invalid", None, True)
    assert (
        stored["reason"] == "it begins at 3.00 m, not within 0.3 m of the ground; it rises by 0.02 m, less than 1.5 m"
    )


def test_the_refusal_says_what_the_record_looks_like(client: TestClient, trial: Json) -> None:
    _, refusal = send(client, trial, KINDS["centimetres"][0])
    assert refusal["detail"] == (
        "The record shows no flight of this campaign: it is at 300.00 m for half of the time, above 4.5 m. It looks "
        "like one with altitude in centimetres."
    )


def test_an_error_of_zero_divides_nothing_and_a_failed_job_leaves_the_campaign_open(
    client: TestClient, database: Database
) -> None:
    """Seen: a constant 3.0 m was valid, with an error of 0; its proposal failed, and the campaign was stuck."""
    campaign = create_ready_campaign(client, database, vehicle="import", definition={"strategy": "calibrated"})
    trial = create_trial(client, campaign["id"])
    _, stored = send(client, trial, KINDS["constant 3 m"][0], invalid=True)
    run_jobs(database)
    said = {"version": stored["version"], "outcome": "valid", "reason": "it was on rails"}
    counted = client.post(f"/api/trials/{trial['id']}/classify", json=said).json()
    assert (counted["state"], counted["error"]) == ("valid", 0.0)
    with database.write() as session:
        job = jobs.claim_job(session, worker=WORKER, kinds=("proposal",), lease_s=30.0)
        assert job is not None
        jobs.fail_job(session, job.id, InputError("It failed.", hint="Nothing."), worker=WORKER)
    path = f"/api/campaigns/{campaign['id']}/proposal"
    assert get(client, path)["state"] == "failed"
    said = {"version": counted["version"], "outcome": "invalid", "reason": "the wrong column"}
    assert client.post(f"/api/trials/{trial['id']}/classify", json=said).status_code == 200
    run_jobs(database)
    assert get(client, path)["state"] == "ready"
    said = {"version": counted["version"] + 1, "outcome": "valid", "reason": "the right column"}
    assert client.post(f"/api/trials/{trial['id']}/classify", json=said).status_code == 200
    run_jobs(database)
    assert get(client, path)["state"] == "ready"
    again = create_trial(client, campaign["id"])
    status, flown = send(client, again, csv(CLIMB_M))
    assert (status, flown["state"]) == (201, "valid")
    assert "higher than the best before it" in flown["verdict"]


@pytest.mark.parametrize(
    ("began_at", "is_used"),
    [
        (None, False),
        (datetime(2024, 5, 4, 10, 30, tzinfo=UTC), True),
        (datetime(2024, 5, 4, 10, 30, tzinfo=timezone(timedelta(hours=2))), True),
        (datetime(1970, 1, 1, 0, 5, tzinfo=UTC), False),
        (datetime(1980, 1, 6, tzinfo=UTC), False),
        (datetime(2106, 2, 7, tzinfo=UTC), False),
    ],
)
def test_a_flight_was_flown_when_its_log_says(
    client: TestClient, database: Database, trial: Json, began_at: datetime | None, is_used: bool
) -> None:
    flown = Takeoff(number=1, start_s=0.0, begins_with="the command", trajectory=CLIMB, gains={}, began_at=began_at)
    before = utc_now()
    with database.write() as session:
        records.import_record(session, trial["id"], flown)
    stored = get(client, f"/api/trials/{trial['id']}")
    at = datetime.fromisoformat(stored["flown_at"])
    assert (at == began_at) if is_used else (before <= at <= utc_now())
    assert ("date by the log's clock, taken as UTC" in stored["record"]["source"]) == is_used
    assert ("date unknown" in stored["record"]["source"]) == (began_at is not None and not is_used)
