"""What kind of file it is, from its first bytes: for import, analysis, the check of a controller, the command line."""

import re
from collections.abc import Callable
from enum import StrEnum
from operator import methodcaller
from pathlib import Path
from typing import BinaryIO, Final

from app.logs.base import HEAD_BYTES
from app.logs.dataflash import is_dataflash, is_sdlog2
from app.logs.dataflash_text import is_dataflash_text
from app.logs.tlog import is_tlog
from app.logs.ulog import is_ulog

NEVER_WRITTEN: Final = "has nothing but zeros where a log begins: it was never written, or not copied"
_GROUND_LOG_LINE: Final = re.compile(rb"\s*\d+(?:\.\d*)?\s+\S{1,32}\s+[A-Z][A-Z0-9_]{1,63}(?:\s|$)")


class Format(StrEnum):
    """A kind of log by its usual file suffix, or of a file that contains one; or of one that was never written."""

    TLOG = ".tlog"
    DATAFLASH = ".bin"
    ULOG = ".ulg"
    GROUND_LOG = ".data"
    GZIP = ".gz"
    ZIP = ".zip"
    SDLOG2 = "sdlog2"
    DATAFLASH_TEXT = ".log"
    ZEROS = "zeros"


def head_of(stream: BinaryIO) -> bytes:
    """The first bytes of a file, which is at its beginning afterwards."""
    stream.seek(0)
    head = stream.read(HEAD_BYTES)
    stream.seek(0)
    return head


def is_ground_log(head: bytes) -> bool:
    """Whether a file with this head has lines of time, aircraft, name of a message and its fields (.data)."""
    return bool(_GROUND_LOG_LINE.match(head))


_KINDS: Final[tuple[tuple[Format, Callable[[bytes], bool]], ...]] = (
    (Format.ULOG, is_ulog),
    (Format.GROUND_LOG, is_ground_log),
    (Format.GZIP, methodcaller("startswith", b"\x1f\x8b")),
    (Format.ZIP, methodcaller("startswith", b"PK\x03\x04")),
    (Format.ZEROS, lambda head: bool(head) and not any(head)),
    (Format.SDLOG2, is_sdlog2),
    (Format.TLOG, is_tlog),
    (Format.DATAFLASH, is_dataflash),
    (Format.DATAFLASH_TEXT, is_dataflash_text),
)
"""First those with a mark at the beginning of the file; a log of ArduPilot's may begin with the end of another one."""


def recognise(head: bytes) -> Format | None:
    """The format of a file with these first bytes; None if it is none of these."""
    return next((kind for kind, is_kind in _KINDS if is_kind(head)), None)


def companion_of(file: Path) -> Path | None:
    """The .log file beside Paparazzi's .data file, which has its messages and gains; None if there is none."""
    beside = file.with_suffix(".log")
    return beside if file.suffix.lower() == ".data" and beside.is_file() else None
