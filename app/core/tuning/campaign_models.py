"""Registry of the models that are fitted to flights, and what the flights tell of the vehicle."""

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Final

from app.core.definition import Flight
from app.core.errors import InputError, TrajectoryError
from app.core.experiments.base import Experiment, ModelledExperiment, ParameterDistribution, prior_distribution
from app.core.tuning.campaign_model import CampaignModel
from app.core.tuning.copter_model import fit_copter_steps
from app.core.tuning.vertical_model import fit_vertical

MODELS: Final[Mapping[str, Callable[[ModelledExperiment, Sequence[Flight]], CampaignModel]]] = MappingProxyType(
    {
        "takeoff": fit_vertical,
        "altitude-steps": fit_vertical,
        "altitude-steps-ardupilot": fit_copter_steps,
        "altitude-steps-px4": fit_copter_steps,
    }
)
"""By the name of the experiment; at least one flight must be valid."""


def is_calibrated(experiment: ModelledExperiment) -> bool:
    """Whether the parameters of its model are found by `app.core.tuning.calibration`."""
    return MODELS.get(experiment.name) is fit_vertical


def known_distribution(experiment: Experiment, flights: Sequence[Flight]) -> ParameterDistribution:
    """Distribution of the vehicle's parameters: the data sheet's until a flight is valid, then that of the fit.

    Experiments without a fit, and flights that do not suffice for one, use the data sheet; without a model the
    distribution is empty.
    """
    modelled = experiment.modelled
    if modelled is None or modelled.name not in MODELS or all(flight.error is None for flight in flights):
        return prior_distribution(experiment)
    try:
        return MODELS[modelled.name](modelled, flights).spread
    except (InputError, TrajectoryError):
        return prior_distribution(experiment)


def as_flown(
    experiment: ModelledExperiment, flights: Sequence[Flight], donor: Flight | None = None
) -> ModelledExperiment:
    """The experiment with the autopilot's parameters of the last flight that recorded any on which its model depends;
    before the first of these, with those of the donor's flight, whose vehicle is of the same kind."""
    all_flights = flights if donor is None else (donor, *flights)
    recorded = [own for flight in all_flights if (own := experiment.loop_parameters(flight.parameters))]
    return experiment.under(recorded[-1]) if recorded else experiment
