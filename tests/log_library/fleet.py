"""Telemetry logs of several vehicles."""

from dataclasses import replace
from typing import Final

from tests.logs.written_tlog import GROUND_STATION, Recording, together

HOVERS: Final = Recording(every=12, set_points=((0.0, 5.0),), lasts_s=20.0, sends=GROUND_STATION)
CLIMBS: Final = replace(HOVERS, set_points=((0.0, 5.0), (8.0, 6.0)))
FLEET: Final = together(HOVERS.content, replace(CLIMBS, system=7, kind=8).content)
"""A quadrotor, and a balloon that moves by more."""
