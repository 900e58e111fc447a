"""What this installation offers: experiments, strategies, vehicles, presets; and whether it is well."""

from typing import Literal

from fastapi import APIRouter
from pydantic import BaseModel

from app import __version__
from app.api.deps import Live
from app.campaigns.files import preset_names, read_preset
from app.campaigns.schemas import NewCampaign
from app.core.experiments import EXPERIMENTS
from app.core.strategies import STRATEGIES
from app.schemas import OptionValue
from app.vehicles.open import VEHICLE_KINDS

router = APIRouter(prefix="/api", tags=["catalogue"])


class Health(BaseModel):
    status: Literal["ok"]
    version: str
    worker: Literal["running", "absent"]


class GainInfo(BaseModel):
    name: str
    title: str
    unit: str
    lower: float
    upper: float
    scale: float
    default: float
    integer: bool


class ExperimentInfo(BaseModel):
    """`output` is the channel that is scored."""

    name: str
    title: str
    output: str
    error_unit: str
    gains: list[GainInfo]


class StrategyOption(BaseModel):
    """`choices` is empty when any value of the default's type may be set."""

    name: str
    title: str
    default: OptionValue
    choices: list[OptionValue]


class StrategyInfo(BaseModel):
    name: str
    title: str
    line: str
    options: list[StrategyOption]


class VehicleOptionInfo(BaseModel):
    name: str
    title: str
    unit: str
    default: OptionValue
    lower: float | None
    upper: float | None


class VehicleKindInfo(BaseModel):
    """`can_fly` is false when flights are made elsewhere and uploaded."""

    name: str
    title: str
    line: str
    is_real: bool
    can_fly: bool
    options: list[VehicleOptionInfo]


class PresetInfo(BaseModel):
    """A campaign that is ready to be created."""

    name: str
    title: str
    line: str
    campaign: NewCampaign


class Catalogue(BaseModel):
    experiments: list[ExperimentInfo]
    strategies: list[StrategyInfo]
    vehicle_kinds: list[VehicleKindInfo]
    presets: list[PresetInfo]


@router.get("/health")
def get_health(live: Live) -> Health:
    """Whether the program answers, and whether a worker is there to fly and compute."""
    return Health(status="ok", version=__version__, worker="running" if live.worker_running else "absent")


@router.get("/catalogue")
def get_catalogue() -> Catalogue:
    """Everything that a campaign can be made of."""
    return Catalogue.model_validate(
        {
            "experiments": [
                {
                    "name": each.name,
                    "title": each.title,
                    "output": each.output,
                    "error_unit": each.error_unit,
                    "gains": each.space.gains,
                }
                for each in EXPERIMENTS.values()
            ],
            "strategies": list(STRATEGIES.values()),
            "vehicle_kinds": list(VEHICLE_KINDS.values()),
            "presets": [_preset(name) for name in preset_names()],
        },
        from_attributes=True,
    )


def _preset(name: str) -> PresetInfo:
    file = read_preset(name)
    return PresetInfo(
        name=name,
        title=file.name,
        line=file.description,
        campaign=NewCampaign.model_validate(file.model_dump(exclude={"description"})),
    )
