"""What a log tells about the altitude control of its vehicle: for a person and, in numbers, for scripts."""

from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from app.autopilots.replica_check import Kind, Verdict
from app.common.schemas import Gains, Schema
from app.core.analysis.analysis import Behaviour, Grade
from app.core.analysis.description import Description
from app.core.analysis.hand_rules import UsualGains
from app.core.analysis.shapes import FailureShape
from app.core.models.copter import Copter

Unit = Annotated[str, AfterValidator(lambda unit: unit.replace(" ", "_"))]
"""A unit in one word: of_full."""


class EstimatedValue(Schema):
    """A fitted quantity and its standard deviation."""

    mean: float
    deviation: Annotated[float, Field(description="standard deviation")]


class EstimatedVehicle(Schema):
    """The copter that the log fits."""

    hover_throttle: EstimatedValue
    assumed_hover_throttle: Annotated[float, Field(description="MOT_THST_HOVER in flight, or MPC_THR_HOVER")]
    thrust_slope: EstimatedValue
    motor_lag_s: EstimatedValue
    drag_1_s: EstimatedValue
    residual_m_s2: Annotated[float, Field(description="acceleration that throttle and climb rate do not explain, rms")]


class AssessedGains(Schema):
    """What the model predicts for a gain set: the error, with the 90 % interval of a single flight."""

    name: str
    gains: Gains
    error_m: Annotated[float, Field(description="predicted mean distance between reference and altitude")]
    low_m: Annotated[float, Field(description="lower end of the 90 % interval of a single flight")]
    high_m: float


class GainsInManoeuvre(AssessedGains):
    """A gain set in the same manoeuvre and weather."""

    activity: Annotated[float, Field(description="throttle activity relative to the gains flown")]
    margin: Annotated[
        float,
        Field(
            description="factor on the gains of the acceleration controller, PX4: of the velocity controller, at which "
            "the loop rings with 30 ms more lag, PX4: dead time, on the most critical of the vehicles consistent with "
            "the log; 0: less than 1, 8: at least 8"
        ),
    ]


class GainsInTakeoff(AssessedGains):
    """A gain set in another takeoff to 3 m."""

    flown_error_m: Annotated[float | None, Field(description="mean error of the takeoffs with these gains in the log")]
    passes_gate: bool


class HoverSetting(Schema):
    """A better value of the parameter for the hover throttle."""

    parameter: str
    present: float
    proposed: float
    is_outside: Annotated[
        bool,
        Field(
            description="whether the vehicle hovers outside MPC_THR_HOVER ± HTE_THR_RANGE, where PX4's estimate stops; "
            "the gain sets but the first are then assessed with the proposed value"
        ),
    ]


class ManoeuvreNumbers(Schema):
    """The analysis of an ArduCopter's or PX4's log. `assessments` begins with the gains flown."""

    behaviour: Behaviour
    vehicle: EstimatedVehicle
    assessments: list[GainsInManoeuvre]
    proposed: GainsInManoeuvre | None
    at_limit: Annotated[list[str], Field(description="proposed gains at an end of the range that was searched")]
    hover: Annotated[HoverSetting | None, Field(description="none if the present value suits")]
    assumed: Annotated[list[str], Field(description="parameters not in the log, assumed to have their default")]


class UsualNumbers(Schema):
    """Margins on a copter with the hover throttle of the log and what is usual, where it tells the gains and no more.
    `assessments` begins with the gains flown; a margin of 0 is less than 1, and one of 8 at least 8."""

    vehicle: Copter
    assessments: Sequence[UsualGains]


class FittedValue(Schema):
    """A parameter of the model with its standard error."""

    name: str
    title: str
    unit: Unit
    value: float
    standard_error: float


class TakeoffNumbers(Schema):
    """The analysis of a log of takeoffs under Paparazzi. `assessments` begins with the gains of the best takeoff."""

    window_s: Annotated[float, Field(description="scored time from the command on")]
    takeoffs: Annotated[list[int], Field(description="numbers of those analysed")]
    best: Annotated[int, Field(description="number of the takeoff with the lowest error")]
    error_m: Annotated[float, Field(description="its mean distance from 3 m")]
    rise_time_s: float | None
    settling_time_s: float | None
    overshoot_m: float | None
    steady_state_error_m: float | None
    vehicle: list[FittedValue]
    residual_m: Annotated[float, Field(description="altitude that the model does not explain, rms")]
    assessments: list[GainsInTakeoff]
    proposed: GainsInTakeoff | None


class TextTable(Schema):
    """A table of formatted cells."""

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]


class ParameterFile(Schema):
    """The proposed gains and hover throttle as a ground station or an airframe takes them."""

    name: str
    content: str


