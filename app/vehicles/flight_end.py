"""How a flight ended, in codes and names, from the trial to the page. Sentences about it are made by `end_texts`; no
decision reads them.
"""

from dataclasses import dataclass
from enum import StrEnum


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
