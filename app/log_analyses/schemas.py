"""What a log tells about the altitude control of its vehicle: for a person and, in numbers, for scripts."""

from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import Field

from app.autopilots.replica_check import Kind, SignalResult
from app.common.schemas import Gains, ProblemField, Schema
from app.core.analysis.analysis import Behaviour
from app.figures.base import Card
from app.figures.theme import ThemeName


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
    refusal: Annotated[str, Field(description="why the gate refuses these gains; empty: it does not")]


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
    reason: str


class ManoeuvreNumbers(Schema):
    """The analysis of an ArduCopter's or PX4's log. `assessments` begins with the gains flown."""

    behaviour: Behaviour
    vehicle: EstimatedVehicle
    assessments: list[GainsInManoeuvre]
    proposed: GainsInManoeuvre | None
    at_limit: Annotated[list[str], Field(description="proposed gains at an end of the range that was searched")]
    hover: Annotated[HoverSetting | None, Field(description="none if the present value suits")]


class FittedValue(Schema):
    """A parameter of the model with its standard error."""

    name: str
    title: str
    unit: str
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

    columns: Sequence[str]
    rows: Sequence[Sequence[str]]


class ParameterFile(Schema):
    """The proposed gains and hover throttle as a ground station or an airframe takes them."""

    name: str
    content: str


class TuningAnswer(Schema):
    """How the altitude was controlled, the fitted vehicle, and better gains."""

    answer: str
    proposes: Annotated[bool, Field(description="whether gains are proposed; if not, `answer` says why")]
    starts_campaign: Annotated[bool, Field(description="whether a campaign can start from this log")]
    experiment: Annotated[
        str | None,
        Field(description="of this campaign, for a vehicle that flies it; null: the vehicle is flown elsewhere"),
    ]
    flight: Annotated[Sequence[str], Field(description="how the altitude was controlled")]
    vehicle: Annotated[Sequence[str], Field(description="the fitted vehicle")]
    gains: Annotated[TextTable, Field(description="the sets flown, the proposed one, and others")]
    notes: Annotated[Sequence[str], Field(description="how to read the table, and precautions")]
    parameter_file: ParameterFile | None
    numbers: ManoeuvreNumbers | TakeoffNumbers


class ReplicaAnswer(Schema):
    """How well Gainline's replica of the autopilot's vertical loop explains the log."""

    answer: str
    agrees: Annotated[bool, Field(description="whether every signal does")]
    kind: Annotated[Kind, Field(description="the log of a flight, or a trace with every step")]
    facts: Annotated[Sequence[str], Field(description="what was compared, and the gains")]
    table: Annotated[TextTable, Field(description="the difference of every signal")]
    notes: Annotated[Sequence[str], Field(description="what is allowed, and how it was compared")]
    rows: Annotated[int, Field(description="number of samples or steps compared")]
    first_different_row: Annotated[int | None, Field(description="counted from 0; null: none, or not counted")]
    gains: Annotated[Gains | None, Field(description="null if they change within the recording")]
    gains_from: str
    better_gains: Annotated[Gains | None, Field(description="other gains that reproduce more of the commands")]
    signals: Sequence[SignalResult]


class Refusal(Schema):
    """Why the log does not answer: what happened, the fields concerned, and what to do."""

    title: str
    hint: str
    problems: list[ProblemField]


class LogAnswer(Schema):
    """The result of a log analysis without its figures: at least one of both parts."""

    file_name: str
    autopilot: Annotated[str, Field(description="its title")]
    tuning: TuningAnswer | Refusal
    replica: ReplicaAnswer | Refusal


Part = Literal["tuning", "replica"]


class LogAnalysis(LogAnswer):
    """The result of a log analysis."""

    figures: Annotated[dict[ThemeName, dict[Part, list[Card]]], Field(description="by theme, of each part")]
