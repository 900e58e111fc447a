"""What the server says of itself: where a tablet finds it, and a copy of the database that can be relied on."""

import io
import shutil
import sqlite3
import threading
from contextlib import closing
from pathlib import Path
from xml.etree import ElementTree

import ifaddr
import pytest
import segno
from fastapi.testclient import TestClient

from app.common.data_folder import folder_bytes
from app.common.settings import Settings
from app.db.backup import SPARE_BYTES
from app.db.migrate import migrate
from app.db.revision import REVISION
from app.db.session import Database
from app.main import create_app
from app.web import addresses
from tests.builders import Json, create_campaign, get, problems_of
from tests.waiting import Waits

TABLET = "http://192.0.2.7:8000"


@pytest.fixture
def exposed(settings: Settings) -> TestClient:
    """A server that was told one address of the machine."""
    application = create_app(settings.model_copy(update={"host": "192.0.2.7"}))
    return TestClient(application, base_url=TABLET, raise_server_exceptions=False)


def backup(client: TestClient, file: Path) -> sqlite3.Connection:
    answer = client.get("/api/system/backup")
    assert answer.status_code == 200, answer.text
    file.write_bytes(answer.content)
    return sqlite3.connect(file)


def names(connection: sqlite3.Connection) -> list[str]:
    return [name for (name,) in connection.execute("SELECT name FROM campaign ORDER BY id")]


def test_a_server_on_loopback_has_no_address_for_a_tablet_and_says_what_another_host_would_open(
    client: TestClient,
) -> None:
    system: Json = get(client, "/api/system")
    assert (system["is_exposed"], system["addresses"], system["host"]) == (False, [], "127.0.0.1")
    assert "fly only from a browser on the computer that runs the server" in system["exposes"]
    refused = client.get("/api/system/qr.svg", params={"address": TABLET})
    assert refused.status_code == 422
    assert problems_of(refused) == {"address": "is not one of the server's addresses"}


def test_a_server_that_others_reach_says_where_and_draws_that_for_a_camera(exposed: TestClient) -> None:
    with exposed as client:
        system = get(client, "/api/system")
        assert system["is_exposed"]
        assert [each["url"] for each in system["addresses"]] == [TABLET]
        drawn = client.get("/api/system/qr.svg", params={"address": TABLET})
    assert drawn.headers["content-type"] == "image/svg+xml"
    root = ElementTree.fromstring(drawn.content)
    modules = segno.make_qr(TABLET)
    side = modules.symbol_size(border=4)[0]
    assert root.attrib["viewBox"] == f"0 0 {side} {side}"
    rows = enumerate(modules.matrix_iter(border=4))
    assert dark_of(root) == {(x, y) for y, row in rows for x, is_dark in enumerate(row) if is_dark}


def dark_of(root: ElementTree.Element) -> set[tuple[int, int]]:
    """Column and row of each dark module: lines of the path, whose moves are relative to where the last one ended."""
    path = next(one for one in root.iter() if one.attrib.get("class") == "qrline").attrib["d"]
    found: set[tuple[int, int]] = set()
    x, y = 0.0, 0.0
    for command, numbers in [(part[0], part[1:]) for part in tokens(path)]:
        values = [float(number) for number in numbers.split()]
        if command == "M":
            x, y = values
        elif command == "m":
            x, y = x + values[0], y + values[1]
        else:
            found |= {(int(x) + step, int(y)) for step in range(int(values[0]))}
            x += values[0]
    return found


def tokens(path: str) -> list[str]:
    """`M4 4.5h7m2 0h1` in its commands."""
    for letter in "Mmh":
        path = path.replace(letter, f"|{letter}")
    return path.strip("|").split("|")


def test_listening_everywhere_is_told_as_the_addresses_of_this_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    everywhere = "0.0.0.0"
    hosts = {"wlan0": ["192.0.2.7", "169.254.1.1"], "lo": ["127.0.0.1"], "docker0": ["172.17.0.1"]}
    monkeypatch.setattr(ifaddr, "get_adapters", lambda: [Adapter(name, ips) for name, ips in hosts.items()])
    found = [(each.url, each.interface) for each in addresses.addresses_elsewhere(everywhere, 8000)]
    assert found == [("http://192.0.2.7:8000", "wlan0"), ("http://169.254.1.1:8000", "wlan0")]


