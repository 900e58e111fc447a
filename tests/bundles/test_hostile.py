"""Bundles that are not what they say: refused with a message that names the field, and nothing is stored."""

import json
import struct
import tracemalloc
import zipfile
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import pytest
import zstandard
from fastapi.testclient import TestClient

from app.bundles import reader
from app.db.models import CampaignRow, TrajectoryRow
from app.db.session import Database
from tests.builders import create_flown_trial, create_ready_campaign, problems_of
from tests.bundles.builders import download_bundle, import_bundle, parts_of, sealed, second_installation, zipped

Parts = dict[str, bytes]
Change = Callable[[Any], object]


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory, migrated_file: Path) -> Parts:
    """Of a campaign with one flight, flown elsewhere."""
    with second_installation(tmp_path_factory.mktemp("elsewhere"), migrated_file) as (client, database):
        campaign = create_ready_campaign(client, database)
        create_flown_trial(client, database, campaign["id"])
        return parts_of(download_bundle(client, campaign["id"]))


def refused(client: TestClient, database: Database, bundle: bytes) -> dict[str, str]:
    """The problems of the refusal; that nothing was stored is seen to."""
    with database.read() as session:
        before = session.query(CampaignRow).count(), session.query(TrajectoryRow).count()
    answer = import_bundle(client, bundle)
    assert answer.status_code == 422, answer.text
    assert answer.json()["hint"]
    with database.read() as session:
        assert (session.query(CampaignRow).count(), session.query(TrajectoryRow).count()) == before
    return problems_of(answer)


def changed(parts: Parts, change: Change, name: str = "contents.json") -> bytes:
    document = json.loads(parts[name])
    change(document)
    return sealed({**parts, name: json.dumps(document).encode()})


def record_of(parts: Parts) -> str:
    part: str = json.loads(parts["contents.json"])["campaigns"][0]["trials"][0]["record"]["part"]
    return part


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 not really", b"\x00" * 5000, b"{}"])
def test_what_is_no_zip_is_refused(client: TestClient, database: Database, content: bytes) -> None:
    assert "file" in refused(client, database, content)


def test_a_zip_of_something_else_is_refused(client: TestClient, database: Database) -> None:
    assert "manifest.json" in refused(client, database, zipped({"holiday.jpg": b"sun"}))


@pytest.mark.parametrize(
    ("field", "value"), [("version", 7), ("version", 0), ("format", "zip"), ("made_at", "yesterday"), ("extra", 1)]
)
def test_another_format_or_version_is_refused_by_its_field(
    client: TestClient, database: Database, parts: Parts, field: str, value: object
) -> None:
    manifest = {**json.loads(parts["manifest.json"]), field: value}
    found = refused(client, database, zipped({**parts, "manifest.json": json.dumps(manifest).encode()}))
    assert list(found) == [f"manifest.json: {field}"]


def test_a_newer_version_is_reported_as_such(client: TestClient, database: Database, parts: Parts) -> None:
    manifest = {**json.loads(parts["manifest.json"]), "version": 7, "new": True}
    found = refused(client, database, zipped({**parts, "manifest.json": json.dumps(manifest).encode()}))
    assert "newer Gainline" in found["manifest.json: version"]


@pytest.mark.parametrize("name", ["../../evil", "/etc/cron.d/evil", "records/../../evil.zst", "records\\..\\evil.zst"])
def test_names_that_lead_elsewhere_are_refused(client: TestClient, database: Database, parts: Parts, name: str) -> None:
    assert refused(client, database, sealed({**parts, name: b"x"}))
    moved = dict(parts)
    moved[name] = moved.pop(record_of(parts))

    def point(document: Any) -> None:
        document["campaigns"][0]["trials"][0]["record"]["part"] = name

    found = refused(client, database, changed(moved, point))
    assert any(field.endswith("record.part") or field == "manifest.json: parts" for field in found), found


def test_a_part_that_nothing_names_is_refused(client: TestClient, database: Database, parts: Parts) -> None:
    assert "photos/9.png" in refused(client, database, sealed({**parts, "photos/9.png": b"x"}))


def test_a_part_that_is_missing_is_refused(client: TestClient, database: Database, parts: Parts) -> None:
    found = refused(client, database, sealed({name: data for name, data in parts.items() if name != record_of(parts)}))
    assert record_of(parts) in found