class Facts(Schema):
    """Formatted numbers about one thing."""

    title: str
    values: Sequence[str]


class ShapeWords(Schema):
    """A shape of failure for a person."""

    title: str
    recognised: Annotated[str, Field(description="how the program recognises it")]
    advice: Annotated[str, Field(description="what to do")]


class ShapeTexts(ShapeWords):
    """One that was found."""

    found: Annotated[str, Field(description="with the numbers of this log")]


class PartTexts(Schema):
    """A part of the answer for a person."""

    answer: str
    reasons: Annotated[Sequence[str], Field(description="the part's reasons as sentences")] = ()
    facts: Sequence[Facts] = ()
    shapes: Annotated[Sequence[ShapeTexts], Field(description="the part's shapes of failure, in the same order")] = ()
    table: TextTable | None = None
    notes: Annotated[Sequence[str], Field(description="how to read the table, precautions, what to do")] = ()
    parameter_file: ParameterFile | None = None


class ReasonField(Schema):
    """Why a part does not answer, or not in full."""

    code: Annotated[str, Field(description="a code of app.core.reasons")]
    field: Annotated[str, Field(description="the message, column or parameter concerned; file: the whole log")]
    numbers: Annotated[dict[str, float], Field(description="by names that end in their unit")]
    named: Annotated[list[str], Field(description="what else the reason names: modes, parameters, a kind of vehicle")]


class FoundShapeField(Schema):
    """A shape of failure in the flight."""

    code: FailureShape
    numbers: Annotated[dict[str, float], Field(description="by names that end in their unit; 1: a share or a number")]
    since_s: Annotated[float, Field(description="when it is seen first, s of the recording")]


class TuningAnswer(Schema):
    """How the altitude was controlled, the vehicle, and better gains, as far as the log tells."""

    grade: Annotated[
        Grade,
        Field(
            description="full: gains are judged; partial: the vehicle is fitted or its hover throttle known, and no "
            "gains are proposed; description: the flight alone; refused: nothing"
        ),
    ]
    reasons: Annotated[Sequence[ReasonField], Field(description="why the grade is no better, or nothing is proposed")]
    proposes: Annotated[bool, Field(description="whether gains are proposed")] = False
    starts_campaign: Annotated[bool, Field(description="whether a campaign can start from this log")] = False
    experiment: Annotated[
        str | None,
        Field(description="of this campaign, for a vehicle that flies it; null: the vehicle is flown elsewhere"),
    ] = None
    description: Annotated[Description | None, Field(description="the whole flight as it was flown")] = None
    shapes: Annotated[Sequence[FoundShapeField], Field(description="shapes of failure in the whole flight")] = ()
    numbers: ManoeuvreNumbers | UsualNumbers | TakeoffNumbers | None = None


class SignalNumbers(Schema):
    """Result of one signal: the largest difference between recording and replica, the tolerance, and the number of
    samples that differ by more; of a signal judged by its median difference, the tolerance is the median's."""

    name: str
    difference_unit: Unit
    largest_difference: float
    tolerance: float
    verdict: Verdict
    different: int
    first_different_s: float | None
    median_difference: float | None


class ReplicaAnswer(Schema):
    """How well Gainline's replica of the autopilot's vertical loop explains the log."""

    agrees: Annotated[bool, Field(description="whether every signal does")]
    kind: Annotated[Kind, Field(description="the log of a flight, or a trace with every step")]
    rows: Annotated[int, Field(description="number of samples or steps compared")]
    first_different_row: Annotated[int | None, Field(description="counted from 0; null: none, or not counted")]
    gains: Annotated[Gains | None, Field(description="null if they change within the recording")]
    better_gains: Annotated[Gains | None, Field(description="other gains that reproduce more of the commands")]
    signals: Sequence[SignalNumbers]


class Refusal(Schema):
    """Why the log is not compared with a replica."""

    reasons: Sequence[ReasonField]


Part = Literal["tuning", "replica"]


class Texts(Schema):
    """All that is written for a person."""

    tuning: PartTexts
    replica: PartTexts


class LogAnswer(Schema):
    """The result of a log analysis without its figures: numbers and codes, and in `texts` alone what a person reads."""

    schema_version: Literal[1] = 1
    file_name: str
    autopilot: Annotated[str, Field(description="its title")]
    release: Annotated[str | None, Field(description="of the firmware; null: not in the log")]
    frame: Annotated[str | None, Field(description="of the vehicle; null: not in the log, or of no named kind")]
    vehicle: Annotated[int | None, Field(description="system id of the one analysed, if the log has several")]
    vehicles: Annotated[dict[int, str], Field(description="titles of the autopilots of several, by system id")]
    tuning: TuningAnswer
    replica: ReplicaAnswer | Refusal
    texts: Texts
