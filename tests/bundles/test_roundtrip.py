"""A campaign out of one installation and into another: every number is the same, and nothing more than it can be."""

import json
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from app.bundles.importer import store_bundle
from app.bundles.reader import Bundle
from app.common.data_folder import telemetry_log
from app.common.settings import Settings
from app.common.states import FlightState
from app.db.models import CampaignRow, FlightRow, TrajectoryRow, TrialPhotoRow, TrialRow, VehicleRow
from app.db.session import Database
from tests.builders import (
    Json,
    create_ready_campaign,
    create_record,
    create_trial,
    fly_trial,
    get,
    land,
    lift_off,
    made_once,
    run_jobs,
)
from tests.bundles.builders import download_bundle, import_bundle, parts_of, sealed, second_installation
from tests.campaigns.test_recomputing import told
from tests.campaigns.test_statistics import modelled

PNG = b"\x89PNG\r\n\x1a\n" + bytes(range(200))
NAMED_ANEW = {"id", "campaign_id", "proposal_id", "created_at", "updated_at", "version", "actions", "flight", "speed"}


@pytest.fixture
def elsewhere(tmp_path: Path, migrated_file: Path) -> Iterator[tuple[TestClient, Database]]:
    with second_installation(tmp_path / "elsewhere", migrated_file) as both:
        yield both


@pytest.fixture
def campaign(client: TestClient, database: Database) -> Json:
    return made_once(database, "three flights, a note and a photo", lambda: make_campaign(client, database))


def make_campaign(client: TestClient, database: Database) -> Json:
    """Three flights with the calibrated strategy, the first ruled out; a note, a photo."""
    ready = create_ready_campaign(
        client, database, definition={"strategy": "calibrated", "stop": {"kind": "noise", "max_flights": 8}}
    )
    flown = [fly(client, database, ready["id"]) for _ in range(3)]
    said = {"version": flown[1]["version"], "outcome": "invalid", "reason": "Gust, ≈ 4 m/s"}
    assert client.post(f"/api/trials/{flown[1]['id']}/classify", json=said).status_code == 200
    noted = client.patch(f"/api/trials/{flown[0]['id']}", json={"version": flown[0]["version"], "note": "Cold. ☃"})
    assert noted.status_code == 200
    with database.write() as session:
        first = session.get_one(TrialRow, flown[0]["id"])
        session.add(TrialPhotoRow(trial=first, media_type="image/png", data=PNG))
    run_jobs(database)
    found: Json = get(client, f"/api/campaigns/{ready['id']}")
    return found


def fly(client: TestClient, database: Database, campaign_id: int) -> Json:
    trial = create_trial(client, campaign_id, fly={"speed": None})
    land(database, lift_off(database), modelled(trial["gains"]))
    run_jobs(database)
    flown: Json = get(client, f"/api/trials/{trial['id']}")
    return flown


def brought(client: TestClient, bundle: bytes) -> Json:
    answer = import_bundle(client, bundle)
    assert answer.status_code == 201, answer.text
    arrived: Json = answer.json()
    return arrived


def as_of_version(version: int, bundle: bytes, *, without: str) -> bytes:
    """The bundle as an earlier version wrote it: no trial has that field, nor a part of its own for it."""
    parts = parts_of(bundle)
    contents, manifest = json.loads(parts["contents.json"]), {**json.loads(parts["manifest.json"]), "version": version}
    values = [each.pop(without) for each in contents["campaigns"][0]["trials"]]
    named = {each["part"] for each in values if isinstance(each, dict) and "part" in each}
    old = {name: data for name, data in parts.items() if name not in named}
    old |= {"contents.json": json.dumps(contents).encode(), "manifest.json": json.dumps(manifest).encode()}
    return sealed(old)


def with_reasons(bundle: bytes, reasons: dict[int, str]) -> bytes:
    """The bundle with other reasons, by the trials' numbers."""
    parts = parts_of(bundle)
    contents = json.loads(parts["contents.json"])
    for trial in contents["campaigns"][0]["trials"]:
        trial["reason"] = reasons.get(trial["number"], trial["reason"])
    return sealed({**parts, "contents.json": json.dumps(contents).encode()})


