"""The server's secret, the keys derived from it, and the links that unlock a browser.

Everything is in `access/` of the data folder, which only the user that runs Gainline can read:

    secret          from which the keys of browsers and scripts are derived; created at the first start
    links/DIGEST    one file for each unopened link, named by the SHA-256 of its token

A link is opened by deleting its file, so it works once, across processes and restarts, and only its digest is stored.
Deleting `access/` while Gainline is stopped locks out every browser and script.
"""

import errno
import hashlib
import hmac
import os
import secrets
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Final

from app.accounts.permissions import Key
from app.common.errors import StorageError

LINK_VALID_S: Final = 15 * 60
_SECRET_BYTES: Final = 32


class Keyring:
    """The keys of one data folder. Several processes may have it open."""

    def __init__(self, data_dir: Path, *, now_s: Callable[[], float] = time.time) -> None:
        """Open the data folder's keyring; create it if there is none. Raises StorageError when that fails."""
        folder = data_dir / "access"
        self._links = folder / "links"
        self._now_s = now_s
        try:
            folder.mkdir(mode=0o700, exist_ok=True)
            self._links.mkdir(mode=0o700, exist_ok=True)
            self._secret = _secret(folder / "secret")
        except OSError as error:
            raise StorageError(
                f"The folder {folder}, which holds this server's secret, cannot be used: {error.strerror}.",
                hint="Give this user read and write permission for it. Or stop Gainline and delete it; every "
                "browser must then be unlocked again.",
            ) from error
        self._values = {self.value(key): key for key in (Key.REMOTE, Key.SCRIPT, Key.BROWSER)}
        self.cookie = f"gainline-{self._derived('cookie')[:8]}"
        """Name of the browser's cookie, different for each data folder: browsers share cookies between the ports of a
        host, and several servers may run."""

    def value(self, key: Key) -> str:
        """Value of a browser's cookie or a script's header that presents this key."""
        return self._derived(f"key {key.name}")

    def key_of(self, shown: str) -> Key:
        """The key that this value presents; `Key.NONE` for any other value."""
        same = [key for value, key in self._values.items() if hmac.compare_digest(value.encode(), shown.encode())]
        return max(same, default=Key.NONE)

    def new_link(self) -> str:
        """Create a link that works once within LINK_VALID_S (15 minutes), and return its token; delete older ones."""
        for file in self._links.iterdir():
            with suppress(FileNotFoundError):
                if self._now_s() - file.stat().st_mtime > LINK_VALID_S:
                    file.unlink()
        token = secrets.token_urlsafe(_SECRET_BYTES)
        self._file(token).touch(mode=0o600)
        os.utime(self._file(token), (self._now_s(), self._now_s()))
        return token

    def open_link(self, token: str) -> bool:
        """Open a link. Returns whether there was an unopened, valid link with this token."""
        try:
            age_s = self._now_s() - self._file(token).stat().st_mtime
            self._file(token).unlink()
        except OSError:
            return False
        return age_s <= LINK_VALID_S

    def _derived(self, purpose: str) -> str:
        return hmac.new(self._secret, purpose.encode(), hashlib.sha256).hexdigest()

    def _file(self, token: str) -> Path:
        return self._links / hashlib.sha256(token.encode("utf-8", "replace")).hexdigest()


def _secret(file: Path) -> bytes:
    """Content of the secret's file, which is created atomically if missing."""
    if not file.exists():
        draft = file.with_name(f"{file.name}.new")
        draft.unlink(missing_ok=True)
        with os.fdopen(os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as out:
            out.write(secrets.token_bytes(_SECRET_BYTES))
        draft.rename(file)
    found = file.read_bytes()
    if len(found) != _SECRET_BYTES:
        raise OSError(errno.EINVAL, f"{file.name} does not contain {_SECRET_BYTES} bytes")
    return found
