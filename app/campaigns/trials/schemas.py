"""API schemas of trials and trajectories."""

from datetime import datetime
from typing import Annotated, Literal, Self

from pydantic import AwareDatetime, Field, model_validator

from app.campaigns.schemas import Variant
from app.common.schemas import Gains, Gate, Number, OptionValue, Reason, Request, Schema, Text, Version
from app.common.states import AbortCause, Ending, FlightMode, FlightState, TrialKind, TrialState
from app.core.definition import Interval
from app.core.records.glitches import Glitch
from app.core.statistics.comparisons import Verdict
from app.vehicles.flight_end import FlightEnd

Speed = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.1, le=1000)]


class FlightOrder(Request):
    """Speed of a simulated flight: simulated time over wall-clock time; null: as fast as possible."""

    speed: Speed | None = 10.0


class TrialPlan(Request):
    """A trial of a proposal, of custom gains, or of a variant: exactly one of the three. Variants: `smaller step`,
    halfway from the best gains to the proposal; `repeat`, the best gains again; `baseline`, the first flight's gains
    again. A variant with `gains` is refused when these are not its gains: it then flies what its client has shown, or
    nothing."""

    proposal_id: Annotated[int, Field(ge=1, le=2**63 - 1, strict=True)] | None = None
    gains: Annotated[dict[str, Number], Field(max_length=50, examples=[{"kp": 283, "ki": 13, "kd": 82}])] | None = None
    variant: Variant | None = None
    overrule: Annotated[
        Reason | None,
        Field(description="reason to fly gains that the gate refuses; simulated vehicles only"),
    ] = None
    note: Text = ""


class NewTrial(TrialPlan):
    """A trial to plan. With `fly` it is flown at once."""

    fly: FlightOrder | None = None


class TrialEdit(Request):
    """A change of a trial's note."""

    version: Version
    note: Text


class TrialPhoto(Schema):
    """A photo of a flight; the picture itself is at `/api/trials/{trial_id}/photos/{id}`."""

    id: int
    trial_id: int
    media_type: str
    added_at: datetime


class Reopening(Request):
    """For how many more flights a finished campaign is reopened; its stop rule applies again after them. `plan` are
    those that are planned at once, in this order."""

    flights: Annotated[int, Field(strict=True, ge=1, le=50)] = 3
    plan: Annotated[list[Variant], Field(max_length=50)] = Field(default_factory=list)

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if len(self.plan) > self.flights:
            raise ValueError("plan has more flights than the campaign is reopened for")
        return self


class Classification(Request):
    """A person's review of a finished flight."""

    version: Version
    outcome: Literal["valid", "aborted", "invalid"]
    reason: Reason


class AbortJudgement(Request):
    """The operator's reason for aborting a flight, which decides whether it counts against its gains."""

    version: Version
    cause: Literal["behaved badly", "something else"]


class Abort(Request):
    """Reason for aborting the flight; without one it is aborted by the operator."""

    reason: Annotated[str, Field(max_length=500)] = ""


class AbortAnswer(Schema):
    """Answer to an abort. `accepted` is true when the worker has accepted the abort, or the flight is over already; the
    flight's end is reported by its events."""

    trial_id: int
    accepted: bool
    sentence: str


class RecordBrief(Schema):
    """The stored record of a flight, without its samples. `ending`: whether the flight was completed, was aborted, or
    has an invalid measurement."""

    samples: int
    ending: Ending
    duration_s: float
    source: str
    clock: str
    channels: list[str]
    units: dict[str, str]
    checksum: Annotated[str, Field(description="SHA-256 of the stored samples; see docs/api.md for its verification")]


class FlightBrief(Schema):
    """The last flight requested for this trial. `problem` states why it failed, `end` how it ended. A flight of mode
    `stage` waits with its gains on the vehicle until its operator requests the takeoff."""

    id: int
    state: FlightState
    mode: FlightMode
    take_off_at: Annotated[datetime | None, Field(description="time of the takeoff request")]
    standing_down: Annotated[str, Field(description="why a staged flight was cancelled; empty otherwise")]
    problem: str
    end: FlightEnd | None
    battery: Annotated[str, Field(description="label of the battery used; empty if not given")]
    battery_v_before: float | None
    battery_v_after: float | None
    safe_gains_restored: Annotated[
        bool | None,
        Field(description="whether the safe gains were read back afterwards; null if nothing was reported about them"),
    ]


