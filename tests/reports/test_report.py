"""A campaign's report: it says what the API says, runs nothing but its own scripts, and becomes a PDF where it can."""

import base64
import hashlib
import re
from html.parser import HTMLParser

import pytest
from fastapi.testclient import TestClient

from app.core.formatting import measured
from app.reports import service
from tests.builders import (
    Json,
    get,
)
from tests.campaigns.trials.test_photos import JPEG, add, png
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
