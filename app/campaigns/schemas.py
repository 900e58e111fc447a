"""API schemas of campaigns and proposals."""

from datetime import datetime
from enum import StrEnum
from typing import Annotated, Final, Literal

from pydantic import Field

from app.autopilots.registry import EXPERIMENTS
from app.common.schemas import (
    Gains,
    Gate,
    Name,
    Number,
    OptionValue,
    Reason,
    Request,
    Schema,
    Text,
    Trouble,
    Version,
)
from app.common.states import CampaignState, Outcome
from app.core.definition import Interval
from app.core.statistics.comparisons import Verdict
from app.core.tuning.definition_checks import (
    MAX_CEILING_M,
    MAX_FLIGHTS,
    MAX_IMPROVEMENT,
    MAX_SEED,
    MIN_CEILING_M,
    MIN_CONFIDENCE,
)
from app.core.tuning.proposals import Advice, AdviceKind
from app.core.tuning.strategies import recommended_strategy
from app.core.tuning.strategy import Explanation, Kind
from app.fleet.schemas import CampaignVehicle, VehicleChoice

# The ranges of a definition are documented here and checked in app.core.tuning.definition_checks with everything else,
# so that one answer names every wrong field.
Fraction = Annotated[Number, Field(json_schema_extra={"exclusiveMinimum": 0, "maximum": 1})]
Whole = Annotated[int, Field(strict=True)]
Key = Annotated[str, Field(max_length=40)]
VERDICT: Final = (
    "verdict of the best gains against the first flight's; null while they are the same or no flight is valid"
)


class Sort(StrEnum):
    """Orders of the list of campaigns; `error` starts with the lowest best error."""

    NEWEST = "-created"
    OLDEST = "created"
    LATELY_CHANGED = "-updated"
    NAME = "name"
    BEST_ERROR = "error"


class Donor(Request):
    """The flight of another campaign that a warm start uses, with the checksum of its record. Without a trial
    number it is the best valid one; the checksum is filled in."""

    campaign_id: Annotated[int, Field(ge=1, le=2**63 - 1, strict=True)]
    trial_number: Annotated[int, Field(ge=1, le=2**31, strict=True)] | None = None
    checksum: Annotated[str, Field(max_length=64)] = ""


class LogEvidence(Request):
    """What the log of another flight tells of the vehicle before the first flight, as found by its analysis."""

    file_name: Name
    error_m: Annotated[Number, Field(description="mean distance between reference and altitude in its own manoeuvre")]
    vehicle: Annotated[
        dict[Key, tuple[Number, Number]],
        Field(max_length=10, description="mean and standard deviation of the parameters of the vehicle's model"),
    ]
    parameters: Annotated[
        dict[Key, Number], Field(max_length=100, description="of the autopilot, by the firmware's names")
    ]


class Start(Request):
    """Source of the first flight's gains. `gains` goes with kind `given`; `donor` with kind `campaign`, whose
    gains are filled in; `log` with gains that were proposed from it, for altitude steps under ArduCopter and PX4."""

    kind: Literal["default", "simplex", "given", "campaign"] = "default"
    gains: dict[str, Number] | None = None
    donor: Donor | None = None
    log: LogEvidence | None = None


class StopRule(Request):
    """`noise`: ends when no remaining difference can be resolved with `confidence`, after the winner was flown again
    and compared with the baseline. `paper`: ends after two flights in a row without `improvement` (a share of the best)
    on the best so far, or with the budget. `budget`: only the number of flights ends the campaign. With every kind a
    flight that ends below `min_battery_v` ends it."""

    kind: Literal["noise", "paper", "budget"] = "noise"
    max_flights: Annotated[Whole, Field(json_schema_extra={"minimum": 1, "maximum": MAX_FLIGHTS})] = 7
    improvement: Annotated[Number, Field(json_schema_extra={"minimum": 0, "maximum": MAX_IMPROVEMENT})] = 0.05
    confidence: Annotated[Number, Field(json_schema_extra={"minimum": MIN_CONFIDENCE, "exclusiveMaximum": 1})] = 0.9
    min_battery_v: Annotated[Number, Field(json_schema_extra={"exclusiveMinimum": 0})] | None = None


