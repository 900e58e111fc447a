"""Logs sent in over HTTP: takeoff and gains are found, and gains that were not planned need a person's confirmation."""

import json

import pytest
from fastapi.testclient import TestClient

from app.db.models import TrajectoryRow, TrialRow
from app.db.session import Database
from tests.builders import Json, create_ready_campaign, create_trial, get, problems_of, run_jobs
from tests.logs.paparazzi_flights import COMPANION, Flight, data_of
from tests.logs.recorded import SCRIPT_CURRENT_4, TLOGS, recorded

ANY = {"Content-Type": "application/octet-stream"}
DEFAULT, TUNED = TLOGS


@pytest.fixture
def campaign(client: TestClient, database: Database) -> Json:
    return create_ready_campaign(client, database, vehicle="import")


@pytest.fixture
def trial(client: TestClient, campaign: Json) -> Json:
    """Planned with the default gains."""
    return create_trial(client, campaign["id"])


def path_of(trial: Json) -> str:
    return f"/api/trials/{trial['id']}/trajectory"


def test_a_log_with_the_planned_gains_is_stored_and_scored(client: TestClient, trial: Json) -> None:
    answer = client.post(path_of(trial), content=recorded(f"{DEFAULT}.tlog"), headers=ANY)
    flown = answer.json()
    assert (answer.status_code, flown["state"]) == (201, "valid")
    assert flown["error"] == pytest.approx(0.3297, abs=0.00005)
    assert flown["gains"] == flown["read_back"] == TLOGS[DEFAULT]
    read = "MAVLink log of Paparazzi, altitude from LOCAL_POSITION_NED.z; time from the block Takeoff"
    assert flown["record"]["source"].startswith(read)


def test_a_log_of_other_gains_is_refused_naming_both_sets_and_stores_nothing(client: TestClient, trial: Json) -> None:
    answer = client.post(path_of(trial), content=recorded(f"{TUNED}.tlog"), headers=ANY)
    assert (answer.status_code, answer.json()["title"]) == (409, "Confirmation needed")
    assert "kp 1624, ki 1356, kd 195" in answer.json()["detail"]
    assert "kp 283, ki 13, kd 82" in answer.json()["detail"]
    assert set(problems_of(answer)) == {"confirm"}
    after = get(client, f"/api/trials/{trial['id']}")
    assert (after["state"], after["record"], after["read_back"]) == ("planned", None, None)


def test_a_record_with_its_trial_is_one_operation_and_a_refused_one_leaves_nothing_planned(
    client: TestClient, campaign: Json
) -> None:
    path = f"/api/campaigns/{campaign['id']}/records"
    proposal = get(client, f"/api/campaigns/{campaign['id']}/proposal")["proposal"]
    form = {"trial": json.dumps({"proposal_id": proposal["id"], "note": "Before noon"})}
    refused = client.post(path, data=form, files={"file": ("flight.tlog", recorded(f"{TUNED}.tlog"))})
    assert (refused.status_code, set(problems_of(refused))) == (409, {"confirm"})
    assert get(client, f"/api/campaigns/{campaign['id']}/trials")["items"] == []
    once = {"Idempotency-Key": "one flight"}
    answers = [
        client.post(path, data=form, files={"file": ("flight.tlog", recorded(f"{DEFAULT}.tlog"))}, headers=once)
        for _ in range(2)
    ]
    assert [answer.status_code for answer in answers] == [201, 201]
    (flown,) = get(client, f"/api/campaigns/{campaign['id']}/trials")["items"]
    assert (flown["state"], flown["note"], flown["gains"]) == ("valid", "Before noon", TLOGS[DEFAULT])
    other = {"trial": json.dumps({"variant": "repeat"})}
    reused = client.post(path, data=other, files={"file": ("flight.tlog", recorded(f"{DEFAULT}.tlog"))}, headers=once)
    assert reused.json()["title"] == "Key reused"


@pytest.mark.parametrize(
    ("trial", "field", "reason"),
    [
        (None, "trial", "must be an object with fields"),
        ("{", "trial", "is not JSON"),
        pytest.param("[" * 100_000, "trial", "is not JSON", id="nested too deep"),
        ('{"gains": {"kp": "many"}}', "trial.gains.kp", "number"),
        ('{"variant": "repeat", "fly": {"speed": 1}}', "trial.fly", "is not a known field"),
        ("{}", "proposal_id", "exactly one is required"),
    ],
)
def test_a_trial_that_cannot_be_planned_is_refused_by_field(
    client: TestClient, campaign: Json, trial: str | None, field: str, reason: str
) -> None:
    form = {} if trial is None else {"trial": trial}
    answer = client.post(
        f"/api/campaigns/{campaign['id']}/records",
        data=form,
        files={"file": ("flight.tlog", recorded(f"{DEFAULT}.tlog"))},
    )
    assert answer.status_code == 422
    assert reason in problems_of(answer)[field]
    assert get(client, f"/api/campaigns/{campaign['id']}/trials")["items"] == []


