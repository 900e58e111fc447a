"""The log library over HTTP, with recorded logs."""

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta
from typing import Any

import httpx2
import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient

from app.db.base import utc_now
from app.db.models import AnalysedLogRow, LogFileRow, LoggedVehicleRow
from app.db.session import Database
from app.log_library import flights, stored_answers
from tests.builders import get, problems_of
from tests.log_library.fleet import FLEET
from tests.log_library.library import FLOWN, PATH, VEHICLES, add, change, copied, library
from tests.logs.recorded import recorded

PX4, COPTER, TAKEOFF = FLOWN


@pytest.fixture
def logs(database: Database) -> Mapping[str, int]:
    return library(database)


def send(client: TestClient, name: str, content: bytes, **query: int) -> httpx2.Response:
    return client.post(PATH, files={"file": (name, content)}, params=query)


def keep(client: TestClient, log_id: int, name: str) -> httpx2.Response:
    return client.put(f"{PATH}/{log_id}/vehicle", json={"name": name})


def kept(client: TestClient, log_id: int, name: str) -> Any:
    answer = keep(client, log_id, name)
    assert answer.status_code == 200, answer.text
    return answer.json()


def store_file(client: TestClient, log_id: int, content: bytes, name: str = "flight") -> httpx2.Response:
    return client.put(f"{PATH}/{log_id}/file", files={"file": (name, content)})


def listed(client: TestClient, **query: int) -> list[int]:
    answer = client.get(PATH, params=query)
    assert answer.status_code == 200, answer.text
    return [each["id"] for each in answer.json()["items"]]


def test_the_same_log_is_recognised_and_has_the_same_answer_under_any_name(
    client: TestClient, logs: Mapping[str, int]
) -> None:
    first = send(client, COPTER, recorded(COPTER)).json()
    assert first["log"]["id"] == logs[COPTER]
    assert send(client, "renamed.bin", recorded(COPTER)).json() == first
    assert len(listed(client, kept=False)) == len(FLOWN)


def test_another_vehicle_of_the_same_log_is_another_answer(client: TestClient, database: Database) -> None:
    first, other = (add(database, "fleet.tlog", content=FLEET, vehicle=system) for system in (1, 7))
    assert first != other
    assert [get(client, f"{PATH}/{each}")["vehicle"] for each in (first, other)] == [1, 7]
    assert send(client, "fleet.tlog", FLEET, vehicle=7).json()["log"]["id"] == other


def test_logs_are_kept_by_name_in_the_order_of_their_flights(client: TestClient, logs: Mapping[str, int]) -> None:
    for log in (TAKEOFF, PX4, COPTER):
        kept(client, logs[log], "Bee" if log == PX4 else "bee ")
    newest_first = [logs[each] for each in (TAKEOFF, COPTER, PX4)]
    assert (listed(client), listed(client, kept=False)) == (newest_first, [])
    [bee] = get(client, VEHICLES)
    assert (bee["name"], bee["logs"], bee["newest"]["id"]) == ("bee", 3, logs[TAKEOFF])
    assert listed(client, vehicle=bee["id"]) == newest_first
    before = [get(client, f"{PATH}/{each}")["log"]["previous_id"] for each in newest_first]
    assert before == [*newest_first[1:], None]
    assert get(client, f"{VEHICLES}/{bee['id']}/trend")["state"] == "ready"


def test_a_name_with_other_letters_than_those_of_english_is_found_again(
    client: TestClient, logs: Mapping[str, int]
) -> None:
    """Seen: SQLite makes no small letters of them."""
    for log in (PX4, COPTER):
        kept(client, logs[log], "Ärger")
    assert [(each["name"], each["logs"]) for each in get(client, VEHICLES)] == [("Ärger", 2)]


def test_a_log_is_compared_with_another_one_of_its_vehicle_alone(client: TestClient, logs: Mapping[str, int]) -> None:
    kept(client, logs[COPTER], "Bee")
    kept(client, logs[PX4], "Wasp")
    for other in (COPTER, PX4, TAKEOFF):
        refused = client.get(f"{PATH}/{logs[COPTER]}/comparison", params={"before": logs[other]})
        assert (refused.status_code, problems_of(refused)) == (
            422,
            {"before": "is no other log of its vehicle and autopilot"},
        )


