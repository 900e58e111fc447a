"""A real vehicle flies in two steps: its gains staged and read back, then its operator's own act in the browser."""

from collections.abc import Iterator
from concurrent.futures import Future
from dataclasses import replace
from datetime import timedelta
from typing import Any

import pytest
from fastapi.testclient import TestClient

from app.common.data_folder import telemetry_log
from app.common.errors import ConflictError
from app.common.settings import Settings
from app.core.records.trajectory import Trajectory
from app.db.base import FLIGHT_END, utc_now
from app.db.models import FlightRow
from app.db.session import Database
from app.fleet import commands
from app.flights import flight_rows
from app.flights.flight_rows import FlightOutcome
from app.flights.service import record_abort
from app.live.link import LiveServer
from app.live.messages import UnreadyReason, VehicleStatus, live_address
from app.main import create_app
from app.vehicles.base import FlightRecord
from app.vehicles.flight_end import (
    Failure,
    FlightEnd,
    GainsLeft,
    Landing,
    Requester,
    StopRequest,
    end_text,
    unstaged_text,
    withdrawn_by,
)
from tests.builders import (
    WORKER,
    Json,
    claim,
    create_climb,
    create_ready_campaign,
    create_record,
    create_trial,
    get,
)
from tests.builders import stage as stage_claimed
from tests.fleet.vehicles import (
    DEFAULT_GAINS,
    OUR_PAGE,
    control_header,
    create_campaign_on,
    create_connected,
    seen,
    take_control,
)
from tests.unlocking import HERE, unlock
from tests.vehicles.mavlink.test_before_lift_off import stopped as stopped_drone

UNSTAGED = FlightEnd(request=StopRequest(), landed=Landing.STAYED)


@pytest.fixture(autouse=True)
def worker_link(settings: Settings) -> Iterator[LiveServer]:
    """The worker's end of the live link, before the client looks for it."""
    with LiveServer(
        live_address(settings.data_dir),
        abort=lambda _trial, _reason: False,
        order=lambda *_: Future(),
    ) as server:
        yield server


def report(client: TestClient, planned: Json, unready: UnreadyReason = "", *, battery_v: float = 11.8) -> None:
    """The vehicle's status arrives, as five times a second."""
    application: Any = client.app
    while not application.state.live.client.connected:
        get(client, "/api/health")
    vehicle_id = get(client, f"/api/campaigns/{planned['campaign_id']}")["vehicle"]["id"]
    status = VehicleStatus(
        vehicle_id=vehicle_id, state="connected", at="", step="idle", unready=unready, battery_v=battery_v
    )
    application.state.live.hub.publish(status)


@pytest.fixture
def real(client: TestClient, database: Database) -> Json:
    """A real vehicle, connected."""
    return create_connected(client, database, real=True)


@pytest.fixture
def planned(client: TestClient, database: Database, real: Json) -> Json:
    """A trial on it."""
    return create_trial(client, create_campaign_on(client, database, real)["id"])


@pytest.fixture
def staged(client: TestClient, database: Database, planned: Json) -> Json:
    """The same, with its gains on the vehicle."""
    assert client.post(f"/api/trials/{planned['id']}/stage").status_code == 202
    stage_claimed(database)
    return trial(client, planned)


def trial(client: TestClient, known: Json) -> Json:
    found: Json = get(client, f"/api/trials/{known['id']}")
    return found


def take_off(client: TestClient, staged: Json, headers: dict[str, str]) -> tuple[int, str]:
    report(client, staged)
    answer = client.post(f"/api/trials/{staged['id']}/take-off", headers=headers)
    return answer.status_code, answer.json().get("detail", "")


def unstage_claimed(database: Database, staged: Json) -> None:
    """Its worker restores the safe gains instead of taking off."""
    outcome = FlightOutcome(withdrawn=True, end=UNSTAGED, restored=DEFAULT_GAINS)
    with database.write() as session:
        flight_rows.record_outcome(session, staged["flight"]["id"], outcome)


