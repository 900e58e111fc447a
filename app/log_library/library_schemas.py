"""API views of analysed logs: kept as flights of a vehicle, or for a few days."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Annotated, Self

from pydantic import Field

from app.campaigns.schemas import Definition
from app.common.schemas import Gains, Name, Request, Schema
from app.core.analysis.analysis import Grade
from app.core.analysis.combined_fit import LogFit
from app.core.analysis.description import Description
from app.core.analysis.shapes import FailureShape
from app.core.statistics.comparisons import Verdict
from app.core.statistics.gain_change import Basis, ScoredTakeoff
from app.figures.base import Card
from app.figures.panels import Plot
from app.figures.theme import ThemeName
from app.log_library.parameter_changes import ParameterChange
from app.log_library.schemas import EstimatedValue, LogAnswer, Part, ShapeWords


class LogNumbers(Schema):
    """What lists and trends show of a log; null for what it does not tell."""

    hover_throttle: EstimatedValue | None = None
    thrust_slope: EstimatedValue | None = None
    deviation_m: Annotated[float | None, Field(description="mean distance between reference and altitude")] = None
    activity: Annotated[
        float | None,
        Field(description="standard deviation of the demanded throttle about its 2 Hz low-pass, share of full"),
    ] = None
    margin: Annotated[float | None, Field(description="of the gains flown; 0: less than 1, 8: at least 8")] = None
    gains: Gains = Field(default_factory=dict)

    def completed_by(self, flight: Description) -> Self:
        """These numbers, with those of the flight's description where there is none."""
        mean, deviation = flight.hover_throttle, flight.hover_throttle_deviation
        hover = None if mean is None or deviation is None else EstimatedValue(mean=mean, deviation=deviation)
        found = {
            "hover_throttle": hover if self.hover_throttle is None else self.hover_throttle,
            "deviation_m": flight.deviation_mean_m if self.deviation_m is None else self.deviation_m,
        }
        return self.model_copy(update=found)


class LoggedVehicleBrief(Schema):
    """The vehicle of a kept log."""

    id: int
    name: str


class AnalysedLog(Schema):
    """A log whose answer is stored, with the version of Gainline that gave it."""

    id: int
    file_name: str
    autopilot: str
    grade: Grade
    vehicle: Annotated[LoggedVehicleBrief | None, Field(description="null: not kept, and deleted after seven days")]
    hardware_id: Annotated[str, Field(description="of the autopilot's board; empty: not in the log")]
    program: Annotated[str, Field(description="version of Gainline")]
    flown_at: datetime | None
    analysed_at: datetime
    numbers: LogNumbers
    file_bytes: Annotated[int, Field(description="size of the stored file; 0: not stored")]


class LogPlace(AnalysedLog):
    """A log, and its place among the others."""

    suggested_name: Annotated[str, Field(description="of the vehicle, by the hardware id or the log; may be empty")]
    is_recognised: Annotated[bool, Field(description="whether the hardware id is that of a vehicle with logs")]
    previous_id: Annotated[int | None, Field(description="the log before it of the same vehicle")]
    starts_campaign: Annotated[bool, Field(description="whether a campaign can start without the file")]


class LogAnalysis(LogAnswer):
    """The result of a log analysis, and where it is stored."""

    figures: Annotated[dict[ThemeName, dict[Part, list[Card]]], Field(description="by theme, of each part")]
    log: LogPlace


class StoredAnswer(Schema):
    """What is stored of an analysis beside the numbers for lists."""

    answer: LogAnswer
    plots: Mapping[Part, Sequence[Plot]]
    parameters: Mapping[str, float]
    takeoffs: Sequence[ScoredTakeoff]
    definition: Definition | None


class LogExport(LogAnswer):
    """A log for other programs: its answer, who gave it, its vehicle, and all of its parameters."""

    program: Annotated[str, Field(description="version of Gainline that gave the answer")]
    flown_at: datetime | None
    analysed_at: datetime
    vehicle_name: Annotated[str | None, Field(description="null: not kept")]
    hardware_id: Annotated[str, Field(description="empty: not in the log")]
    parameters: Annotated[Mapping[str, float], Field(description="of the vehicle, as last known in the log")]


class VehicleName(Request):
    """Name of a vehicle whose logs are kept."""

    name: Name


class LoggedVehicle(LoggedVehicleBrief):
    """A vehicle whose logs are kept, with its newest log."""

    hardware_id: str | None
    logs: Annotated[int, Field(description="number of its logs")]
    newest: AnalysedLog


@dataclass(frozen=True, slots=True, kw_only=True)
class AnalysedContent:
    """What an analysis finds: the answer and the figures of its parts; and what the library keeps beside them: numbers
    for lists, the vehicle's identity, when it flew, its parameters, and the campaign that can start from the log."""

    answer: LogAnswer
    autopilot: str
    plots: Mapping[Part, Sequence[Plot]]
    numbers: LogNumbers
    hardware_id: str = ""
    vehicle_name: str = ""
    flown_at: datetime | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)
    fit: LogFit | None = None
    flight: bytes | None = None
    takeoffs: Sequence[ScoredTakeoff] = ()
    definition: Definition | None = None


class ErrorChange(Schema):
    """Differences of two logs' errors, later − earlier, m, and what of it the models of both flights attribute to what;
    null for what is not known."""

    measured_m: float | None
    by_gains_m: Annotated[float | None, Field(description="in the manoeuvres and the weather of both")]
    by_manoeuvre_m: float | None
    by_weather_m: float | None
    standard_error_m: Annotated[float | None, Field(description="of two single flights")]


class LogComparison(Schema):
    """A log compared with an earlier one."""

    log: AnalysedLog
    before: AnalysedLog
    verdict: Annotated[Verdict | None, Field(description="on the gains of the later log; null: they are the same")]
    confidence: float | None
    basis: Annotated[Basis, Field(description="what the comparison of the gains rests on")]
    change: ErrorChange
    is_contradicted: Annotated[bool, Field(description="whether the flights went the other way than the verdict says")]
    sentence: str
    notes: Sequence[str]
    parameters: Annotated[list[ParameterChange], Field(description="all that differ, gains first")]


class CombinedVehicle(Schema):
    """The vehicle that all of its logs fit together; the hover throttle differs from flight to flight, and has the
    standard deviation of that."""

    logs: Annotated[int, Field(description="number of logs that tell the vehicle")]
    hover_throttle: EstimatedValue
    thrust_slope: EstimatedValue
    motor_lag_s: EstimatedValue
    drag_1_s: EstimatedValue
    is_one_vehicle: Annotated[
        bool, Field(description="false: thrust slopes differ, as after a change of propellers or motors")
    ]


class LoggedVehicleDetails(LoggedVehicle):
    """A vehicle, and what its logs tell together."""

    combined: Annotated[CombinedVehicle | None, Field(description="null: fewer than two logs tell the vehicle")]


class AtlasShape(ShapeWords):
    """A shape of failure in the atlas."""

    code: FailureShape
    figures: Annotated[dict[ThemeName, Card], Field(description="of a simulated flight with it, by theme")]