def test_a_file_that_was_analysed_twice_is_evidence_once(
    client: TestClient, database: Database, logs: Mapping[str, int]
) -> None:
    twice = [copied(database, logs[COPTER], digest=f"with other gains {number}") for number in (1, 2)]
    for log in twice:
        kept(client, log, "Bee")
    [bee] = get(client, VEHICLES)
    assert (bee["logs"], get(client, f"{VEHICLES}/{bee['id']}")["combined"]) == (2, None)


def test_a_log_that_is_not_kept_has_none_before_it(client: TestClient, logs: Mapping[str, int]) -> None:
    """Seen: the log analysed before it was, of whatever vehicle."""
    assert get(client, f"{PATH}/{logs[TAKEOFF]}")["log"]["previous_id"] is None
    refused = client.get(f"{PATH}/{logs[TAKEOFF]}/comparison")
    assert (refused.status_code, problems_of(refused)) == (422, {"before": "is missing"})


def test_a_vehicle_is_recognised_by_its_hardware_id(
    client: TestClient, database: Database, logs: Mapping[str, int]
) -> None:
    for log in (PX4, COPTER):
        change(database, logs[log], hardware_id="0012")
    assert not kept(client, logs[TAKEOFF], "Bee")["is_recognised"]
    assert kept(client, logs[PX4], "Bee")["is_recognised"]
    place = get(client, f"{PATH}/{logs[COPTER]}")["log"]
    assert (place["is_recognised"], place["suggested_name"]) == (True, "Bee")
    refused = keep(client, logs[COPTER], "Wasp")
    assert (refused.status_code, "is that of Bee" in refused.json()["detail"]) == (409, True)
    assert kept(client, logs[COPTER], "bee")["vehicle"]["name"] == "Bee"
    assert get(client, VEHICLES)[0]["hardware_id"] == "0012"


def test_the_name_of_another_hardware_id_is_refused(
    client: TestClient, database: Database, logs: Mapping[str, int]
) -> None:
    change(database, logs[PX4], hardware_id="0012")
    change(database, logs[COPTER], hardware_id="0034")
    kept(client, logs[PX4], "Bee")
    refused = keep(client, logs[COPTER], "BEE")
    assert (refused.status_code, refused.json()["detail"]) == (
        409, "The log was not kept: Bee has another hardware id.")  # fmt: skip
    assert listed(client) == [logs[PX4]]


def test_a_vehicle_is_renamed_but_not_to_the_name_of_another(client: TestClient, logs: Mapping[str, int]) -> None:
    bee, wasp = (kept(client, logs[log], name)["vehicle"] for log, name in ((PX4, "Bee"), (COPTER, "Wasp")))
    refused = client.put(f"{VEHICLES}/{wasp['id']}/name", json={"name": "bee"})
    assert (refused.status_code, refused.json()["detail"]) == (409, "There is another vehicle called Bee.")
    assert client.put(f"{VEHICLES}/{bee['id']}/name", json={"name": "BEE"}).json()["name"] == "BEE"
    assert get(client, f"{PATH}/{logs[PX4]}")["log"]["vehicle"]["name"] == "BEE"


def test_a_vehicle_without_logs_is_forgotten(client: TestClient, logs: Mapping[str, int]) -> None:
    bee, _ = (kept(client, logs[log], "Bee")["vehicle"] for log in (PX4, COPTER))
    assert client.delete(f"{PATH}/{logs[PX4]}").status_code == 204
    assert [each["id"] for each in get(client, VEHICLES)] == [bee["id"]]
    kept(client, logs[COPTER], "Wasp")
    assert [each["name"] for each in get(client, VEHICLES)] == ["Wasp"]
    assert client.delete(f"{PATH}/{logs[COPTER]}").status_code == 204
    assert get(client, VEHICLES) == []


