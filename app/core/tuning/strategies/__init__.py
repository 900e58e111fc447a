"""Registry of strategies."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from app.core.tuning.strategies.calibrated import CALIBRATED
from app.core.tuning.strategies.gradient import GRADIENT
from app.core.tuning.strategies.identified import IDENTIFIED
from app.core.tuning.strategies.manual import MANUAL
from app.core.tuning.strategies.simplex import SIMPLEX
from app.core.tuning.strategy import Strategy

STRATEGIES: Final[Mapping[str, Strategy]] = MappingProxyType(
    {strategy.name: strategy for strategy in (CALIBRATED, GRADIENT, IDENTIFIED, SIMPLEX, MANUAL)}
)
