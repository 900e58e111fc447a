"""API schemas of vehicles."""

from datetime import datetime
from typing import Annotated, Literal

from pydantic import Field

from app.common.schemas import Gains, Name, Number, OptionValue, Reason, Request, Schema, Shown, Version
from app.common.states import ActKind, ActState, VehicleState
from app.vehicles.base import CheckItem, Identity


class VehicleChoice(Request):
    """The vehicle of a campaign: a simulation by its kind with its settings, where an omitted one has its default, or a
    registered vehicle by its id, which has settings of its own."""

    kind: Annotated[str, Field(max_length=40, examples=["jsbsim"])]
    options: dict[str, OptionValue] = Field(default_factory=dict)
    id: Annotated[int | None, Field(ge=1, le=2**63 - 1, strict=True)] = None


class CampaignVehicle(Schema):
    """A campaign's vehicle with its settings: the campaign's own, or those that it is registered with."""

    id: int
    kind: str
    name: str
    title: str
    is_real: bool
    registered: bool
    can_fly: Annotated[bool, Field(description="false when flights are flown elsewhere and uploaded")]
    needs_staging: Annotated[
        bool, Field(description="true if a flight is staged first and its operator starts the takeoff")
    ]
    state: VehicleState
    options: dict[str, OptionValue]


class NewVehicle(Request):
    """A vehicle to register. Without `safe_gains` it has the experiment's default gains. For a real vehicle a person
    must confirm them (`safe_gains_confirmed`) and state it in `statement`."""

    name: Name
    kind: Annotated[str, Field(max_length=40, examples=["mavlink"])]
    options: dict[str, OptionValue] = Field(default_factory=dict)
    safe_gains: Annotated[dict[str, Number], Field(max_length=50)] | None = None
    safe_gains_confirmed: bool = False
    statement: Annotated[str, Field(max_length=500)] = ""


class VehicleEdit(Request):
    """Changes of a registered vehicle; omitted fields stay as they are. Options can change only while it is
    disconnected, and the next connection then pins the identity again; safe gains need a statement of who decided and
    why."""

    version: Version
    name: Name | None = None
    options: dict[str, OptionValue] | None = None
    battery: Annotated[str, Field(max_length=60), Shown] | None = None
    safe_gains: Annotated[dict[str, Number], Field(max_length=50)] | None = None
    statement: Reason | None = None


class Control(Schema):
    """The operator in control. Renewals are not published as events: load it again after `until` to see whether it has
    ended."""

    operator: str
    until: datetime


class Lease(Schema):
    """Control of a vehicle until then. Requests that need it send the token in the header X-Gainline-Control."""

    operator: str
    token: str
    until: datetime


class LeaseRequest(Request):
    """Take control, renew it with the token of your lease, or take over from another operator."""

    operator: Annotated[Name, Field(max_length=80)]
    take_over: bool = False
    token: Annotated[str, Field(max_length=100)] | None = None


class Vehicle(Schema):
    """Something that can fly a trial. `concern` states why it is quarantined; `held` are the gains that it reported at
    `held_at`. A simulation that is shared by campaigns is not `registered` and has no link."""

    id: int
    version: int
    kind: str
    name: str
    title: str
    is_real: bool
    can_fly: bool
    registered: bool
    state: VehicleState
    concern: str
    experiments: Annotated[list[str], Field(description="experiments that it can fly: those whose gains it has")]
    options: dict[str, OptionValue]
    identity: Identity | None
    safe_gains: Gains
    held: Gains | None
    held_at: datetime | None
    checks: list[CheckItem] | None
    checked_at: datetime | None
    battery: Annotated[str, Field(description="label of the installed battery; empty if not given")]
    control: Annotated[Control | None, Field(description="null while no operator is in control")]
    actions: Annotated[list[str], Field(description="allowed actions: fly, stage, connect, release, …")]


class VehicleAct(Schema):
    """A request to a vehicle: its operator, reason and outcome. `result` holds the items of a check, all parameters of
    the vehicle for `parameters`, or the `flight_id` of a command of a flight, whose outcome follows from the
    flight's."""

    id: int
    vehicle_id: int
    kind: ActKind
    state: ActState
    by: Annotated[str, Field(description="the operator in control; empty if there was none")]
    reason: str
    asked: Gains | None
    read_back: Gains | None
    result: dict[str, object] | None
    problem: Annotated[str, Field(description="why it failed; empty if it did not")]
    requested_at: datetime
    finished_at: datetime | None


class GivenGains(Schema):
    """One line of a vehicle's ledger: the gains that were sent to it, for what purpose, and those that it read back.

    Nothing is sent when a vehicle is connected for the first time: `asked` is empty, and `read_back` what was found.
    """

    purpose: Literal["flight", "restore after flight", "connect", "restore", "release"]
    flight_id: int | None
    campaign_id: int | None
    trial_id: int | None
    act_id: int | None
    asked: Gains
    read_back: Gains | None
    outcome: str
    asked_at: datetime | None


class Release(Request):
    """Statement of the person who inspected the vehicle, and of their findings."""

    statement: Reason


class VehicleOrder(Request):
    """Reason for landing the vehicle, or stopping its motors, now; without one, it is the operator's request."""

    reason: Annotated[str, Field(max_length=500)] = ""


class OrderAnswer(Schema):
    """`accepted` is true once the process that has the vehicle's link has forwarded the command; the effect appears in
    the vehicle's status. When it is false, `sentence` states why, and the command is not executed later."""

    accepted: bool
    sentence: str
