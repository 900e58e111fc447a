"""Failures of a trial: how each is noticed, what is done, what the trial is then worth, and what a person is told; and
the limits that a trial must keep. The order of the table is that of severity: the first failure that holds counts.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
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


MAX_WITNESS_GAP: Final = 1.05
"""Periods of its heartbeat that lie between two of them which agree: one that said otherwise would come between."""
HEARTBEATS_MISSED: Final = 3.5
"""Periods of its heartbeat after which a vehicle that has sent none is lost."""
GROUND_M: Final = 0.15
"""Nearer to the ground than this a vehicle may stand on it."""
REPEAT_S: Final = 1.0
"""How often an order is repeated that a vehicle has not obeyed."""
_LAND_REPEATED_S: Final = 5.0
"""For so long Land is repeated as often as any other order."""
UNHEEDED_S: Final = 5.0
"""A vehicle that has not begun to land so long after it was told does not obey."""
DESCENDING_M_S: Final = -0.2
"""A vehicle that sinks faster than this is landing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """`set_point_m` is on the vehicle's own datum, as altitudes are; `ceiling_m` counts from the ground under it. Modes
    are as `Heartbeat` names them: `flying_modes` and `landing_modes` are empty where any will do, `hovering_modes`
    follow upon the climb, in `manual_modes` a person flies, `mode_names` is what people call them. Heartbeats come
    every `heartbeat_s`. `blocks` are a flight plan's by number, `arming_blocks` and so on the names of those that the
    vehicle may be in, empty where it has none."""

    set_point_m: float
    heartbeat_s: float
    min_battery_v: float
    silent_s: float = 1.0
    stuck_s: float = 0.25
    lost_s: float = 0.5
    slow_s: float = 3.0
    ceiling_m: float = 4.5
    radius_m: float = 5.0
    climb_rate_m_s: float = 4.0
    impact_m_s: float = 2.0
    crossing_m: float = 0.3
    crossings: int = 4
    flying_modes: frozenset[str] = frozenset()
    hovering_modes: frozenset[str] = frozenset()
    landing_modes: frozenset[str] = frozenset()
    manual_modes: frozenset[str] = frozenset()
    mode_names: Mapping[str, str] = field(default_factory=dict)
    blocks: Mapping[int, str] = field(default_factory=dict)
    arming_blocks: frozenset[str] = frozenset()
    flying_blocks: frozenset[str] = frozenset()
    landing_blocks: frozenset[str] = frozenset()

    @property
    def confirmation_s(self) -> float:
        """How far apart two heartbeats are that agree without another between them having said otherwise."""
        return MAX_WITNESS_GAP * self.heartbeat_s

    def stretched(self, patience: float) -> "Limits":
        """The same with so many times the patience for packets that do not come."""
        return replace(
            self,
            heartbeat_s=self.heartbeat_s * patience,
            silent_s=self.silent_s * patience,
            stuck_s=self.stuck_s * patience,
            lost_s=self.lost_s * patience,
            slow_s=self.slow_s * patience,
        )


def land_every_s(asked_for_s: float, land_again_s: float) -> float:
    """How often Land is repeated that was first asked for `asked_for_s` ago. After some seconds only as often as the
    autopilot bears: where every order begins the landing anew, it would never be over."""
    return REPEAT_S if asked_for_s < _LAND_REPEATED_S else land_again_s
