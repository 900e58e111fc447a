"""A second installation with its own database, and bundles between it and the first."""

import hashlib
import json
import shutil
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any

import httpx2
from fastapi.testclient import TestClient

from app.common.settings import Settings
from app.db.session import Database
from app.main import create_app
from tests.unlocking import client_here


@contextmanager
def second_installation(folder: Path, migrated_file: Path) -> Iterator[tuple[TestClient, Database]]:
    settings = Settings(data_dir=folder / "data", ui_dir=folder / "ui", port=0)
    settings.data_dir.mkdir(parents=True)
    shutil.copyfile(migrated_file, settings.database_file)
    application = create_app(settings)
    with client_here(application) as client:
        yield client, application.state.database


def download_bundle(client: httpx2.Client, campaign_id: int) -> bytes:
    """The campaign as one file."""
    answer = client.get(f"/api/campaigns/{campaign_id}/bundle")
    assert answer.status_code == 200, answer.text
    assert answer.headers["content-type"] == "application/zip"
    return answer.content


def import_bundle(client: httpx2.Client, bundle: bytes) -> httpx2.Response:
    return client.post("/api/bundles", files={"file": ("bundle.zip", bundle, "application/zip")})


def parts_of(bundle: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(BytesIO(bundle)) as opened:
        return {name: opened.read(name) for name in opened.namelist()}


def sealed(parts: Mapping[str, bytes]) -> bytes:
    """A zip whose manifest fits the parts, whatever is in them."""
    manifest: dict[str, Any] = json.loads(parts["manifest.json"])
    manifest["parts"] = {
        name: hashlib.sha256(data).hexdigest() for name, data in parts.items() if name != "manifest.json"
    }
    return zipped({**parts, "manifest.json": json.dumps(manifest).encode()})


def zipped(parts: Mapping[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    file = BytesIO()
    with zipfile.ZipFile(file, "w", method) as out:
        for name, data in parts.items():
            out.writestr(name, data)
    return file.getvalue()