@pytest.mark.complete
def test_gains_beyond_the_bounds_that_flew_all_the_same_count_and_the_next_ones_stay_inside(
    client: TestClient, database: Database, campaign: Json, trial: Json
) -> None:
    flown = client.post(f"{path_of(trial)}?confirm=true", content=recorded(f"{TUNED}.tlog"), headers=ANY).json()
    assert (flown["state"], flown["gains"], flown["gate"]["passed"]) == ("valid", TLOGS[TUNED], False)
    run_jobs(database)
    found = get(client, f"/api/campaigns/{campaign['id']}/proposal")
    assert found["state"] == "ready", found
    assert found["proposal"]["gains"]["ki"] <= 1073


@pytest.mark.complete
def test_a_step_starts_from_the_best_gains_within_the_bounds(
    client: TestClient, database: Database, campaign: Json, trial: Json
) -> None:
    """The best flight, ki 1356, lies beyond the bounds: neither repeats nor changes are of its gains."""
    client.post(path_of(trial), content=recorded("paparazzi_283_13_82.tlog"), headers=ANY)
    run_jobs(database)
    second = create_trial(client, campaign["id"])
    client.post(f"{path_of(second)}?confirm=true", content=recorded(f"{TUNED}.tlog"), headers=ANY)
    run_jobs(database)
    proposal = get(client, f"/api/campaigns/{campaign['id']}/proposal")["proposal"]
    repeat = next(each["gains"] for each in proposal["choices"] if each["kind"] == "repeat")
    assert repeat == TLOGS["paparazzi_283_13_82"]
    assert {name: change["now"] for name, change in proposal["changes"].items()} == repeat
    assert get(client, f"/api/campaigns/{campaign['id']}")["best"]["gains"] == TLOGS[TUNED]


@pytest.mark.complete
def test_confirmed_gains_become_the_trial_s_and_what_was_predicted_for_others_goes(
    client: TestClient, trial: Json
) -> None:
    flight = data_of(Flight({"kp": 290, "ki": 40, "kd": 80})).encode()
    answer = client.post(f"{path_of(trial)}?confirm=true", content=flight, headers=ANY)
    flown = answer.json()
    assert (answer.status_code, flown["state"], flown["kind"]) == (201, "valid", "manual")
    assert flown["gains"] == flown["read_back"] == {"kp": 290, "ki": 40, "kd": 80}
    assert (flown["predicted_error"], flown["predicted_interval"]) == (None, None)
    assert not is_prediction_drawn(client, flown)


@pytest.mark.complete
def test_the_curve_predicted_for_other_custom_gains_is_deleted(
    client: TestClient, database: Database, campaign: Json
) -> None:
    trial = create_trial(client, campaign["id"], gains={"kp": 300, "ki": 20, "kd": 80})
    with database.read() as session:
        assert session.query(TrajectoryRow).count() == 2, "the proposal's and the trial's"
    flight = data_of(Flight({"kp": 290, "ki": 40, "kd": 80})).encode()
    flown = client.post(f"{path_of(trial)}?confirm=true", content=flight, headers=ANY).json()
    assert not is_prediction_drawn(client, flown)
    with database.read() as session:
        assert session.query(TrajectoryRow).count() == 2, "the proposal's and the record"
        assert session.get_one(TrialRow, trial["id"]).predicted_id is None


def is_prediction_drawn(client: TestClient, trial: Json) -> bool:
    drawn = get(client, f"/api/trials/{trial['id']}/figure")["figure"]["data"]
    return any(trace["meta"]["role"] in {"prediction", "band"} for trace in drawn)


EXPERIMENTS = {
    "takeoff": {"paparazzi_283_13_82.tlog", "paparazzi_1624_1356_195.tlog"},
    "takeoff-ardupilot": {"arducopter_takeoff.bin", "arducopter_steps.bin"},
    "takeoff-px4": {"px4_takeoff.ulg"},
}


