"""The simulated counterparts of the autopilots."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from app.autopilots.ardupilot.simulated import KINDS as ARDUPILOT
from app.autopilots.paparazzi.simulated import KINDS as PAPARAZZI
from app.autopilots.px4.simulated import KINDS as PX4
from app.autopilots.simulated.body import SimulatedKind

SIMULATED: Final[Mapping[str, SimulatedKind]] = MappingProxyType(
    {kind.name: kind for kind in (*PAPARAZZI, *ARDUPILOT, *PX4)}
)
"""By name; of each autopilot the default first."""
