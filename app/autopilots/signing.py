"""MAVLink 2 signing: frames contain a keyed hash, and frames without a valid one count as bad data.

Both ends have the same key of 32 bytes. MAVLink 1, and so Paparazzi, has no signing.
"""

import datetime as dt
import time
from pathlib import Path
from typing import Final, Protocol

from app.core.errors import InputError, Problem

KEY_BYTES: Final = 32
_EPOCH_NS: Final = int(dt.datetime(2015, 1, 1, tzinfo=dt.UTC).timestamp()) * 10**9
_TICK_NS: Final = 10_000


class SigningState(Protocol):
    """Signing state of one link in the MAVLink library."""

    secret_key: bytes | None
    timestamp: int
    link_id: int
    sign_outgoing: bool


def parse_key(text: str) -> bytes:
    """Parse a key of 64 hexadecimal digits. Raises InputError, which does not contain the text: it is secret."""
    try:
        key = bytes.fromhex(text.strip())
    except ValueError:
        key = b""
    check_key(key)
    return key


def read_key(file: Path) -> bytes:
    """Read a key from a file. Raises InputError."""
    try:
        return parse_key(file.expanduser().read_text(encoding="ascii"))
    except (OSError, ValueError) as error:
        raise InputError(
            "The signing key cannot be read.",
            problems=(Problem("signing_key_file", f"names a file that cannot be read ({type(error).__name__})"),),
            hint=f"Name a file with {2 * KEY_BYTES} hexadecimal digits that this user can read.",
        ) from error


def check_key(key: bytes) -> None:
    """Raise InputError unless `key` has the length of a signing key."""
    if len(key) != KEY_BYTES:
        raise InputError(
            "This is not a signing key.",
            problems=(
                Problem("signing_key", f"must be {KEY_BYTES} bytes, written as {2 * KEY_BYTES} hexadecimal digits"),
            ),
            hint="Create one with: openssl rand -hex 32",
        )


def enable(state: SigningState, key: bytes, *, link_id: int = 0) -> None:
    """Sign sent frames and accept only signed ones. Raises InputError for a key of a wrong length."""
    check_key(key)
    state.secret_key = key
    state.link_id = link_id
    state.sign_outgoing = True
    state.timestamp = timestamp_now()


def refresh(state: SigningState, *, seen: int) -> None:
    """Set the time stamp of the next frame to now, or to the latest one `seen` from the other end if that is ahead:
    time stamps must not go back or repeat."""
    state.timestamp = max(state.timestamp, seen, timestamp_now())


def timestamp_now() -> int:
    """Return the time in units of 10 µs since 2015, as in signatures."""
    return (time.time_ns() - _EPOCH_NS) // _TICK_NS