class Adapter:
    """One interface as ifaddr lists it."""

    def __init__(self, name: str, ips: list[str]) -> None:
        self.nice_name = name
        self.ips = [ifaddr.IP(ip, 24, name) for ip in ips]


def test_version_revision_and_room_are_those_of_this_server(client: TestClient, settings: Settings) -> None:
    system = get(client, "/api/system")
    assert system["database_revision"] == REVISION
    assert system["database_bytes"] == len(client.get("/api/system/backup").content)
    assert 0 < system["data_bytes"] <= folder_bytes(settings.data_dir)
    assert system["free_bytes"] > 0
    assert system["worker"] == "absent"


def test_a_backup_is_a_database_with_the_same_rows(client: TestClient, settings: Settings, tmp_path: Path) -> None:
    for number in range(3):
        create_campaign(client, name=f"Number {number}")
    file = tmp_path / "copy.sqlite3"
    with closing(backup(client, file)) as copy:
        assert names(copy) == ["Number 0", "Number 1", "Number 2"]
        assert copy.execute("PRAGMA integrity_check").fetchone() == ("ok",)
    migrate(file)  # the program takes it as its own
    assert list(settings.data_dir.rglob("*copy*")) == []


def test_a_backup_during_writes_has_the_committed_rows_and_blocks_no_writer(
    client: TestClient, database: Database, tmp_path: Path
) -> None:
    create_campaign(client, name="Committed")
    begun, go_on = threading.Event(), threading.Event()

    def write() -> None:
        with database.write() as session:
            session.connection().exec_driver_sql("UPDATE campaign SET name = 'Half way'")
            begun.set()
            assert go_on.wait(Waits.at_most_s)

    writer = threading.Thread(target=write)
    writer.start()
    assert begun.wait(Waits.at_most_s)
    with closing(backup(client, tmp_path / "copy.sqlite3")) as copy:
        assert names(copy) == ["Committed"]
    go_on.set()
    writer.join()
    with closing(backup(client, tmp_path / "later.sqlite3")) as copy:
        assert names(copy) == ["Half way"]


def test_a_backup_comes_as_a_file_with_its_size_and_the_date(client: TestClient) -> None:
    answer = client.get("/api/system/backup", headers={"Accept-Encoding": "gzip"})
    assert int(answer.headers["content-length"]) == len(answer.content)
    assert answer.headers["content-type"] == "application/vnd.sqlite3"
    assert answer.headers["cross-origin-resource-policy"] == "same-origin"
    assert answer.headers["content-disposition"].startswith('attachment; filename="gainline-20')
    with closing(sqlite3.connect(":memory:")) as copy:
        copy.deserialize(io.BytesIO(answer.content).read())
        assert names(copy) == []


def test_a_backup_never_takes_the_room_that_flights_need(
    client: TestClient, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    room = shutil.disk_usage(settings.data_dir)
    monkeypatch.setattr(shutil, "disk_usage", lambda _folder: room._replace(free=SPARE_BYTES))
    answer = client.get("/api/system/backup")
    assert answer.status_code == 503
    assert "so that flights can still be stored" in answer.json()["detail"]
    monkeypatch.setattr(shutil, "disk_usage", lambda _folder: room._replace(free=2 * SPARE_BYTES))
    assert client.get("/api/system/backup").status_code == 200


@pytest.mark.parametrize(
    ("path", "size", "otherwise"),
    [
        ("/api/bundles", "1024 MiB", "gainline unbundle"),
        ("/api/log-analyses", "48 MiB", "gainline analyze"),
        ("/api/trials/1/photos", "10 MiB", "a lower resolution"),
        ("/api/campaigns", "1 MiB", "no operation of the API needs more"),
    ],
)
def test_what_is_too_large_is_told_its_own_way_out(client: TestClient, path: str, size: str, otherwise: str) -> None:
    answer = client.post(path, content=b"x", headers={"Content-Length": str(10**10)})
    assert answer.status_code == 413
    assert f"at most {size}" in answer.json()["hint"]
    assert otherwise in answer.json()["hint"]
