"""Records sent in: every malformed one is refused and stores nothing; the largest never fills the memory."""

import hashlib
import resource
from collections.abc import Iterator
from typing import Final

import numpy as np
import pytest
from fastapi.testclient import TestClient

from app.common.settings import Settings
from app.db.models import TrajectoryRow
from app.db.session import Database
from app.main import create_app
from app.web import headers
from tests.builders import Json, create_climb, create_csv, create_ready_campaign, create_trial, csv_of, get, problems_of
from tests.builders import upload as send
from tests.unlocking import client_here

HEADER = b"time_s,altitude_m\n"
FORM: Final = "multipart/form-data"


@pytest.fixture
def trial(client: TestClient, database: Database) -> Json:
    campaign = create_ready_campaign(client, database, vehicle="import")
    return create_trial(client, campaign["id"])


def rows(*lines: str) -> bytes:
    return HEADER + "\n".join(lines).encode() + b"\n"


def long_enough(*last: str) -> bytes:
    return rows(*(f"{0.1 * index:.1f},0" for index in range(30)), *last)


@pytest.mark.parametrize(
    ("content", "field", "reason"),
    [
        (b"", "", ""),
        (b"\x00\x01\x02\x03" * 100, "", ""),
        (b"zeit,hoehe\n0,0\n", "", "time_s"),
        (b"time_s\n0\n", "", "altitude_m"),
        (rows("0,0", "1,1"), "", ""),
        (long_enough("3.0,nan"), "line 32", "finite"),
        (long_enough("3.0,inf"), "line 32", "finite"),
        (long_enough("3.0,high"), "line 32", ""),
        (long_enough("3.0"), "line 32", ""),
        (long_enough("2.0,0"), "line 32", ""),
        (long_enough("2.9,0"), "line 32", ""),
    ],
)
def test_a_malformed_record_is_refused_in_words_and_stores_nothing(
    client: TestClient, database: Database, trial: Json, content: bytes, field: str, reason: str
) -> None:
    answer = send(client, trial["id"], content)
    assert answer.status_code == 422
    found = problems_of(answer)
    assert any(name.startswith(field) and reason in why + name for name, why in found.items()), found
    assert answer.json()["hint"]
    after = get(client, f"/api/trials/{trial['id']}")
    assert (after["state"], after["record"]) == ("planned", None)
    with database.read() as session:
        assert session.query(TrajectoryRow).filter_by(source="csv").count() == 0


def test_a_record_that_ends_too_early_is_kept_only_when_somebody_says_so(client: TestClient, trial: Json) -> None:
    """Seen: a log of 12 s became an invalid flight, and the trial could not take the right log any more."""
    short = create_csv(until_s=20.0)
    asked = send(client, trial["id"], short)
    assert (asked.status_code, asked.json()["title"]) == (409, "Confirmation needed")
    assert set(problems_of(asked)) == {"invalid"}
    assert "the record covers 0 … 20 s; 0 … 32.6 s after the command are needed" in asked.json()["detail"]
    assert get(client, f"/api/trials/{trial['id']}")["state"] == "planned"
    answer = send(client, trial["id"], short, invalid=True)
    assert (answer.status_code, answer.json()["state"], answer.json()["error"]) == (201, "invalid", None)
    assert "0 … 32.6 s after the command are needed" in answer.json()["reason"]
    assert answer.json()["record"]["samples"] == 1001


def ten_million_rows() -> Iterator[bytes]:
    yield HEADER
    for start in range(0, 10_000_000, 100_000):
        yield b"".join(b"%d,1\n" % number for number in range(start, start + 100_000))


@pytest.mark.complete
def test_ten_million_rows_are_refused_without_filling_the_memory(client: TestClient, trial: Json) -> None:
    before_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    answer = client.post(
        f"/api/trials/{trial['id']}/trajectory", content=ten_million_rows(), headers={"Content-Type": "text/csv"}
    )
    assert answer.status_code == 413
    assert "200 000 rows" in answer.json()["hint"]
    assert problems_of(answer) == {"file": "is larger than 48 MiB"}
    # 98 MB of text arrive in the test's own memory as well; the server's share stays below the limit of an upload.
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kib < 400_000
    assert get(client, f"/api/trials/{trial['id']}")["state"] == "planned"


def test_more_rows_than_allowed_are_refused_even_when_they_are_short(client: TestClient, trial: Json) -> None:
    content = HEADER + b"".join(b"%d,1\n" % number for number in range(200_001))
    answer = send(client, trial["id"], content)
    assert answer.status_code == 422
    assert "200 000" in answer.text or "200000" in answer.text


SMALL: Final = 2**16
"""Limit of every upload in the tests below, and a part of what is sent beyond it."""


@pytest.fixture
def strict(settings: Settings, monkeypatch: pytest.MonkeyPatch) -> Iterator[TestClient]:
    for name in ("PHOTO_BYTES", "BUNDLE_BYTES"):
        monkeypatch.setattr(headers, name, SMALL)
    application = create_app(settings.model_copy(update={"max_upload_bytes": SMALL}))
    with client_here(application) as client:
        yield client


def of_no_stated_length(first: bytes, parts: int) -> Iterator[bytes]:
    yield first
    for _ in range(parts):
        yield SMALL * b"a"


