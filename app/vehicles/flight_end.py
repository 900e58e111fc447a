"""How a flight ended, in codes and names, from the trial to the page, and the sentences about it for people: made from
its codes where somebody reads them. No decision reads a sentence.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Final


class Failure(StrEnum):
    """Failures by their numbers in docs/real-flight.md."""

    NO_HEARTBEAT = "F1"
    PARAMETER = "F2"
    NOT_ARMED = "F3"
    NO_LIFT_OFF = "F4a"
    TAKE_OFF_REFUSED = "F4b"
    LINK = "F5"
    ENVELOPE = "F6"
    BATTERY = "F7"
    OPERATOR = "F8"
    FROZEN = "F9a"
    GLITCHES = "F9b"
    DISAGREEMENT = "F9c"
    LOST_POSITION = "F9d"
    SLOW_CLOCK = "F9e"
    TAKEN_OVER = "F10a"
    UNEXPECTED = "F10b"
    INTERRUPTED = "F10c"
    OWN_LANDING = "F11"
    DUPLICATE = "F12"
    FALL = "F13"
    SET_POINT = "F14a"
    NOT_SETTLED = "F14b"
    PAUSED = "F14c"


class Requester(StrEnum):
    """Who asked that a flight ends, or does not take place: a person, a script, or a part of this program."""

    OPERATOR = "operator"
    BROWSER = "another browser"
    DEVICE = "another device"
    SCRIPT = "script"
    PROGRAM_STOPPED = "program stopped"
    WORKER_EXITED = "worker exited"
    INTERNAL_ERROR = "internal error"


class GainsLeft(StrEnum):
    """Gains that a flight left on its vehicle: the safe gains, read back; others, read back; the flight's own, because
    nothing was sent to a vehicle that its pilot took over; or unknown ones."""

    SAFE = "safe"
    OTHER = "other"
    FLIGHT = "flight"
    UNKNOWN = "unknown"


class Landing(StrEnum):
    """Contact of a vehicle with the ground at the end. stayed: it has certainly never left it. fell: its motors were
    stopped, or it hit the ground. unknown: its motors were not seen to stop."""

    STAYED = "stayed"
    LANDED = "landed"
    FELL = "fell"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class StopRequest:
    """Request to end a flight early, with the words of who asked, if any. `motors_off` stops the motors at once, at any
    height; otherwise the vehicle lands."""

    words: str = ""
    motors_off: bool = False
    by: Requester = Requester.OPERATOR


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightEnd:
    """How a flight ended. `failure` is the first one; `request` is what ended the flight, before any limit did, or kept
    it on the ground. `remarks` are explanations, for people only."""

    failure: Failure | None = None
    request: StopRequest | None = None
    remarks: tuple[str, ...] = ()
    gains_left: GainsLeft = GainsLeft.UNKNOWN
    landed: Landing = Landing.LANDED

    @property
    def requested_by(self) -> Requester | None:
        return None if self.request is None else self.request.by


def not_begun(*remarks: str) -> FlightEnd:
    """Return the end of a flight that did not take place, for reasons that only people read."""
    return FlightEnd(remarks=tuple(filter(None, remarks)), landed=Landing.STAYED)


def withdrawn_by(request: StopRequest) -> FlightEnd:
    """Return the end of a flight that was aborted before its vehicle left the ground."""
    return FlightEnd(failure=Failure.OPERATOR, request=request, landed=Landing.STAYED)


# ---- sentences

FAILURE_TEXTS: Final[Mapping[Failure, str]] = {
    Failure(number): text
    for number, text in tomllib.loads((Path(__file__).parent / "failures.toml").read_text("utf-8")).items()
}
"""What each failure means. The remarks alone explain a low battery, and a request itself."""

REQUESTED_BY_OPERATOR: Final = "requested by the operator"
_ORIGINS: Final[Mapping[Requester, str]] = {
    Requester.OPERATOR: "by the operator",
    Requester.BROWSER: "from another browser",
    Requester.DEVICE: "from another device",
    Requester.SCRIPT: "by a script",
}
_OF_PROGRAM: Final[Mapping[Requester, str]] = {
    Requester.PROGRAM_STOPPED: "Gainline was stopped",
    Requester.WORKER_EXITED: "the worker has exited",
}
_RESTORED: Final = "It landed the vehicle and restored the safe gains."
_RESTORED_ON_GROUND: Final = (
    "It restored the safe gains before the takeoff. Request the flight again if it is still needed."
)


def joined(*parts: str) -> str:
    return " ".join(part for part in parts if part)


def requested(command: str, words: str) -> str:
    """`Land was requested: too low.`; without words `Land was requested by the operator.`"""
    return f"{command} was requested: {words}." if words else f"{command} was {REQUESTED_BY_OPERATOR}."


def unstaged_text(by: Requester) -> str:
    """`unstaged by the operator`."""
    return f"unstaged {_ORIGINS[by]}"


def is_worded(request: StopRequest) -> bool:
    """Whether more is told about a request than who made it."""
    return bool(request.words) or request.motors_off or request.by in _OF_PROGRAM


def request_text(request: StopRequest, verb: str = "aborted") -> str:
    """The words of a request that ended a flight; `aborted by the operator` without any."""
    if request.motors_off:
        return requested("Motors off", request.words)
    return _OF_PROGRAM.get(request.by) or request.words or f"{verb} {_ORIGINS[request.by]}".lstrip()


def cause_text(end: FlightEnd, verb: str = "aborted") -> str:
    """Why a flight ended early or does not count, and the remarks on it. `verb` is said of a request without words."""
    if end.request is None or end.failure not in {None, Failure.OPERATOR}:
        first = "" if end.failure is None else FAILURE_TEXTS.get(end.failure, "")
    elif end.failure is None:
        first = unstaged_text(end.request.by)
    else:
        first = request_text(end.request, verb)
        if end.requested_by is Requester.PROGRAM_STOPPED and end.gains_left is GainsLeft.SAFE:
            first = f"{first}. {_RESTORED_ON_GROUND if end.landed is Landing.STAYED else _RESTORED}"
    return joined(first, *end.remarks)


def end_text(end: FlightEnd | None) -> str:
    """The cause, and that a vehicle had not left the ground; empty without an end."""
    if end is None or end.landed is not Landing.STAYED or end.failure is None:
        return "" if end is None else cause_text(end)
    request, on_ground = end.request, f"{'aborted' if end.request else 'ended'} before lift-off"
    if request is not None and (request.by is Requester.PROGRAM_STOPPED or not is_worded(request)):
        return cause_text(end, on_ground)
    return f"{on_ground}: {cause_text(end)}"