LOGS = sorted(set().union(*EXPERIMENTS.values()))


@pytest.mark.complete
@pytest.mark.parametrize("experiment", EXPERIMENTS)
def test_a_log_of_another_autopilot_is_refused_whatever_is_confirmed(
    client: TestClient, database: Database, experiment: str
) -> None:
    """Seen: logs of ArduCopter and PX4 in a campaign of Paparazzi, stored with the planned gains."""
    definition = {"experiment": experiment, "strategy": "manual"}
    campaign = create_ready_campaign(client, database, vehicle="import", definition=definition)
    trial = create_trial(client, campaign["id"])
    path = f"{path_of(trial)}?confirm=true&invalid=true&takeoff=1"
    for log in {*LOGS} - EXPERIMENTS[experiment]:
        answer = client.post(path, content=recorded(log), headers=ANY)
        assert answer.status_code == 422, log
        assert set(problems_of(answer)) == {"file"}
        assert "this campaign tunes" in answer.json()["detail"]
        assert get(client, f"/api/trials/{trial['id']}")["state"] == "planned"
    for log in sorted(EXPERIMENTS[experiment]):
        path = f"{path_of(trial)}?confirm=true&invalid=true&takeoff=1"
        answer = client.post(path, content=recorded(log), headers=ANY)
        assert answer.status_code == 201, answer.text
        assert answer.json()["gains"] == answer.json()["read_back"]
        run_jobs(database)
        trial = create_trial(client, campaign["id"])


FLOWN_HERE = {"twin": "takeoff", "jsbsim": "takeoff", "lti": "pitch-tracking"}


@pytest.mark.complete
@pytest.mark.parametrize("vehicle", FLOWN_HERE)
def test_no_log_is_taken_for_a_trial_that_gainline_flies_itself(
    client: TestClient, database: Database, vehicle: str
) -> None:
    definition = {"experiment": FLOWN_HERE[vehicle], "strategy": "manual"}
    campaign = create_ready_campaign(client, database, vehicle=vehicle, definition=definition)
    trial = create_trial(client, campaign["id"])
    for log in LOGS:
        answer = client.post(f"{path_of(trial)}?confirm=true&takeoff=1", content=recorded(log), headers=ANY)
        assert answer.status_code == 409, log
        assert "is flown from here" in answer.json()["detail"]
    after = get(client, f"/api/trials/{trial['id']}")
    assert (after["state"], after["record"], after["read_back"]) == ("planned", None, None)


def test_the_content_of_a_log_counts_and_not_its_file_extension(client: TestClient, trial: Json) -> None:
    empty = client.post(path_of(trial), files={"file": ("flight.ulg", b"")})
    assert (empty.status_code, set(problems_of(empty))) == (422, {"file"})
    answer = client.post(path_of(trial), files={"file": ("flight.csv", recorded(f"{DEFAULT}.tlog"))})
    assert (answer.status_code, answer.json()["read_back"]) == (201, TLOGS[DEFAULT])


CUT = {
    f"{DEFAULT}.tlog": "without a rise by 0.5 m",
    "arducopter_takeoff.bin": "contains neither PSCD.PD nor CTUN.Alt, the altitude",
    "px4_takeoff.ulg": "contains no vehicle_local_position.z, the altitude",
}


@pytest.mark.parametrize("log", CUT)
def test_a_log_that_was_cut_before_the_flight_is_refused_and_stores_nothing(
    client: TestClient, database: Database, log: str
) -> None:
    experiment = next(name for name, logs in EXPERIMENTS.items() if log in logs)
    definition = {"experiment": experiment, "strategy": "manual"}
    campaign = create_ready_campaign(client, database, vehicle="import", definition=definition)
    trial = create_trial(client, campaign["id"])
    answer = client.post(f"{path_of(trial)}?confirm=true", content=recorded(log)[:20_000], headers=ANY)
    assert answer.status_code == 422
    assert CUT[log] in next(iter(problems_of(answer).values()))
    assert get(client, f"/api/trials/{trial['id']}")["state"] == "planned"


def test_a_log_of_another_autopilot_is_refused_also_where_its_gains_are_not_in_it(
    client: TestClient, database: Database
) -> None:
    definition = {"experiment": "takeoff-px4", "strategy": "manual"}
    campaign = create_ready_campaign(client, database, vehicle="import", definition=definition)
    data = data_of(Flight({"kp": 283, "ki": 13, "kd": 82}, loop_log=False)).encode()
    answer = client.post(path_of(create_trial(client, campaign["id"])), content=data, headers=ANY)
    assert (answer.status_code, set(problems_of(answer))) == (422, {"file"})
    assert "The log has the gains kp, ki, kd" in answer.json()["detail"]
    assert problems_of(answer) == {"file": "is a log of another autopilot"}


