"""The models that are fitted to flights, and what the flights tell of the vehicle."""

from collections.abc import Sequence
from typing import Final

from app.core.definition import Flight
from app.core.errors import InputError
from app.core.experiments.altitude_steps import AltitudeSteps
from app.core.experiments.base import Experiment, ModelledExperiment, ParameterDistribution, prior_distribution
from app.core.experiments.copter_steps import CopterSteps
from app.core.experiments.takeoff import Takeoff
from app.core.tuning.copter_model import CopterModel
from app.core.tuning.vertical_model import StepsModel, TakeoffModel

CampaignModel = TakeoffModel | StepsModel | CopterModel
"""A model of one vehicle, fitted to a campaign's flights, as the strategy `calibrated` takes it."""

CALIBRATED: Final = (Takeoff, AltitudeSteps)
"""Experiments the parameters of whose model are found by `app.core.tuning.calibration`."""
FITTED: Final = (*CALIBRATED, CopterSteps)
"""Experiments whose model is fitted to flights."""


def fit(experiment: ModelledExperiment, flights: Sequence[Flight]) -> CampaignModel:
    """The model of these flights; at least one must be valid.

    Raises TypeError for an experiment whose model is not fitted, and TrajectoryError if a record does not suffice.
    """
    if isinstance(experiment, Takeoff):
        return TakeoffModel(experiment, flights)
    if isinstance(experiment, AltitudeSteps):
        return StepsModel(experiment, flights)
    if isinstance(experiment, CopterSteps):
        return CopterModel(experiment, flights)
    raise TypeError(f"calibrated does not work with {experiment.name}")


def known_distribution(experiment: Experiment, flights: Sequence[Flight]) -> ParameterDistribution:
    """Distribution of the vehicle's parameters: the data sheet's until a flight is valid, then that of the fit.

    Experiments without a fit, and flights that do not suffice for one, use the data sheet; without a model the
    distribution is empty.
    """
    if not isinstance(experiment, FITTED) or all(flight.error is None for flight in flights):
        return prior_distribution(experiment)
    try:
        return fit(experiment, flights).spread
    except InputError:
        return prior_distribution(experiment)


def as_flown(
    experiment: ModelledExperiment, flights: Sequence[Flight], donor: Flight | None = None
) -> ModelledExperiment:
    """The experiment with the autopilot's parameters of the last flight that recorded any on which its model depends;
    before the first of these, with those of the donor's flight, whose vehicle is of the same kind."""
    all_flights = flights if donor is None else (donor, *flights)
    recorded = [own for flight in all_flights if (own := experiment.loop_parameters(flight.parameters))]
    return experiment.under(recorded[-1]) if recorded else experiment


def changed_parameters(experiment: ModelledExperiment, flights: Sequence[Flight]) -> str:
    """A sentence that names the autopilot's parameters beside the gains that differ, in three digits, from those of the
    first valid flight that recorded them; empty if none do."""
    recorded = [
        (flight.number, own)
        for flight in flights
        if flight.outcome == "valid" and (own := experiment.loop_parameters(flight.parameters))
    ]
    if not recorded:
        return ""
    (first, before), *later = recorded
    changed = {
        name: f"{name} was {before[name]:g} in flight {first} and {own[name]:g} in flight {number}"
        for number, own in later
        for name in before
        if name in own and name not in experiment.space.names and f"{own[name]:.3g}" != f"{before[name]:.3g}"
    }
    if not changed:
        return ""
    return f"The errors are compared as if only the gains had changed, but {', '.join(changed.values())}."
