"""A trial walked through by hand: a machine, a clock, and a vehicle that says what the test wants."""

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field, replace
from functools import wraps
from typing import Any, ParamSpec, Self, TypeVar

from app.autopilots.commands import Action, Setting
from app.autopilots.measurements import (
    DISARMING,
    Battery,
    CommandReply,
    Heartbeat,
    LandedState,
    Measurement,
    Parameter,
    Position,
)
from app.autopilots.registry import AUTOPILOTS
from app.vehicles.mavlink.events import (
    ActionDone,
    Command,
    Event,
    GainsRestored,
    PacketReceived,
    PerformAction,
    RecordSample,
    RequestGain,
    SendGain,
    Tick,
)
from app.vehicles.mavlink.failures import RESPONSES, Outcome
from app.vehicles.mavlink.monitors.clock import WRAP_S
from app.vehicles.mavlink.observation import TrialObservation
from app.vehicles.mavlink.plan import Plan
from app.vehicles.mavlink.trial_machine import advance, begin
from app.vehicles.mavlink.trial_state import State, Trial

GROUND_M = 0.1
STEP_S = 0.02
_NOISE_M = 1e-9
"""An estimate is never the same twice."""
SAFE_GAINS = (Setting("gui_v_kp", 283.0), Setting("gui_v_kd", 82.0), Setting("gui_v_ki", 13.0))
AUTOPILOT = replace(
    AUTOPILOTS["paparazzi"],
    land_again_s=1.0,
    flying_modes=frozenset({"4"}),
    landing_modes=frozenset({"4"}),
    automatic_modes=frozenset({"0", "4", "8"}),
    mode_names={},
    modes_without_land={},
    mode_parameter=None,
    arming_blocks=frozenset(),
    flying_blocks=frozenset(),
    landing_blocks=frozenset(),
    landed_blocks=frozenset(),
    stop_settings=(),
)
"""Without a flight plan, and without a mode that cannot be told from its heartbeats."""
PLAN = Plan(
    autopilot=AUTOPILOT,
    safe_gains=SAFE_GAINS,
    ground_m=GROUND_M,
    set_point_m=3.0,
    record_s=8.0,
    min_battery_v=10.5,
)


def with_autopilot(plan: Plan = PLAN, **changes: Any) -> Plan:
    """The plan under an autopilot that differs by these."""
    return replace(plan, autopilot=replace(plan.autopilot, **changes))


