"""`gainline unlock`: a link for a browser, or a token for a script, of the server that runs on this data folder."""

import sys
from collections.abc import Sequence

import httpx2
from pydantic import BaseModel, ValidationError

from app.accounts.keys_and_links import LINK_VALID_S, Keyring
from app.accounts.permissions import Key
from app.common.errors import UnavailableError
from app.common.settings import Settings
from app.processes.locks import signature
from app.web.addresses import AddressInfo, unlock_link


class _System(BaseModel):
    """The fields of GET /api/system that are used here."""

    is_exposed: bool
    addresses: list[AddressInfo]


def unlock(settings: Settings, *, script: bool) -> None:
    """Print a link or a token.

    Raises UnavailableError when no server runs on the data folder, StorageError when its secret cannot be read.
    """
    address, system = _running(settings)
    keyring = Keyring(settings.data_dir)
    if script:
        _say("For scripts on this computer:", [keyring.value(Key.SCRIPT)])
        if system.is_exposed:
            _say("For scripts on other devices, simulated campaigns only:", [keyring.value(Key.REMOTE)])
        return
    _say("Open this in a browser on this computer:", [unlock_link(address, keyring.new_link())])
    if system.addresses:
        links = [unlock_link(each.url, keyring.new_link()) for each in system.addresses]
        _say("Or open one of these on another device, for simulated campaigns:", links)
    _say(f"Each link works once, within {LINK_VALID_S // 60} minutes.", [])


def _running(settings: Settings) -> tuple[str, _System]:
    """Address of the running server, and its system information."""
    found = signature(settings.data_dir / "server.lock")
    if found is None or not found.address:
        raise _not_running(settings)
    try:
        answer = httpx2.get(f"{found.address}/api/system", timeout=5.0, trust_env=False)
        return found.address, _System.model_validate_json(answer.raise_for_status().content)
    except (httpx2.HTTPError, ValidationError) as error:
        raise _not_running(settings) from error


def _not_running(settings: Settings) -> UnavailableError:
    return UnavailableError(
        f"No Gainline server is running on {settings.data_dir}.",
        hint="Start it with `gainline serve`, which prints such a link, or give its folder with --data-dir.",
    )


def _say(sentence: str, lines: Sequence[str]) -> None:
    sys.stdout.write("".join(f"{line}\n" for line in (sentence, *(f"  {each}" for each in lines))))
