"""Registry of strategies."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from app.core.strategies.base import Strategy
from app.core.strategies.calibrated import CALIBRATED
from app.core.strategies.gradient import GRADIENT
from app.core.strategies.identified import IDENTIFIED
from app.core.strategies.manual import MANUAL
from app.core.strategies.simplex import SIMPLEX

STRATEGIES: Final[Mapping[str, Strategy]] = MappingProxyType(
    {strategy.name: strategy for strategy in (CALIBRATED, GRADIENT, IDENTIFIED, SIMPLEX, MANUAL)}
)