def without(document: Json, names: set[str]) -> Json:
    return {name: value for name, value in document.items() if name not in names}


def test_every_number_and_every_sample_arrives_as_it_was(
    client: TestClient, database: Database, campaign: Json, elsewhere: tuple[TestClient, Database]
) -> None:
    there, their_database = elsewhere
    arrived = brought(there, download_bundle(client, campaign["id"]))
    for name in ("name", "state", "outcome", "stop_reason", "definition", "definition_digest", "created_at", "trials"):
        assert arrived[name] == campaign[name], name
    ours = get(client, f"/api/campaigns/{campaign['id']}/trials")["items"]
    theirs = get(there, f"/api/campaigns/{arrived['id']}/trials")["items"]
    assert len(ours) == 3
    for mine, other in zip(ours, theirs, strict=True):
        assert without(mine, NAMED_ANEW) == without(other, NAMED_ANEW)
        path = "/api/trials/{}/trajectory.csv"
        assert client.get(path.format(mine["id"])).content == there.get(path.format(other["id"])).content
    assert get(client, f"/api/campaigns/{campaign['id']}/statistics") == get(
        there, f"/api/campaigns/{arrived['id']}/statistics"
    )
    with database.read() as here, their_database.read() as other_session:
        assert [bytes(row.data) for row in here.query(TrajectoryRow).order_by(TrajectoryRow.checksum)] == [
            bytes(row.data) for row in other_session.query(TrajectoryRow).order_by(TrajectoryRow.checksum)
        ]
        assert [row.data for row in other_session.query(TrialPhotoRow)] == [PNG]


@pytest.mark.complete
def test_the_next_gains_are_computed_again_to_the_last_bit(
    client: TestClient, database: Database, campaign: Json, elsewhere: tuple[TestClient, Database]
) -> None:
    there, their_database = elsewhere
    arrived = brought(there, download_bundle(client, campaign["id"]))
    assert told(their_database, arrived["id"]) == told(database, campaign["id"])
    ours = get(client, f"/api/campaigns/{campaign['id']}/proposal")["proposal"]
    theirs = get(there, f"/api/campaigns/{arrived['id']}/proposal")["proposal"]
    assert not theirs["stale"]
    assert without(ours, {"id", "campaign_id"}) == without(theirs, {"id", "campaign_id"})


@pytest.mark.complete
def test_a_warm_start_brings_the_campaign_that_it_came_from(
    client: TestClient, database: Database, campaign: Json, elsewhere: tuple[TestClient, Database]
) -> None:
    there, their_database = elsewhere
    brought(there, download_bundle(client, campaign["id"]))  # ids are others there
    answer = client.post(f"/api/campaigns/{campaign['id']}/clone", json={"warm_start": True})
    warm = answer.json()
    run_jobs(database)
    fly(client, database, warm["id"])
    arrived = brought(there, download_bundle(client, warm["id"]))
    run_jobs(their_database)
    donor = arrived["definition"]["start"]["donor"]
    assert donor["campaign_id"] != warm["definition"]["start"]["donor"]["campaign_id"]
    assert get(there, f"/api/campaigns/{donor['campaign_id']}")["name"] == f"{campaign['name']} (imported)"
    ours = get(client, f"/api/campaigns/{warm['id']}/proposal")["proposal"]
    theirs = get(there, f"/api/campaigns/{arrived['id']}/proposal")["proposal"]
    for name in ("kind", "gains", "predicted_error", "interval", "advice", "gate"):
        assert theirs[name] == ours[name], name


def test_a_campaign_whose_name_is_taken_says_that_it_was_imported(client: TestClient, campaign: Json) -> None:
    """Under one name nobody could tell which of them is flown on."""
    bundle = download_bundle(client, campaign["id"])
    names = [brought(client, bundle)["name"] for _ in range(2)]
    assert names == [f"{campaign['name']} (imported)", f"{campaign['name']} (imported 2)"]


@pytest.mark.complete
def test_a_simulated_campaign_flies_on_where_it_arrives(
    client: TestClient, campaign: Json, elsewhere: tuple[TestClient, Database]
) -> None:
    there, their_database = elsewhere
    arrived = brought(there, download_bundle(client, campaign["id"]))
    assert fly(there, their_database, arrived["id"])["number"] == 4