def is_wanted(database: Database, staged: Json) -> tuple[bool, FlightOutcome | None]:
    """Whether its worker may take off, and the outcome if it is to stand down."""
    with database.read() as session:
        flight_id = staged["flight"]["id"]
        return flight_rows.clearance_of(session, flight_id)


@pytest.mark.complete
def test_a_real_vehicle_takes_off_only_on_its_operators_own_act_in_the_browser(
    client: TestClient, database: Database, real: Json, staged: Json
) -> None:
    assert staged["actions"] == ["take-off", "unstage", "cancel", "abort", "note"]
    assert is_wanted(database, staged) == (False, None)
    with pytest.raises(ConflictError, match="its takeoff has not been requested"), database.write() as session:
        flight_rows.record_lift_off(session, staged["flight"]["id"])

    status, sentence = take_off(client, staged, {})
    assert (status, sentence) == (
        403,
        "Drone is a real vehicle: only its operator can start the takeoff, in the browser.",
    )
    script = control_header(client, real)
    assert take_off(client, staged, script)[0] == 403
    assert take_off(client, staged, {**script, "Sec-Fetch-Site": "none"})[0] == 403
    assert take_off(client, staged, OUR_PAGE) == (409, "Ada is in control of Drone.")
    assert take_off(client, staged, {**OUR_PAGE, "X-Gainline-Control": "guessed"})[0] == 409
    assert trial(client, staged)["flight"]["take_off_at"] is None

    assert take_off(client, staged, {**OUR_PAGE, **script}) == (202, "")
    assert is_wanted(database, staged) == (True, None)
    assert take_off(client, staged, {**OUR_PAGE, **script}) == (
        409,
        f"The takeoff of trial {staged['number']} has already been requested.",
    )
    with database.write() as session:
        flight_rows.record_lift_off(session, staged["flight"]["id"])
    assert trial(client, staged)["state"] == "flying"
    assert seen(client, real)["state"] == "flying"


@pytest.mark.complete
def test_without_anybody_in_control_nothing_real_takes_off(client: TestClient, staged: Json) -> None:
    assert take_off(client, staged, OUR_PAGE) == (409, "No operator is in control of Drone.")


@pytest.mark.complete
def test_a_rehearsal_that_is_found_bad_while_its_vehicle_is_staged_keeps_it_on_the_ground(
    client: TestClient, database: Database, real: Json, staged: Json
) -> None:
    rehearsal = get(client, f"/api/campaigns/{staged['campaign_id']}")["rehearsal"]
    flown = get(client, f"/api/campaigns/{rehearsal['campaign_id']}/trials")["items"][1]
    body = {"version": flown["version"], "outcome": "invalid", "reason": "it flew with the wrong mass"}
    assert client.post(f"/api/trials/{flown['id']}/classify", json=body).status_code == 200
    status, sentence = take_off(client, staged, {**OUR_PAGE, **control_header(client, real)})
    assert (status, sentence.endswith("has not passed its rehearsal (flight 2 is invalid).")) == (409, True)
    assert is_wanted(database, staged) == (False, None)
    assert trial(client, staged)["flight"]["take_off_at"] is None


@pytest.mark.complete
def test_the_word_sent_twice_with_one_key_is_one_word(client: TestClient, real: Json, staged: Json) -> None:
    headers = {**OUR_PAGE, **control_header(client, real), "Idempotency-Key": "hold"}
    assert take_off(client, staged, headers) == (202, "")
    assert take_off(client, staged, headers) == (202, "")


@pytest.mark.complete
def test_a_take_off_that_could_not_begin_in_time_does_not_begin_at_all(
    client: TestClient, database: Database, real: Json, staged: Json
) -> None:
    take_off(client, staged, {**OUR_PAGE, **control_header(client, real)})
    with database.write() as session:
        session.get_one(FlightRow, staged["flight"]["id"]).take_off_at = utc_now() - timedelta(seconds=11)
    why = "the takeoff did not start within 10 s of the operator's request"
    assert is_wanted(database, staged) == (False, FlightOutcome(withdrawn=True, problem=why))
    with pytest.raises(ConflictError, match=why), database.write() as session:
        flight_rows.record_lift_off(session, staged["flight"]["id"])


