"""The gate of a campaign, applied to the flights of reproductions."""

from typing import Final

from app.core.definition import Definition
from app.core.experiments import get_experiment
from app.core.gate import GateResult, check_policy, require_flyable
from app.core.policy import Gains
from app.core.spread import prior_distribution
from app.studies.results import OVERRULE
from app.vehicles.open import get_kind

_CAMPAIGN: Final = Definition(experiment="takeoff", first_step_fraction=1.0)
"""The default campaign, without a step limit inside its bounds."""


def judge_takeoff(gains: Gains) -> GateResult:
    """Check a takeoff's gains as before the first flight. Takes a tenth of a second."""
    experiment = get_experiment(_CAMPAIGN.experiment)
    return check_policy(_CAMPAIGN, experiment, experiment.space, gains, (), spread=prior_distribution(experiment))


def overruled_for(gains: Gains, vehicle: str) -> str:
    """The reason for flying these gains on this kind of vehicle despite the gate's refusal; empty without a refusal.

    Raises GainsError if the refusal cannot be overruled.
    """
    return require_flyable(judge_takeoff(gains), overrule=OVERRULE, is_real=get_kind(vehicle).is_real)