def test_of_a_log_with_two_takeoffs_the_one_that_is_asked_for_is_stored(client: TestClient, trial: Json) -> None:
    both = recorded(f"{TUNED}.tlog") + recorded(f"{DEFAULT}.tlog")
    refused = client.post(path_of(trial), content=both, headers=ANY)
    assert refused.status_code == 422
    assert [problem["field"] for problem in refused.json()["problems"]] == ["takeoff", "takeoff"]
    flown = client.post(f"{path_of(trial)}?takeoff=2", content=both, headers=ANY).json()
    assert flown["error"] == pytest.approx(0.3297, abs=0.00005)


def test_the_same_key_with_another_question_or_another_log_is_another_request(client: TestClient, trial: Json) -> None:
    headers = {**ANY, "Idempotency-Key": "one"}
    content = recorded(f"{DEFAULT}.tlog")
    first = client.post(path_of(trial), content=content, headers=headers)
    assert client.post(path_of(trial), content=content, headers=headers).json() == first.json()
    for query, sent in (("?takeoff=1", content), ("", recorded(f"{TUNED}.tlog"))):
        other = client.post(f"{path_of(trial)}{query}", content=sent, headers=headers)
        assert (other.status_code, other.json()["title"]) == (422, "Key reused")


def test_a_paparazzi_log_comes_with_its_companion_in_a_form(client: TestClient, trial: Json) -> None:
    data = data_of(Flight({"kp": 283, "ki": 13, "kd": 82}))
    answer = client.post(path_of(trial), files={"file": ("a.data", data), "companion": ("a.log", COMPANION)})
    assert answer.status_code == 201, answer.text
    assert answer.json()["read_back"] == TLOGS[DEFAULT]


def test_a_record_from_lift_off_is_not_comparable_and_stored_only_as_invalid(client: TestClient, trial: Json) -> None:
    """The same flight, 0.3240 m from the command on, is 0.3123 m from its lift-off."""
    log = recorded("paparazzi_takeoff_no_block_list.tlog")
    silent = log.replace(SCRIPT_CURRENT_4, bytes(len(SCRIPT_CURRENT_4)))
    refused = client.post(path_of(trial), content=silent, headers=ANY)
    assert (refused.status_code, set(problems_of(refused))) == (409, {"invalid"})
    assert "not comparable: it begins at lift-off" in refused.json()["detail"]
    stored = client.post(f"{path_of(trial)}?invalid=true", content=silent, headers=ANY).json()
    assert (stored["state"], stored["error"]) == ("invalid", None)
    assert "not comparable: it begins at lift-off" in stored["reason"]


def test_motors_stopped_in_the_air_are_no_flight_to_score(client: TestClient, trial: Json) -> None:
    log = recorded("paparazzi_motors_stopped_in_the_air.tlog")
    assert set(problems_of(client.post(path_of(trial), content=log, headers=ANY))) == {"invalid"}
    stored = client.post(f"{path_of(trial)}?invalid=true", content=log, headers=ANY).json()
    assert (stored["state"], stored["error"]) == ("invalid", None)


def test_a_log_without_gains_is_refused_and_says_where_they_can_be_found(client: TestClient, trial: Json) -> None:
    """Nobody knows what was flown: taken with the planned gains, a flight of others would train the model."""
    data = data_of(Flight({"kp": 283, "ki": 13, "kd": 82}, loop_log=False)).encode()
    answer = client.post(f"{path_of(trial)}?confirm=true&invalid=true", content=data, headers=ANY)
    assert (answer.status_code, problems_of(answer)) == (422, {"file": "does not contain values of kp, ki, kd"})
    assert answer.json()["detail"] == "The log does not say with which gains it was flown."
    assert ".log file of the same name" in answer.json()["hint"]
    assert get(client, f"/api/trials/{trial['id']}")["state"] == "planned"


def test_a_file_of_the_wrong_kind_is_refused_by_its_name(client: TestClient, trial: Json) -> None:
    answer = client.post(path_of(trial), files={"file": ("flight.ulg", b"\x7fELF" + bytes(100))})
    assert answer.status_code == 422
    assert answer.json()["detail"] == "flight.ulg does not match its file extension."