@pytest.mark.complete
def test_a_real_vehicle_is_never_flown_in_one_go(client: TestClient, planned: Json) -> None:
    for path, body in (
        (f"/api/trials/{planned['id']}/fly", {}),
        (f"/api/campaigns/{planned['campaign_id']}/trials", {"gains": DEFAULT_GAINS, "fly": {}}),
    ):
        refused = client.post(path, json=body, headers=OUR_PAGE)
        assert refused.status_code == 403
        assert "Stage the trial" in refused.json()["hint"]
    assert planned["actions"] == ["stage", "cancel", "note"]


@pytest.mark.complete
def test_real_vehicles_fly_only_from_a_server_that_nobody_else_reaches(
    settings: Settings, client: TestClient, database: Database, real: Json, planned: Json
) -> None:
    exposed = settings.model_copy(update={"host": "0.0.0.0"})
    headers = {**OUR_PAGE, **control_header(client, real)}
    with TestClient(create_app(exposed), base_url="http://127.0.0.1:8000", client=HERE) as network:
        refused = network.post(f"/api/trials/{planned['id']}/stage", headers=headers)
        assert (refused.status_code, refused.json()["title"]) == (403, "Not allowed")
        unlock(network)
        assert client.post(f"/api/trials/{planned['id']}/stage", headers=headers).status_code == 202
        stage_claimed(database)
        status, sentence = take_off(network, planned, headers)
        assert (status, "other devices can reach the server" in sentence) == (403, True)


@pytest.mark.complete
def test_an_unstaged_vehicle_gets_its_safe_gains_back_and_its_trial_is_planned_again(
    client: TestClient, database: Database, real: Json, staged: Json
) -> None:
    headers = {**OUR_PAGE, **control_header(client, real)}
    answer = client.post(f"/api/trials/{staged['id']}/unstage", headers=headers)
    assert (answer.status_code, answer.json()["state"]) == (202, "staged")
    assert answer.json()["flight"]["standing_down"] == end_text(UNSTAGED)
    assert answer.json()["actions"] == ["cancel", "abort", "note"]
    assert is_wanted(database, staged) == (False, FlightOutcome(withdrawn=True, end=UNSTAGED))
    assert take_off(client, staged, headers) == (
        409,
        f"Flight {staged['number']} is being unstaged: {end_text(UNSTAGED)}.",
    )
    unstage_claimed(database, staged)
    after = trial(client, staged)
    assert (after["state"], after["flight"]["state"], after["actions"][0]) == ("planned", "cancelled", "stage")
    assert seen(client, real)["state"] == "ready"


@pytest.mark.complete
@pytest.mark.parametrize(("headers", "by"), [(OUR_PAGE, Requester.BROWSER), ({}, Requester.SCRIPT)])
def test_an_unstaging_by_somebody_else_is_not_recorded_as_the_operators(
    client: TestClient, real: Json, staged: Json, headers: dict[str, str], by: Requester
) -> None:
    """Observed defect: everyone may unstage, and it was always “by the operator”."""
    take_control(client, real)
    answer = client.post(f"/api/trials/{staged['id']}/unstage", headers=headers)
    assert answer.json()["flight"]["standing_down"] == unstaged_text(by)


@pytest.mark.complete
def test_a_take_off_does_not_pass_an_unstaging(
    client: TestClient, database: Database, real: Json, staged: Json
) -> None:
    take_off(client, staged, {**OUR_PAGE, **control_header(client, real)})
    client.post(f"/api/trials/{staged['id']}/unstage")
    with pytest.raises(ConflictError, match=unstaged_text(Requester.SCRIPT)), database.write() as session:
        flight_rows.record_lift_off(session, staged["flight"]["id"])


@pytest.mark.complete
def test_a_cancelled_trial_stands_its_vehicle_down(client: TestClient, database: Database, staged: Json) -> None:
    assert client.post(f"/api/trials/{staged['id']}/cancel").status_code == 200
    assert is_wanted(database, staged) == (False, FlightOutcome(withdrawn=True, problem="the trial is cancelled"))


