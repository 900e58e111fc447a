"""The autopilots there are."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from app.core.errors import InputError, Problem
from app.vehicles.simdrone.autopilots.ardupilot import ArduPilot, ArduPilot47
from app.vehicles.simdrone.autopilots.base import Autopilot
from app.vehicles.simdrone.autopilots.paparazzi.autopilot import Paparazzi
from app.vehicles.simdrone.autopilots.px4 import Px4
from app.vehicles.simdrone.body import Body


@dataclass(frozen=True, slots=True, kw_only=True)
class AutopilotKind:
    """An autopilot that a simulated drone can have; `make(body, system)` switches one on."""

    name: str
    title: str
    system: int
    """Its system id unless another is asked for."""
    link: str
    """Where it speaks unless told otherwise."""
    make: Callable[[Body, int], Autopilot]


def _paparazzi(body: Body, system: int) -> Autopilot:
    return Paparazzi(body, system=system)


def _ardupilot(body: Body, system: int) -> Autopilot:
    return ArduPilot(body, system=system)


def _ardupilot_47(body: Body, system: int) -> Autopilot:
    return ArduPilot47(body, system=system)


def _px4(body: Body, system: int) -> Autopilot:
    return Px4(body, system=system)


def _bare_paparazzi(body: Body, system: int) -> Autopilot:
    return Paparazzi(body, system=system, tuned_telemetry=False)


AUTOPILOTS: Final[Mapping[str, AutopilotKind]] = MappingProxyType(
    {
        kind.name: kind
        for kind in (
            AutopilotKind(
                name="paparazzi",
                title="Paparazzi with a telemetry file for tuning",
                system=31,
                link="udp:127.0.0.1:4244@4245",
                make=_paparazzi,
            ),
            AutopilotKind(
                name="paparazzi-bare",
                title="Paparazzi as it is built by default: its position comes at 1.25 Hz",
                system=31,
                link="udp:127.0.0.1:4244@4245",
                make=_bare_paparazzi,
            ),
            AutopilotKind(
                name="ardupilot", title="ArduCopter up to 4.6", system=1, link="udp:127.0.0.1:14550", make=_ardupilot
            ),
            AutopilotKind(
                name="ardupilot-4.7",
                title="ArduCopter from 4.7 on",
                system=1,
                link="udp:127.0.0.1:14550",
                make=_ardupilot_47,
            ),
            AutopilotKind(name="px4", title="PX4", system=1, link="udp:127.0.0.1:14550", make=_px4),
        )
    }
)


def get_autopilot(name: str) -> AutopilotKind:
    """Raises InputError when there is none of that name."""
    if name not in AUTOPILOTS:
        raise InputError(
            "There is no such autopilot.",
            problems=(Problem("autopilot", f"must be one of {', '.join(AUTOPILOTS)}, got {name!r}"),),
            hint="gainline sim-drone --help lists them.",
        )
    return AUTOPILOTS[name]
