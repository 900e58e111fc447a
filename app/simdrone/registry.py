"""Registry of the simulated autopilots."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from app.core.errors import InputError, Problem
from app.simdrone.ardupilot import ArduPilot, ArduPilot47
from app.simdrone.body import Autopilot, Body
from app.simdrone.copter import Copter
from app.simdrone.paparazzi import Paparazzi
from app.simdrone.paparazzi_plan import NEWER_KILL_SETTING
from app.simdrone.px4 import Px4

_ARDUPILOT_FAILSAFES: Final = {"FS_GCS_ENABLE": 5.0, "FENCE_ENABLE": 1.0, "FENCE_ACTION": 2.0, "FENCE_ALT_MAX": 10.0}
"""Land when the ground station is lost; stay inside the fence."""
_LAND: Final = 3.0
_LAND_WITHOUT_SET_POINTS: Final = 4.0
_LAND_AT_FENCE: Final = 5.0

Make = Callable[[Body, int], Autopilot]


@dataclass(frozen=True, slots=True, kw_only=True)
class AutopilotKind:
    """An autopilot of simulated drones; `make(body, system)` creates one with default parameters, `set_up` with the
    failsafes enabled that are disabled by default, as before a first flight."""

    name: str
    title: str
    system: int
    """Default system id."""
    link: str
    """Default address of its link."""
    make: Make
    set_up: Make


def _paparazzi(body: Body, system: int) -> Autopilot:
    return Paparazzi(body, system=system)


def _ardupilot(body: Body, system: int) -> Copter:
    return ArduPilot(body, system=system)


def _ardupilot_47(body: Body, system: int) -> Copter:
    return ArduPilot47(body, system=system)


def _with(make: Callable[[Body, int], Copter], **parameters: float) -> Make:
    """Return a factory of the same copter with these parameters set."""

    def switch_on(body: Body, system: int) -> Autopilot:
        copter = make(body, system)
        for name, value in parameters.items():
            copter.parameters[name] = value
        return copter

    return switch_on


def _px4(body: Body, system: int) -> Copter:
    return Px4(body, system=system)


def _bare_paparazzi(body: Body, system: int) -> Autopilot:
    return Paparazzi(body, system=system, tuned_telemetry=False)


def _paparazzi_510(body: Body, system: int) -> Autopilot:
    return Paparazzi(body, system=system, kill_setting=NEWER_KILL_SETTING)


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
                set_up=_paparazzi,
            ),
            AutopilotKind(
                name="paparazzi-bare",
                title="Paparazzi as built by default: position at 1.25 Hz",
                system=31,
                link="udp:127.0.0.1:4244@4245",
                make=_bare_paparazzi,
                set_up=_bare_paparazzi,
            ),
            AutopilotKind(
                name="paparazzi-5.10",
                title="Paparazzi of 2017, in which the setting that stops the throttle has another name",
                system=31,
                link="udp:127.0.0.1:4244@4245",
                make=_paparazzi_510,
                set_up=_paparazzi_510,
            ),
            AutopilotKind(
                name="ardupilot",
                title="ArduCopter up to 4.6",
                system=1,
                link="udp:127.0.0.1:14550",
                make=_ardupilot,
                set_up=_with(_ardupilot, **_ARDUPILOT_FAILSAFES),
            ),
            AutopilotKind(
                name="ardupilot-4.7",
                title="ArduCopter from 4.7 on",
                system=1,
                link="udp:127.0.0.1:14550",
                make=_ardupilot_47,
                set_up=_with(_ardupilot_47, **_ARDUPILOT_FAILSAFES),
            ),
            AutopilotKind(
                name="px4",
                title="PX4",
                system=1,
                link="udp:127.0.0.1:14550",
                make=_px4,
                set_up=_with(
                    _px4,
                    NAV_DLL_ACT=_LAND,
                    GF_ACTION=_LAND_AT_FENCE,
                    GF_MAX_VER_DIST=10.0,
                    COM_OBL_RC_ACT=_LAND_WITHOUT_SET_POINTS,
                ),
            ),
        )
    }
)


def get_autopilot(name: str) -> AutopilotKind:
    """Return the autopilot of this name. Raises InputError if it is unknown."""
    if name not in AUTOPILOTS:
        raise InputError(
            "This simulated autopilot is unknown.",
            problems=(Problem("autopilot", f"must be one of {', '.join(AUTOPILOTS)}, got {name!r}"),),
            hint="gainline sim-drone --help lists them.",
        )
    return AUTOPILOTS[name]
