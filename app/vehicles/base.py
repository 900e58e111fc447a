"""The seam between the program and anything that flies."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal, Protocol

from app.core.policy import Gains
from app.core.trajectory import Trajectory

OptionValue = bool | int | float | str
Ending = Literal["completed", "aborted", "invalid"]
"""aborted: cut short, a safety limit or a person; invalid: the measurement is no good, whatever the gains."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleOption:
    """One setting of a vehicle kind, with its unit, range and default."""

    name: str
    title: str
    unit: str
    default: OptionValue
    lower: float | None = None
    upper: float | None = None


@dataclass(frozen=True, slots=True)
class Sample:
    """Telemetry of one instant: seconds since the command, and the channels of a record that are worth watching, the
    scored one among them."""

    time_s: float
    channels: Mapping[str, float]

    def __getitem__(self, channel: str) -> float:
        return self.channels[channel]


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightOrder:
    """What one flight is to do.

    `seed` makes scatter repeatable: the same vehicle, gains and seed give the same flight. `speed` is simulated time
    over wall time (10.0: ten times as fast as life); None runs as fast as possible. Vehicles that own no time ignore
    it.
    """

    seed: int
    speed: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightRecord:
    """What a flight left: its full-rate trajectory, how it ended, and why when it was cut short."""

    trajectory: Trajectory
    ending: Ending
    reason: str = ""
    settings: Mapping[str, OptionValue] = field(default_factory=dict)


class Vehicle(Protocol):
    """One vehicle under this program's control, between `open_vehicle` and its exit.

    Nothing flies on gains that were not read back: `stage` writes and returns what the vehicle now holds.
    """

    @property
    def kind(self) -> str: ...
    @property
    def is_real(self) -> bool: ...
    @property
    def safe_gains(self) -> Gains: ...

    def stage(self, gains: Gains) -> dict[str, float]:
        """Write every gain and return what was read back."""
        ...

    def read_gains(self) -> dict[str, float]:
        """What the vehicle holds now."""
        ...

    def fly(
        self, order: FlightOrder, *, on_sample: Callable[[Sample], None], should_abort: Callable[[], str | None]
    ) -> FlightRecord:
        """Take off with the staged gains and record until the manoeuvre is over.

        `on_sample` gets telemetry at 50 Hz of vehicle time while it happens; `should_abort` is asked at least as often
        and returns the reason once an abort is wanted. Raises VehicleError when the flight could not be carried out.
        """
        ...

    def close(self) -> None: ...