@pytest.mark.complete
def test_a_word_given_to_a_worker_that_ended_moves_nothing_later(
    client: TestClient, database: Database, real: Json, staged: Json
) -> None:
    take_off(client, staged, {**OUR_PAGE, **control_header(client, real)})
    with database.write() as session:
        assert flight_rows.lose_running_flights(session) == []
    assert is_wanted(database, staged) == (False, FlightOutcome(withdrawn=True, problem="the flight is failed"))
    after = trial(client, staged)
    assert (after["state"], after["flight"]["problem"]) == ("planned", "the worker stopped before lift-off")
    assert seen(client, real)["state"] == "quarantined"


@pytest.mark.complete
def test_a_second_vehicle_of_the_kind_flies_meanwhile_and_the_same_one_does_not(
    client: TestClient, database: Database, staged: Json
) -> None:
    other = create_connected(client, database, "Other")
    second = create_trial(client, create_campaign_on(client, database, other)["id"])
    assert client.post(f"/api/trials/{second['id']}/fly").status_code == 202
    task = claim(database)
    assert (task.vehicle_id, task.vehicle_kind, task.mode) == (other["id"], "mavlink", "fly")
    assert task.vehicle_options == other["options"]
    again = create_trial(client, staged["campaign_id"], gains={"kp": 250, "ki": 13, "kd": 82})
    refused = client.post(f"/api/trials/{again['id']}/stage")
    assert refused.status_code == 409
    assert "is staged" in refused.json()["detail"]


def test_a_simulated_vehicle_is_staged_by_a_script_too(client: TestClient, database: Database) -> None:
    vehicle = create_connected(client, database)
    planned = create_trial(client, create_campaign_on(client, database, vehicle)["id"])
    assert planned["actions"] == ["fly", "stage", "cancel", "note"]
    client.post(f"/api/trials/{planned['id']}/stage")
    task = stage_claimed(database)
    assert task.mode == "stage"
    assert seen(client, vehicle)["held"] == task.gains
    assert take_off(client, planned, {}) == (202, "")
    with database.write() as session:
        flight_rows.record_lift_off(session, task.flight_id)


def test_a_shared_simulation_is_not_staged(client: TestClient, database: Database) -> None:
    planned = create_trial(client, create_ready_campaign(client, database)["id"])
    refused = client.post(f"/api/trials/{planned['id']}/stage")
    assert (refused.status_code, "is flown without staging" in refused.json()["detail"]) == (409, True)
    client.post(f"/api/trials/{planned['id']}/fly")
    stage_claimed(database)
    for act in ("take-off", "unstage"):
        answer = client.post(f"/api/trials/{planned['id']}/{act}")
        assert (answer.status_code, "flies without staging" in answer.json()["detail"]) == (409, True)


def fly(client: TestClient, database: Database, vehicle: Json, planned: Json, record: FlightRecord) -> Json:
    """The whole flight of a staged trial."""
    assert client.post(f"/api/trials/{planned['id']}/stage").status_code == 202
    task = stage_claimed(database)
    take_off(client, planned, {**OUR_PAGE, **control_header(client, vehicle)})
    with database.write() as session:
        flight_rows.record_lift_off(session, task.flight_id)
    with database.write() as session:
        outcome = FlightOutcome(record=record, restored=dict(task.safe_gains))
        flight_rows.record_outcome(session, task.flight_id, outcome)
    return trial(client, planned)


def with_battery(first_v: float, last_v: float) -> FlightRecord:
    climb = create_climb()
    falling = first_v + (last_v - first_v) * climb.time_s / climb.time_s[-1]
    channels = {**climb.channels, "battery_v": falling}
    return FlightRecord(trajectory=Trajectory(climb.time_s, channels, "test", "vehicle"), ending="completed")


