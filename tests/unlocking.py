"""A client on this computer, and how a person unlocks it: by a link, as `gainline unlock` prints it."""

from pathlib import Path
from typing import Final

import httpx2
from fastapi import FastAPI
from fastapi.testclient import TestClient

from app.accounts.keys_and_links import Keyring

HERE: Final = ("127.0.0.1", 50000)
"""Where a request comes from that a browser or script on this computer sends."""


def client_here(application: FastAPI) -> TestClient:
    """HTTP from this computer to an application in this process. Errors come as answers, as from a server."""
    return TestClient(application, base_url="http://127.0.0.1:8000", client=HERE, raise_server_exceptions=False)


def new_link(data_dir: Path) -> str:
    """The path and query of a link."""
    return f"/unlock?token={Keyring(data_dir).new_link()}"


def unlock(client: httpx2.Client) -> None:
    """Open a link of the application that the client speaks to, in this process."""
    assert isinstance(client, TestClient)
    opened = client.get(new_link(client.app.state.settings.data_dir), follow_redirects=False)  # type: ignore[attr-defined]
    assert opened.status_code == 303, opened.text
