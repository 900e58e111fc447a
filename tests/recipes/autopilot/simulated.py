"""The simulated toy: a copter under a PID controller of its altitude."""

import math
from types import MappingProxyType
from typing import ClassVar, Final

from app.autopilots.dialects import COMMON
from app.autopilots.simulated.body import ACCEPTED, FAILED, TICK_S, Body
from app.autopilots.simulated.copter import Copter, copter_kind
from app.autopilots.simulated.copter_control import AltitudeController, Phase, SetPoint
from app.autopilots.simulated.copter_parameters import (
    Behaviour,
    FirmwareProfile,
    FlightMode,
    Reaction,
    real,
)

HOVER: Final = 0.62
CLIMB_M_S: Final = 1.0
SINK_M_S: Final = 0.7


class ToyController(AltitudeController):
    """A PID controller; its target moves at a steady speed."""

    def __init__(self, body: Body) -> None:
        super().__init__(body)
        self.gains = (0.0, 0.0, 0.0)
        self._goal_m = self._target_m = self._sum = self._throttle = 0.0

    def take_off(self, height_m: float) -> None:
        self.phase, self._goal_m = Phase.CLIMBING, height_m
        self._target_m = self._sum = 0.0

    def hold(self) -> None:
        if self.flies:
            self.phase, self._goal_m = Phase.HOLDING, self._body.altitude_m

    def begin_landing(self) -> None:
        self._goal_m = -math.inf

    def move_to(self, altitude_m: float) -> None:
        self._goal_m = altitude_m

    def run(self) -> float:
        if not self.flies:
            return 0.0
        step_m = max(min(self._goal_m - self._target_m, CLIMB_M_S * TICK_S), -SINK_M_S * TICK_S)
        self._target_m = max(self._target_m + step_m, -1.0)
        proportional, integral, derivative = self.gains
        self._sum += self.error_m * TICK_S
        demanded = HOVER + proportional * self.error_m + integral * self._sum - derivative * self._body.climb_rate_m_s
        self._throttle = min(max(demanded, 0.0), 1.0)
        return self._throttle

    @property
    def set_point(self) -> SetPoint:
        return SetPoint(self._goal_m)

    @property
    def error_m(self) -> float:
        return self._target_m - self._body.altitude_m

    @property
    def demand(self) -> float:
        return self._throttle


class Toy(Copter):
    """The toy from switching on."""

    firmware: ClassVar[FirmwareProfile] = FirmwareProfile(
        dialect=COMMON,
        autopilot=16,
        version=0x010000FF,
        parameters=(real("TOY_P", 0.1), real("TOY_I", 0.02), real("TOY_D", 0.2), real("TOY_IDLE", 10.0)),
        periods_s=MappingProxyType({"HEARTBEAT": 1.0}),
        streams=(),
        modes=(
            FlightMode("MANUAL", 1, 81),
            FlightMode("AUTO", 2, 89),
            FlightMode("LAND", 3, 89, Behaviour.LAND, may_arm=False),
        ),
        land="LAND",
        home="LAND",
        hold="AUTO",
        by_hand="MANUAL",
        automatic="AUTO",
        refused=FAILED,
        unready="",
        no_estimate="No position",
        not_armable="Not in this mode",
        not_landed="In the air",
        link_lost="Link lost",
        fence_breached="Too high",
        idle_limit="TOY_IDLE",
        ground_m=0.0,
    )
    controller: ToyController

    def __init__(self, body: Body, system: int) -> None:
        super().__init__(body, ToyController(body), system=system)

    def tune(self) -> None:
        self.controller.gains = (self.parameters["TOY_P"], self.parameters["TOY_I"], self.parameters["TOY_D"])

    def requested_mode(self, main: int, _sub: int) -> FlightMode | None:
        return next((mode for mode in self.firmware.modes if mode.custom_mode == main), None)

    def take_off(self, param7: float) -> int:
        if not self.armed or self.controller.flies:
            return FAILED
        self.climb(param7)
        return ACCEPTED

    def follow(self, target: SetPoint, _type_mask: int) -> None:
        self.controller.move_to(target.altitude_m)

    def link_loss(self) -> tuple[float, Reaction]:
        return 5.0, Reaction.LAND

    def fence(self) -> tuple[float, Reaction]:
        return 10.0, Reaction.LAND


KINDS: Final = (copter_kind("toy", "Toy", Toy, {}),)