def test_logs_that_nobody_kept_are_deleted_after_seven_days(
    client: TestClient, database: Database, logs: Mapping[str, int]
) -> None:
    for log, days in ((PX4, 8), (COPTER, 8), (TAKEOFF, 6)):
        change(database, logs[log], analysed_at=utc_now() - timedelta(days=days))
    kept(client, logs[COPTER], "Bee")
    fresh = add(database, "fleet.tlog", content=FLEET)
    assert (listed(client), set(listed(client, kept=False))) == ([logs[COPTER]], {logs[TAKEOFF], fresh})
    assert client.get(f"{PATH}/{logs[PX4]}").status_code == 404


def test_an_answer_that_is_about_to_be_deleted_is_given_anew(
    client: TestClient, database: Database, logs: Mapping[str, int]
) -> None:
    """Seen: the answer to a log sent again was deleted with the next analysis."""
    change(database, logs[COPTER], analysed_at=utc_now() - timedelta(days=8))
    again = add(database, COPTER)
    add(database, "fleet.tlog", content=FLEET)
    assert get(client, f"{PATH}/{again}")["log"]["analysed_at"] > (utc_now() - timedelta(days=1)).isoformat()


def test_a_newer_version_answers_again_in_the_same_place(
    client: TestClient, database: Database, logs: Mapping[str, int]
) -> None:
    place = kept(client, logs[COPTER], "Bee")
    change(database, logs[COPTER], program="0.0.1", answer=b"of another form")
    assert add(database, COPTER) == logs[COPTER]
    assert get(client, f"{PATH}/{logs[COPTER]}")["log"] == {
        **place, "analysed_at": get(client, f"{PATH}/{logs[COPTER]}")["log"]["analysed_at"]}  # fmt: skip


def test_the_file_of_a_kept_log_is_stored_on_request(client: TestClient, logs: Mapping[str, int]) -> None:
    path, content = f"{PATH}/{logs[COPTER]}/file", recorded(COPTER)
    assert client.get(path).status_code == 404
    refused = store_file(client, logs[COPTER], content)
    assert (refused.status_code, refused.json()["hint"]) == (409, "Keep the log of a vehicle first.")
    kept(client, logs[COPTER], "Bee")
    refused = store_file(client, logs[COPTER], content + b"x")
    assert (refused.status_code, problems_of(refused)) == (422, {"file": "is not the file that was analysed"})
    for _ in range(2):
        stored = store_file(client, logs[COPTER], content)
        assert (stored.status_code, stored.json()["file_bytes"]) == (200, len(content))
    answer = client.get(path)
    assert (answer.content, answer.headers["content-type"]) == (content, "application/octet-stream")
    assert answer.headers["content-disposition"] == f"attachment; filename*=UTF-8''{COPTER}"
    assert client.get(path, params={"companion": True}).status_code == 404