@dataclass
class TrialDriver:
    """Feeds a trial at 50 Hz with what its vehicle does; `told` are the commands with the time of each."""

    plan: Plan = PLAN
    now_s: float = 100.0
    boot_s: float = 40.0
    altitude_m: float = GROUND_M
    climb_rate_m_s: float = 0.0
    climbed_m: float = 0.0
    north_m: float = 0.0
    armed: bool = False
    mode: str = "4"
    voltage_v: float = 12.4
    mute: bool = False
    frozen: bool = False
    blind: bool = False
    tempo: float = 1.0
    landed: bool | None = None
    """The landed state that it reports; None: the true one."""
    without_landed_state: bool = False
    heartless: bool = False
    deaf: bool = False
    told: list[tuple[float, Command]] = field(default_factory=list)
    states: list[State] = field(default_factory=list)
    steps: int = 0

    def __post_init__(self) -> None:
        here = Position(self.boot_s, self.altitude_m, 0.0)
        self._asked: list[str] = []
        self.trial: Trial
        watch = TrialObservation.begin(self.now_s, last=here, battery_v=self.voltage_v, stood_s=1.0)
        self.trial, commands = begin(self.plan, watch, self.now_s)
        self._note(commands)

    @property
    def state(self) -> State:
        return self.trial.state

    @property
    def outcome(self) -> Outcome | None:
        """How the trial and its vehicle end, by the table; None without a failure."""
        if self.state is State.QUARANTINE:
            return "quarantine"
        if self.trial.failure is None:
            return None
        known = RESPONSES[self.trial.failure].outcome
        return "invalid" if known == "quarantine" else known

    @property
    def actions(self) -> list[Action]:
        return [command.action for _, command in self.told if isinstance(command, PerformAction)]

    @property
    def gains_sent(self) -> list[Setting]:
        return [command.setting for _, command in self.told if isinstance(command, SendGain)]

    @property
    def kept(self) -> list[RecordSample]:
        return [command for _, command in self.told if isinstance(command, RecordSample)]

    def when(self, action: Action) -> list[float]:
        return [at_s for at_s, command in self.told if isinstance(command, PerformAction) and command.action is action]

    def copied(self) -> Self:
        """One that goes its own way from here."""
        other = copy(self)
        for name, value in vars(self).items():
            if isinstance(value, list):
                setattr(other, name, list(value))
        return other

    def give(self, event: Event) -> "TrialDriver":
        self.trial, commands = advance(self.trial, event)
        self._note(commands)
        return self

    def hear(self, measurement: Measurement | None) -> "TrialDriver":
        return self.give(PacketReceived(measurement, self.now_s))

    def pass_s(self, seconds: float) -> "TrialDriver":
        """Let time pass, the vehicle saying what it does; altitude follows the climb rate."""
        for _ in range(round(seconds / STEP_S)):
            self.steps += 1
            self.now_s += STEP_S
            self.boot_s += STEP_S * self.tempo * (not self.frozen)
            self.altitude_m += self.climb_rate_m_s * STEP_S
            self.climbed_m = max(self.climbed_m + self.climb_rate_m_s * STEP_S, 0.0)
            if not self.mute:
                self._speak()
                self._reply()
            self.give(Tick(self.now_s))
        return self

    def does(self, for_s: float, **changes: object) -> Self:
        """Let it do this from now on, for so long."""
        for name, value in changes.items():
            assert hasattr(self, name)
            setattr(self, name, value)
        self.pass_s(for_s)
        return self

    def _speak(self) -> None:
        estimated_m = self.altitude_m + _NOISE_M * (self.steps % 2)
        here = Position(round(self.boot_s % WRAP_S, 6), estimated_m, self.climb_rate_m_s, self.north_m)
        self.hear(None if self.blind else here)
        if not self.without_landed_state:
            self.hear(LandedState(self.climbed_m < 0.1 if self.landed is None else self.landed))
        if self.steps % 25 == 0 and not self.heartless:
            self.hear(Heartbeat(9, self.armed, self.mode))
        if self.steps % 50 == 0:
            self.hear(Battery(self.voltage_v))

    def _reply(self) -> None:
        """Reply to requests, which it has received unless it is deaf."""
        asked, self._asked = self._asked, []
        for parameter in () if self.deaf else asked:
            self.hear(Parameter(parameter, 1600.0))

    def _note(self, commands: tuple[Command, ...]) -> None:
        self._asked += [command.parameter for command in commands if isinstance(command, RequestGain)]
        self.told += [(self.now_s, command) for command in commands]
        if not self.states or self.states[-1] is not self.trial.state:
            self.states.append(self.trial.state)

    def through(self, state: State) -> "TrialDriver":
        """To the end of a state that it is in, or of the trial."""
        while self.state is state and not self.trial.is_over:
            self.pass_s(STEP_S)
        return self

    def climb(self, rate_m_s: float, *, for_s: float) -> "TrialDriver":
        """At this rate, and stay there."""
        self.climb_rate_m_s = rate_m_s
        self.pass_s(for_s)
        self.climb_rate_m_s = 0.0
        return self

    # ---- as a flight goes

    def report_armed(self) -> "TrialDriver":
        """To the first heartbeat that reports it."""
        self.give(ActionDone(Action.ARM, self.now_s))
        self.armed = True
        while self.state is State.ARM and self.trial.armed_s is None:
            self.pass_s(STEP_S)
        return self

    def arm(self) -> "TrialDriver":
        """To the takeoff command."""
        return self.report_armed().through(State.ARM)

    def lift_off(self) -> "TrialDriver":
        """Until it hovers at 3 m, on record."""
        return self.arm().climb(1.0, for_s=3.0 - GROUND_M)

    def land(self) -> "TrialDriver":
        """To the end of the record, and half a second of descent."""
        self.lift_off().through(State.RECORD)
        self.climb_rate_m_s = -0.8
        return self.pass_s(0.5)

    def touch_down(self) -> "TrialDriver":
        """Down from wherever it is, then at rest until something happens."""
        self.climb_rate_m_s = -0.8
        while self.altitude_m > GROUND_M + 0.02:
            self.pass_s(STEP_S)
        self.climb_rate_m_s = 0.0
        return self.through(self.state)

    def disarm(self) -> "TrialDriver":
        """From the landed vehicle to its gains being restored: it answers, and its next heartbeats agree."""
        self.hear(CommandReply(DISARMING, accepted=True))
        self.armed = False
        return self.pass_s(1.1)

    def restore(self, problem: str = "") -> "TrialDriver":
        return self.give(GainsRestored(self.now_s, problem))


Walk = ParamSpec("Walk")
Driver = TypeVar("Driver", bound=TrialDriver)


def once(make: Callable[Walk, Driver]) -> Callable[Walk, Driver]:
    """A walk to some state is made once for all tests, each of which gets a copy."""
    made: dict[object, Driver] = {}

    @wraps(make)
    def copied(*args: Walk.args, **kwargs: Walk.kwargs) -> Driver:
        where = (args, *kwargs.items())
        if where not in made:
            made[where] = make(*args, **kwargs)
        return made[where].copied()

    return copied
