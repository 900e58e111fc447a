"""What the controller check must know of an autopilot; each one is an entry of the registry in `check.py`."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import BinaryIO

from app.controller_checks.results import FigureName, Result, Signals
from app.logs.formats import Format


@dataclass(frozen=True, slots=True, kw_only=True)
class Upload:
    """A file to examine: its content and name, the file that was written beside it, and gains that a person gave."""

    stream: BinaryIO
    name: str
    companion: BinaryIO | None = None
    given: Mapping[str, float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Autopilot:
    """An autopilot whose vertical loop has a replica.

    `recordings` completes the sentence “Give …”; `figures` holds a title and the signals one below another for each
    figure that its recordings have; `note` is what a reader of its signals must know. `log` is the format of its own
    log; `is_trace` says whether a file with these first bytes is a recorded run of its loop. `examine_log`
    and `examine_trace` compare them with the replica and raise InputError that names what cannot be read.
    """

    name: str
    title: str
    recordings: str
    signals: Signals
    figures: Mapping[FigureName, tuple[str, tuple[str, ...]]]
    note: str
    log: Format
    is_trace: Callable[[bytes], bool]
    examine_log: Callable[[Upload], Result]
    examine_trace: Callable[[Upload], Result]
