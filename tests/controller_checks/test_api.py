"""Controller checks over HTTP, with the recorded runs and with logs of the replica's own flights."""

import gzip
import json
from pathlib import Path
from typing import Any

import httpx2
import numpy as np
import pytest
from fastapi.testclient import TestClient
from typer.testing import CliRunner

from app.cli.commands import app
from app.core.control.vertical_guidance import OUTPUTS
from app.db.models import ControllerCheckRow
from app.db.session import Database
from tests.builders import get, problems_of
from tests.logs import recorded as logs
from tests.logs.paparazzi_flights import COMPANION, Flight, data_of, write

Json = dict[str, Any]
PATH = "/api/controller-checks"
DATA = Path(__file__).parents[1] / "data"
TRACES = sorted((DATA / "vertical_loop").glob("*.csv.gz"))
ARDUCOPTER = DATA / "ardupilot_loop" / "steps_default.csv.gz"
DEFAULT = {"kp": 283, "ki": 13, "kd": 82}


def send(
    client: TestClient, name: str, content: bytes | str, *, companion: str = "", gains: str = ""
) -> httpx2.Response:
    files = {"file": (name, content)} | ({"companion": ("a.log", companion)} if companion else {})
    return client.post(PATH, files=files, params={"gains": gains} if gains else {})


def figures(client: TestClient, check: Json) -> list[Json]:
    return [get(client, f"{PATH}/{check['id']}/figures/{figure['name']}") for figure in check["figures"]]


def spoilt(*, line: int, column: str, value: str) -> bytes:
    """The first trace with one value replaced; lines count from 1, the header is line 1."""
    rows = [row.split(",") for row in gzip.decompress(TRACES[0].read_bytes()).decode().splitlines()]
    rows[line - 1][rows[0].index(column)] = value
    return "\n".join(map(",".join, rows)).encode()


def test_a_recorded_run_is_exact_in_every_signal(client: TestClient, database: Database) -> None:
    """All seven: tests/core/control/test_replay.py."""
    trace = TRACES[0]
    answer = send(client, trace.name, trace.read_bytes())
    assert answer.status_code == 201, answer.text
    check = answer.json()
    assert (check["file_name"], check["kind"], check["passed"]) == (trace.name, "trace", True)
    assert [signal["name"] for signal in check["signals"]] == list(OUTPUTS)
    assert {(signal["largest_difference"], signal["verdict"]) for signal in check["signals"]} == {(0.0, "exact")}
    assert get(client, f"{PATH}/{check['id']}") == check
    with database.read() as session:
        row = session.get(ControllerCheckRow, check["id"])
        assert row is not None
        assert len(json.dumps(row.result)) < 1_000_000


def test_a_run_of_arducopter_agrees_within_the_tolerance_of_each_signal(client: TestClient) -> None:
    check = send(client, ARDUCOPTER.name, ARDUCOPTER.read_bytes()).json()
    assert (check["autopilot"], check["kind"], check["passed"]) == ("ArduCopter", "trace", True)
    assert "5\N{NARROW NO-BREAK SPACE}600 steps are within the tolerances in all 8 signals" in check["sentence"]
    assert check["gains"] == {
        "PSC_POSZ_P": 1.0, "PSC_VELZ_P": 5.0, "PSC_ACCZ_P": 0.5, "PSC_ACCZ_I": 1.0, "PSC_ACCZ_D": 0.0,
    }  # fmt: skip
    found = {signal["name"]: signal for signal in check["signals"]}
    assert {signal["verdict"] for signal in found.values()} == {"agrees"}
    assert (found["z_d_m"]["tolerance"], found["z_d_m"]["difference_unit"]) == (1e-4, "m")
    reference, commands = figures(client, check)
    assert [reference["state"], commands["state"]] == ["ready", "ready"]
    assert len(reference["figure"]["data"]) == 2 * 3
    assert len(commands["figure"]["data"]) == 2 * 5


