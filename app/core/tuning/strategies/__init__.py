"""Registry of strategies."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from app.core.experiments import EXPERIMENTS
from app.core.tuning.strategies.calibrated import CALIBRATED
from app.core.tuning.strategies.gradient import GRADIENT
from app.core.tuning.strategies.identified import IDENTIFIED
from app.core.tuning.strategies.manual import MANUAL
from app.core.tuning.strategies.simplex import SIMPLEX
from app.core.tuning.strategy import Strategy

STRATEGIES: Final[Mapping[str, Strategy]] = MappingProxyType(
    {strategy.name: strategy for strategy in (CALIBRATED, GRADIENT, IDENTIFIED, SIMPLEX, MANUAL)}
)


def recommended_strategy(experiment: str) -> str:
    """Name of the first strategy that works with the experiment; that of the takeoff if there is no such experiment."""
    known = EXPERIMENTS.get(experiment)
    return next(
        (name for name, each in STRATEGIES.items() if known is not None and each.works_with(known)), CALIBRATED.name
    )
