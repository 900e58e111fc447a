"""A campaign's report: it says what the API says, runs nothing but its own scripts, and becomes a PDF where it can."""

import base64
import hashlib
import os
import re
import select
import shutil
import subprocess
import zlib
from dataclasses import dataclass
from html.parser import HTMLParser
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from app.campaigns.proposals import start_flying
from app.campaigns.service import get_row
from app.core.formatting import measured
from app.db.session import Database
from app.reports import pdf, router, service
from tests.builders import (
    Json,
    create_ready_campaign,
    create_record,
    fly_trial,
    get,
    run_jobs,
)
from tests.campaigns.trials.test_photos import JPEG, add, png
from tests.fleet.vehicles import create_campaign_on, create_connected
from tests.reports.conftest import NAME, REASON

POLICY = "content-security-policy"
HEADINGS = {"h1", "h2", "h3"}


class Page(HTMLParser):
    """Text of the page, its scripts as they would run, and every address that it names."""

    def __init__(self, html: str) -> None:
        super().__init__(convert_charrefs=True)
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.scripts: list[str] = []
        self.cells: list[str] = []
        self.headings: list[tuple[str, str]] = []
        self.text = ""
        self._open: list[str] = []
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        self._open.append(tag)
        if tag in {"td", "th"}:
            self.cells.append("")
        if tag in HEADINGS:
            self.headings.append((tag, ""))
        if tag == "script" and dict(attrs).get("type") is None:
            self.scripts.append("")

    def handle_endtag(self, tag: str) -> None:
        while self._open and self._open.pop() != tag:
            pass

    def handle_data(self, data: str) -> None:
        if "script" in self._open:
            if self.tags[-1][1].get("type") is None:
                self.scripts[-1] += data
            return
        if "style" not in self._open:
            self.text += data
        if "td" in self._open or "th" in self._open:
            self.cells[-1] += data
        if HEADINGS & set(self._open):
            tag, text = self.headings[-1]
            self.headings[-1] = (tag, " ".join((text + data).split()))

    @property
    def said(self) -> str:
        return re.sub(r"[ \t\n]+", " ", self.text).strip()


def read(client: TestClient, campaign: Json) -> Page:
    answer = client.get(f"/api/campaigns/{campaign['id']}/report.html")
    assert answer.status_code == 200, answer.text
    assert answer.headers["content-type"] == "text/html; charset=utf-8"
    return Page(answer.text)


def test_the_report_says_what_the_api_says(client: TestClient, campaign: Json) -> None:
    page = read(client, campaign)
    statistics = get(client, f"/api/campaigns/{campaign['id']}/statistics")
    best = campaign["best"]
    assert measured(best["mean"], best["standard_error"], "m") in page.said
    assert statistics["comparison"]["sentence"] in page.said
    first = statistics["groups"][0]
    assert (
        f"First gains (flight 1): {measured(first['mean'], first['standard_error'], 'm')}; the error with the best"
        in page.said
    )
    assert "± is the standard deviation of one flight" in page.said
    assert statistics["track_record"]["sentence"] in page.said
    assert campaign["definition_digest"] in page.said
    health = get(client, "/api/health")
    assert f"Gainline {health['version']}" in page.said
    cells = [" ".join(cell.split()) for cell in page.cells]
    for trial in get(client, f"/api/campaigns/{campaign['id']}/trials")["items"]:
        assert all(f"{value:.0f}" in cells for value in trial["gains"].values())
        assert trial["record"]["checksum"] in cells
        assert trial["verdict"] in page.said
        if trial["error"] is not None:
            assert measured(trial["error"], statistics["sigma"], "") in cells


