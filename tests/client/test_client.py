"""The Python client against the running application, its own transport included."""

import socket
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from app.accounts.keys_and_links import Keyring
from app.accounts.permissions import Key
from app.campaigns.schemas import Definition, StopRule
from app.campaigns.trials.schemas import Classification
from app.client import (
    Client,
    ConflictError,
    InvalidError,
    NotAllowedError,
    NotFoundError,
    RefusedError,
    UnavailableError,
)
from app.common.settings import Settings
from app.core.records.plausibility import Reading
from app.db.session import Database
from app.flights import flight_rows
from tests.builders import claim, climb_error, create_climb, create_csv, create_record, land, lift_off, run_jobs
from tests.fleet.vehicles import create_campaign_on, create_connected
from tests.logs.recorded import TLOGS, recorded


@pytest.fixture
def gainline(client: TestClient) -> Client:
    return Client(http=client)


def test_ask_and_tell(gainline: Client, database: Database, tmp_path: Path) -> None:
    campaign = gainline.create_campaign(
        "Mine", vehicle="import", definition=Definition(seed=3, stop=StopRule(kind="budget", max_flights=9))
    )
    run_jobs(database)
    proposal = gainline.ask(campaign.id)
    assert (proposal.kind, proposal.gains) == ("start", {"kp": 283, "ki": 13, "kd": 82})
    climb = create_climb(2.0)
    record = {"time_s": climb.time_s, "altitude_m": climb["altitude_m"]}
    trial = gainline.tell(campaign.id, proposal, record, note="dusk")
    assert (trial.state, trial.note) == ("valid", "dusk")
    assert trial.error == pytest.approx(climb_error(2.0), rel=1e-4)
    run_jobs(database)
    file = tmp_path / "flight.csv"
    file.write_bytes(create_csv(1.5))
    assert gainline.tell(campaign.id, gainline.ask(campaign.id), file).number == 2
    run_jobs(database)
    in_feet = {**record, "altitude_m": climb["altitude_m"] / 0.3048}
    by_hand = {"kp": 300, "ki": 20, "kd": 90}
    assert gainline.tell(campaign.id, by_hand, in_feet, reads_as=[Reading.FEET]).kind == "manual"
    assert [found.number for found in gainline.trials(campaign.id)] == [1, 2, 3]
    assert gainline.trajectory(trial.id, points=100).samples == 1651
    assert gainline.trajectory_csv(trial.id).startswith(b"time_s,altitude_m\n")
    run_jobs(database)
    classed = gainline.classify(trial, Classification(version=trial.version, outcome="invalid", reason="rain"))
    assert classed.state == "invalid"


@pytest.mark.complete
def test_a_script_with_its_token_plans_on_a_real_vehicle_and_is_refused_in_words_without(
    client: TestClient, database: Database, settings: Settings
) -> None:
    real = create_connected(client, database, real=True)
    campaign = create_campaign_on(client, database, real)
    client.cookies.clear()
    with pytest.raises(NotAllowedError, match="gainline unlock --script") as refused:
        Client(http=client).fly(campaign["id"], {"kp": 300, "ki": 20, "kd": 90})
    assert (refused.value.status, refused.value.title) == (403, "Not allowed")
    script = Client(http=client, token=Keyring(settings.data_dir).value(Key.SCRIPT))
    with pytest.raises(NotAllowedError, match="only its operator can start the takeoff"):
        script.fly(campaign["id"], {"kp": 300, "ki": 20, "kd": 90})
    assert script.ask(campaign["id"]).kind == "start"


def test_a_log_is_handed_in_by_its_takeoff_and_with_the_gains_it_was_flown_with(
    gainline: Client, database: Database, tmp_path: Path
) -> None:
    campaign = gainline.create_campaign("Logged", vehicle="import")
    run_jobs(database)
    both = tmp_path / "both.tlog"
    both.write_bytes(b"".join(recorded(f"{name}.tlog") for name in TLOGS))
    with pytest.raises(InvalidError, match="2 takeoffs"):
        gainline.tell(campaign.id, gainline.ask(campaign.id), both)
    [trial] = gainline.trials(campaign.id)
    with pytest.raises(ConflictError, match="kp 1624, ki 1356, kd 195"):
        gainline.upload(trial.id, both, takeoff=2)
    flown = gainline.upload(trial.id, both, takeoff=2, confirm=True)
    assert (flown.state, flown.gains["ki"]) == ("valid", 1356)


def test_fly_and_wait(gainline: Client, database: Database) -> None:
    campaign = gainline.create_campaign("Mine", vehicle="twin", options={"scatter": 0.0})
    run_jobs(database)
    trial = gainline.fly(campaign.id, gainline.ask(campaign.id))
    land(database, lift_off(database), create_record())
    assert gainline.wait(trial.id).state == "valid"


def test_an_operator_gives_the_cause_of_an_abort(gainline: Client, database: Database) -> None:
    campaign = gainline.create_campaign("Mine", vehicle="twin")
    run_jobs(database)
    trial = gainline.fly(campaign.id, gainline.ask(campaign.id))
    land(database, lift_off(database), create_record(ending="aborted", reason="enough", on_request=True))
    aborted = gainline.wait(trial.id)
    assert aborted.abort_cause == "operator"
    assert gainline.judge_abort(aborted, "something else").abort_cause == "something else"


def test_a_flight_that_did_not_take_place_is_raised(gainline: Client, database: Database) -> None:
    campaign = gainline.create_campaign("Mine", vehicle="twin")
    run_jobs(database)
    trial = gainline.fly(campaign.id, gainline.ask(campaign.id))
    task = claim(database)
    with database.write() as session:
        flight_rows.record_outcome(
            session, task.flight_id, flight_rows.FlightOutcome(problem="the vehicle did not answer.")
        )
    with pytest.raises(RefusedError, match="was not flown: the vehicle did not answer"):
        gainline.wait(trial.id)


def test_all_campaigns_come_page_by_page(gainline: Client) -> None:
    made = [gainline.create_campaign(f"C{index}").id for index in range(3)]
    assert [campaign.id for campaign in gainline.campaigns()] == made[::-1]
    assert [campaign.name for campaign in gainline.campaigns(search="c1")] == ["C1"]


@pytest.mark.complete
def test_refusals_are_raised_with_the_servers_own_words(gainline: Client, database: Database) -> None:
    with pytest.raises(NotFoundError, match="There is no campaign 99") as missing:
        gainline.campaign(99)
    assert missing.value.status == 404
    campaign = gainline.create_campaign("Mine", vehicle="import")
    run_jobs(database)
    with pytest.raises(InvalidError) as refused:
        gainline.fly(campaign.id, {"kp": -1, "ki": 13, "kd": 82})
    assert refused.value.problems[0].field == "gains.kp"
    with pytest.raises(ConflictError, match="cannot be flown from here"):
        gainline.fly(campaign.id, {"kp": 283, "ki": 13, "kd": 82})
    with pytest.raises(ConflictError):
        gainline.finish(campaign.id)


def test_asking_without_a_worker_ends_with_what_to_look_for(gainline: Client) -> None:
    campaign = gainline.create_campaign("Mine")
    with pytest.raises(UnavailableError, match="Check that a worker is running"):
        gainline.ask(campaign.id, timeout_s=0.0)


def test_a_server_that_is_not_there_is_raised_with_what_to_do() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    with Client(f"http://127.0.0.1:{port}") as gainline, pytest.raises(UnavailableError, match="gainline serve"):
        gainline.campaign(1)
