"""Photos of flights: kept byte by byte, told by their content, refused at the edge, and harmless to look at."""

import struct
import zlib

import httpx2
import pytest
from fastapi.testclient import TestClient

from app.campaigns.trials import photos
from app.db.session import Database
from tests.builders import Json, create_ready_campaign, create_trial, get, problems_of


def png(width: int = 1) -> bytes:
    """A grey picture of one line."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, 1, 8, 0, 0, 0, 0)
    line = zlib.compress(b"\0" + b"\x80" * width)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", line) + chunk(b"IEND", b"")


JPEG, WEBP = b"\xff\xd8\xff\xe0" + b"\0" * 40, b"RIFF\x1a\0\0\0WEBPVP8L" + b"\0" * 20


@pytest.fixture
def trial(client: TestClient, database: Database) -> Json:
    return create_trial(client, create_ready_campaign(client, database)["id"])


def add(client: TestClient, trial: Json, content: bytes, name: str = "photo.jpg", key: str = "") -> httpx2.Response:
    headers = {"Idempotency-Key": key} if key else {}
    return client.post(f"/api/trials/{trial['id']}/photos", files={"file": (name, content)}, headers=headers)


@pytest.mark.parametrize(
    ("content", "media_type"),
    [(png(), "image/png"), (JPEG, "image/jpeg"), (WEBP, "image/webp")],
    ids=["png", "jpeg", "webp"],
)
def test_a_photo_comes_back_as_it_was_handed_in(
    client: TestClient, trial: Json, content: bytes, media_type: str
) -> None:
    added = add(client, trial, content, "anything.bin")
    assert (added.status_code, added.json()["media_type"]) == (201, media_type)
    assert get(client, f"/api/trials/{trial['id']}/photos") == [added.json()]
    shown = client.get(f"/api/trials/{trial['id']}/photos/{added.json()['id']}")
    assert (shown.content, shown.headers["content-type"]) == (content, media_type)
    assert shown.headers["x-content-type-options"] == "nosniff"
    assert shown.headers["content-security-policy"].startswith("default-src 'none'; sandbox")


@pytest.mark.parametrize(
    ("content", "status"),
    [
        (b"", 422),
        (b"<svg xmlns='http://www.w3.org/2000/svg'><script>alert(1)</script></svg>", 415),
        (b"<!doctype html><script>alert(1)</script>", 415),
        (b"\0\0\0\x18ftypheic\0\0\0\0mif1heic", 415),
        (b"RIFF\x24\0\0\0WAVEfmt ", 415),
        (png() + b"\0" * photos.MAX_BYTES, 413),
        (b"\xff\xd8\xff" + b"\0" * (11 * 2**20), 413),
    ],
    ids=["empty", "svg", "html", "heic", "wave", "a little too large", "far too large"],
)
def test_what_is_no_photo_is_refused_by_its_content_whatever_it_is_called(
    client: TestClient, trial: Json, content: bytes, status: int
) -> None:
    refused = add(client, trial, content, "photo.jpg")
    assert refused.status_code == status
    assert "file" in problems_of(refused)
    assert refused.json()["hint"]
    assert get(client, f"/api/trials/{trial['id']}/photos") == []


def test_the_same_photo_sent_twice_with_one_key_is_one_photo(client: TestClient, trial: Json) -> None:
    assert add(client, trial, png(), key="once").json() == add(client, trial, png(), key="once").json()
    assert len(get(client, f"/api/trials/{trial['id']}/photos")) == 1


def test_a_photo_can_be_deleted_and_belongs_to_one_flight(client: TestClient, trial: Json) -> None:
    other = create_trial(client, trial["campaign_id"])
    photo = add(client, trial, png()).json()["id"]
    assert client.get(f"/api/trials/{other['id']}/photos/{photo}").status_code == 404
    assert client.delete(f"/api/trials/{other['id']}/photos/{photo}").status_code == 404
    assert client.delete(f"/api/trials/{trial['id']}/photos/{photo}").status_code == 204
    assert get(client, f"/api/trials/{trial['id']}/photos") == []
    assert client.get("/api/trials/999/photos").status_code == 404


def test_there_are_at_most_twenty_of_a_flight(client: TestClient, trial: Json) -> None:
    for width in range(1, photos.MAX_PER_TRIAL + 1):
        assert add(client, trial, png(width)).status_code == 201
    refused = add(client, trial, png(30))
    assert (refused.status_code, "Delete one" in refused.json()["hint"]) == (409, True)