@pytest.mark.complete
def test_a_real_flight_keeps_its_battery_and_waits_for_a_persons_class(
    client: TestClient, database: Database, real: Json, planned: Json
) -> None:
    answer = client.patch(f"/api/vehicles/{real['id']}", json={"version": real["version"], "battery": " blue 2 "})
    assert answer.json()["battery"] == "blue 2"
    flown = fly(client, database, real, planned, with_battery(11.5, 10.75))
    assert (flown["state"], flown["flight"]["battery"]) == ("captured", "blue 2")
    assert (flown["flight"]["battery_v_before"], flown["flight"]["battery_v_after"]) == (11.5, 10.75)
    assert flown["flight"]["safe_gains_restored"] is True


@pytest.mark.complete
def test_an_unusable_measurement_suggests_invalid_for_a_real_flight_and_makes_a_simulated_one_invalid(
    client: TestClient, database: Database, real: Json, planned: Json
) -> None:
    void = create_record(ending="invalid", reason="the clock stood still for 0.3 s")
    flown = fly(client, database, real, planned, void)
    assert (flown["state"], flown["reason"]) == ("captured", "the clock stood still for 0.3 s")
    assert flown["record"]["ending"] == "invalid"
    assert "the measurement is doubtful: the clock stood still for 0.3 s" in flown["verdict"]
    assert flown["flight"]["state"] == "landed"

    simulated = create_connected(client, database, "Simulated")
    second = create_trial(client, create_campaign_on(client, database, simulated)["id"])
    judged = fly(client, database, simulated, second, void)
    assert (judged["state"], judged["reason"], judged["error"]) == ("invalid", "the clock stood still for 0.3 s", None)


@pytest.mark.complete
def test_the_ledger_lists_every_gain_set_that_was_given(
    client: TestClient, database: Database, real: Json, planned: Json
) -> None:
    fly(client, database, real, planned, create_record())
    assert seen(client, real)["held"] == DEFAULT_GAINS
    better = {"kp": 250, "ki": 13, "kd": 82}
    change = {"version": real["version"], "safe_gains": better, "statement": "Ada"}
    header = control_header(client, real)
    assert client.patch(f"/api/vehicles/{real['id']}", json=change, headers=header).status_code == 200
    client.post(f"/api/vehicles/{real['id']}/restore", headers=header)
    with database.write() as session:
        task = commands.claim_act(session, WORKER)
        assert task is not None
        commands.finish_act(session, task.act_id, read_back=task.vehicle.safe_gains)
    client.post(f"/api/vehicles/{real['id']}/check", headers=header)

    path = f"/api/vehicles/{real['id']}/ledger"
    first = get(client, f"{path}?limit=3")
    rest = get(client, f"{path}?limit=3&cursor={first['next_cursor']}")
    lines = [*first["items"], *rest["items"]]
    assert (first["total"], rest["next_cursor"]) == (4, None)
    assert [(line["purpose"], line["asked"], line["read_back"], line["outcome"]) for line in lines] == [
        ("restore", better, better, "done"),
        ("restore after flight", DEFAULT_GAINS, DEFAULT_GAINS, "done"),
        ("flight", DEFAULT_GAINS, DEFAULT_GAINS, "landed"),
        ("connect", {}, DEFAULT_GAINS, "done"),
    ]
    assert [line["trial_id"] for line in lines] == [None, planned["id"], planned["id"], None]
    assert seen(client, real)["held"] == better


@pytest.mark.parametrize(
    ("restored", "outcome"),
    [(None, "not confirmed"), ({"kp": 283, "ki": 0, "kd": 82}, "failed")],
    ids=["not read", "read otherwise"],
)
def test_safe_gains_that_did_not_come_back_after_a_flight_stand_in_the_ledger_as_they_were_read(
    client: TestClient, database: Database, real: Json, staged: Json, restored: Json | None, outcome: str
) -> None:
    """Observed defect: the ledger ended with the gains of the flight, and nothing said that the safe ones failed."""
    ended = FlightOutcome(problem="refused", restored=restored, concern="Its safe gains could not be verified.")
    with database.write() as session:
        flight_rows.record_outcome(session, staged["flight"]["id"], ended)
    line = get(client, f"/api/vehicles/{real['id']}/ledger")["items"][0]
    assert (line["purpose"], line["asked"]) == ("restore after flight", DEFAULT_GAINS)
    assert (line["read_back"], line["outcome"]) == (restored, outcome)
    assert line["asked_at"] is not None
    assert seen(client, real)["state"] == "quarantined"


