"""Where a trial is, as the wire and the drone's true height tell: nothing of the program's own state."""

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Final

from bench.hazards.wire import Order

LIFTED_M: Final = 0.15
RECORDED_S: Final = 32.9
_SILENT_S: Final = 0.9


class Stage(StrEnum):
    """The states of a trial, from the opening of the link to the safe gains read back."""

    CONNECT = "connect"
    PREFLIGHT = "preflight"
    SET_GAINS = "set gains"
    ARM = "arm"
    TAKEOFF = "take-off"
    RECORD = "record"
    LAND = "land"
    ABORT_LAND = "abort-land"
    LINK_LOST = "link lost"
    DISARM = "disarm"
    RESTORE = "restore"


AIR: Final = (Stage.TAKEOFF, Stage.RECORD)
DESCENT: Final = (Stage.LAND, Stage.ABORT_LAND, Stage.LINK_LOST)
_BEFORE_ARMING: Final = (Stage.CONNECT, Stage.PREFLIGHT, Stage.SET_GAINS)
_FLOWN: Final = (*AIR, *DESCENT)


@dataclass(slots=True)
class Stages:
    """The stages that a trial went through, with the drone's time of their beginning."""

    entered: list[tuple[Stage, float]] = field(default_factory=list)
    orders: list[tuple[float, Order]] = field(default_factory=list)
    over_s: float = float("inf")

    @property
    def now(self) -> Stage | None:
        return self.entered[-1][0] if self.entered else None

    def begin(self, now_s: float) -> None:
        """The ground opens its link."""
        self._enter(Stage.CONNECT, now_s)

    def first_s(self, stage: Stage) -> float | None:
        return next((since_s for each, since_s in self.entered if each is stage), None)

    def spans(self, *stages: Stage) -> list[tuple[float, float]]:
        """When the trial was in one of them."""
        ends = [since_s for _, since_s in self.entered[1:]] + [self.over_s]
        return [(since_s, end_s) for (each, since_s), end_s in zip(self.entered, ends, strict=True) if each in stages]

    def at(self, now_s: float) -> Stage | None:
        """Where the trial was then."""
        return next((each for each, since_s in reversed(self.entered) if since_s <= now_s), None)

    def ordered(self, order: Order) -> list[float]:
        return [at_s for at_s, each in self.orders if each is order]

    def height(self, height_m: float, now_s: float) -> None:
        if self.now is Stage.TAKEOFF and height_m > LIFTED_M:
            self._enter(Stage.RECORD, now_s)

    def hear(self, order: Order, now_s: float, *, armed: bool, height_m: float, silent_since_s: float | None) -> None:
        """An order reached the drone's antenna; `silent_since_s`: since when the ground has heard no heartbeat."""
        self.orders.append((now_s, order))
        following = self._following(order, now_s, armed=armed, height_m=height_m, silent_since_s=silent_since_s)
        if following is not None and following is not self.now:
            self._enter(following, now_s)

    def _enter(self, stage: Stage, now_s: float) -> None:
        self.entered.append((stage, now_s))

    def _following(  # noqa: PLR0911 - a line for each way on
        self, order: Order, now_s: float, *, armed: bool, height_m: float, silent_since_s: float | None
    ) -> Stage | None:
        now, flown = self.now, self.now in _FLOWN
        match order:
            case Order.ASK if now is Stage.CONNECT:
                return Stage.PREFLIGHT
            case Order.GAIN if now in _BEFORE_ARMING:
                return Stage.SET_GAINS
            case Order.GAIN if now is Stage.ARM or (now in (*DESCENT, Stage.DISARM) and not armed):
                return Stage.RESTORE
            case Order.GAIN if flown or (now is Stage.DISARM and height_m > LIFTED_M):
                return Stage.ABORT_LAND
            case Order.PREPARE_ARMING | Order.ARM if now in (Stage.PREFLIGHT, Stage.SET_GAINS):
                return Stage.ARM
            case Order.TAKE_OFF if now is Stage.ARM:
                return Stage.TAKEOFF
            case Order.LAND if flown or now is Stage.DISARM:
                return self._landing(now_s, silent_since_s)
            case Order.MOTORS_OFF if now is not Stage.RESTORE:
                return Stage.DISARM
            case _:
                return None

    def _landing(self, now_s: float, silent_since_s: float | None) -> Stage | None:
        if (
            silent_since_s is not None
            and now_s - silent_since_s > _SILENT_S
            and self.now not in (Stage.LAND, Stage.ABORT_LAND)
        ):
            return Stage.LINK_LOST
        commanded_s = self.first_s(Stage.TAKEOFF)
        if self.now in AIR:
            full = commanded_s is not None and now_s - commanded_s > RECORDED_S
            return Stage.LAND if full else Stage.ABORT_LAND
        return Stage.ABORT_LAND if self.now in (Stage.LINK_LOST, Stage.DISARM) else None
