"""The experiments there are."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from app.core.errors import InputError, Problem
from app.core.experiments.base import Experiment
from app.core.experiments.takeoff import Takeoff

_ALL: Final[tuple[Experiment, ...]] = (Takeoff(),)

EXPERIMENTS: Final[Mapping[str, Experiment]] = MappingProxyType({experiment.name: experiment for experiment in _ALL})


def get_experiment(name: str) -> Experiment:
    """Raises InputError when there is no experiment of that name."""
    if name not in EXPERIMENTS:
        raise InputError(
            "There is no such experiment.",
            hint=f"Choose one of: {', '.join(EXPERIMENTS)}.",
            problems=(Problem("experiment", f"unknown name {name!r}"),),
        )
    return EXPERIMENTS[name]