@pytest.mark.complete
def test_the_telemetry_log_of_a_flight_is_handed_out(
    settings: Settings, client: TestClient, database: Database, staged: Json
) -> None:
    path = f"/api/trials/{staged['id']}/tlog"
    missing = client.get(path)
    assert (missing.status_code, "vehicles with a link" in missing.json()["hint"]) == (404, True)
    file = telemetry_log(settings.data_dir, staged["flight"]["id"])
    file.parent.mkdir()
    file.write_bytes(b"\x00\x01frames")
    answer = client.get(path)
    assert (answer.status_code, answer.content) == (200, b"\x00\x01frames")
    assert f"campaign-{staged['campaign_id']}-trial-{staged['number']}.tlog" in answer.headers["content-disposition"]


@pytest.mark.complete
def test_an_abort_needs_no_control(client: TestClient, real: Json, planned: Json) -> None:
    client.post(f"/api/trials/{planned['id']}/stage")
    take_control(client, real)
    answer = client.post(f"/api/trials/{planned['id']}/abort")
    assert (answer.status_code, answer.json()["accepted"]) == (202, True)
    assert trial(client, planned)["flight"]["state"] == "cancelled"


@pytest.mark.complete
def test_the_command_log_says_who_asked_what_of_a_flight(
    client: TestClient, database: Database, real: Json, planned: Json
) -> None:
    """Observed gap: staging, takeoff and abort of a flight left no trace among the vehicle's commands."""
    operator = {**OUR_PAGE, **control_header(client, real)}
    client.post(f"/api/trials/{planned['id']}/stage", headers=operator)
    stage_claimed(database)
    client.post(f"/api/trials/{planned['id']}/unstage")
    unstage_claimed(database, trial(client, planned))
    client.post(f"/api/trials/{planned['id']}/stage", headers=operator)
    stage_claimed(database)
    assert take_off(client, planned, operator)[0] == 202
    unstage_claimed(database, trial(client, planned))
    client.post(f"/api/trials/{planned['id']}/stage", headers=operator)
    client.post(f"/api/trials/{planned['id']}/abort", json={"reason": "too close"})
    log = get(client, f"/api/vehicles/{real['id']}/acts")["items"]
    campaign = get(client, f"/api/campaigns/{planned['campaign_id']}")
    flight = f"flight {planned['number']} of {campaign['name']}"
    assert [(act["kind"], act["by"], act["reason"], act["state"], act["problem"]) for act in log[:6]] == [
        ("abort", "", f"{flight}: too close", "done", ""),
        ("stage", "Ada", flight, "failed", end_text(withdrawn_by(StopRequest("too close")))),
        ("take-off", "Ada", flight, "failed", end_text(UNSTAGED)),
        ("stage", "Ada", flight, "done", ""),
        ("unstage", "", f"{flight}: {unstaged_text(Requester.SCRIPT)}", "done", ""),
        ("stage", "Ada", flight, "done", ""),
    ]