def uploads_of(client: TestClient) -> dict[str, list[str]]:
    """Types that each route for files accepts, by its path."""
    operations = {path: at["post"] for path, at in get(client, "/api/openapi.json")["paths"].items() if "post" in at}
    accepted = {path: list(each.get("requestBody", {}).get("content", {})) for path, each in operations.items()}
    return {path.format(campaign_id=1, trial_id=1): kinds for path, kinds in accepted.items() if FORM in kinds}


@pytest.mark.complete
def test_every_route_for_files_refuses_what_is_too_large_whatever_its_length_says(strict: TestClient) -> None:
    uploads = uploads_of(strict)
    assert len(uploads) == 6
    part = b'--b\r\nContent-Disposition: form-data; name="file"; filename="a"\r\n\r\n'
    sent = [(path, kind, part if kind == FORM else b"") for path, kinds in uploads.items() for kind in kinds]
    for path, kind, first in [*sent, ("/api/campaigns", "application/json", b'"')]:
        content = of_no_stated_length(first, 1 + (2**20 if kind == "application/json" else SMALL) // SMALL)
        stated = strict.post(path, content=b"x", headers={"Content-Type": kind, "Content-Length": str(2**21)})
        chunked = strict.post(path, content=content, headers={"Content-Type": f"{kind}; boundary=b"})
        for answer in (stated, chunked):
            assert (answer.status_code, answer.json()["title"]) == (413, "Too large"), (path, kind, answer.text)
            assert answer.headers["content-type"] == "application/problem+json"
            assert "Send at most" in answer.json()["hint"]


@pytest.mark.parametrize(
    ("arguments", "status"),
    [
        ({"files": {"record": ("flight.csv", b"x")}}, 422),
        ({"data": {"file": "text"}, "files": {"other": ("a", b"x")}}, 422),
        ({"json": {"time_s": [0], "altitude_m": [0]}}, 415),
        ({"content": b"x", "headers": {"Content-Type": "application/zip"}}, 415),
        ({"content": create_csv(), "headers": {"Content-Type": "text/plain"}}, 415),
        ({"content": b"broken", "headers": {"Content-Type": "multipart/form-data"}}, 400),
        ({"content": b"broken", "headers": {"Content-Type": "multipart/form-data; boundary=b"}}, 400),
    ],
)
def test_something_else_than_a_record_is_refused(client: TestClient, trial: Json, arguments: Json, status: int) -> None:
    answer = client.post(f"/api/trials/{trial['id']}/trajectory", **arguments)
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"


@pytest.mark.complete
def test_an_export_can_be_imported_and_gives_the_same_record_and_error(client: TestClient, database: Database) -> None:
    first, second = (
        create_trial(client, create_ready_campaign(client, database, vehicle="import")["id"]) for _ in range(2)
    )
    climb = create_climb(0.8, rate_hz=512.0)
    sent = send(
        client,
        first["id"],
        csv_of({"time_s": climb.time_s, "altitude_m": climb["altitude_m"], "thrust": np.cos(climb.time_s)}),
    ).json()
    export = client.get(f"/api/trials/{first['id']}/trajectory.csv")
    assert export.headers["content-type"].startswith("text/csv")
    assert export.headers["x-checksum-sha256"] == sent["record"]["checksum"]
    back = send(client, second["id"], export.content).json()
    assert back["record"]["checksum"] == sent["record"]["checksum"]
    assert back["error"] == sent["error"]


@pytest.mark.complete
def test_a_thinned_record_keeps_its_ends_and_its_peak(client: TestClient, trial: Json) -> None:
    time_s = np.arange(16_700) / 500.0
    altitude_m = 3.0 - 3.0 * np.exp(-time_s)
    altitude_m[7_777] = 4.25
    send(client, trial["id"], csv_of({"time_s": time_s, "altitude_m": altitude_m, "battery_v": 11.0 - 0.01 * time_s}))
    thinned = get(client, f"/api/trials/{trial['id']}/trajectory?points=200")
    assert (thinned["samples"], len(thinned["time_s"]), thinned["units"]["battery_v"]) == (16_700, 200, "V")
    assert {len(values) for values in thinned["channels"].values()} == {200}
    assert (thinned["time_s"][0], max(thinned["channels"]["altitude_m"])) == (0.0, 4.25)
    assert thinned["time_s"][-1] == pytest.approx(time_s[-1], rel=1e-6)
    whole = get(client, f"/api/trials/{trial['id']}/trajectory?points=20000")
    assert len(whole["time_s"]) == 16_700


def test_the_checksum_of_an_export_can_be_verified_by_anybody(client: TestClient, trial: Json) -> None:
    """As docs/api.md says: SHA-256 of the column names, a NUL, and the columns as little-endian single precision."""
    send(client, trial["id"], create_csv(0.8))
    export = client.get(f"/api/trials/{trial['id']}/trajectory.csv")
    header, *lines = export.text.splitlines()
    table = np.array([line.split(",") for line in lines], dtype="<f4").T
    content = "\n".join(header.split(",")).encode() + b"\0" + table.tobytes()
    assert hashlib.sha256(content).hexdigest() == export.headers["x-checksum-sha256"]
