"""The simulated counterparts of the autopilots: `KINDS` in `simulated.py` of each one's folder."""

from collections.abc import Mapping
from importlib import import_module
from types import MappingProxyType
from typing import Final

from app.autopilots.registry import AUTOPILOTS
from app.autopilots.simulated.body import SimulatedKind

SIMULATED: Final[Mapping[str, SimulatedKind]] = MappingProxyType(
    {
        kind.name: kind
        for autopilot in AUTOPILOTS
        for kind in import_module(f"app.autopilots.{autopilot}.simulated").KINDS
    }
)
"""By name; of each autopilot the default first."""