@pytest.mark.complete
def test_the_command_log_follows_a_flight(client: TestClient, database: Database, real: Json, planned: Json) -> None:
    """Observed gap: every command of a flight stayed “requested” for ever."""
    operator = {**OUR_PAGE, **control_header(client, real)}

    def states(count: int) -> list[tuple[str, str, bool]]:
        log = get(client, f"/api/vehicles/{real['id']}/acts")["items"][:count]
        return [(act["kind"], act["state"], act["finished_at"] is not None) for act in reversed(log)]

    client.post(f"/api/trials/{planned['id']}/stage", headers=operator)
    assert states(1) == [("stage", "requested", False)]
    task = claim(database)
    assert states(1) == [("stage", "running", False)]
    with database.write() as session:
        flight_rows.record_staged(session, task.flight_id, dict(task.gains))
    take_off(client, planned, operator)
    assert states(2) == [("stage", "done", True), ("take-off", "running", False)]
    with database.write() as session:
        flight_rows.record_lift_off(session, task.flight_id)
        record_abort(session, planned["id"], StopRequest("too high"))
    assert states(2) == [("take-off", "done", True), ("abort", "running", False)]
    with database.write() as session:
        outcome = FlightOutcome(record=create_record(ending="aborted", reason="too high", on_request=True))
        flight_rows.record_outcome(session, task.flight_id, outcome)
    assert states(3) == [("stage", "done", True), ("take-off", "done", True), ("abort", "done", True)]


def stopped(
    by: Requester = Requester.PROGRAM_STOPPED,
    said: str = "",
    *,
    restored: Json | None = DEFAULT_GAINS,
    remark: str = "",
) -> FlightOutcome:
    end = FlightEnd(failure=Failure.OPERATOR, request=StopRequest(said, by=by), remarks=(remark,) if remark else ())
    return FlightOutcome(record=replace(create_record(ending="aborted", until_s=4.0), end=end), restored=restored)


@pytest.mark.complete
@pytest.mark.parametrize(
    ("outcome", "gains_left", "cause"),
    [
        (stopped(), GainsLeft.SAFE, "something else"),
        (stopped(remark="2 samples jumped and were dropped."), GainsLeft.SAFE, "something else"),
        (stopped(restored=None), GainsLeft.UNKNOWN, "something else"),
        (stopped(restored={"kp": 1}), GainsLeft.OTHER, "something else"),
        (stopped(Requester.OPERATOR, "too close"), GainsLeft.SAFE, "operator"),
    ],
)
def test_a_flight_that_ended_because_gainline_was_stopped_says_so_and_asks_for_no_cause(
    client: TestClient,
    database: Database,
    real: Json,
    planned: Json,
    outcome: FlightOutcome,
    gains_left: GainsLeft,
    cause: str,
) -> None:
    """Observed defect: “The worker was stopped (SIGTERM).”, and the question why the flight was aborted."""
    assert client.post(f"/api/trials/{planned['id']}/stage").status_code == 202
    task = stage_claimed(database)
    take_off(client, planned, {**OUR_PAGE, **control_header(client, real)})
    with database.write() as session:
        flight_rows.record_lift_off(session, task.flight_id)
        flight_rows.record_outcome(session, task.flight_id, outcome)
    flown = trial(client, planned)
    end = replace(outcome.ended, gains_left=gains_left)
    assert (flown["state"], flown["reason"], flown["abort_cause"]) == ("aborted", end_text(end), cause)
    assert FLIGHT_END.validate_python(flown["end"]) == FLIGHT_END.validate_python(flown["flight"]["end"]) == end


SILENT = "No current data has been received from the vehicle for more than 2 s."
LOW = "The battery voltage is below the vehicle's minimum."


@pytest.mark.complete
@pytest.mark.parametrize(
    ("unready", "over_minimum_v", "told", "steps", "lost"),
    [
        ("link silent", 0.0, SILENT, ["control"], ["staged"]),
        ("", -0.1, LOW, ["control", "staged"], []),
    ],
    ids=["link silent", "battery low"],
)
def test_a_staged_vehicle_that_is_no_longer_ready_does_not_take_off_until_it_is_again(
    client: TestClient,
    database: Database,
    real: Json,
    staged: Json,
    unready: UnreadyReason,
    over_minimum_v: float,
    told: str,
    steps: list[str],
    lost: list[str],
) -> None:
    """The rules themselves: test_readiness.py. With a low battery it stays staged."""
    operator = control_header(client, real) | OUR_PAGE
    path, minimum_v = f"/api/trials/{staged['id']}", real["options"]["min_battery_v"]
    report(client, staged, unready, battery_v=minimum_v + over_minimum_v)
    refused = client.post(f"{path}/take-off", headers=operator)
    assert (refused.status_code, refused.json()["detail"]) == (409, told), refused.text
    readiness = client.get(f"{path}/readiness", headers=operator).json()
    assert (readiness["steps"], readiness["lost"], readiness["is_ready"]) == (steps, lost, False)
    assert [(loss["what"], loss["way_on"]) for loss in readiness["losses"]] == [(told, refused.json()["hint"])]
    assert is_wanted(database, staged) == (False, None)
    report(client, staged, battery_v=minimum_v)
    readiness = client.get(f"{path}/readiness", headers=operator).json()
    assert (readiness["steps"], readiness["losses"], readiness["is_ready"]) == (["control", "staged"], [], True)
    assert client.post(f"{path}/take-off", headers=operator).status_code == 202
    assert client.get(f"{path}/readiness", headers=operator).json()["steps"] == ["control", "staged", "held"]


