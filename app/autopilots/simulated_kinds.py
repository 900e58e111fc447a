"""The simulated counterparts of the autopilots: `KINDS` in `simulated.py` of each one's folder."""

from collections.abc import Iterator, Mapping
from importlib import import_module
from types import MappingProxyType
from typing import Final

from app.autopilots.registry import AUTOPILOTS
from app.autopilots.simulated.body import SimulatedKind


def _kinds() -> Iterator[SimulatedKind]:
    for autopilot in AUTOPILOTS:
        yield from import_module(f"app.autopilots.{autopilot}.simulated").KINDS


SIMULATED: Final[Mapping[str, SimulatedKind]] = MappingProxyType({kind.name: kind for kind in _kinds()})
"""By name; of each autopilot the default first."""