class GroupBrief(Schema):
    """The valid flights of one gain set: their mean and its standard error, from the scatter pooled over the campaign;
    null while that is not known."""

    mean: float
    standard_error: float | None
    n: int


class TrialComparison(Schema):
    """The flight's gains compared with those of another one, each with all their flights. `difference` is this − other.
    `confidence` is that of the likelier direction; 90 % or more decides. `confidence` and `standard_error` are null
    while the scatter of flights is not known."""

    against: Literal["best before", "first"]
    trial_number: int
    verdict: Verdict
    confidence: float | None
    difference: float
    standard_error: float | None


class TrialFacts(Schema):
    """What the database, the API and a bundle all tell of a trial."""

    number: int
    state: TrialState
    kind: TrialKind
    gains: Gains
    read_back: Gains | None
    error: float | None
    predicted_error: float | None
    overshoot_m: float | None
    rise_time_s: Annotated[float | None, Field(description="from 10 to 90 % of the set point; null if never reached")]
    settling_time_s: Annotated[
        float | None,
        Field(description="from the command until the output stays within ±5 % of the set point; null if it does not"),
    ]
    steady_state_error_m: Annotated[
        float | None, Field(description="mean of output − set point over the last 5 s of the window")
    ]
    reason: Annotated[str, Field(description="reason for the state, for people; empty if there is none")]
    end: Annotated[FlightEnd | None, Field(description="how its last flight ended; null before the first")]
    abort_cause: Annotated[
        AbortCause | None,
        Field(
            description="abort cause: `limit` and `behaved badly` count against the gains, `operator` (no reason "
            "given) and `something else` do not; null if the flight was not aborted or the cause was not "
            "recorded"
        ),
    ]
    note: str
    overrule_reason: Annotated[str, Field(description="why the gate's refusal was overruled; empty if it was not")]
    repaired_error: Annotated[
        float | None, Field(description="error with the glitches replaced by straight lines; null without glitches")
    ]
    seed: int
    settings: Annotated[
        dict[str, OptionValue], Field(description="settings that the vehicle reported after the flight")
    ]
    created_at: AwareDatetime
    flown_at: AwareDatetime | None


class Trial(TrialFacts):
    """One flight of one policy. `error` is the performance measure; lower is better."""

    id: int
    version: int
    campaign_id: int
    proposal_id: int | None
    predicted_interval: Interval | None
    inside_interval: Annotated[
        bool | None, Field(description="whether a valid flight's error was inside the predicted interval")
    ]
    group: Annotated[GroupBrief | None, Field(description="all valid flights of the same gains; null before the first")]
    comparisons: list[TrialComparison]
    verdict: Annotated[
        str, Field(description="comparison of the flight with the best before it and with its prediction")
    ]
    given_reason: Annotated[
        str, Field(description="the reason if a person or an import gave it; empty if it follows from `end`")
    ]
    gate: Gate
    glitches: Annotated[list[Glitch], Field(description="implausible parts of the record; the record is not changed")]
    record: RecordBrief | None
    may_be_valid: Annotated[
        bool, Field(description="whether its record covers the scored window, so that it can be marked valid")
    ]
    flight: FlightBrief | None
    speed: float | None
    actions: Annotated[list[str], Field(description="allowed actions: fly, cancel, abort, upload, …")]


class Trajectory(Schema):
    """A flight's record, thinned to the requested number of points; every channel has as many values as `time_s`."""

    trial_id: int
    source: str
    clock: str
    checksum: str
    samples: Annotated[int, Field(description="samples of the stored record, before thinning")]
    units: dict[str, str]
    time_s: list[float]
    channels: dict[str, list[float]]
