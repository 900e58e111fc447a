"""Registries of the autopilots and of the experiments: those of the autopilots, and one without any."""

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from itertools import chain, zip_longest
from types import MappingProxyType
from typing import Final

import numpy as np

from app.autopilots.ardupilot.profile import ARDUPILOT
from app.autopilots.autopilot import Autopilot
from app.autopilots.paparazzi.profile import PAPARAZZI
from app.autopilots.px4.profile import PX4
from app.core.definition import Definition, Flight, OptionValue
from app.core.errors import InputError, Problem
from app.core.experiments.base import Experiment, ModelledExperiment
from app.core.experiments.pitch_tracking import PitchTracking
from app.core.tuning.evidence import Evidence

AUTOPILOTS: Final[Mapping[str, Autopilot]] = MappingProxyType(
    {autopilot.name: autopilot for autopilot in (PAPARAZZI, ARDUPILOT, PX4)}
)
"""The default first."""

_DEFAULT, *_OTHERS = (autopilot.experiments for autopilot in AUTOPILOTS.values())

EXPERIMENTS: Final[Mapping[str, Experiment]] = MappingProxyType(
    {
        experiment.name: experiment
        for experiment in (*_DEFAULT, *chain(*zip_longest(*_OTHERS)), PitchTracking())
        if experiment is not None
    }
)
"""Those of the default autopilot first, then the others' by rank."""

TUNED: Final[Mapping[str, Autopilot]] = MappingProxyType(
    {experiment.name: autopilot for autopilot in AUTOPILOTS.values() for experiment in autopilot.experiments}
)
"""The autopilots whose gains experiments tune, by the names of these."""

REPLACEMENTS: Final[Mapping[str, str]] = MappingProxyType(
    {
        without_model.name: modelled.name
        for experiments in _OTHERS
        for without_model in experiments
        for modelled in experiments
        if not isinstance(without_model, ModelledExperiment) and isinstance(modelled, ModelledExperiment)
    }
)
"""Experiments that are not offered for new campaigns, and what replaces each: without a model nothing proposes gains.
Stored campaigns still fly them."""


def offered(experiments: Iterable[str]) -> list[str]:
    """Those of these experiments that a new campaign can have."""
    return [name for name in experiments if name not in REPLACEMENTS]


def get_experiment(name: str, options: Mapping[str, OptionValue] | None = None) -> Experiment:
    """Return an experiment with its settings, which must be free of problems; the same object for the same settings.

    Raises InputError for an unknown name.
    """
    if name not in EXPERIMENTS:
        raise InputError(
            "Unknown experiment.",
            hint=f"Choose one of: {', '.join(EXPERIMENTS)}.",
            problems=(Problem("experiment", f"unknown name {name!r}"),),
        )
    return _configured(name, tuple(sorted(options.items()))) if options else EXPERIMENTS[name]


@lru_cache
def _configured(name: str, options: tuple[tuple[str, OptionValue], ...]) -> Experiment:
    return EXPERIMENTS[name].configured(dict(options))


def experiment_of(definition: Definition) -> Experiment:
    """Return the experiment of a definition, configured as defined there; with the vehicle and the autopilot's
    parameters of the log that it starts from, if it does."""
    experiment = get_experiment(definition.experiment, definition.experiment_options)
    log = definition.start.log
    if log is None or not isinstance(experiment, ModelledExperiment):
        return experiment
    mean, deviation = np.array([log.vehicle[each.name] for each in experiment.model_parameters]).T
    return experiment.informed(mean, deviation).under(log.parameters)


def evidence_of(
    definition: Definition, flights: Sequence[Flight], *, donor: Flight | None = None, open_until_flight: int = 0
) -> Evidence[Experiment]:
    """The evidence of these flights, with the experiment of the definition."""
    return Evidence(
        definition=definition,
        experiment=experiment_of(definition),
        flights=flights,
        donor=donor,
        open_until_flight=open_until_flight,
    )