def test_files_take_no_more_than_the_quota_and_go_with_their_logs(
    application: FastAPI,
    client: TestClient,
    database: Database,
    logs: Mapping[str, int],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    quota = sum(len(recorded(each)) for each in (TAKEOFF, COPTER)) - 1
    limited = application.state.settings.model_copy(update={"log_file_bytes": quota})
    monkeypatch.setitem(application.state._state, "settings", limited)
    for log in (TAKEOFF, COPTER):
        kept(client, logs[log], "Bee")
    assert store_file(client, logs[TAKEOFF], recorded(TAKEOFF)).status_code == 200
    refused = store_file(client, logs[COPTER], recorded(COPTER))
    assert (refused.status_code, set(problems_of(refused))) == (413, {"file"})
    assert "The answer is kept." in refused.json()["detail"]
    assert client.delete(f"{PATH}/{logs[TAKEOFF]}").status_code == 204
    with database.read() as session:
        assert session.query(LogFileRow).count() == 0
    assert store_file(client, logs[COPTER], recorded(COPTER)).status_code == 200


@pytest.mark.complete
def test_a_campaign_starts_from_a_stored_log(client: TestClient, logs: Mapping[str, int]) -> None:
    path = f"{PATH}/{logs[TAKEOFF]}/campaign"
    assert client.post(path).status_code == 404
    kept(client, logs[TAKEOFF], "Bee")
    assert store_file(client, logs[TAKEOFF], recorded(TAKEOFF)).json()["starts_campaign"]
    answer = client.post(path)
    assert (answer.status_code, answer.json()["name"]) == (201, TAKEOFF.removesuffix(".tlog"))
    assert answer.json()["trials"]["flown"] == 1


def test_what_is_not_there_is_not_found(client: TestClient) -> None:
    log, vehicle = f"{PATH}/99", f"{VEHICLES}/99"
    answers = [
        *(client.get(f"{log}{part}") for part in ("", "/file", "/comparison", "/export.json", "/export.html")),
        *(client.get(f"{vehicle}{part}") for part in ("", "/trend")),
        keep(client, 99, "Bee"),
        store_file(client, 99, b"x"),
        client.post(f"{log}/campaign"),
        client.delete(log),
        client.put(f"{vehicle}/name", json={"name": "Bee"}),
    ]
    assert {answer.status_code for answer in answers} == {404}
    assert (get(client, PATH)["total"], listed(client, vehicle=99)) == (0, [])


def test_an_answer_is_stored_and_found_again_with_what_can_be_shown_of_the_files_name(client: TestClient) -> None:
    given = send(client, "../a\x1b[2Jb\u202e<img src=x>[bold]%{x}" + "x" * 300, recorded(COPTER)).json()
    name = ("a[2Jb<img src=x>[bold]%{x}" + "x" * 300)[:120]
    log_id = given["log"]["id"]
    assert (given["file_name"], given["log"]["file_name"], given["log"]["vehicle"]) == (name, name, None)
    assert get(client, f"{PATH}/{log_id}") == given
    assert (listed(client), listed(client, kept=False)) == ([], [log_id])
    page = client.get(f"{PATH}/{log_id}/export.html").text
    assert "<img" not in page.partition('id="figures"')[0]
    kept(client, log_id, "Bee")
    store_file(client, log_id, recorded(COPTER))
    header = client.get(f"{PATH}/{log_id}/file").headers["content-disposition"]
    assert header.isascii()
    assert not set('<>\n"\\') & set(header)


@pytest.mark.parametrize("name", ["", " ", "x" * 121, "a\x1b[2Jb", "\u202eeeb"])
def test_a_name_that_no_vehicle_may_have_is_refused(
    client: TestClient, database: Database, logs: Mapping[str, int], name: str
) -> None:
    refused = keep(client, logs[COPTER], name)
    assert (refused.status_code, set(problems_of(refused))) == (422, {"name"})
    with database.read() as session:
        assert session.query(LoggedVehicleRow).count() == 0


@pytest.mark.parametrize("damage", ["cut", "other", "empty"])
def test_a_damaged_answer_says_so_and_is_analysed_again(
    client: TestClient, database: Database, logs: Mapping[str, int], damage: str
) -> None:
    with database.read() as session:
        held = session.get_one(AnalysedLogRow, logs[COPTER]).answer
    change(database, logs[COPTER], answer={"cut": held[:-9], "other": b"notes", "empty": b""}[damage])
    refused = client.get(f"{PATH}/{logs[COPTER]}")
    assert (refused.status_code, refused.json()["title"]) == (503, "Storage error")
    assert refused.json()["hint"] == "Analyse the log again."
    assert set(listed(client, kept=False)) == set(logs.values())
    assert add(database, COPTER) == logs[COPTER]
    assert get(client, f"{PATH}/{logs[COPTER]}")["file_name"] == COPTER


def test_a_log_kept_twice_at_once_is_kept_once(client: TestClient, database: Database, logs: Mapping[str, int]) -> None:
    with ThreadPoolExecutor(8) as threads:
        answers = list(
            threads.map(lambda number: keep(client, logs[COPTER], "Bee" if number % 2 else "Wasp"), range(8))
        )
    assert {answer.status_code for answer in answers} == {200}
    [left] = get(client, VEHICLES)
    assert get(client, f"{PATH}/{logs[COPTER]}")["log"]["vehicle"]["name"] == left["name"]
    with database.read() as session:
        assert session.query(LoggedVehicleRow).count() == 1


def test_the_list_comes_in_pages(client: TestClient, database: Database, logs: Mapping[str, int]) -> None:
    bee = kept(client, logs[COPTER], "Bee")["vehicle"]
    made = [copied(database, logs[COPTER], digest=str(number)) for number in range(4)]
    pages, query = [], {"limit": "2", "vehicle": str(bee["id"])}
    while True:
        page = client.get(PATH, params=query).json()
        pages.append([each["id"] for each in page["items"]])
        if page["next_cursor"] is None:
            break
        query["cursor"] = page["next_cursor"]
    assert pages == [made[:1:-1], made[1::-1], [logs[COPTER]]]


def test_a_log_after_one_that_it_cannot_be_compared_with_has_a_document_without_a_comparison(
    client: TestClient, database: Database, logs: Mapping[str, int]
) -> None:
    for log in (PX4, COPTER):
        kept(client, logs[log], "Bee")
    assert client.get(f"{PATH}/{logs[COPTER]}/comparison").status_code == 422
    change(database, logs[PX4], autopilot="ardupilot", answer=b"notes")
    assert client.get(f"{PATH}/{logs[COPTER]}/comparison").status_code == 503
    page = client.get(f"{PATH}/{logs[COPTER]}/export.html")
    assert (page.status_code, "Compared with" in page.text) == (200, False)


def test_the_largest_answer_and_the_largest_flight_fit_into_what_a_log_may_take() -> None:
    """60 KiB, with the numbers and the fit beside them."""
    assert stored_answers.LARGEST_BYTES + flights.LARGEST_BYTES + 2**10 <= 60 * 2**10


def test_others_may_read_the_library_but_not_change_it(
    application: FastAPI, client: TestClient, logs: Mapping[str, int]
) -> None:
    vehicle = kept(client, logs[COPTER], "Bee")["vehicle"]
    neighbour = TestClient(application, base_url="http://192.0.2.7:8000", client=("192.0.2.9", 50000))
    log, path = f"{PATH}/{logs[COPTER]}", f"{VEHICLES}/{vehicle['id']}"
    changes = [
        send(neighbour, COPTER, recorded(COPTER)),
        neighbour.post(f"{PATH}/example"),
        neighbour.post(f"{log}/campaign"),
        keep(neighbour, logs[COPTER], "Wasp"),
        store_file(neighbour, logs[COPTER], recorded(COPTER)),
        neighbour.delete(log),
        neighbour.put(f"{path}/name", json={"name": "Wasp"}),
    ]
    assert {answer.status_code for answer in changes} == {403}
    assert get(neighbour, log) == get(client, log)
    assert get(neighbour, path)["name"] == "Bee"


def test_the_document_of_a_log_needs_nothing_else(
    client: TestClient, database: Database, logs: Mapping[str, int]
) -> None:
    kept(client, logs[TAKEOFF], "<b>Bee</b>")
    long_ago = utc_now() - timedelta(days=900)
    copied(database, logs[TAKEOFF], digest="earlier", file_name="earlier.tlog", ordered_at=long_ago)
    answer = client.get(f"{PATH}/{logs[TAKEOFF]}/export.html")
    assert (answer.status_code, answer.headers["content-disposition"]) == (
        200, f'inline; filename="log-{logs[TAKEOFF]}.html"')  # fmt: skip
    policy = answer.headers["content-security-policy"]
    assert policy.startswith("default-src 'none'; script-src 'sha256-")
    assert policy.endswith("frame-ancestors 'none'; sandbox allow-scripts")
    page, found = answer.text, get(client, f"{PATH}/{logs[TAKEOFF]}")
    head = page.partition('<script type="application/json"')[0]
    assert "&lt;b&gt;Bee&lt;/b&gt;" in head
    assert "<b>" not in head
    assert not {"src=", "href=", "http://", "https://"} & set(head.replace(">", " ").split())
    for part in ("tuning", "replica"):
        assert found["texts"][part]["notes"] == [] or found["texts"][part]["notes"][0] in head.replace("&#39;", "'")
        for card in found["figures"]["light"][part]:
            assert card["title"] in head
    assert found["texts"]["tuning"]["parameter_file"]["name"] in head
    assert "Compared with earlier.tlog" in head
    assert "None: every parameter is the same in both logs." in head
    assert f"Gainline {found['log']['program']}" in head
