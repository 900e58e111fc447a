"""The gate of a campaign, held before the reproductions' flights too."""

from typing import Final

from app.core.definition import Definition
from app.core.experiments import get_experiment
from app.core.gate import GateResult, check_policy, require_flyable
from app.core.policy import Gains
from app.core.spread import prior_distribution
from app.studies.results import OVERRULE
from app.vehicles.open import get_kind

_CAMPAIGN: Final = Definition(experiment="takeoff", first_step_fraction=1.0)
"""The default campaign, free to step anywhere inside its bounds."""


def judge_takeoff(gains: Gains) -> GateResult:
    """The verdict on a takeoff's gains before anything has flown. Takes a tenth of a second."""
    experiment = get_experiment(_CAMPAIGN.experiment)
    return check_policy(_CAMPAIGN, experiment, experiment.space, gains, (), spread=prior_distribution(experiment))


def overruled_for(gains: Gains, vehicle: str) -> str:
    """Why these gains may fly on a vehicle of this kind although the gate refuses them; empty where it does not.

    Raises GainsError for gains that nobody can overrule the gate for.
    """
    return require_flyable(judge_takeoff(gains), overrule=OVERRULE, is_real=get_kind(vehicle).is_real)
