"""The body of a simulated drone, which persists between flights and falls if its motors stop in the air, and what the
autopilots that fly it share: their time, parameters and reports.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar, Final, NamedTuple, Protocol, Self

from app.autopilots.dialects import Dialect, FieldValue, Message, number, text
from app.autopilots.simulated.copter_parameters import Parameters
from app.core.control.vertical_guidance import RATE_HZ, THROTTLE

TICK_STEPS: Final = 2
"""Steps of the simulation between two updates of the autopilot's radio, timers and flight plan."""
TICK_S: Final = TICK_STEPS / RATE_HZ
FULL_BATTERY_V: Final = 11.1
_STANDS_BELOW_M: Final = 0.03
_STANDS_BELOW_M_S: Final = 0.1

_FULL_COMMAND: Final = 9600


class VerticalCommand(NamedTuple):
    """A command of the body's vertical loop, in its integers."""

    mode: int
    target: int
    kp: int = 0
    ki: int = 0
    kd: int = 0


MOTORS_OFF: Final = VerticalCommand(THROTTLE, 0)


def throttle_command(share: float) -> VerticalCommand:
    """Return a command of thrust as a share of full, for autopilots with their own loop."""
    return VerticalCommand(THROTTLE, round(min(max(share, 0.0), 1.0) * _FULL_COMMAND))


class Flight(Protocol):
    """A simulation of the body from its first thrust on."""

    def advance(self, steps: int, command: VerticalCommand) -> tuple[float, float, float, float]:
        """Return its altitude, m, climb rate, m/s, thrust and battery voltage after `steps` steps of 1/512 s."""

    def forget_error_sum(self) -> None: ...


Launch = Callable[[int], Flight]
"""Creates a flight, standing on the ground, from its seed."""


class Body:
    """The vehicle between power-on and power-off. Altitude is above the ground at its place.

    A flight begins with the first thrust and ends when the motors are off on the ground; the seed is incremented for
    every flight. Between flights nothing is computed.
    """

    def __init__(self, launch: Launch, *, seed: int) -> None:
        self._launch = launch
        self._seed = seed
        self._flight: Flight | None = None
        self.altitude_m = 0.0
        self.climb_rate_m_s = 0.0
        self.thrust = 0.0
        self.battery_v = FULL_BATTERY_V
        self.north_m = 0.0
        """Position relative to the place where it was switched on."""
        self.steered_m_s = self.wind_m_s = 0.0
        """Speeds north, by its autopilot and by the wind, while it is off the ground."""
        self.motors_dead = False
        """Fault: the motors do not turn."""

    @property
    def is_resting(self) -> bool:
        """Whether it is on the ground with its motors off."""
        return self._flight is None

    @property
    def stands(self) -> bool:
        """Whether it is on the ground, by height and speed."""
        return abs(self.altitude_m) < _STANDS_BELOW_M and abs(self.climb_rate_m_s) < _STANDS_BELOW_M_S

    @property
    def north_m_s(self) -> float:
        return 0.0 if self.is_resting or self.stands else self.steered_m_s + self.wind_m_s

    def advance(self, steps: int, command: VerticalCommand) -> None:
        """Advance by `steps` steps of 1/512 s under `command`. Raises GainlineError if the simulation diverged."""
        if self.motors_dead:
            command = MOTORS_OFF
        wants_to_rest = command.mode == THROTTLE and command.target == 0
        if wants_to_rest and (self._flight is None or self.stands):
            self._flight = None
            self.altitude_m = self.climb_rate_m_s = self.thrust = 0.0
            self.battery_v = FULL_BATTERY_V
            return
        if self._flight is None:
            self._flight = self._launch(self._seed)
            self._seed += 1
        self.altitude_m, self.climb_rate_m_s, self.thrust, self.battery_v = self._flight.advance(steps, command)
        self.north_m += self.north_m_s * steps / RATE_HZ

    def forget_error_sum(self) -> None:
        """Empty the vertical loop's integrator."""
        if self._flight is not None:
            self._flight.forget_error_sum()


Fields = Mapping[str, FieldValue]

ARMED: Final = 128
"""Bit of HEARTBEAT.base_mode."""

# MAV_RESULT
ACCEPTED: Final = 0
TEMPORARILY_REJECTED: Final = 1
UNSUPPORTED: Final = 3
FAILED: Final = 4


@dataclass(frozen=True, slots=True)
class OutgoingMessage:
    """An outgoing message, not yet packed; fields that are not given are 0. `counter` names its sequence counter:
    Paparazzi has one for each of its source files. `system` is the sender's id if it is not the vehicle's own."""

    kind: str
    fields: Fields
    counter: str = ""
    system: int | None = None


