"""The application as a browser meets it: the dashboard, its headers, and an API that never answers with a page."""

import json
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from app import __version__
from app.common.settings import Settings
from app.main import create_app
from tests.builders import create_campaign
from tests.unlocking import client_here

PAGE = {"Accept": "text/html"}
OPENAPI = Path(__file__).parent.parent / "frontend" / "openapi.json"


@pytest.fixture
def dashboard(settings: Settings) -> TestClient:
    """The application with a built dashboard."""
    (settings.ui_dir / "assets").mkdir(parents=True)
    (settings.ui_dir / "index.html").write_text("<title>Gainline</title>")
    (settings.ui_dir / "assets" / "index-abc123.js").write_text("console.log(1);\n" * 200)
    return client_here(create_app(settings))


def test_the_dashboard_is_served_at_every_address_of_its_own(dashboard: TestClient) -> None:
    with dashboard as client:
        for path in ("/", "/campaigns/7", "/campaigns/new"):
            answer = client.get(path, headers=PAGE)
            assert (answer.status_code, answer.text) == (200, "<title>Gainline</title>")
            assert answer.headers["cache-control"] == "no-cache"


def test_built_assets_are_kept_for_ever_and_sent_compressed(dashboard: TestClient) -> None:
    with dashboard as client:
        answer = client.get("/assets/index-abc123.js")
        missing = client.get("/assets/index-old.js")
    assert answer.headers["cache-control"] == "public, max-age=31536000, immutable"
    assert answer.headers["content-encoding"] == "gzip"
    assert missing.status_code == 404
    assert "immutable" not in missing.headers["cache-control"]


def test_built_assets_come_as_they_are_to_who_does_not_take_them_compressed(dashboard: TestClient) -> None:
    with dashboard as client:
        compressed = client.get("/assets/index-abc123.js")
        plain = client.get("/assets/index-abc123.js", headers={"Accept-Encoding": "identity"})
        part = client.get("/assets/index-abc123.js", headers={"Range": "bytes=0-6", "Accept-Encoding": "identity"})
    assert plain.text == compressed.text == "console.log(1);\n" * 200
    assert "content-encoding" not in plain.headers
    assert compressed.headers["content-type"] == plain.headers["content-type"]
    assert (part.status_code, part.text) == (206, "console")


@pytest.mark.parametrize("headers", [PAGE, {}])
def test_an_unknown_api_path_is_a_problem_and_not_a_page(dashboard: TestClient, headers: dict[str, str]) -> None:
    with dashboard as client:
        answers = [client.get(path, headers=headers) for path in ("/api/nothing", "/api", "/api/campaigns/1/nothing")]
    for answer in answers:
        assert answer.status_code == 404
        assert answer.headers["content-type"] == "application/problem+json"


def test_every_answer_says_what_a_page_may_load(dashboard: TestClient) -> None:
    with dashboard as client:
        for path in ("/", "/api/health", "/api/nothing", "/assets/index-abc123.js"):
            headers = client.get(path, headers=PAGE).headers
            assert headers["content-security-policy"] == (
                "default-src 'self'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
                "object-src 'none'; base-uri 'none'; frame-ancestors 'none'; form-action 'self'"
            )
            assert headers["x-content-type-options"] == "nosniff"


def test_answers_of_the_api_are_not_kept(client: TestClient) -> None:
    create_campaign(client)
    assert client.get("/api/campaigns").headers["cache-control"] == "no-store"


def test_without_a_built_dashboard_the_first_page_says_what_to_do(client: TestClient) -> None:
    answer = client.get("/", headers=PAGE)
    assert answer.status_code == 404
    assert "./dev up" in answer.json()["hint"]


def test_health_names_the_version_and_whether_a_worker_runs(client: TestClient) -> None:
    assert client.get("/api/health").json() == {
        "status": "ok",
        "version": __version__,
        "worker": "absent",
        "vehicles_not_answering": [],
    }


def test_the_catalogue_offers_what_a_campaign_can_be_made_of(client: TestClient) -> None:
    catalogue = client.get("/api/catalogue").json()
    experiments = [experiment["name"] for experiment in catalogue["experiments"]]
    assert experiments == [
        "takeoff",
        "altitude-steps",
        "takeoff-ardupilot",
        "takeoff-px4",
        "altitude-steps-ardupilot",
        "altitude-steps-px4",
        "pitch-tracking",
    ]
    strategies = [strategy["name"] for strategy in catalogue["strategies"]]
    assert strategies == ["calibrated", "gradient", "identified", "simplex", "manual"]
    assert {kind["name"]: kind["can_fly"] for kind in catalogue["vehicle_kinds"]} == {
        "jsbsim": True,
        "twin": True,
        "lti": True,
        "mavlink": True,
        "import": False,
    }
    assert catalogue["experiments"][0]["gains"][0] == {
        "name": "kp",
        "title": "Proportional gain",
        "unit": "counts",
        "lower": 0,
        "upper": 4000,
        "scale": 400,
        "default": 283,
        "integer": True,
    }


def test_every_preset_makes_a_campaign(client: TestClient) -> None:
    presets = client.get("/api/catalogue").json()["presets"]
    assert "ardrone-takeoff" in {preset["name"] for preset in presets}
    for preset in presets:
        answer = client.post("/api/campaigns", json=preset["campaign"])
        assert answer.status_code == 201, answer.text


def test_the_checked_in_openapi_document_is_the_applications(client: TestClient) -> None:
    assert json.loads(OPENAPI.read_text()) == client.get("/api/openapi.json").json()


def test_every_operation_has_a_name_of_its_own_and_its_problems_described(client: TestClient) -> None:
    document = client.get("/api/openapi.json").json()
    operations = [operation for path in document["paths"].values() for operation in path.values()]
    names = [operation["operationId"] for operation in operations]
    assert len(set(names)) == len(names)
    assert all(name.isidentifier() for name in names)
    assert all("application/problem+json" in operation["responses"]["default"]["content"] for operation in operations)
    assert "Problem" in document["components"]["schemas"]