@pytest.mark.complete
def test_who_watches_while_another_operator_is_in_control_sees_the_flight_as_staged(
    client: TestClient, real: Json, staged: Json
) -> None:
    report(client, staged)
    take_control(client, real, "Ada")
    readiness = get(client, f"/api/trials/{staged['id']}/readiness")
    assert (readiness["steps"], readiness["lost"], readiness["is_ready"]) == (["staged"], [], False)
    assert [loss["kind"] for loss in readiness["losses"]] == ["controlled by other"]


@pytest.mark.complete
def test_a_vehicle_of_which_no_status_has_come_does_not_take_off(client: TestClient, real: Json, staged: Json) -> None:
    operator = control_header(client, real) | OUR_PAGE
    answer = client.post(f"/api/trials/{staged['id']}/take-off", headers=operator)
    assert (answer.status_code, "not connected" in answer.json()["detail"]) == (409, True)


@pytest.mark.complete
def test_a_window_that_its_flight_plan_does_not_fit_is_refused_before_it_is_staged(
    client: TestClient, database: Database, real: Json
) -> None:
    definition = {"experiment_options": {"window_s": 60.0}}
    planned = create_trial(client, create_campaign_on(client, database, real, definition=definition)["id"])
    refused = client.post(f"/api/trials/{planned['id']}/stage")
    assert refused.status_code == 409
    assert "a scored window of at most 42.6 s; the campaign's is 60 s" in refused.json()["detail"]
    assert "“Paparazzi: time limit of the flight plan's takeoff”" in refused.json()["hint"]


@pytest.mark.complete
@pytest.mark.parametrize("motors_off", [False, True])
def test_a_vehicle_whose_motors_were_stopped_in_the_air_is_not_said_to_have_landed(
    client: TestClient, database: Database, real: Json, staged: Json, motors_off: bool
) -> None:
    """Observed defect: “Landed” was ticked for a drone that fell from 3 m."""
    record, _, concern = stopped_drone("paparazzi", 4.0, motors_off=motors_off)
    report(client, staged)
    take_off(client, staged, {**OUR_PAGE, **control_header(client, real)})
    assert bool(concern) == motors_off
    outcome = FlightOutcome(record=record, concern=concern)
    with database.write() as session:
        flight_rows.record_lift_off(session, staged["flight"]["id"])
        flight_rows.record_outcome(session, staged["flight"]["id"], outcome)
    path, flew = f"/api/trials/{staged['id']}", ["staged", "held", "in flight"]

    def readiness() -> tuple[list[str], list[str]]:
        found = get(client, f"{path}/readiness")
        return found["steps"], found["lost"]

    assert (trial(client, staged)["state"], trial(client, staged)["abort_cause"]) == ("aborted", "operator")
    assert readiness() == ((flew, ["landed"]) if motors_off else ([*flew, "landed"], []))
    cause = {"version": trial(client, staged)["version"], "cause": "something else"}
    given = client.post(f"{path}/judge-abort", json=cause, headers=OUR_PAGE)
    assert given.is_success, given.text
    assert readiness() == (([*flew, "reviewed"], ["landed"]) if motors_off else ([*flew, "landed", "reviewed"], []))
