"""Profiles of the supported autopilots."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from app.vehicles.mavlink.profiles.ardupilot import ArduPilot
from app.vehicles.mavlink.profiles.base import Profile
from app.vehicles.mavlink.profiles.paparazzi import Paparazzi
from app.vehicles.mavlink.profiles.px4 import Px4

_ALL: Final[tuple[Profile, ...]] = (Paparazzi(), ArduPilot(), Px4())

PROFILES: Final[Mapping[str, Profile]] = MappingProxyType({profile.name: profile for profile in _ALL})
