"""What the controller check must know of an autopilot; each one is an entry of the registry in `check.py`."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import BinaryIO

from app.controller_checks.results import FigureName, Result, Signals


@dataclass(frozen=True, slots=True)
class Beginning:
    """The first bytes of a file, as they are and, if the file is gzipped, unzipped."""

    raw: bytes
    unzipped: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """A file to examine: its content, beginning and name, the file that was written beside it, and gains that a person
    gave."""

    stream: BinaryIO
    beginning: Beginning
    name: str
    companion: BinaryIO | None = None
    given: Mapping[str, float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Autopilot:
    """An autopilot whose vertical loop has a replica.

    `recordings` completes the sentence “Give …”; `figures` holds a title and the signals one below another for each
    figure that its recordings have; `note` is what a reader of its signals must know. `recognises` says whether a file
    with this beginning is a recording of its loop; `examine` compares it with the replica and raises InputError that
    names what cannot be read.
    """

    name: str
    title: str
    recordings: str
    signals: Signals
    figures: Mapping[FigureName, tuple[str, tuple[str, ...]]]
    note: str
    recognises: Callable[[Beginning], bool]
    examine: Callable[[Recording], Result]