def test_the_log_of_an_arducopter_is_compared_row_by_row(client: TestClient) -> None:
    content = logs.recorded("arducopter_steps.bin")
    check = send(client, "flight.bin", content).json()
    assert (check["autopilot"], check["kind"], check["passed"]) == ("ArduCopter", "log", True)
    assert "238 logged rows are within the tolerances in all 5 signals" in check["sentence"]
    assert [card["state"] for card in figures(client, check)] == ["ready", "ready"]
    takeoff = send(client, "takeoff.bin", content.replace(b"GUIP", b"XUIP").replace(b"PIDA", b"XIDA")).json()
    assert [signal["name"] for signal in takeoff["signals"]] == ["v_t_m_s"]
    assert "has no position targets (GUIP)" in takeoff["notes"][1]
    assert "has no PIDA and CTUN" in takeoff["notes"][2]
    assert [card["state"] for card in figures(client, takeoff)] == ["waiting", "ready"]
    refused = send(client, "empty.bin", content.replace(b"PSCD", b"XSCD"))
    assert "is missing" in problems_of(refused)["PSCD"]


def test_the_log_of_a_px4_is_judged_by_medians(client: TestClient) -> None:
    content = logs.recorded("px4_takeoff.ulg")
    check = send(client, "flight.ulg", content).json()
    assert (check["autopilot"], check["kind"], check["passed"]) == ("PX4", "log", True)
    assert check["sentence"] == (
        "The replica agrees: over 169 rows the medians of all 2 signals are within the tolerances."
    )
    assert check["gains"]["MPC_Z_VEL_P_ACC"] == pytest.approx(4.2)
    assert (
        "The velocity target was computed from the position and the set-point of the same row, in 58 rows."
        in (check["notes"])
    )
    assert any(note.startswith("The acceleration target was not computed") for note in check["notes"])
    assert [signal["different"] for signal in check["signals"]] == [0, 0]
    assert all(0.0 <= signal["median_difference"] <= signal["tolerance"] for signal in check["signals"])
    assert [card["state"] for card in figures(client, check)] == ["ready", "ready"]
    refused = send(client, "empty.ulg", content.replace(b"takeoff_status", b"xakeoff_status"))
    assert problems_of(refused) == {"takeoff_status": "is missing"}
    without = content.replace(b"hover_thrust_estimate", b"hover_thrusx_estimate")
    refused = send(client, "bare.ulg", without.replace(b"trajectory_setpoint", b"trajectory_sexpoint"))
    assert "no set-point and no hover thrust" in problems_of(refused)["file"]


def test_a_difference_beyond_the_tolerance_is_found_in_a_run_of_arducopter(client: TestClient) -> None:
    lines = gzip.decompress(ARDUCOPTER.read_bytes()).decode().splitlines()
    row = lines[1002].split(",")
    row[-2] = str(float(row[-2]) + 6e-4)
    lines[1002] = ",".join(row)
    check = send(client, "spoilt.csv", "\n".join(lines)).json()
    assert check["passed"] is False
    assert "steps is not within the tolerances, the first at 2.500 s in throttle" in check["sentence"]


@pytest.mark.complete
def test_a_check_of_an_earlier_version_is_one_of_paparazzi(client: TestClient, database: Database) -> None:
    made = client.post(f"{PATH}/example").json()["id"]
    with database.write() as session:
        row = session.get(ControllerCheckRow, made)
        assert row is not None
        row.result = {
            key: value for key, value in row.result.items() if key not in {"autopilot", "first_different_row"}
        }
    assert get(client, f"{PATH}/{made}")["autopilot"] == "Paparazzi"
    assert get(client, f"{PATH}/{made}/figures/commands")["state"] == "ready"


@pytest.mark.complete
def test_what_is_drawn_is_the_recording_in_its_units_and_the_replica_over_it(client: TestClient) -> None:
    trace = next(path for path in TRACES if path.name.startswith("takeoff_default"))
    check = send(client, trace.name, trace.read_bytes()).json()
    header, *lines = gzip.decompress(trace.read_bytes()).decode().splitlines()
    names = header.split(",")
    rows = np.array([line.split(",") for line in lines])
    scales = {"z_ref": 2**-8, "zd_ref": 2**-19, "zdd_ref": 2**-10, "z_sum_err": 2**-17}
    cards = figures(client, check)
    assert [card["state"] for card in cards] == ["ready", "ready"]
    traces = [each for card in cards for each in card["figure"]["data"]]
    assert [each["meta"]["role"] for each in traces] == ["recorded", "replica"] * len(OUTPUTS)
    for name, recorded, replica in zip(OUTPUTS, traces[::2], traces[1::2], strict=True):
        assert (recorded["x"], recorded["y"]) == (replica["x"], replica["y"])
        whole = rows[:, names.index(name)].astype(np.int64) * scales.get(name, 1)
        places = np.round(np.array(recorded["x"]) * 512).astype(int)
        assert recorded["y"] == pytest.approx(whole[places].tolist(), abs=1e-6)
        assert max(recorded["y"]) == pytest.approx(whole.max(), abs=1e-6)
        assert places[-1] == len(rows) - 1