class Definition(Request):
    """Everything besides the flights that a proposal depends on. Frozen at the first flight.

    `bounds` narrow the experiment's own. `first_step_fraction` and `step_fraction` limit a gain's change as shares of
    its range, before and after the first valid flight; `ceiling_m` is the highest altitude that the gate lets a model
    run reach.
    """

    experiment: Key = "takeoff"
    experiment_options: dict[str, OptionValue] = Field(default_factory=dict)
    strategy: Annotated[Key, Field(description="by default the first of the catalogue for the experiment")] = Field(
        default_factory=lambda given: recommended_strategy(EXPERIMENTS.get(str(given.get("experiment", ""))))
    )
    options: dict[str, OptionValue] = Field(default_factory=dict)
    start: Start = Field(default_factory=Start)
    bounds: dict[str, tuple[Number, Number]] = Field(default_factory=dict)
    first_step_fraction: Fraction = 0.25
    step_fraction: Fraction = 1.0
    ceiling_m: Annotated[Number, Field(json_schema_extra={"minimum": MIN_CEILING_M, "maximum": MAX_CEILING_M})] = 4.5
    stop: StopRule = Field(default_factory=StopRule)
    seed: Annotated[Whole, Field(json_schema_extra={"minimum": 0, "maximum": MAX_SEED})] = 1


class NewCampaign(Request):
    """A campaign to be created; omitted fields have working defaults."""

    name: Name
    vehicle: VehicleChoice = Field(default_factory=lambda: VehicleChoice(kind="jsbsim"))
    definition: Definition = Field(default_factory=Definition)


class CampaignEdit(Request):
    """Changes of a campaign; omitted fields stay as they are. Definition and vehicle can change only before the first
    flight."""

    version: Version
    name: Name | None = None
    definition: Definition | None = None
    vehicle: VehicleChoice | None = None


class Clone(Request):
    """A new campaign with the same definition, optionally on another vehicle, linked to this one. With `warm_start` it
    starts from this one's best gains."""

    name: Name | None = None
    vehicle: VehicleChoice | None = None
    warm_start: bool = False


class Finish(Request):
    """Why the operator finishes the campaign."""

    reason: Text = "stopped by the operator"


class Promotion(Request):
    """Who makes the best gains the vehicle's safe gains, and why; `version` is the vehicle's."""

    version: Version
    statement: Reason


class BestTrial(Schema):
    """The valid trial with the lowest error, and the mean of all flights of its gains with its standard error, null
    while the scatter is not known."""

    trial_id: int
    trial_number: int
    error: float
    gains: Gains
    mean: float
    standard_error: float | None
    flights: int


class FlyingTrial(Schema):
    """The trial whose flight is requested or under way."""

    trial_id: int
    trial_number: int


class TrialCounts(Schema):
    """Number of trials by their state; `flown` are those that left the ground."""

    total: int
    flown: int
    valid: int
    aborted: int
    invalid: int
    lost: int


RehearsalState = Literal["not needed", "missing", "under way", "passed", "failed"]


class Rehearsal(Schema):
    """Whether a campaign on a real vehicle was first flown on a simulation, which has to be `passed` before a trial can
    be staged. `campaign_id` is the rehearsal's own campaign; `reason` explains the state."""

    state: RehearsalState
    campaign_id: int | None
    reason: str


class Winner(Schema):
    """The gains with the lowest mean error plus its standard error, which are repeated, confirmed and promoted. After
    repeats these may differ from those of the flight with the lowest error."""

    gains: Gains
    trial_numbers: list[int]
    verdict: Annotated[Verdict | None, Field(description=VERDICT)]


Standing = Literal["candidate", "confirmed", "not confirmed"]


class CampaignBrief(Schema):
    """What the list of campaigns and a campaign's own page both tell."""

    id: int
    name: str
    state: CampaignState
    outcome: Outcome | None
    vehicle: CampaignVehicle
    best: BestTrial | None
    verdict: Annotated[Verdict | None, Field(description=VERDICT)]
    next_action: str
    updated_at: datetime


