"""MAVSDK, an independent ground station, against the simulated PX4 and ArduPilot.

Its time-outs are seconds of this computer's clock; the drones live faster.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import pytest
from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action.action import Action, ActionError
from mavsdk.plugins.info.info import Info, InfoError
from mavsdk.plugins.param.param import Param
from mavsdk.plugins.telemetry.telemetry import Telemetry

from app.core.clock import ScaledClock
from tests.ports import free_port
from tests.simdrone.ground import served
from tests.waiting import eventually

SPEED = 5.0


@dataclass
class Station:
    """MAVSDK's plugins for one vehicle; it has no types."""

    param: Any
    action: Any
    telemetry: Any

    def height_m(self) -> float:
        height: float = self.telemetry.position().relative_altitude_m
        return height

    def is_armed(self) -> bool:
        return bool(self.telemetry.armed())


@contextmanager
def station(autopilot: str) -> Iterator[Station]:
    port = free_port()
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    try:
        mavsdk.add_any_connection(f"udpin://127.0.0.1:{port}")
        with served(autopilot, f"udp:127.0.0.1:{port}", clock=ScaledClock(SPEED)):
            eventually(lambda: any(system.has_autopilot() for system in mavsdk.get_systems()))
            system = next(system for system in mavsdk.get_systems() if system.has_autopilot())
            info = Info(system)
            eventually(lambda: knows(info))
            telemetry = Telemetry(system)
            telemetry.set_rate_position(4.0)  # an ArduPilot tells nothing unasked
            yield Station(Param(system), Action(system), telemetry)
    finally:
        mavsdk.destroy()


def knows(info: Any) -> bool:
    """Whether MAVSDK has learnt whose manners the vehicle has: what it sends before may be in another's."""
    try:
        info.get_version()
    except InfoError:
        return False
    return True


@pytest.mark.parametrize(
    ("autopilot", "gain", "whole"), [("px4", "MPC_Z_P", "NAV_DLL_ACT"), ("ardupilot", "PSC_POSZ_P", "FS_GCS_ENABLE")]
)
def test_mavsdk_sets_and_reads_parameters_of_both_kinds(autopilot: str, gain: str, whole: str) -> None:
    with station(autopilot) as ground:
        ground.param.set_param_float(gain, 1.25)
        ground.param.set_param_int(whole, 3)
        assert ground.param.get_param_float(gain) == 1.25
        assert ground.param.get_param_int(whole) == 3
        listed = ground.param.get_all_params()
    assert gain in [each.name for each in listed.float_params]
    assert whole in [each.name for each in listed.int_params]


@pytest.mark.complete
@pytest.mark.parametrize("autopilot", ["px4", "ardupilot"])
def test_mavsdk_flies_a_whole_flight(autopilot: str) -> None:
    with station(autopilot) as ground:
        ground.action.set_takeoff_altitude(3.0)
        eventually(lambda: armed_by(ground))
        ground.action.takeoff()
        eventually(lambda: ground.height_m() > 2.8)
        with pytest.raises(ActionError):
            ground.action.disarm()
        assert ground.is_armed()
        ground.action.land()
        eventually(lambda: not ground.is_armed())
        assert ground.height_m() == pytest.approx(0.0, abs=0.05)


def armed_by(ground: Station) -> bool:
    """It refuses until it knows where it is."""
    try:
        ground.action.arm()
    except ActionError:
        return False
    return True