@pytest.mark.complete
def test_numbers_are_those_of_the_command(client: TestClient, tmp_path: Path) -> None:
    log = write(tmp_path, Flight(DEFAULT, stale=True))
    printed = CliRunner().invoke(app, ["controller", "check", str(log), "--json", str(tmp_path / "out.json")])
    assert printed.exit_code == 0
    (said,) = json.loads((tmp_path / "out.json").read_text())["files"]
    check = send(client, "flight.data", log.read_bytes(), companion=COMPANION).json()
    assert (check["passed"], check["gains"], check["gains_from"]) == (True, DEFAULT, "of the log")
    commands = said["commands"]
    assert check["rows"] == commands["rows"] == 669
    assert f"{commands['exact']} of {commands['rows']} commands are bit-exact" in check["sentence"]
    simulated = {signal["name"]: signal for signal in check["signals"][:4]}
    assert {name: signal["largest_difference"] for name, signal in simulated.items()} == (
        said["simulation"]["largest_difference"]
    )
    assert all(signal["tolerance"] == said["tolerances"][name] for name, signal in simulated.items())
    verdicts = {signal["name"]: signal["verdict"] for signal in check["signals"]}
    assert (verdicts["z_ref"], verdicts["fb_cmd"]) == ("exact", "agrees")


def test_a_difference_is_named_measured_and_marked_where_it_is(client: TestClient) -> None:
    check = send(client, "spoilt.csv", spoilt(line=1002, column="thrust", value="123")).json()
    assert check["passed"] is False
    assert "1 of 8\N{NARROW NO-BREAK SPACE}192 steps is not exact, the first at 1.953 s in thrust" in check["sentence"]
    found = {signal["name"]: signal for signal in check["signals"]}
    assert (found["thrust"]["verdict"], found["thrust"]["different"]) == ("differs", 1)
    assert found["thrust"]["first_different_s"] == pytest.approx(1000 / 512, abs=1e-6)
    assert found["ff_cmd"]["verdict"] == "exact"
    marks = [trace for trace in figures(client, check)[1]["figure"]["data"] if trace["meta"]["role"] == "differs"]
    assert [(mark["x"], mark["y"]) for mark in marks] == [([pytest.approx(1000 / 512, abs=1e-6)], [123])]


def test_other_gains_than_flown_are_noticed_and_the_flown_ones_offered(client: TestClient) -> None:
    data = data_of(Flight(DEFAULT))
    check = send(client, "flight.data", data, gains="300,13,82").json()
    assert (check["passed"], check["gains_from"], check["better_gains"]) == (False, "given", DEFAULT)
    assert "The replica differs" in check["sentence"]
    assert send(client, "flight.data", data, gains="283,13,82").json()["passed"] is True


def test_a_calm_flight_asks_for_its_gains(client: TestClient) -> None:
    lines = data_of(Flight(DEFAULT)).splitlines()
    calm = "\n".join(line for line in lines if float(line.split()[0]) > 40.0)
    refused = send(client, "calm.data", calm)
    assert (refused.status_code, problems_of(refused)) == (422, {"gains": "are needed"})
    assert "on the command line: --gains KP,KI,KD" in refused.json()["hint"]
    check = send(client, "calm.data", calm, gains="283,13,82").json()
    assert check["passed"] is True
    assert any("not simulated" in note for note in check["notes"])
    assert [signal["name"] for signal in check["signals"]] == ["ff_cmd", "fb_cmd", "thrust"]
    reference, commands = figures(client, check)
    assert (reference["state"], commands["state"]) == ("waiting", "ready")