def test_two_parts_of_one_name_are_refused(client: TestClient, database: Database, parts: Parts) -> None:
    file = BytesIO(sealed(parts))
    with zipfile.ZipFile(file, "a") as out, pytest.warns(UserWarning, match="Duplicate name"):
        out.writestr("contents.json", b"{}")
    assert "two parts" in refused(client, database, file.getvalue())["file"]


def test_a_changed_sample_is_found(client: TestClient, database: Database, parts: Parts) -> None:
    name = record_of(parts)
    spoiled = bytearray(parts[name])
    spoiled[len(spoiled) // 2] ^= 1
    assert "SHA-256" in refused(client, database, zipped({**parts, name: bytes(spoiled)}))[name]
    plain = bytearray(zstandard.ZstdDecompressor().decompress(parts[name]))
    plain[100] ^= 1
    found = refused(client, database, sealed({**parts, name: zstandard.ZstdCompressor().compress(bytes(plain))}))
    assert any(field.endswith("record.checksum") for field in found), found


def test_a_bomb_in_the_zip_is_refused_before_it_goes_off(
    client: TestClient, database: Database, parts: Parts, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reader, "MAX_JSON_BYTES", 2**20)
    found = refused(client, database, sealed({**parts, "contents.json": b" " * 2**22}))
    assert found["contents.json"] == "is larger than 1 MiB"
    monkeypatch.setattr(reader, "MAX_TOTAL_BYTES", 2**21)
    assert "unpack" in refused(client, database, sealed({**parts, "contents.json": b" " * 2**22}))["file"]


def peak_bytes(work: Callable[[], object]) -> int:
    """The most that Python held meanwhile beyond what it holds now."""
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        work()
        return tracemalloc.get_traced_memory()[1] - before
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("name", [pytest.param("manifest.json", marks=pytest.mark.complete), "contents.json"])
@pytest.mark.parametrize(
    "value", ["0", *(pytest.param(each, marks=pytest.mark.complete) for each in ("[]", '{"a":0}'))]
)
def test_a_small_bundle_of_many_values_stays_small_in_memory(
    client: TestClient, database: Database, parts: Parts, name: str, value: str
) -> None:
    """It took 1.3 GB for 60 KiB."""
    many = "[" + ",".join([value] * (60 * 2**20 // (len(value) + 1))) + "]"
    hostile = {**parts, name: many.encode()}
    bundle = zipped(hostile) if name == "manifest.json" else sealed(hostile)
    assert len(bundle) < 2**18
    found: dict[str, str] = {}
    peak = peak_bytes(lambda: found.update(refused(client, database, bundle)))
    assert peak < 250 * 2**20
    assert found[name] == "is larger than 4 MiB" or "million values" in found[name]


@pytest.mark.complete
def test_a_directory_without_end_is_not_read(client: TestClient, database: Database) -> None:
    file = BytesIO()
    with zipfile.ZipFile(file, "w") as out:
        for number in range(9_000):
            out.writestr(f"records/{number:0500}.zst", b"")
    found: dict[str, str] = {}
    peak = peak_bytes(lambda: found.update(refused(client, database, file.getvalue())))
    assert "directory is larger than 4 MiB" in found["file"]
    assert peak < 50 * 2**20


def test_a_part_that_lies_about_its_size_is_bounded(client: TestClient, database: Database, parts: Parts) -> None:
    """The directory says 10 bytes, the stream goes on for ever."""
    bundle = bytearray(sealed({**parts, "contents.json": b" " * 2**22}))
    for found in (index for index in range(len(bundle) - 4) if bundle[index : index + 4] == b"PK\x01\x02"):
        name_length = struct.unpack_from("<H", bundle, found + 28)[0]
        if bundle[found + 46 : found + 46 + name_length] == b"contents.json":
            struct.pack_into("<I", bundle, found + 24, 10)
    assert "contents.json" in refused(client, database, bytes(bundle))


def test_a_bomb_in_a_record_is_refused_before_it_goes_off(client: TestClient, database: Database, parts: Parts) -> None:
    bomb = zstandard.ZstdCompressor().compress(b"\0" * 2**26)
    found = refused(client, database, sealed({**parts, record_of(parts): bomb}))
    assert any("would unpack to 67108864 bytes" in reason for reason in found.values()), found


def at(path: str, value: object) -> Change:
    """Set what is at `trials.0.error` and the like, of the first campaign."""

    def change(document: Any) -> None:
        *way, last = path.split(".")
        node = document["campaigns"][0]
        for step in way:
            node = node[int(step)] if step.isdecimal() else node[step]
        node[last] = value

    return change


@pytest.mark.parametrize(
    ("path", "value", "field"),
    [
        ("trials.0.error", None, "trials.0"),
        ("trials.0.error", "low", "trials.0.error"),
        ("trials.0.state", "flying", "trials.0"),
        ("trials.0.state", "perfect", "trials.0.state"),
        ("trials.0.gains", {"kp": 1}, "trials.0.gains"),
        ("trials.0.gains", {}, "trials.0.gains"),
        ("trials.0.gate", {"passed": "maybe"}, "trials.0.gate"),
        ("trials.0.proposal", 99, ""),
        ("trials.0.seed", -1, "trials.0.seed"),
        ("trials.0.note", "x" * 10_001, "trials.0.note"),
        ("trials.0.end", {"remarks": ["x" * 10_001]}, "trials.0.end"),
        ("trials.0.end", {"remarks": ["x" * 1000] * 11}, "trials.0.end"),
        ("trials.0.end", {"remarks": ["x" * 6000], "request": {"words": "y" * 6000}}, "trials.0.end"),
        ("trials.0.flown_at", "2026-11-22T10:00:00", "trials.0.flown_at"),
        ("trials.0.record.columns", ["altitude_m", "time_s"], "trials.0.record.columns"),
        ("trials.0.record.columns", ["time_s", "feet"], "trials.0.record.columns"),
        ("trials.0.record.samples", 2**40, "trials.0.record.samples"),
        ("trials.0.record.codec", 9, "trials.0.record.codec"),
        ("trials.0.glitches", [{"kind": "rust"}], "trials.0.glitches.0"),
        ("state", "flying", ""),
        ("name", "", "name"),
        ("name", "x" * 500, "name"),
        ("definition.experiment", "landing", "definition.experiment"),
        ("definition.strategy", "guess", "definition.strategy"),
        ("definition.stop.max_flights", 10_000, "definition.stop"),
        ("definition.bounds", {"kp": [5, 1]}, "definition.bounds"),
        ("vehicle.kind", "zeppelin", "vehicle.kind"),
        ("vehicle_options", {"wings": 4}, "vehicle"),
        ("unknown", 1, "unknown"),
    ],
)
def test_contents_that_cannot_be_are_refused_by_their_field(
    client: TestClient, database: Database, parts: Parts, path: str, value: object, field: str
) -> None:
    found = refused(client, database, changed(parts, at(path, value)))
    assert any(f"campaigns.0.{field}".rstrip(".") in name for name in found), found


@pytest.mark.parametrize("text", ["NaN", "Infinity", "1e999"])
def test_numbers_that_are_none_are_refused(client: TestClient, database: Database, parts: Parts, text: str) -> None:
    document = json.loads(parts["contents.json"])
    document["campaigns"][0]["trials"][0]["error"] = "HERE"
    spoiled = json.dumps(document).replace('"HERE"', text).encode()
    found = refused(client, database, sealed({**parts, "contents.json": spoiled}))
    assert any(name.startswith("contents.json") for name in found), found


def test_json_that_is_nested_without_end_is_refused(client: TestClient, database: Database, parts: Parts) -> None:
    found = refused(client, database, sealed({**parts, "contents.json": b"[" * 200_000}))
    assert "contents.json" in found


def test_a_photo_that_is_none_is_refused(client: TestClient, database: Database, parts: Parts) -> None:
    photo = {"part": "photos/1.png", "media_type": "image/png", "added_at": "2026-11-22T10:00:00Z"}
    document = json.loads(parts["contents.json"])
    document["campaigns"][0]["trials"][0]["photos"] = [photo]
    page = {**parts, "contents.json": json.dumps(document).encode(), "photos/1.png": b"<script>alert(1)</script>"}
    found = refused(client, database, sealed(page))
    assert any(name.endswith("photos.media_type") for name in found), found
