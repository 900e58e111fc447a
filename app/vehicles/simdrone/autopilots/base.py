"""What every autopilot of a simulated drone is to the drone around it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, Protocol, Self

from app.vehicles.mavlink.dialects import Dialect, FieldValue
from app.vehicles.simdrone.body import TICK_S

Fields = Mapping[str, FieldValue]

ARMED: Final = 128
"""The bit of HEARTBEAT.base_mode."""

# MAV_RESULT
ACCEPTED: Final = 0
TEMPORARILY_REJECTED: Final = 1
DENIED: Final = 2
UNSUPPORTED: Final = 3
FAILED: Final = 4


@dataclass(frozen=True, slots=True)
class OutgoingMessage:
    """A message on its way out, not yet packed. `counter` names the sequence counter that numbers it: Paparazzi has
    one for each of its source files. `system` is the sender's id where it is not the vehicle's own."""

    kind: str
    fields: Fields
    counter: str = ""
    system: int | None = None


class Autopilot(Protocol):
    """Flies its body, hears bytes and has letters to send; its time is counted in ticks since it was switched on."""

    dialect: Dialect
    system: int
    component: int
    refuses_arming: bool
    """A fault: arming is refused in this autopilot's own manner."""
    ignores_parameters: bool
    """A fault: PARAM_SET changes nothing and is not answered."""
    took_off: bool
    """Whether a takeoff was ever commanded."""

    @property
    def armed(self) -> bool: ...

    @property
    def is_by_hand(self) -> bool:
        """Whether a pilot flies it, and nobody has switched it out of that since."""
        ...

    def held(self, parameter: str) -> float:
        """What a parameter is now, whatever was said of it on the wire. Raises KeyError for an unknown name."""
        ...

    def receive(self, data: bytes) -> None:
        """Take in what the radio received."""
        ...

    def take_over(self) -> None:
        """A pilot switches to a mode of theirs, and holds it where it is."""
        ...

    def hand_back(self) -> None:
        """The pilot switches back to the mode in which it is told what to do."""
        ...

    def restore_persistent(self, before: Self) -> None:
        """Take over what outlives a reboot from itself as it was."""
        ...

    def tick(self) -> list[OutgoingMessage]:
        """Let one tick of TICK_S pass: answer what was heard, fly the body on, and return what is to be sent."""
        ...


@dataclass(slots=True)
class Timetable:
    """Telemetry at fixed periods, rounded down to whole ticks."""

    ticks: dict[str, int] = field(default_factory=dict)

    @classmethod
    def from_periods(cls, periods_s: Mapping[str, float]) -> "Timetable":
        table = cls()
        for kind, period_s in periods_s.items():
            table.set(kind, period_s)
        return table

    def set(self, kind: str, period_s: float) -> None:
        """From now on send `kind` every `period_s` seconds; 0 or less: never."""
        if period_s > 0.0:
            self.ticks[kind] = whole_ticks(period_s)
        else:
            self.ticks.pop(kind, None)

    def due(self, tick: int) -> list[str]:
        return [kind for kind, period in self.ticks.items() if tick % period == 0]


def whole_ticks(seconds: float) -> int:
    """At least one."""
    return max(int(seconds / TICK_S), 1)
