"""Why a log does not answer, or not in full: a code with its numbers, and the table of what a person reads."""

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from types import MappingProxyType
from typing import Final

from app.core.errors import Problem, TrajectoryError


class ReasonCode(StrEnum):
    """What a log lacks, what it has instead, or what follows from it."""

    ALTITUDE_NOT_HELD = "altitude_not_held"
    CHANNEL_MISSING = "channel_missing"
    COLUMN_MISSING = "column_missing"
    CONSTANT_SIGNAL = "constant_signal"
    DEVIATION_NOT_EXPLAINED = "deviation_not_explained"
    GAPS = "gaps"
    LEANS = "leans"
    LOG_BIT_UNSET = "log_bit_unset"
    MANUAL_ALTITUDE = "manual_altitude"
    MARGIN_UNREACHABLE = "margin_unreachable"
    MESSAGE_MISSING = "message_missing"
    MESSAGE_RARE = "message_rare"
    NEVER_ARMED = "never_armed"
    NEVER_FLEW = "never_flew"
    NONE_BETTER = "none_better"
    NOT_A_COPTER = "not_a_copter"
    NOT_COMPARED = "not_compared"
    NOT_NUMBERS = "not_numbers"
    NO_ALTITUDE = "no_altitude"
    NO_ALTITUDE_CHANGES = "no_altitude_changes"
    NO_DATA = "no_data"
    NO_STEPS = "no_steps"
    NO_WHOLE_CHANGE = "no_whole_change"
    ONLY_TAKEOFFS_OR_LANDINGS = "only_takeoffs_or_landings"
    OTHER_CONTROLLER = "other_controller"
    OTHER_MODES = "other_modes"
    PARAMETER_CHANGES = "parameter_changes"
    PARAMETER_MISSING = "parameter_missing"
    PARAMETER_NOT_POSITIVE = "parameter_not_positive"
    PARAMETER_OUT_OF_RANGE = "parameter_out_of_range"
    PARAMETER_READ_LATE = "parameter_read_late"
    PARAMETER_UNSUPPORTED = "parameter_unsupported"
    REFERENCE_NOT_SHAPED = "reference_not_shaped"
    RESETS = "resets"
    SAMPLES_RARE = "samples_rare"
    SATURATED = "saturated"
    SLOPE_UNKNOWN = "slope_unknown"
    STEPS_TOO_CLOSE = "steps_too_close"
    TOO_SHORT = "too_short"
    UNEXPLAINED_ACCELERATIONS = "unexplained_accelerations"
    UNUSABLE = "unusable"
    VIBRATION_FAILSAFE = "vibration_failsafe"


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
        text = _TEXTS[self.code].format(
            **self.numbers,
            named=", ".join(OTHER_FRAMES.get(each, each) for each in self.named),
            also="".join(f", nor is {each}" for each in self.named),
        )
        return f"{text}; {_balanced(self.numbers)}" if "flown_s" in self.numbers else text

    @property
    def problem(self) -> Problem:
        """The reason as an error has it."""
        return Problem(self.field, self.text, code=self.code, numbers=self.numbers, named=self.named)


def refusal(happened: str, hint: str, reasons: Iterable[Reason], notes: Sequence[str] = ()) -> TrajectoryError:
    """The error of a log in which this happened, with `notes` on what of it was lost or damaged."""
    problems = tuple(replace(each.problem, reason="; ".join((each.text, *notes))) for each in reasons)
    return TrajectoryError(happened, hint=hint, problems=problems)


def _balanced(numbers: Mapping[str, float]) -> str:
    left_out = [
        f"{lost_s:.1f} s by {_FILTERS[code]}" for code in _FILTERS if (lost_s := numbers.get(f"left_out_by_{code}_s"))
    ]
    flown = f"of {numbers['flown_s']:.1f} s in the air {numbers['held_s']:.1f} s are in a mode that holds altitude"
    return f"{flown}; left out are {', '.join(left_out)}" if left_out else flown


