"""What this installation offers (experiments, strategies, vehicles, presets), and its health."""

import math
from collections.abc import Iterator
from typing import Literal

from fastapi import APIRouter
from pydantic import Field

from app import __version__
from app.autopilots.registry import AUTOPILOTS, EXPERIMENTS, offered
from app.campaigns.campaign_files import preset_names, read_preset
from app.campaigns.schemas import NewCampaign
from app.common.schemas import OptionValue, Schema
from app.core.experiments.base import ModelledExperiment
from app.core.policy import Gain
from app.core.records.trajectory import CHANNEL_UNITS
from app.core.tuning.strategies import STRATEGIES
from app.fleet.service import is_registered_one_by_one
from app.vehicles.registry import VEHICLE_KINDS, get_kind
from app.web.dependencies import Live

router = APIRouter(prefix="/api", tags=["catalogue"])


class VehicleTrouble(Schema):
    vehicle_id: int
    trouble: str


class Health(Schema):
    """Health of the server. `vehicles_not_answering`: vehicles that commands do not reach, because the process that has
    their link does not answer."""

    status: Literal["ok"]
    version: str
    worker: Literal["running", "not answering", "absent"]
    vehicles_not_answering: list[VehicleTrouble]


class OptionInfo(Schema):
    """A setting of an experiment, a strategy or a vehicle: one of `choices`, or any value of the default's type within
    `lower` … `upper` where `choices` is empty."""

    name: str
    title: str
    label: str = Field(default="", description="the title without the help for entering a value; empty if it has none")
    unit: str = ""
    default: OptionValue
    choices: list[OptionValue] = Field(default=[])
    lower: float | None = None
    upper: float | None = None
    autopilots: list[str] = Field(default=[], description="the autopilots that have this option; empty: all")


class ExperimentInfo(Schema):
    """An experiment. `output` is the channel that is scored. Without a model there are no predictions, and gains are
    chosen by hand."""

    name: str
    title: str
    output: str
    output_unit: str
    error_unit: str
    has_model: bool
    gains: list[Gain]
    options: list[OptionInfo]


class StrategyInfo(Schema):
    """A strategy. `experiments` names those that it works with."""

    name: str
    title: str
    line: str
    options: list[OptionInfo]
    experiments: list[str]


class VehicleKindInfo(Schema):
    """A kind of vehicle. `can_fly` is false when flights are flown elsewhere and uploaded; `experiments` names those
    that it can fly. Vehicles of a kind that is `registered` are registered one by one and chosen by their id."""

    name: str
    title: str
    line: str
    is_real: bool
    can_fly: bool
    registered: bool
    experiments: list[str]
    options: list[OptionInfo]
    highest_set_point_m: float | None = Field(description="highest altitude that it is commanded to fly to; null: any")


class AutopilotInfo(Schema):
    """An autopilot over MAVLink."""

    name: str
    title: str
    label: str = Field(description="title with the vehicle that usually has it")
    experiments: list[str] = Field(description="those that tune its gains, the default first")
    address: str = Field(description="usual address of a vehicle")
    simulated_address: str = Field(description="usual address of a simulated one")


class PresetInfo(Schema):
    """A campaign that is ready to be created."""

    name: str
    title: str
    line: str
    campaign: NewCampaign


class Catalogue(Schema):
    experiments: list[ExperimentInfo]
    strategies: list[StrategyInfo]
    vehicle_kinds: list[VehicleKindInfo]
    autopilots: list[AutopilotInfo]
    presets: list[PresetInfo]


@router.get("/health")
async def get_health(live: Live) -> Health:
    """Whether the server answers, whether a worker is there to fly and compute, and whether commands reach every
    connected vehicle."""
    silent = live.hub.vehicles("not answering")
    return Health(
        status="ok",
        version=__version__,
        worker=live.worker,
        vehicles_not_answering=[VehicleTrouble(vehicle_id=each.vehicle_id, trouble=each.trouble) for each in silent],
    )


@router.get("/catalogue")
def get_catalogue() -> Catalogue:
    """Everything that a campaign can consist of."""
    return Catalogue(
        experiments=[
            ExperimentInfo.view_of(
                each,
                output_unit=CHANNEL_UNITS[each.output],
                has_model=isinstance(each, ModelledExperiment),
                gains=each.space.gains,
            )
            for each in EXPERIMENTS.values()
        ],
        strategies=[
            StrategyInfo.view_of(
                strategy, experiments=[each.name for each in EXPERIMENTS.values() if strategy.works_with(each)]
            )
            for strategy in STRATEGIES.values()
        ],
        vehicle_kinds=[
            VehicleKindInfo.view_of(
                kind,
                registered=is_registered_one_by_one(kind),
                experiments=offered(kind.experiments),
                highest_set_point_m=kind.highest_set_point_m if math.isfinite(kind.highest_set_point_m) else None,
            )
            for kind in VEHICLE_KINDS.values()
        ],
        autopilots=[
            AutopilotInfo.view_of(each, experiments=[own.name for own in each.experiments])
            for each in AUTOPILOTS.values()
        ],
        presets=list(_presets()),
    )


def _presets() -> Iterator[PresetInfo]:
    """Those whose vehicle is available without being registered first."""
    for name in preset_names():
        file = read_preset(name)
        if not is_registered_one_by_one(get_kind(file.vehicle.kind)):
            campaign = NewCampaign.model_validate(file.model_dump(exclude={"description", "gains"}))
            yield PresetInfo(name=name, title=file.name, line=file.description, campaign=campaign)
