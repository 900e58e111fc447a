"""Why a log does not answer, or not in full: a code with its numbers, and the table of what a person reads."""

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from types import MappingProxyType
from typing import Final

from app.core.errors import Problem, TrajectoryError


class ReasonCode(Enum):
    """What a log lacks, what it has instead, or what follows from it; its value is what a person reads about the field,
    with the numbers of the reason and the names in it."""

    ALTITUDE_NOT_HELD = "has too little flight in a mode that holds altitude"
    CHANNEL_MISSING = "is not among the recorded channels ({named})"
    COLUMN_MISSING = "is missing: this release logs it otherwise, which is not supported"
    CONSTANT_SIGNAL = "has a constant {named}: nothing can be learned from it"
    DERIVATIVE_REVERSED = "must be 0 in release {named}, which has the sign of this term wrong"
    DEVIATION_NOT_EXPLAINED = "deviates by {flown_mm:.1f} mm, its gains by {modelled_mm:.1f} mm: perhaps other gains"
    FEED_FORWARD_UNKNOWN = "does not tell the climb rates fed forward, so that other gains cannot be predicted"
    GAPS = "has too little without a gap between its rows"
    LEANS = "leans by more than 30° in too much of the flight"
    LOG_BIT_UNSET = "is not in the log: add {named} to LOG_BITMASK, and fly again"
    MANUAL_ALTITUDE = "has too little with an altitude to follow, as in manual modes"
    MARGIN_UNREACHABLE = "allows no gains: none within the documented ranges reach the required margin"
    MESSAGE_MISSING = "is missing"
    MESSAGE_RARE = "arrives {rate_hz:.1f} times a second; {needed_hz:.0f} times are needed"
    NEVER_ARMED = "never reports armed motors"
    NEVER_FLEW = "has no flight: the vehicle never left the ground"
    NO_ALTITUDE_CHANGES = "has no altitude changes: the reference moves by {reference_range_m:.2f} m"
    NO_CLOCK = "has no message with the time (TimeUS or TimeMS)"
    NO_DATA = "has no data: copy the whole log"
    NO_STEPS = "has no altitude step in {named} in flight after {rest_s:g} s at rest"
    NO_WHOLE_CHANGE = "has no altitude change that both begins and ends: slope, lag and drag cannot be told apart"
    NONE_BETTER = "allows no gains that are predicted to reduce the error by more than 5 %"
    NOT_A_COPTER = "is that of {named}, not of a copter with several rotors"
    NOT_COMPARED = "is not compared"
    NOT_NUMBERS = "has too few rows of plausible numbers beside all other signals"
    ONLY_TAKEOFFS_OR_LANDINGS = "has too little flight between takeoff and landing"
    OTHER_CONTROLLER = "has climb rate targets that its parameters do not give: {differing_rows:.0f} of {rows:.0f}"
    OTHER_MODES = "has no flight in {first}, the mode whose set points the messages give, only in {others}"
    PARAMETER_CHANGES = "change too often"
    PARAMETER_MISSING = "is not in the log{also}: read the vehicle's parameters while it is recorded"
    PARAMETER_NOT_POSITIVE = "must be positive, got {value:g}"
    PARAMETER_OUT_OF_RANGE = "must be {low:g} to {high:g}, got {value:g}"
    PARAMETER_READ_LATE = "was changed after the flight, and was not read before"
    PARAMETER_UNSUPPORTED = "must be 0"
    REFERENCE_NOT_SHAPED = "differs by {misfit_m:.2f} m from the target that ArduCopter shapes from the set points"
    RESETS = "is reset by the estimator, or jumps, too often"
    SAMPLES_RARE = "has a sample every {interval_s:.2f} s; {needed_s:g} s are needed"
    SATURATED = "has the throttle at a limit in {saturated_share:.0%} of its rows"
    SLOPE_UNKNOWN = "tells the thrust slope to ±{thrust_slope_deviation:.2f}; ±{needed_deviation:g} is needed"
    STEPS_TOO_CLOSE = "moves again within {apart_s:g} s: fly steps, and wait after each"
    TOO_SHORT = "leaves too short a time to analyse: {needed_s:g} s are needed"
    UNEXPLAINED_ACCELERATIONS = "has {residual_m_s2:.1f} m/s² of acceleration that the throttle does not explain"
    UNUSABLE = "cannot be used"
    VIBRATION_FAILSAFE = "has vibration compensation active in too much of the flight"

    @property
    def key(self) -> str:
        """The code as a document has it."""
        return self.name.lower()


@dataclass(frozen=True, slots=True, kw_only=True)
class Reason:
    """A reason, the message, column or parameter concerned, its numbers, whose names end in their unit, and what else
    it names: modes, parameters, a kind of vehicle."""

    code: ReasonCode
    field: str = "file"
    numbers: Mapping[str, float] = dataclasses.field(default_factory=dict)
    named: Sequence[str] = ()

    @property
    def text(self) -> str:
        """What is said of the field; a sentence without its subject and its stop."""
        text = self.code.value.format(
            **self.numbers,
            first=self.named[0] if self.named else "",
            others=", ".join(self.named[1:]),
            named=", ".join(OTHER_FRAMES.get(each, each) for each in self.named),
            also="".join(f", nor is {each}" for each in self.named),
        )
        return f"{text}; {_balanced(self.numbers)}" if "flown_s" in self.numbers else text

    @property
    def problem(self) -> Problem:
        """The reason as an error has it."""
        return Problem(self.field, self.text, code=self.code.key, numbers=self.numbers, named=self.named)


def refusal(happened: str, hint: str, reasons: Iterable[Reason], notes: Sequence[str] = ()) -> TrajectoryError:
    """The error of a log in which this happened, for at least one reason; the last is followed by `notes` on what of
    the log was lost or damaged, and what else it holds."""
    *others, last = (each.problem for each in reasons)
    noted = replace(last, reason="; ".join((last.reason, *notes)))
    return TrajectoryError(happened, hint=hint, problems=(*others, noted))


def _balanced(numbers: Mapping[str, float]) -> str:
    left_out = [
        f"{lost_s:.1f} s ({name.removeprefix(LEFT_OUT).removesuffix('_s').replace('_', ' ')})"
        for name, lost_s in numbers.items()
        if name.startswith(LEFT_OUT)
    ]
    flown = f"of {numbers['flown_s']:.1f} s in the air {numbers['held_s']:.1f} s are in a mode that holds altitude"
    return f"{flown}; left out: {', '.join(left_out)}" if left_out else flown


LEFT_OUT: Final = "left_out_by_"
"""Begins the names of seconds that a filter leaves out, before its code."""
UNNAMED_FRAME: Final = "other"
OTHER_FRAMES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "VTOL": "a VTOL",
        "airship": "an airship",
        "boat": "a boat",
        "helicopter": "a helicopter",
        UNNAMED_FRAME: "a vehicle of another kind",
        "plane": "a plane",
        "rover": "a rover",
        "submarine": "a submarine",
        "tracker": "an antenna tracker",
    }
)
"""Kinds of vehicles that are no copter with several rotors, and what a person reads."""