class Campaign(CampaignBrief):
    """One vehicle, one experiment, one strategy, and the results."""

    version: int
    stop_reason: str
    definition: Definition
    definition_digest: Annotated[
        str | None, Field(description="SHA-256 of definition and vehicle, once they are frozen")
    ]
    open_until_flight: Annotated[
        int, Field(description="number of flights up to which no stop rule ends it, because it was reopened")
    ]
    parent_id: int | None
    rehearsal: Rehearsal
    rehearses: Annotated[int | None, Field(description="the campaign that this one rehearses")]
    winner: Winner | None
    standing: Annotated[
        Standing | None,
        Field(
            description="of the winner of a finished campaign: candidate until it and the first gains were flown "
            "at least twice, then confirmed if it is better"
        ),
    ]
    parameter_file: Annotated[
        str | None,
        Field(description="name of the file with the best gains of a finished campaign; null if none are better"),
    ]
    trials: TrialCounts
    flying: FlyingTrial | None
    actions: Annotated[list[str], Field(description="allowed actions: plan, define, finish, archive, …")]
    created_at: datetime


class SparkCurve(Schema):
    """One flight's scored output in a few points."""

    trial_number: int
    best: bool
    time_s: list[float]
    values: list[float]


class CampaignSummary(CampaignBrief):
    """A campaign as one card of the list. `best` is of the gains with the best mean, `first_error` the mean with the
    first gains; `spark` holds the first flight, the best and the latest, at most 7."""

    experiment: str
    strategy: str
    flights: int
    first_error: float | None
    rehearsal: RehearsalState
    has_passed_as_rehearsal: Annotated[bool, Field(description="whether it is a rehearsal that lets its campaign fly")]
    spark: list[SparkCurve]


class GainChange(Schema):
    """One gain now (of the best flight, else of the vehicle's safe gains) and next."""

    now: int | float
    next: int | float
    delta: int | float


class StopVerdict(Schema):
    """Whether the campaign's stop rule ends it, and why."""

    stop: bool
    reason: str
    sentence: str
    threshold: Annotated[float | None, Field(description="error below which the next flight counts as better")]


Variant = Literal["smaller step", "repeat", "baseline"]
ChoiceKind = Literal["step", "smaller step", "repeat", "baseline"]


class FlightChoice(Schema):
    """A gain set that the next flight may use. `proposed`: it is the proposal's own, otherwise a variant of that kind;
    `recommended`: it is the advice's."""

    kind: ChoiceKind
    gains: Gains
    proposed: bool
    recommended: bool


class Proposal(Schema):
    """The next gain set, computed from one history; stale as soon as that history has changed. `recommended` is the
    advice's kind; the campaign's own rule has ended it only when `stop_verdict.stop` is true. `choices` are the
    proposal and its variants, no gain set twice; none is recommended when the advice is to stop."""

    id: int
    campaign_id: int
    kind: Kind
    recommended: AdviceKind
    advice: Advice
    gains: Gains
    changes: dict[str, GainChange]
    choices: list[FlightChoice]
    predicted_error: float | None
    interval: Interval | None
    explanation: Explanation
    gate: Gate
    stop_verdict: StopVerdict
    history_digest: str
    stale: bool
    computed_at: datetime


class NextFlight(Schema):
    """State of the next proposal. While a new one is computed, `proposal` may be the stale one before it."""

    state: Literal["computing", "ready", "failed", "none"]
    proposal: Proposal | None
    problem: Trouble | None


class ConsideredGains(Request):
    """A complete gain set that is considered for the next flight."""

    gains: Annotated[dict[str, Number], Field(max_length=50, examples=[{"kp": 283, "ki": 13, "kd": 82}])]


class PredictedCurve(Schema):
    """The scored output of a predicted flight over time, thinned for drawing."""

    time_s: list[float]
    values: list[float]


class GainsPrediction(Schema):
    """What is predicted for gains: their error with its interval, the curve, and the edges of its band. From the
    flights of these gains if there were any, otherwise from the model of the next proposal; null without a model."""

    gains: Gains
    predicted_error: float | None
    interval: Interval | None
    curve: PredictedCurve | None
    lower: PredictedCurve | None
    upper: PredictedCurve | None
