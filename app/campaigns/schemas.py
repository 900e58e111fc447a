"""What campaigns and proposals look like from outside."""

from datetime import datetime
from enum import StrEnum
from typing import Annotated, Literal

from pydantic import BaseModel, Field

from app.campaigns.states import CampaignState, Outcome
from app.core.strategies.base import Explanation, Kind
from app.fleet.schemas import CampaignVehicle, VehicleChoice
from app.schemas import Gains, Gate, Name, Number, OptionValue, Request, Text, Trouble, Version

Fraction = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=1)]
Key = Annotated[str, Field(max_length=40)]


class Sort(StrEnum):
    """Orders of the list of campaigns; `error` begins with the lowest best error."""

    NEWEST = "-created"
    OLDEST = "created"
    LATELY_CHANGED = "-updated"
    NAME = "name"
    BEST_ERROR = "error"


class Start(Request):
    """Where the first flight's gains come from; `gains` only with kind `given`."""

    kind: Literal["default", "simplex", "given"] = "default"
    gains: dict[str, Number] | None = None


class StopRule(Request):
    """`paper`: two flights in a row without `improvement` (a share of the best) on the best so far, or the budget;
    `budget`: only the number of flights ends the campaign."""

    kind: Literal["paper", "budget"] = "paper"
    max_flights: Annotated[int, Field(strict=True, ge=1, le=200)] = 7
    improvement: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=0.5)] = 0.05


class Definition(Request):
    """Everything that a proposal depends on, beside the flights. Frozen at the first flight.

    `bounds` narrow the experiment's own. `first_step_fraction` and `step_fraction` limit a gain's change as shares of
    its range, before and after the first valid flight.
    """

    experiment: Key = "takeoff"
    strategy: Key = "gradient"
    options: dict[str, OptionValue] = Field(default_factory=dict)
    start: Start = Field(default_factory=Start)
    bounds: dict[str, tuple[Number, Number]] = Field(default_factory=dict)
    first_step_fraction: Fraction = 0.25
    step_fraction: Fraction = 1.0
    stop: StopRule = Field(default_factory=StopRule)
    seed: Annotated[int, Field(strict=True, ge=0, le=2**53 - 1)] = 1


class NewCampaign(Request):
    """A campaign to be created; what is left out has a working default."""

    name: Name
    vehicle: VehicleChoice = Field(default_factory=lambda: VehicleChoice(kind="jsbsim"))
    definition: Definition = Field(default_factory=Definition)


class CampaignEdit(Request):
    """Changes of a campaign; what is left out stays. Definition and vehicle change only before the first flight."""

    version: Version
    name: Name | None = None
    definition: Definition | None = None
    vehicle: VehicleChoice | None = None


class Clone(Request):
    """A new campaign with the same definition, perhaps on another vehicle, linked to this one."""

    name: Name | None = None
    vehicle: VehicleChoice | None = None


class Finish(Request):
    """Why the operator ends the campaign."""

    reason: Text = "stopped by the operator"


class BestTrial(BaseModel):
    """The valid trial with the lowest error."""

    trial_id: int
    trial_number: int
    error: float
    gains: Gains


class FlyingTrial(BaseModel):
    """The trial whose flight is asked for or under way."""

    trial_id: int
    trial_number: int


class TrialCounts(BaseModel):
    """Trials by what became of them; `flown` are those with a record or a known end."""

    total: int
    flown: int
    valid: int
    aborted: int
    invalid: int
    lost: int


class Campaign(BaseModel):
    """One vehicle, one experiment, one strategy, and what came of it."""

    id: int
    version: int
    name: str
    state: CampaignState
    outcome: Outcome | None
    stop_reason: str
    definition: Definition
    definition_digest: Annotated[
        str | None, Field(description="SHA-256 of definition and vehicle, once they are frozen")
    ]
    vehicle: CampaignVehicle
    parent_id: int | None
    best: BestTrial | None
    trials: TrialCounts
    flying: FlyingTrial | None
    next_action: str
    actions: Annotated[list[str], Field(description="what may be done with it now: plan, define, finish, archive, …")]
    created_at: datetime
    updated_at: datetime


class SparkCurve(BaseModel):
    """One flight's scored output in a few points."""

    trial_number: int
    best: bool
    time_s: list[float]
    values: list[float]


class CampaignSummary(BaseModel):
    """A campaign as one card of the list. `spark` holds the first flight, the best and the latest, at most 7."""

    id: int
    name: str
    state: CampaignState
    outcome: Outcome | None
    vehicle: CampaignVehicle
    experiment: str
    strategy: str
    flights: int
    best: BestTrial | None
    first_error: float | None
    next_action: str
    spark: list[SparkCurve]
    updated_at: datetime


class GainChange(BaseModel):
    """One gain now (of the best flight, else of the vehicle's safe gains) and next."""

    now: int | float
    next: int | float
    delta: int | float


class StopVerdict(BaseModel):
    """Whether the campaign's own rule says that it is over, and why."""

    stop: bool
    reason: str
    sentence: str
    threshold: Annotated[float | None, Field(description="error that the next flight has to beat to count as better")]


class Proposal(BaseModel):
    """The next gain set, from one history. Stale as soon as that history has changed."""

    id: int
    campaign_id: int
    kind: Kind
    recommended: Literal["step", "repeat", "baseline", "stop"]
    gains: Gains
    changes: dict[str, GainChange]
    predicted_error: float | None
    explanation: Explanation
    gate: Gate
    stop_verdict: StopVerdict
    history_digest: str
    stale: bool
    computed_at: datetime


class NextFlight(BaseModel):
    """Where the next proposal stands. While a new one is computed, `proposal` may be the stale one before it."""

    state: Literal["computing", "ready", "failed", "none"]
    proposal: Proposal | None
    problem: Trouble | None