@pytest.mark.complete
def test_a_flight_withdrawn_later_does_not_hide_the_telemetry_log(
    client: TestClient, database: Database, settings: Settings, campaign: Json
) -> None:
    """The bundle has the log that the flight's page offers."""
    with database.write() as session:
        flight = session.query(FlightRow).order_by(FlightRow.id).first()
        assert flight is not None
        log, trial_id = telemetry_log(settings.data_dir, flight.id), flight.trial_id
        session.add(FlightRow(campaign_id=campaign["id"], trial_id=trial_id, vehicle_id=flight.vehicle_id,
                              state=FlightState.CANCELLED, gains=flight.gains))  # fmt: skip
    log.parent.mkdir(exist_ok=True)
    log.write_bytes(b"telemetry")
    assert client.get(f"/api/trials/{trial_id}/tlog").content == b"telemetry"
    assert parts_of(download_bundle(client, campaign["id"]))[f"telemetry/{trial_id}.tlog"] == b"telemetry"


@pytest.mark.complete
def test_what_a_registered_vehicle_flew_is_history_where_it_arrives(
    client: TestClient, database: Database, settings: Settings, campaign: Json, elsewhere: tuple[TestClient, Database]
) -> None:
    """Even where a vehicle of that name is registered: it did not fly there."""
    with database.write() as session:
        twin = session.query(VehicleRow).one()
        real = VehicleRow(kind="mavlink", name="Blue", title="MAVLink", is_real=True, registered=True,
                          state="ready", safe_gains=twin.safe_gains)  # fmt: skip
        session.add(real)
        session.flush()
        session.get_one(CampaignRow, campaign["id"]).vehicle = real
        flight = session.query(FlightRow).order_by(FlightRow.id).first()
        assert flight is not None
        log = telemetry_log(settings.data_dir, flight.id)
    log.parent.mkdir(exist_ok=True)
    log.write_bytes(b"telemetry" * 1000)
    there, their_database = elsewhere
    arrived = brought(there, download_bundle(client, campaign["id"]))
    vehicle = arrived["vehicle"]
    assert (vehicle["name"], vehicle["is_real"], vehicle["can_fly"]) == ("Blue (elsewhere)", True, False)
    trials = get(there, f"/api/campaigns/{arrived['id']}/trials")["items"]
    assert there.get(f"/api/trials/{trials[0]['id']}/tlog").content == b"telemetry" * 1000
    with their_database.read() as session:
        assert session.query(FlightRow).count() == 0
    refused = there.post(
        f"/api/campaigns/{arrived['id']}/trials", json={"gains": trials[0]["gains"], "fly": {"speed": None}}
    )
    assert refused.status_code == 409, refused.text
    again = brought(there, download_bundle(there, arrived["id"]))
    assert again["vehicle"]["id"] == vehicle["id"]
    shared = there.post("/api/campaigns", json={"name": "Own", "vehicle": {"kind": "import"}}).json()
    assert shared["vehicle"]["id"] != vehicle["id"]
    cloned = there.post(f"/api/campaigns/{arrived['id']}/clone", json={"vehicle": {"kind": "twin"}})
    assert cloned.status_code == 201, cloned.text


def test_the_same_campaign_makes_the_same_parts(client: TestClient, campaign: Json) -> None:
    first, second = (parts_of(download_bundle(client, campaign["id"])) for _ in range(2))
    assert {**first, "manifest.json": b""} == {**second, "manifest.json": b""}


def test_a_campaign_in_the_air_stays_with_its_vehicle(client: TestClient, database: Database) -> None:
    ready = create_ready_campaign(client, database)
    create_trial(client, ready["id"], fly={"speed": None})
    lift_off(database)
    refused = client.get(f"/api/campaigns/{ready['id']}/bundle")
    assert refused.status_code == 409
    assert "under way" in refused.json()["detail"]


