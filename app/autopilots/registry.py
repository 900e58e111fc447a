"""Registry of the autopilots."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from app.autopilots.ardupilot.profile import ARDUPILOT
from app.autopilots.autopilot import Autopilot
from app.autopilots.paparazzi.profile import PAPARAZZI
from app.autopilots.px4.profile import PX4

AUTOPILOTS: Final[Mapping[str, Autopilot]] = MappingProxyType(
    {autopilot.name: autopilot for autopilot in (PAPARAZZI, ARDUPILOT, PX4)}
)
"""The default first."""
