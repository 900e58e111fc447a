"""The best gains of a finished campaign as a file of their autopilot."""

from xml.etree import ElementTree

import httpx2
import pytest
from fastapi.testclient import TestClient

from app.autopilots.registry import EXPERIMENTS
from app.db.models import TrialRow, VehicleRow
from app.db.session import Database
from tests.builders import (
    Json,
    create_csv,
    create_flown_campaign,
    create_imported_trial,
    create_ready_campaign,
    create_trial,
    get,
    run_jobs,
    upload,
)

PATIENT: Json = {"stop": {"kind": "budget"}}


def finish(client: TestClient, campaign: Json) -> Json:
    """The campaign, finished unless it has ended by itself."""
    client.post(f"/api/campaigns/{campaign['id']}/finish", json={"reason": "Enough."})
    finished: Json = get(client, f"/api/campaigns/{campaign['id']}")
    assert finished["state"] == "finished"
    return finished


def asked(client: TestClient, campaign: Json) -> httpx2.Response:
    return client.get(f"/api/campaigns/{campaign['id']}/parameter-file")


def flown_elsewhere(client: TestClient, database: Database, experiment: str, gains: Json) -> Json:
    """A finished campaign of two imported takeoffs, the second with these gains, and better."""
    definition = {"experiment": experiment, "strategy": "manual", "step_fraction": 1.0}
    campaign = create_ready_campaign(client, database, vehicle="import", definition=definition)
    create_imported_trial(client, campaign["id"], create_csv(1.5))
    run_jobs(database)
    first = EXPERIMENTS[experiment].space
    trial = create_trial(client, campaign["id"], gains={**first.mapping(first.default), **gains})
    assert upload(client, trial["id"], create_csv(0.8)).status_code == 201
    run_jobs(database)
    return finish(client, campaign)


@pytest.mark.complete
def test_the_file_of_a_px4_has_its_number_names_and_types(client: TestClient, database: Database) -> None:
    campaign = flown_elsewhere(client, database, "takeoff-px4", {"MPC_Z_P": 1.3, "MPC_Z_VEL_P_ACC": 5.5})
    with database.write() as session:
        row = session.get(VehicleRow, campaign["vehicle"]["id"])
        assert row is not None
        row.identity = {"system_id": 7, "autopilot": "px4", "version": "1.15.1"}
    renamed = client.patch(f"/api/campaigns/{campaign['id']}", json={"version": campaign["version"], "name": "1 -- a"})
    assert renamed.status_code == 200, renamed.text
    answer = asked(client, campaign)
    assert campaign["parameter_file"] == f"campaign-{campaign['id']}.params"
    assert f'filename="{campaign["parameter_file"]}"' in answer.headers["Content-Disposition"]
    assert answer.headers["Content-Type"].startswith("text/plain")
    heading, *lines = answer.text.splitlines()
    assert heading.startswith(
        f"# Gainline, campaign {campaign['id']}, 1 - a: candidate gains of flight 2 (Flown elsewhere). "
    )
    assert lines == [
        "# MPC_Z_P was 1",
        "# MPC_Z_VEL_P_ACC was 4",
        "# MPC_Z_VEL_I_ACC was 2",
        "# MPC_Z_VEL_D_ACC was 0",
        "# Vehicle-Id Component-Id Name Value Type",
        "7\t1\tMPC_Z_P\t1.3\t9",
        "7\t1\tMPC_Z_VEL_P_ACC\t5.5\t9",
        "7\t1\tMPC_Z_VEL_I_ACC\t2\t9",
        "7\t1\tMPC_Z_VEL_D_ACC\t0\t9",
    ]


def test_the_file_of_an_arducopter_has_the_names_and_units_of_its_release(
    client: TestClient, database: Database
) -> None:
    campaign = flown_elsewhere(client, database, "takeoff-ardupilot", {"PSC_POSZ_P": 1.3, "PSC_ACCZ_P": 0.28})
    older = asked(client, campaign).text.splitlines()
    assert {"# PSC_POSZ_P was 1", "PSC_POSZ_P,1.3", "PSC_ACCZ_P,0.28"} <= set(older)
    with database.write() as session:
        for row in session.query(TrialRow):
            row.settings = {"PSC_D_ACC_P": 0.028, "WP_SPD_UP": 2.5}
    newer = asked(client, campaign).text.splitlines()
    assert {"# PSC_D_ACC_P was 0.05", "PSC_D_POS_P,1.3", "PSC_D_ACC_P,0.028"} <= set(newer)
    assert not any("PSC_ACCZ_P" in line for line in newer)


@pytest.mark.complete
def test_the_file_of_a_paparazzi_is_a_section_of_its_airframe(client: TestClient, database: Database) -> None:
    campaign = create_flown_campaign(client, database, 3.0, 1.0, definition=PATIENT)
    assert (asked(client, campaign).status_code, campaign["parameter_file"]) == (409, None)
    winner = finish(client, campaign)["winner"]["gains"]
    content = asked(client, campaign).text
    heading, *lines = content.splitlines()
    assert "candidate gains of flight 2 (" in heading
    assert ", a simulation). Load on the ground" in heading
    assert lines[0] == "<!-- HOVER_KP was 283 -->"
    section = ElementTree.fromstring(content)
    assert {each.attrib["name"]: float(each.attrib["value"]) for each in section} == {
        f"HOVER_{name.upper()}": value for name, value in winner.items()
    }


@pytest.mark.parametrize("settling_s", [pytest.param((1.0, 3.0), marks=pytest.mark.complete), (1.0,)])
def test_there_is_no_file_without_better_gains(
    client: TestClient, database: Database, settling_s: tuple[float, ...]
) -> None:
    campaign = create_flown_campaign(client, database, *settling_s, definition=PATIENT)
    assert finish(client, campaign)["parameter_file"] is None
    refused = asked(client, campaign)
    assert (refused.status_code, "no better gains" in refused.json()["detail"]) == (409, True)
    assert client.get("/api/campaigns/99/parameter-file").status_code == 404