@pytest.mark.complete
def test_nothing_is_brought_in_while_anything_is_staged_or_flies(
    client: TestClient, database: Database, campaign: Json
) -> None:
    bundle = download_bundle(client, campaign["id"])
    ready = create_ready_campaign(client, database)
    create_trial(client, ready["id"], fly={"speed": None})
    task = lift_off(database)
    refused = import_bundle(client, bundle)
    assert refused.status_code == 409, refused.text
    assert f"Campaign {ready['id']} has a flight" in refused.json()["detail"]
    land(database, task, modelled(task.gains))
    brought(client, bundle)


def test_a_bundle_is_unpacked_and_hashed_before_the_transaction_that_stores_it(
    client: TestClient, database: Database, campaign: Json, settings: Settings
) -> None:
    """A writer is let in until the very moment of storing; from then on the zip is not touched any more."""
    with Bundle(BytesIO(download_bundle(client, campaign["id"]))) as bundle:
        bundle.check()
        bundle._zip.close()
        with database.write() as session:
            arrived = store_bundle(session, bundle, settings.data_dir)
    assert arrived.trials.flown == campaign["trials"]["flown"]


def test_a_longer_chain_of_warm_starts_than_a_bundle_holds_is_refused_in_words(
    client: TestClient, database: Database, campaign: Json
) -> None:
    ids = [campaign["id"]]
    with database.write() as session:
        donor = session.get_one(CampaignRow, campaign["id"])
        names = set(CampaignRow.__mapper__.columns.keys()) - {"id", "definition", "version"}
        same = {name: getattr(donor, name) for name in names}
        for _ in range(20):
            named = {"campaign_id": ids[-1], "trial_number": 1, "checksum": "0" * 64}
            start = {"kind": "campaign", "gains": donor.safe_gains, "donor": named}
            row = CampaignRow(**same, definition={**donor.definition, "start": start})
            session.add(row)
            session.flush()
            ids.append(row.id)
    assert client.get(f"/api/campaigns/{ids[19]}/bundle").status_code == 200
    refused = client.get(f"/api/campaigns/{ids[20]}/bundle")
    assert refused.status_code == 409, refused.text
    assert "follows a chain of 20 warm starts; a bundle can hold 20 campaigns" in refused.json()["detail"]
    assert f"campaign {ids[19]} is the last that fits" in refused.json()["hint"]


def test_what_a_bundle_cannot_hold_is_refused_in_words(client: TestClient, database: Database, campaign: Json) -> None:
    with database.write() as session:
        trial = session.query(TrialRow).order_by(TrialRow.id).first()
        assert trial is not None
        trial.curve = [[float(time), 0.0] for time in range(5001)]
    refused = client.get(f"/api/campaigns/{campaign['id']}/bundle")
    assert refused.status_code == 409, refused.text
    assert "cannot be exported as a bundle: curve: List should have at most 5000 items" in refused.json()["detail"]


def test_a_predicted_interval_with_further_fields_is_read_without_them(
    client: TestClient, campaign: Json, elsewhere: tuple[TestClient, Database]
) -> None:
    there, _ = elsewhere
    parts = parts_of(download_bundle(client, campaign["id"]))
    contents = json.loads(parts["contents.json"])
    interval = {"lower": 0.25, "upper": 0.75, "confidence": 0.9}
    contents["campaigns"][0]["trials"][-1] |= {"predicted_error": 0.5, "predicted_interval": interval | {"more": 1}}
    arrived = brought(there, sealed({**parts, "contents.json": json.dumps(contents).encode()}))
    assert get(there, f"/api/campaigns/{arrived['id']}/trials")["items"][-1]["predicted_interval"] == interval


def test_the_same_bundle_sent_twice_with_one_key_is_one_campaign(client: TestClient, campaign: Json) -> None:
    bundle = download_bundle(client, campaign["id"])
    sent = [
        client.post(
            "/api/bundles",
            content=bundle,
            headers={"Content-Type": "application/octet-stream", "Idempotency-Key": "a key"},
        )
        for _ in range(2)
    ]
    assert sent[0].json()["id"] == sent[1].json()["id"]
    assert get(client, "/api/campaigns")["total"] == 2