_FILTERS: Final[Mapping[ReasonCode, str]] = MappingProxyType(
    {
        ReasonCode.ALTITUDE_NOT_HELD: "other modes",
        ReasonCode.OTHER_MODES: "other modes",
        ReasonCode.MANUAL_ALTITUDE: "rows without an altitude to follow",
        ReasonCode.ONLY_TAKEOFFS_OR_LANDINGS: "takeoffs and landings",
        ReasonCode.VIBRATION_FAILSAFE: "vibration compensation",
        ReasonCode.LEANS: "lean",
        ReasonCode.NOT_NUMBERS: "rows that are not sound",
        ReasonCode.GAPS: "gaps",
        ReasonCode.RESETS: "resets",
        ReasonCode.PARAMETER_CHANGES: "parameter changes",
        ReasonCode.TOO_SHORT: "parts that are too short",
    }
)
"""What leaves out rows of a flight."""
OTHER_FRAMES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "boat": "a boat",
        "helicopter": "a helicopter",
        "plane": "a plane",
        "rover": "a rover",
        "submarine": "a submarine",
        "vtol": "a VTOL",
    }
)
"""Kinds of vehicles that are no copter with several rotors, as a person calls them."""
_TEXTS: Final[Mapping[ReasonCode, str]] = MappingProxyType(
    {
        ReasonCode.ALTITUDE_NOT_HELD: "has too little flight in a mode that holds altitude",
        ReasonCode.CHANNEL_MISSING: "is not among the recorded channels ({named})",
        ReasonCode.COLUMN_MISSING: "is missing: this release logs it otherwise, which is not supported",
        ReasonCode.CONSTANT_SIGNAL: "has a constant {named}: nothing can be learned from it",
        ReasonCode.DEVIATION_NOT_EXPLAINED: (
            "has a deviation of {flown_mm:.1f} mm, where the gains in the log make the fitted vehicle deviate by "
            "{modelled_mm:.1f} mm: perhaps it flew with other gains, for instance set by a tuning knob, or something "
            "else replaced the controller"
        ),
        ReasonCode.GAPS: "has too little without a gap between its rows",
        ReasonCode.LEANS: "leans by more than 30° in too much of the flight",
        ReasonCode.LOG_BIT_UNSET: "is not in the log: add {named} to LOG_BITMASK, and fly again",
        ReasonCode.MANUAL_ALTITUDE: "has too little with an altitude to follow, as in manual modes",
        ReasonCode.MARGIN_UNREACHABLE: (
            "allows no gains: none within the documented ranges reach the required margin on this vehicle"
        ),
        ReasonCode.MESSAGE_MISSING: "is missing",
        ReasonCode.MESSAGE_RARE: "arrives {rate_hz:.1f} times a second; {needed_hz:.0f} times are needed",
        ReasonCode.NEVER_ARMED: "never reports armed motors",
        ReasonCode.NEVER_FLEW: "has no flight: the vehicle never left the ground",
        ReasonCode.NONE_BETTER: (
            "allows no better gains: the margin of those flown is sufficient, and no others are predicted to reduce "
            "the error by more than 5 %"
        ),
        ReasonCode.NOT_A_COPTER: "is that of {named}, not of a copter with several rotors",
        ReasonCode.NOT_COMPARED: "is not compared",
        ReasonCode.NOT_NUMBERS: "has too few rows of plausible numbers beside all other signals",
        ReasonCode.NO_ALTITUDE: "has no altitude",
        ReasonCode.NO_ALTITUDE_CHANGES: (
            "has no altitude changes: the reference moves by {reference_range_m:.2f} m, and {needed_m:g} m are needed"
        ),
        ReasonCode.NO_DATA: "has no data: copy the whole log",
        ReasonCode.NO_STEPS: "has no altitude step in {named} in flight after {rest_s:g} s at rest",
        ReasonCode.NO_WHOLE_CHANGE: (
            "has no altitude change that both begins and ends in it, as in the last part of a takeoff, so that slope, "
            "lag and drag cannot be told apart"
        ),
        ReasonCode.ONLY_TAKEOFFS_OR_LANDINGS: (
            "has too little flight between takeoff and landing, in which the ramp and the ground decide"
        ),
        ReasonCode.OTHER_CONTROLLER: (
            "has a climb rate target that does not follow from the logged parameters, in {differing_rows:.0f} of "
            "{rows:.0f} rows: terrain following, set-points that were not logged, or a release with another position "
            "controller"
        ),
        ReasonCode.OTHER_MODES: (
            "has no flight in the one mode whose set points the messages give: needed and flown, {named}"
        ),
        ReasonCode.PARAMETER_CHANGES: "change too often",
        ReasonCode.PARAMETER_MISSING: "is not in the log{also}: read the vehicle's parameters while it is recorded",
        ReasonCode.PARAMETER_NOT_POSITIVE: "must be positive, got {value:g}",
        ReasonCode.PARAMETER_OUT_OF_RANGE: "must be {low:g} to {high:g}, got {value:g}",
        ReasonCode.PARAMETER_READ_LATE: "was changed after the flight, and was not read before",
        ReasonCode.PARAMETER_UNSUPPORTED: "must be 0",
        ReasonCode.REFERENCE_NOT_SHAPED: (
            "differs by {misfit_m:.2f} m from the target that ArduCopter shapes from the set points with the vehicle's "
            "parameters"
        ),
        ReasonCode.RESETS: "is reset by the estimator, or jumps, too often",
        ReasonCode.SAMPLES_RARE: "has a sample every {interval_s:.2f} s; {needed_s:g} s are needed",
        ReasonCode.SATURATED: "has the throttle at a limit in {saturated_share:.0%} of its rows",
        ReasonCode.SLOPE_UNKNOWN: (
            "determines the thrust slope only to ±{thrust_slope_deviation:.2f}; ±{needed_deviation:g} is needed"
        ),
        ReasonCode.STEPS_TOO_CLOSE: "moves again within {apart_s:g} s: fly steps, and wait after each",
        ReasonCode.TOO_SHORT: "holds altitude for too short a time: {needed_s:g} s are needed",
        ReasonCode.UNEXPLAINED_ACCELERATIONS: (
            "has accelerations that throttle and climb rate do not explain, {residual_m_s2:.1f} m/s² rms: gusts too "
            "strong, oscillating rate controllers, or vibration compensation"
        ),
        ReasonCode.UNUSABLE: "cannot be used",
        ReasonCode.VIBRATION_FAILSAFE: "has vibration compensation active in too much of the flight",
    }
)
