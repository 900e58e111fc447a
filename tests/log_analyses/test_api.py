"""Log analyses over HTTP, with the recorded logs."""

import httpx2
import pytest
from fastapi.testclient import TestClient

from app.figures.theme import PALETTES
from tests.builders import problems_of
from tests.logs.recorded import recorded

PATH = "/api/log-analyses"


def send(client: TestClient, name: str, content: bytes) -> httpx2.Response:
    return client.post(PATH, files={"file": (name, content)})


def test_the_log_of_a_flight_gives_better_gains_with_a_figure(client: TestClient) -> None:
    answer = send(client, "steps.bin", recorded("arducopter_steps.bin"))
    assert answer.status_code == 200, answer.text
    found = answer.json()
    assert found["file_name"] == "steps.bin"
    assert found["vehicle"]["thrust_slope"]["mean"] == pytest.approx(1.0, abs=0.01)
    assert found["vehicle"]["assumed_hover_throttle"] == pytest.approx(0.39)
    assert found["proposed"]["error_m"] < 0.2 * found["assessments"][0]["error_m"]
    assert found["insufficient"] is None
    assert found["answer"].startswith("Mean deviation: 23.4 mm measured.")
    assert "PSC_POSZ_P,3\n" in found["parameter_file"]
    assert found["figures"].keys() == {"light", "dark"}
    drawn = found["figures"]["dark"]["figure"]["data"]
    assert [(one["meta"]["panel"], one["meta"]["line"]) for one in drawn] == [
        (1, "Reference"),
        (1, "Flown"),
        (1, "Predicted with the proposed gains"),
        (2, "Flown"),
        (2, "Predicted with the proposed gains"),
        (3, "Flown"),
        (3, "Predicted with the proposed gains"),
    ]
    dark = PALETTES["dark"]
    looks = {one["meta"]["line"]: (one["line"]["color"], one["line"]["dash"]) for one in drawn}
    assert looks == {
        "Reference": (dark.dim, "dot"),
        "Flown": (dark.ink, "solid"),
        "Predicted with the proposed gains": (dark.prediction, "dash"),
    }
    flown, predicted = (sum(map(abs, drawn[place]["y"])) / len(drawn[place]["y"]) for place in (3, 4))
    assert flown == pytest.approx(25.0, abs=3.0)
    assert predicted < 0.4 * flown


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("arducopter_takeoff.bin", "holds altitude for 4.8 s only; 6 s are needed"),
        ("px4_takeoff.ulg", "is another kind of log (PX4's log): only ArduPilot's .bin logs can be analysed"),
        (
            "paparazzi_283_13_82.tlog",
            "is another kind of log (MAVLink telemetry log): only ArduPilot's .bin logs can be analysed",
        ),
    ],
)
def test_a_log_that_cannot_be_analysed_is_refused_with_the_reason(client: TestClient, name: str, reason: str) -> None:
    answer = send(client, name, recorded(name))
    assert answer.status_code == 422
    assert problems_of(answer) == {"file": reason}


def test_a_file_that_is_no_log_is_refused(client: TestClient) -> None:
    assert problems_of(send(client, "notes.bin", b"hello")) == {
        "file": "is not a log: only ArduPilot's .bin logs can be analysed"
    }