class SimulatedAutopilot(ABC):
    """A simulated autopilot from switching on: it flies its body, receives bytes and returns messages to send. Its time
    is counted in ticks since then.

    Faults: with `refuses_arming` it refuses to arm in its own way, with `ignores_parameters` PARAM_SET changes nothing
    and has no reply. `took_off`: a takeoff has been commanded.
    """

    component: ClassVar[int]
    list_ticks: ClassVar[int]
    """Interval of the parameters in a list."""

    def __init__(
        self, body: Body, dialect: Dialect, parameters: Parameters, periods_s: Mapping[str, float], *, system: int
    ) -> None:
        """`periods_s` are those of the reports that it sends unrequested."""
        self.dialect = dialect
        self.system = system
        self.body = body
        self.parameters = parameters
        self.refuses_arming = self.ignores_parameters = self.took_off = self.armed = False
        self._codec = dialect.codec(system=system, component=self.component)
        self._ticks = 0
        self._listing: int | None = None
        self._every: dict[str, int] = {}
        self._out: list[OutgoingMessage] = []
        for kind, period_s in periods_s.items():
            self.report_every(kind, period_s)

    @property
    @abstractmethod
    def is_by_hand(self) -> bool:
        """Whether it is in the mode in which a pilot flies it."""

    @abstractmethod
    def receive(self, data: bytes) -> None:
        """Process bytes received by the radio."""

    @abstractmethod
    def take_over(self) -> None:
        """Switch to the pilot's mode, in which a pilot holds it in place."""

    @abstractmethod
    def hand_back(self) -> None:
        """Switch back from the pilot's mode to the automatic one."""

    @abstractmethod
    def kill(self) -> None:
        """Stop the motors, at any height, as another ground station commands."""

    @abstractmethod
    def fly_home(self) -> None:
        """Enter the mode in which it flies home by itself."""

    @abstractmethod
    def advance(self) -> None:
        """Process received messages, and fly the body for a tick."""

    @abstractmethod
    def report(self, due: list[str]) -> None:
        """Send these reports, and others that are due."""

    @abstractmethod
    def send_parameter(self, place: int) -> None:
        """Send the parameter at this place in the list."""

    def restore_persistent(self, _before: Self) -> None:  # noqa: B027 - not every autopilot keeps something
        """Copy what survives a reboot from the autopilot before it; nothing if its parameters are compiled in."""

    @property
    def boot_s(self) -> float:
        return self._ticks * TICK_S

    @property
    def boot_ms(self) -> int:
        return int(self.boot_s * 1000.0)

    def tick(self) -> list[OutgoingMessage]:
        """Advance by one tick of TICK_S; return the messages to send."""
        self._ticks += 1
        self.advance()
        if self._listing is not None and self._ticks % self.list_ticks == 0:
            self.send_parameter(self._listing)
            self._listing = self._listing + 1 if self._listing + 1 < len(self.parameters) else None
        self.report([kind for kind, ticks in self._every.items() if self._ticks % ticks == 0])
        out, self._out = self._out, []
        return out

    def report_every(self, kind: str, period_s: float) -> None:
        """Send a report every `period_s` seconds from now on, rounded down to whole ticks; never if 0 or less."""
        if period_s > 0.0:
            self._every[kind] = whole_ticks(period_s)
        else:
            self._every.pop(kind, None)

    def _send(self, kind: str, fields: Fields, counter: str = "") -> None:
        self._out.append(OutgoingMessage(kind, fields, counter))

    def _on_param_list(self, _message: Message) -> None:
        self._listing = 0

    def _on_param_read(self, message: Message) -> None:
        """Send a parameter; a request for an unknown one has no reply."""
        index = int(number(message, "param_index"))
        place = self.parameters.place(text(message, "param_id")) if index < 0 else index
        if place is not None:
            self.send_parameter(place)


def timed(now: SimulatedAutopilot) -> Fields:
    """Return a report of the time since the start alone: SYSTEM_TIME, or ATTITUDE, which is level."""
    return {"time_boot_ms": now.boot_ms}


def sender(message: Message) -> dict[str, int]:
    """Return the target of a reply."""
    return {"target_system": message.get_srcSystem(), "target_component": message.get_srcComponent()}


def whole_ticks(seconds: float) -> int:
    """Return the duration in whole ticks, at least one."""
    return max(int(seconds / TICK_S), 1)


Make = Callable[[Body, int], SimulatedAutopilot]


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedKind:
    """A simulated autopilot as it is chosen; `make(body, system)` creates one with default parameters, `set_up` with
    the failsafes enabled that are disabled by default, as before a first flight."""

    name: str
    title: str
    system: int
    """Default system id."""
    link: str
    """Default address of its link."""
    make: Make
    set_up: Make
