"""MAVLink 2 signing: frames carry a keyed hash, and whatever arrives without a good one is bad data.

Both ends hold the same 32 bytes. Nothing of MAVLink 1 can be signed, so Paparazzi cannot.
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
    """What the MAVLink library keeps about the signing of one link."""

    secret_key: bytes | None
    timestamp: int
    link_id: int
    sign_outgoing: bool


def parse_key(text: str) -> bytes:
    """The key that 64 hexadecimal digits write. Raises InputError, which does not repeat the text: it is a secret."""
    try:
        key = bytes.fromhex(text.strip())
    except ValueError:
        key = b""
    check_key(key)
    return key


def read_key(file: Path) -> bytes:
    """The key that is written in that file. Raises InputError."""
    try:
        return parse_key(file.expanduser().read_text(encoding="ascii"))
    except (OSError, ValueError) as error:
        raise InputError(
            "The signing key cannot be read.",
            problems=(Problem("signing_key_file", f"names a file that cannot be read ({type(error).__name__})"),),
            hint=f"Name a file with {2 * KEY_BYTES} hexadecimal digits that the program may read.",
        ) from error


def check_key(key: bytes) -> None:
    """Raises InputError unless `key` has the length of a signing key."""
    if len(key) != KEY_BYTES:
        raise InputError(
            "This is not a signing key.",
            problems=(
                Problem("signing_key", f"must be {KEY_BYTES} bytes, written as {2 * KEY_BYTES} hexadecimal digits"),
            ),
            hint="Make one with: openssl rand -hex 32",
        )


def enable(state: SigningState, key: bytes, *, link_id: int = 0) -> None:
    """Sign what is sent and accept nothing unsigned. Raises InputError for a key of a wrong length."""
    check_key(key)
    state.secret_key = key
    state.link_id = link_id
    state.sign_outgoing = True
    state.timestamp = timestamp_now()


def refresh(state: SigningState, *, seen: int) -> None:
    """Bring the time stamp of the next frame up to now and to the latest one `seen` from the other end, whose clock may
    be ahead: it must neither fall behind nor repeat."""
    state.timestamp = max(state.timestamp, seen, timestamp_now())


def timestamp_now() -> int:
    """Units of 10 µs since 2015, as the signature counts them."""
    return (time.time_ns() - _EPOCH_NS) // _TICK_NS
