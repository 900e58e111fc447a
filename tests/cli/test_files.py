"""`gainline report`, `bundle` and `unbundle`: beside the running application, on the same database."""

import zipfile
from pathlib import Path

import pytest
from fastapi.testclient import TestClient
from typer.testing import CliRunner, Result

from app.cli.commands import app
from app.common.settings import Settings
from app.db.session import Database
from tests.builders import Json, create_imported_trial, create_ready_campaign, get


@pytest.fixture
def campaign(client: TestClient, database: Database) -> Json:
    ready = create_ready_campaign(client, database, vehicle="import", name="Garage")
    create_imported_trial(client, ready["id"])
    found: Json = get(client, f"/api/campaigns/{ready['id']}")
    return found


def run(settings: Settings, *arguments: object) -> Result:
    return CliRunner().invoke(app, [*map(str, arguments), "--data-dir", str(settings.data_dir)])


def test_a_report_is_written_for_a_campaign_by_its_name(settings: Settings, campaign: Json, tmp_path: Path) -> None:
    out = tmp_path / "garage.html"
    result = run(settings, "report", "garage", "--out", out)
    assert result.exit_code == 0, result.stderr
    assert campaign["definition_digest"] in out.read_text(encoding="utf-8")


def test_a_pdf_is_asked_for_by_the_files_name_and_refused_in_words_where_nothing_prints(
    settings: Settings, campaign: Json, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    result = run(settings, "report", "Garage", "--out", tmp_path / "garage.pdf")
    assert result.exit_code == 1
    assert "Chromium is not installed" in result.stderr
    assert not (tmp_path / "garage.pdf").exists()


def test_a_report_in_a_file_of_an_unknown_format_is_refused_unless_the_format_is_given(
    settings: Settings, campaign: Json, tmp_path: Path
) -> None:
    out = tmp_path / "garage.txt"
    refused = run(settings, "report", "Garage", "--out", out)
    assert (refused.exit_code, out.exists()) == (1, False)
    assert "--out: must end in .html, .htm or .pdf" in refused.stderr
    assert "--format html" in refused.stderr
    assert run(settings, "report", "Garage", "--out", out, "--format", "html").exit_code == 0
    assert campaign["definition_digest"] in out.read_text(encoding="utf-8")


def test_a_campaign_goes_out_and_comes_in(
    client: TestClient, settings: Settings, campaign: Json, tmp_path: Path
) -> None:
    out = tmp_path / "garage.zip"
    assert run(settings, "bundle", campaign["id"], "--out", out).exit_code == 0
    assert zipfile.is_zipfile(out)
    assert [path.name for path in tmp_path.glob("*.part")] == []
    result = run(settings, "unbundle", out)
    assert result.exit_code == 0, result.stderr
    assert "Garage (imported): 1 flight" in result.stdout
    second = get(client, "/api/campaigns")["items"][0]
    assert second["best"]["error"] == campaign["best"]["error"]


def test_what_is_no_bundle_or_no_campaign_is_refused_in_words(
    settings: Settings, campaign: Json, tmp_path: Path
) -> None:
    (tmp_path / "holiday.zip").write_bytes(b"sun")
    refused = run(settings, "unbundle", tmp_path / "holiday.zip")
    assert (refused.exit_code, "is not a zip file" in refused.stderr) == (1, True)
    assert run(settings, "unbundle", tmp_path / "nothing.zip").exit_code == 1
    missing = run(settings, "bundle", "Shed", "--out", tmp_path / "shed.zip")
    assert (missing.exit_code, "There is no campaign" in missing.stderr) == (1, True)
    assert not (tmp_path / "shed.zip").exists()
    assert run(settings, "report", "Garage", "--out", tmp_path / "no" / "folder.html").exit_code == 1
