"""Registry of strategies."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from app.core.experiments.base import Experiment
from app.core.tuning.strategies.calibrated import CALIBRATED
from app.core.tuning.strategies.gradient import GRADIENT
from app.core.tuning.strategies.identified import IDENTIFIED
from app.core.tuning.strategies.manual import MANUAL
from app.core.tuning.strategies.simplex import SIMPLEX
from app.core.tuning.strategy import Strategy

STRATEGIES: Final[Mapping[str, Strategy]] = MappingProxyType(
    {strategy.name: strategy for strategy in (CALIBRATED, GRADIENT, IDENTIFIED, SIMPLEX, MANUAL)}
)


def recommended_strategy(experiment: Experiment | None) -> str:
    """Name of the first strategy that works with the experiment; that of the takeoff without one."""
    fitting = (name for name, each in STRATEGIES.items() if experiment is not None and each.works_with(experiment))
    return next(fitting, CALIBRATED.name)
