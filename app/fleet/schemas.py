"""What a vehicle looks like from outside."""

from datetime import datetime
from typing import Annotated

from pydantic import BaseModel, Field

from app.fleet.states import VehicleState
from app.schemas import Gains, OptionValue, Reason, Request


class VehicleChoice(Request):
    """Which vehicle flies, and its settings; a setting left out has its default."""

    kind: Annotated[str, Field(max_length=40, examples=["jsbsim"])]
    options: dict[str, OptionValue] = Field(default_factory=dict)


class CampaignVehicle(BaseModel):
    """A campaign's vehicle with the campaign's settings of it."""

    id: int
    kind: str
    title: str
    is_real: bool
    can_fly: Annotated[bool, Field(description="false when flights are made elsewhere and uploaded")]
    state: VehicleState
    options: dict[str, OptionValue]


class Vehicle(BaseModel):
    """Something that can fly a trial. `concern` says why it is quarantined."""

    id: int
    kind: str
    title: str
    is_real: bool
    can_fly: bool
    state: VehicleState
    concern: str
    safe_gains: Gains
    actions: Annotated[list[str], Field(description="what may be done with it now: fly, release")]


class GivenGains(BaseModel):
    """One line of a vehicle's ledger: the gains it was asked to take, and those it said it had."""

    flight_id: int
    campaign_id: int
    trial_id: int
    asked: Gains
    read_back: Gains | None
    outcome: str
    asked_at: datetime | None


class Release(Request):
    """Who has looked at the vehicle, and found what."""

    statement: Reason
