"""Registry of the simulated autopilots."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from app.autopilots import registry
from app.autopilots.simulated.body import SimulatedKind
from app.core.errors import InputError, Problem

AUTOPILOTS: Final[Mapping[str, SimulatedKind]] = MappingProxyType(
    {kind.name: kind for autopilot in registry.AUTOPILOTS.values() for kind in autopilot.simulated()}
)


def get_autopilot(name: str) -> SimulatedKind:
    """Return the autopilot of this name. Raises InputError if it is unknown."""
    if name not in AUTOPILOTS:
        raise InputError(
            "This simulated autopilot is unknown.",
            problems=(Problem("autopilot", f"must be one of {', '.join(AUTOPILOTS)}, got {name!r}"),),
            hint="gainline sim-drone --help lists them.",
        )
    return AUTOPILOTS[name]