@pytest.mark.parametrize(
    ("name", "content", "field", "reason"),
    [
        ("empty.data", b"", "file", "is empty"),
        ("flight.ulg", b"ULog\x01\x12\x35" + bytes(100), "vehicle_local_position", "is missing"),
        ("alive.data", b"1.0 31 ALIVE 1\n", "file", "contains no VERT_LOOP"),
        ("cut.csv.gz", TRACES[0].read_bytes()[:5000], "file", "is damaged"),
        ("noise.csv.gz", b"\x1f\x8b" + bytes(range(200)), "file", "is damaged"),
        ("text.csv.gz", gzip.compress(b"a,b\n1,2\n", mtime=0), "line 1, step", "column is missing"),
        ("spoilt.csv", spoilt(line=17, column="z", value="1.5"), "line 17, z", "must be a whole number"),
        ("header.csv", spoilt(line=2, column="z", value="1").splitlines()[0], "file", "has no rows"),
    ],
)
def test_what_cannot_be_checked_is_refused_in_words_and_stores_nothing(
    client: TestClient, name: str, content: bytes, field: str, reason: str
) -> None:
    answer = send(client, name, content)
    assert answer.status_code == 422, answer.text
    found = problems_of(answer)
    assert field in found, found
    assert reason in found[field]
    assert answer.json()["hint"]
    assert get(client, PATH)["total"] == 0


def test_gains_that_are_none_and_a_form_without_a_file_are_refused_naming_the_field(client: TestClient) -> None:
    answer = send(client, "flight.data", data_of(Flight(DEFAULT, fly_s=4.0)), gains="1,2")
    assert (answer.status_code, problems_of(answer)) == (422, {"gains": "must be three whole numbers, KP,KI,KD"})
    assert problems_of(client.post(PATH, files={"log": ("a.data", b"x")})) == {"file": "is missing"}
    assert client.post(PATH, json={}).status_code == 415


@pytest.mark.complete
def test_a_small_file_that_unpacks_to_a_huge_one_is_refused(client: TestClient) -> None:
    bomb = gzip.compress(b"step,mode\n" + bytes(300 * 2**20), compresslevel=1)
    answer = send(client, "bomb.csv.gz", bomb)
    assert (answer.status_code, problems_of(answer)) == (422, {"file": "contains more than 256 MiB of text"})


@pytest.mark.complete
def test_the_example_shows_what_a_check_is(client: TestClient) -> None:
    answer = client.post(f"{PATH}/example", headers={"Idempotency-Key": "one"})
    assert (answer.status_code, answer.json()["passed"]) == (201, True)
    assert "all 8\N{NARROW NO-BREAK SPACE}192 steps are exact in all 7 signals" in answer.json()["sentence"]
    assert client.post(f"{PATH}/example", headers={"Idempotency-Key": "one"}).json() == answer.json()
    assert get(client, PATH)["total"] == 1


@pytest.mark.complete
def test_checks_are_listed_newest_first_in_pages_and_removed(client: TestClient) -> None:
    made = [client.post(f"{PATH}/example").json()["id"] for _ in range(3)]
    first = get(client, f"{PATH}?limit=2")
    assert ([item["id"] for item in first["items"]], first["total"]) == (made[:0:-1], 3)
    rest = get(client, f"{PATH}?limit=2&cursor={first['next_cursor']}")
    assert ([item["id"] for item in rest["items"]], rest["next_cursor"]) == (made[:1], None)
    assert client.delete(f"{PATH}/{made[0]}").status_code == 204
    for answer in (
        client.delete(f"{PATH}/{made[0]}"),
        client.get(f"{PATH}/{made[0]}"),
        client.get(f"{PATH}/{made[0]}/figures/commands"),
    ):
        assert answer.status_code == 404
        assert "There is no controller check" in answer.json()["detail"]
    assert client.get(f"{PATH}/{made[1]}/figures/nonsense").status_code == 422


@pytest.mark.complete
def test_a_browser_hears_of_a_check(client: TestClient, database: Database) -> None:
    made = client.post(f"{PATH}/example").json()["id"]
    with database.engine.connect() as connection:
        told = connection.exec_driver_sql("SELECT topic, entity_id FROM event ORDER BY id DESC LIMIT 1").one()
    assert tuple(told) == ("check", made)
