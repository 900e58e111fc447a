"""What kind of file it is, from its first bytes: for import, analysis, the check of a controller, the command line."""

from collections.abc import Callable
from enum import StrEnum
from typing import Final

from app.logs.dataflash import is_dataflash
from app.logs.paparazzi import is_paparazzi
from app.logs.tlog import is_tlog
from app.logs.ulog import is_ulog

HEAD_BYTES: Final = 4096


class Format(StrEnum):
    """A kind of log by its usual file suffix, or of a file that contains one."""

    TLOG = ".tlog"
    DATAFLASH = ".bin"
    ULOG = ".ulg"
    PAPARAZZI = ".data"
    GZIP = ".gz"
    ZIP = ".zip"
    DATAFLASH_TEXT = ".log"


def _begins_with(first: bytes) -> Callable[[bytes], bool]:
    return lambda head: head.startswith(first)


_KINDS: Final[tuple[tuple[Format, Callable[[bytes], bool]], ...]] = (
    (Format.TLOG, is_tlog),
    (Format.DATAFLASH, is_dataflash),
    (Format.ULOG, is_ulog),
    (Format.PAPARAZZI, is_paparazzi),
    (Format.GZIP, _begins_with(b"\x1f\x8b")),
    (Format.ZIP, _begins_with(b"PK\x03\x04")),
    (Format.DATAFLASH_TEXT, _begins_with(b"FMT, ")),
)


def recognise(head: bytes) -> Format | None:
    """The format of a file with these first bytes; None if it is none of these."""
    return next((kind for kind, is_kind in _KINDS if is_kind(head)), None)