def test_nothing_is_left_of_a_bundle_whose_storing_fails(
    client: TestClient, database: Database, campaign: Json, monkeypatch: pytest.MonkeyPatch
) -> None:
    bundle = download_bundle(client, campaign["id"])
    monkeypatch.setattr("app.bundles.importer.request_proposal", lambda *_: (_ for _ in ()).throw(OSError("disk")))
    monkeypatch.setattr("app.bundles.importer.is_stale", lambda *_: True)
    assert import_bundle(client, bundle).status_code >= 500
    with database.read() as session:
        assert session.query(CampaignRow).count() == 1
        assert session.query(TrialRow).count() == 3


@pytest.mark.complete
def test_the_curve_with_which_custom_gains_were_planned_goes_along(
    client: TestClient, database: Database, campaign: Json, elsewhere: tuple[TestClient, Database]
) -> None:
    there, _ = elsewhere
    trial = create_trial(client, campaign["id"], gains={"kp": 350, "ki": 30, "kd": 90}, fly={"speed": None})
    land(database, lift_off(database), modelled(trial["gains"]))
    run_jobs(database)
    bundle = download_bundle(client, campaign["id"])

    def drawn(client: TestClient, campaign_id: int) -> list[Json]:
        path = f"/api/campaigns/{campaign_id}/figures/takeoffs?predicted={trial['number']}"
        traces = get(client, path)["figure"]["data"]
        return [one for one in traces if one["meta"]["role"] in {"prediction", "band", "predicted deviation"}]

    assert len(drawn(client, campaign["id"])) == 4
    assert drawn(there, brought(there, bundle)["id"]) == drawn(client, campaign["id"])
    assert drawn(there, brought(there, as_of_version(4, bundle, without="predicted"))["id"]) == []


@pytest.mark.complete
def test_why_a_flight_was_broken_off_goes_along_and_bundles_from_before_it_was_recorded_are_still_read(
    client: TestClient, database: Database, campaign: Json, elsewhere: tuple[TestClient, Database]
) -> None:
    there, _ = elsewhere
    trial = fly_trial(
        client, database, campaign["id"], create_record(ending="aborted", reason="enough", on_request=True)
    )
    run_jobs(database)
    bundle = download_bundle(client, campaign["id"])

    def causes(arrived: Json) -> list[str | None]:
        return [each["abort_cause"] for each in get(there, f"/api/campaigns/{arrived['id']}/trials")["items"]]

    assert causes(brought(there, bundle))[trial["number"] - 1] == "operator"
    assert set(causes(brought(there, as_of_version(1, bundle, without="abort_cause")))) == {None}


@pytest.mark.complete
def test_how_a_flight_ended_is_recognised_in_the_words_of_earlier_bundles(
    client: TestClient, database: Database, campaign: Json, elsewhere: tuple[TestClient, Database]
) -> None:
    there, _ = elsewhere
    trial = fly_trial(
        client, database, campaign["id"], create_record(ending="aborted", reason="enough", on_request=True)
    )
    run_jobs(database)
    number = trial["number"]
    earlier = as_of_version(5, download_bundle(client, campaign["id"]), without="end")

    def arrived(reason: str) -> Json:
        brought_in = brought(there, with_reasons(earlier, {number: reason}))
        found: Json = get(there, f"/api/campaigns/{brought_in['id']}/trials")["items"][number - 1]
        return found

    assert arrived("enough")["end"] == trial["end"]
    limit = arrived("A safety limit was exceeded. It rose to 4.6 m.")
    assert (limit["end"]["failure"], limit["end"]["request"], limit["given_reason"]) == ("F6", None, "")


def test_a_valid_flight_of_an_earlier_bundle_has_an_end_as_one_of_an_earlier_database(
    client: TestClient, campaign: Json, elsewhere: tuple[TestClient, Database]
) -> None:
    there, _ = elsewhere
    arrived = brought(there, as_of_version(5, download_bundle(client, campaign["id"]), without="end"))
    trials = get(there, f"/api/campaigns/{arrived['id']}/trials")["items"]
    assert [trial["state"] for trial in trials] == ["valid", "invalid", "valid"]
    assert [(trial["end"]["failure"], trial["end"]["landed"]) for trial in trials] == [(None, "landed")] * 3
    assert trials[1]["reason"] == "Gust, ≈ 4 m/s"
