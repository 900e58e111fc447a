"""What can go wrong in a trial: how it is noticed, what is done, what the trial is then worth, and what a person is
told. The order of the table is that of severity: the first that holds is the one that counts."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType
from typing import Final, Literal

Outcome = Literal["refused", "aborted", "invalid", "quarantine"]
"""refused: nothing flew. aborted: a safety limit was met, which says something about the gains. invalid: the
measurement is no good. quarantine: as invalid, and the vehicle's state is in doubt."""

Reaction = Literal["none", "restore gains", "disarm", "land, gains first", "land", "repeat land", "cease", "note"]


class Failure(StrEnum):
    """By the numbers of the documentation."""

    NO_HEARTBEAT = "F1"
    PARAMETER = "F2"
    NOT_ARMED = "F3"
    NO_LIFT_OFF = "F4"
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
    DOUBLED = "F12"
    FALL = "F13"


@dataclass(frozen=True, slots=True)
class Response:
    """`detection`: when it holds; `reaction`: what the program does at once; `text`: what a person is told."""

    detection: str
    reaction: Reaction
    outcome: Outcome
    text: str


RESPONSES: Final[Mapping[Failure, Response]] = MappingProxyType(
    {
        Failure.NO_HEARTBEAT: Response(
            "no heartbeat within 5 s", "none", "refused", "No heartbeat was heard; nothing was sent."
        ),
        Failure.PARAMETER: Response(
            "a gain unconfirmed after five attempts, 0.5 s apart, or read back unequal",
            "restore gains",
            "refused",
            "The vehicle did not confirm its gains; it was not armed.",
        ),
        Failure.NOT_ARMED: Response(
            "arming refused, or not armed 2 s after it", "disarm", "refused", "The vehicle would not arm."
        ),
        Failure.NO_LIFT_OFF: Response(
            "take-off refused, or less than 0.15 m above the ground by the autopilot's time",
            "disarm",
            "aborted",
            "The vehicle did not lift off.",
        ),
        Failure.LINK: Response(
            "no packet for 1 s, or three heartbeats missed",
            "repeat land",
            "invalid",
            "The link was lost in the air; Land was repeated, the vehicle's own failsafe decides.",
        ),
        Failure.ENVELOPE: Response(
            "a limit of altitude, place, speed or oscillation, or the vehicle's own fence",
            "land, gains first",
            "aborted",
            "A safety limit was met.",
        ),
        Failure.BATTERY: Response(
            "below the limit for 1 s, or unknown for 10 s", "land", "invalid", "The battery is low, or unknown."
        ),
        Failure.OPERATOR: Response("asked for", "land, gains first", "aborted", "Aborted."),
        Failure.FROZEN: Response(
            "packets, but a clock that stands still for 0.25 s",
            "land",
            "invalid",
            "The vehicle's position stood still while it went on talking.",
        ),
        Failure.GLITCHES: Response(
            "more than three lone samples that jump by 0.3 m or are faster than 6 m/s",
            "note",
            "invalid",
            "Too many samples had to be dropped.",
        ),
        Failure.DISAGREEMENT: Response(
            "two sources more than 0.3 m apart for 0.3 s", "land", "invalid", "Two sources of altitude disagree."
        ),
        Failure.LOST_POSITION: Response(
            "none of its positions could be believed for 0.5 s, more than 15 a second are doubted, "
            "or its altitude stays 0.5 m behind its climb rate as it takes off",
            "land",
            "invalid",
            "The vehicle's position was lost.",
        ),
        Failure.SLOW_CLOCK: Response(
            "the record not whole 3 s after it had to be, by the ground's clock",
            "land",
            "invalid",
            "The vehicle's clock goes slower than its clock_speed says.",
        ),
        Failure.TAKEN_OVER: Response(
            "a mode in which a person flies it, in heartbeats that agree",
            "cease",
            "quarantine",
            "Somebody took the vehicle over by hand; it was left alone.",
        ),
        Failure.UNEXPECTED: Response(
            "another mode or block, a disarming or a reboot that was not asked for, in messages that agree",
            "land",
            "quarantine",
            "The vehicle changed its state without being asked; it was told to land, and its motors were not stopped.",
        ),
        Failure.INTERRUPTED: Response(
            "one heartbeat in a mode in which a person flies it, and the next in another",
            "note",
            "invalid",
            "A person may have flown the vehicle for a moment.",
        ),
        Failure.OWN_LANDING: Response(
            "a landing that was not asked for: its own failsafe, or an exception of its flight plan",
            "land",
            "invalid",
            "The vehicle began to land by itself.",
        ),
        Failure.DOUBLED: Response(
            "sequence numbers that come twice with other contents, or two clocks by turns, under one system id",
            "land",
            "quarantine",
            "Two vehicles speak under one system id; both were told to land, and no motors were stopped.",
        ),
        Failure.FALL: Response(
            "the ground met at more than 2 m/s",
            "note",
            "quarantine",
            "The vehicle fell.",
        ),
    }
)


HELP: Final = "fly it by hand, or stop its motors"
"""What is left to a person where a vehicle does not obey."""
UNHEEDED: Final = f"It was told to land, and does not come down: {HELP}."


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """A limit that is not kept, in words."""

    failure: Failure
    why: str


GAIN_FAILURES: Final = frozenset(
    {failure for failure, known in RESPONSES.items() if known.reaction == "land, gains first"}
)
"""Failures that speak against the gains: the safe ones are sent before Land. A vehicle that lifted off late, its
integrator wound up, is treated in the same way."""