@pytest.mark.complete
def test_the_file_runs_its_own_scripts_alone_and_reaches_nothing_whatever_people_wrote(
    client: TestClient, campaign: Json
) -> None:
    answer = client.get(f"/api/campaigns/{campaign['id']}/report.html")
    page = Page(answer.text)
    assert NAME in page.said
    assert REASON in page.said
    assert len(page.scripts) == 2
    assert not [tag for tag, _ in page.tags if tag in {"img", "b", "iframe", "link", "object"}]
    assert not [name for _, attributes in page.tags for name in attributes if name.startswith("on")]
    served = answer.headers[POLICY]
    (own,) = (found["content"] for tag, found in page.tags if tag == "meta" and "http-equiv" in found)
    assert own is not None
    assert served.startswith(own)
    assert "sandbox allow-scripts" in served
    assert "default-src 'none'" in own
    allowed = re.findall(r"'sha256-([^']+)'", own)
    assert allowed == [base64.b64encode(hashlib.sha256(each.encode()).digest()).decode() for each in page.scripts]
    assert not [name for _, attributes in page.tags for name in attributes if name in {"src", "href", "srcset"}]


@pytest.mark.complete
def test_notes_and_photos_stand_with_their_flights_in_the_file_itself(client: TestClient, campaign: Json) -> None:
    first, _, third = get(client, f"/api/campaigns/{campaign['id']}/trials")["items"]
    said = {"version": third["version"], "note": "<i>New</i> propellers."}
    assert client.patch(f"/api/trials/{third['id']}", json=said).status_code == 200
    pictures = [png(1), png(2), JPEG + b'"><script>alert(1)</script>']
    for trial, picture in zip((third, third, first), pictures, strict=True):
        assert add(client, trial, picture).status_code == 201
    page = read(client, campaign)
    assert re.search(r"Flight 1 valid, .*? Flight 3 valid, .*? <i>New</i> propellers\.", page.said)
    shown = [found for tag, found in page.tags if tag == "img"]
    assert [(found["alt"], found["src"]) for found in shown] == [
        ("Photo 1 of flight 1", f"data:image/jpeg;base64,{base64.b64encode(pictures[2]).decode()}"),
        ("Photo 1 of flight 3", f"data:image/png;base64,{base64.b64encode(pictures[0]).decode()}"),
        ("Photo 2 of flight 3", f"data:image/png;base64,{base64.b64encode(pictures[1]).decode()}"),
    ]
    assert "img-src data:;" in client.get(f"/api/campaigns/{campaign['id']}/report.html").headers[POLICY]


@pytest.mark.complete
def test_photos_beyond_what_a_file_can_hold_are_left_out_in_words_the_first_of_each_flight_last(
    client: TestClient, campaign: Json, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, _, third = get(client, f"/api/campaigns/{campaign['id']}/trials")["items"]
    for trial in (first, first, first, third):
        add(client, trial, png())
    monkeypatch.setattr(service, "MAX_PHOTO_BYTES", 3 * len(png()) - 1)
    page = read(client, campaign)
    assert [found["alt"] for tag, found in page.tags if tag == "img"] == [
        "Photo 1 of flight 1",
        "Photo 1 of flight 3",
    ]
    assert "2 photos omitted" in page.said
    assert "2 photos of this flight omitted" in page.said


@pytest.mark.complete
def test_a_flight_that_does_not_settle_is_said_not_to(client: TestClient, database: Database, campaign: Json) -> None:
    assert "not settled" not in read(client, campaign).cells
    fly_trial(client, database, campaign["id"], create_record(30.0), gains={"kp": 283, "ki": 13, "kd": 106})
    run_jobs(database)
    assert read(client, campaign).cells.count("not settled") == 1


@pytest.mark.complete
def test_a_campaign_that_has_not_flown_has_a_report_too(client: TestClient, database: Database) -> None:
    page = read(client, create_ready_campaign(client, database))
    assert "No valid flight yet" in page.said
    assert "No flights yet." in page.said


@pytest.mark.complete
def test_the_safe_gains_are_those_of_the_first_flight_and_later_ones_are_said(
    client: TestClient, database: Database
) -> None:
    drone = create_connected(client, database)
    campaign = create_campaign_on(client, database, drone)
    assert "Safe gainskp 283, ki 13, kd 82Experiment" in read(client, campaign).said
    with database.write() as session:
        start_flying(get_row(session, campaign["id"]))
    softer = {"version": 1, "safe_gains": {"kp": 250, "ki": 13, "kd": 82}, "statement": "Ada: softer"}
    assert client.patch(f"/api/vehicles/{drone['id']}", json=softer).status_code == 200
    assert "Safe gainskp 283, ki 13, kd 82 at the first flight, now kp 250, ki 13, kd 82" in read(client, campaign).said


@pytest.mark.complete
def test_the_settings_of_a_vehicle_with_a_link_have_short_titles(client: TestClient, database: Database) -> None:
    said = read(client, create_campaign_on(client, database, create_connected(client, database))).said
    assert "Addressudp:127.0.0.1:4245@4244" in said
    assert "HOST" not in said


def test_the_report_of_no_campaign_is_not_found(client: TestClient) -> None:
    assert client.get("/api/campaigns/77/report.html").status_code == 404
    assert client.get("/api/campaigns/77/report.pdf").status_code == 404


@pytest.mark.complete
@pytest.mark.skipif(not any(map(shutil.which, pdf.PRINTERS)), reason="no Chromium to print with")
def test_the_pdf_is_one_and_its_text_can_be_read(client: TestClient, campaign: Json) -> None:
    answer = client.get(f"/api/campaigns/{campaign['id']}/report.pdf")
    assert answer.status_code == 200, answer.text
    assert answer.headers["content-type"] == "application/pdf"
    assert answer.content.startswith(b"%PDF-")
    assert b"%%EOF" in answer.content[-64:]
    pages = len(re.findall(rb"/Type\s*/Page\b", answer.content))
    assert 2 <= pages <= 12
    assert b"/ToUnicode" in unpacked(answer.content), "what it says: the tests of its pages, below"


PRINTS = pytest.mark.skipif(
    not any(map(shutil.which, pdf.PRINTERS)) or shutil.which("pdftotext") is None,
    reason="no Chromium to print with, or no pdftotext to read what it printed",
)


@dataclass(frozen=True)
class Printed:
    """One page: its lines from top to bottom without the page number, and the lowest word as a share of the height."""

    lines: list[str]
    filled: float

    @property
    def said(self) -> str:
        return " ".join(self.lines)


def pages_of(client: TestClient, campaign: Json, folder: Path, *, paper: str = "A4") -> list[Printed]:
    html = client.get(f"/api/campaigns/{campaign['id']}/report.html").text
    file = folder / f"{paper}.pdf"
    file.write_bytes(pdf.print_pdf(lambda: html.replace("size: A4;", f"size: {paper};")))

    def read_text(*how: str) -> str:
        return subprocess.run(["pdftotext", *how, file, "-"], capture_output=True, text=True, check=True).stdout

    boxes = re.findall(r'<page [^>]*height="([\d.]+)">(.*?)</page>', read_text("-bbox"), re.DOTALL)
    texts = read_text("-layout").removesuffix("\f").split("\f")
    return [
        Printed(lines_of(text), filled_of(float(height), words))
        for (height, words), text in zip(boxes, texts, strict=True)
    ]


def lines_of(text: str) -> list[str]:
    lines = [" ".join(line.split()) for line in text.splitlines()]
    return [line for line in lines if line and re.fullmatch(r"Gainline \d+ ?/ ?\d+", line) is None]


def filled_of(height: float, words: str) -> float:
    """How far down the text reaches, above the line of the page number."""
    bottoms = [float(bottom) / height for bottom in re.findall(r'yMax="([\d.]+)"', words)]
    return max(bottom for bottom in bottoms if bottom < 0.95)


@PRINTS
@pytest.mark.parametrize("paper", ["A4", pytest.param("Letter", marks=pytest.mark.complete)])
def test_the_first_page_is_full_with_result_curves_and_gains(
    client: TestClient, campaign: Json, tmp_path: Path, paper: str
) -> None:
    first, second, *_ = pages_of(client, campaign, tmp_path, paper=paper)
    statistics = get(client, f"/api/campaigns/{campaign['id']}/statistics")
    for expected in (
        "Takeoff to 3 m",
        measured(campaign["best"]["mean"], campaign["best"]["standard_error"], "m"),
        statistics["comparison"]["sentence"],
        statistics["scatter_source"],
        "Takeoff curves",
        "Time since the command (s)",
        "From the first gains to the best",
        "Error mean ± standard error (m)",
    ):
        assert " ".join(expected.split()) in first.said
    assert first.filled > 0.8
    assert second.lines[0] == "Flights"


@pytest.mark.complete
@PRINTS
def test_photos_are_printed_on_the_page_of_their_note_and_no_heading_ends_a_page(
    client: TestClient, campaign: Json, tmp_path: Path
) -> None:
    trials = get(client, f"/api/campaigns/{campaign['id']}/trials")["items"]
    for trial in trials:
        note = "\n".join(f"Line {line} of flight {trial['number']}." for line in range(1, 13))
        assert client.patch(f"/api/trials/{trial['id']}", json={"version": trial["version"], "note": note}).is_success
        for _ in range(5):
            assert add(client, trial, png()).status_code == 201
    pages = pages_of(client, campaign, tmp_path)
    for trial in trials:
        number = trial["number"]
        (page,) = [page for page in pages if f"Line 1 of flight {number}." in page.said]
        for part in ("Line 12 of flight {}.", "Flight {}, photo 1 of 5", "Flight {}, photo 5 of 5"):
            assert part.format(number) in page.said
    headings = {text for tag, text in read(client, campaign).headings if tag != "h1"}
    assert {"Table of flights", "Takeoff curves", "Records"} <= headings
    assert [page.lines[-1] for page in pages if page.lines[-1] in headings] == []


def unpacked(pdf: bytes) -> bytes:
    """The file with its compressed streams opened."""
    opened = [pdf]
    for stream in re.findall(rb"stream\r?\n(.*?)endstream", pdf, re.DOTALL):
        try:
            opened.append(zlib.decompress(stream))
        except zlib.error:
            continue
    return b"".join(opened)


def test_without_a_browser_the_pdf_is_refused_in_words(
    client: TestClient, campaign: Json, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    answer = client.get(f"/api/campaigns/{campaign['id']}/report.pdf")
    assert answer.status_code == 503
    assert answer.headers["content-type"] == "application/problem+json"
    assert "Chromium" in answer.json()["detail"]
    assert "HTML" in answer.json()["hint"]


@pytest.mark.complete
def test_a_failing_browser_is_reported_in_words(
    client: TestClient, campaign: Json, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    in_path("exit 7", monkeypatch, tmp_path)
    answer = client.get(f"/api/campaigns/{campaign['id']}/report.pdf")
    assert (answer.status_code, answer.json()["title"]) == (503, "Not available")
    assert "without a PDF" in answer.json()["detail"]


@pytest.mark.complete
def test_a_browser_that_takes_too_long_is_ended_with_its_children(
    client: TestClient, campaign: Json, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    heard = tmp_path / "heard"
    os.mkfifo(heard)
    line = os.open(heard, os.O_RDONLY | os.O_NONBLOCK)  # it ends when the last process that holds the other side does
    in_path(f"{{ echo up; exec /bin/sleep 60; }} > {heard} & wait", monkeypatch, tmp_path)
    monkeypatch.setattr(pdf, "TIMEOUT_S", 1.0)
    answer = client.get(f"/api/campaigns/{campaign['id']}/report.pdf")
    assert answer.status_code == 503
    assert "within 1 s" in answer.json()["detail"]
    assert os.read(line, 3) == b"up\n"
    assert select.select([line], [], [], 5.0)[0], "its child is still there"
    assert os.read(line, 3) == b""
    os.close(line)


def in_path(script: str, monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    """That shell script is the only Chromium there is."""
    (folder / "chromium").write_text(f"#!/bin/sh\n{script}\n")
    (folder / "chromium").chmod(0o755)
    monkeypatch.setenv("PATH", str(folder))


def test_prints_beyond_a_few_at_once_are_refused_before_any_work_is_done(
    client: TestClient, campaign: Json, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    in_path("exit 0", monkeypatch, tmp_path)
    monkeypatch.setattr(router, "render", lambda *_: pytest.fail("the page was made for nothing"))
    taken = [pdf._places.acquire(blocking=False) for _ in range(pdf.MAX_CONCURRENT)]
    try:
        assert all(taken)
        answer = client.get(f"/api/campaigns/{campaign['id']}/report.pdf")
        assert answer.status_code == 503
        assert "already" in answer.json()["detail"]
    finally:
        for _ in taken:
            pdf._places.release()
