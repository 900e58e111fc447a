"""A vehicle that flies the reducer of a trial, and what a hazard may do to the messages between them."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from app.autopilots.commands import Action
from app.autopilots.measurements import DISARMING, CommandReply, Measurement, Parameter
from app.vehicles.mavlink.events import (
    ActionDone,
    Command,
    GainsRestored,
    PerformAction,
    RestoreGains,
    SecondaryAltitudeReceived,
    SendGain,
)
from bench.hazards.trial_states import LIFTED_M
from tests.vehicles.mavlink.walking import GROUND_M, STEP_S, TrialDriver

G_M_S2 = 9.81


@dataclass
class Flight(TrialDriver):
    """A vehicle that obeys, as far as its hazard lets it. `altitude_m` is the true one."""

    hazard: "Effect | None" = None
    has_second_source: bool = False
    wanted_m: float | None = None
    lands: bool = False
    late_s: float = 0.0
    obeys: bool = True
    lost_control: bool = False
    stops_m: list[float] = field(default_factory=list)
    due: list[tuple[float, Command]] = field(default_factory=list)

    @property
    def height_m(self) -> float:
        return self.altitude_m - GROUND_M

    def hear(self, measurement: Measurement | None) -> "Flight":
        arriving = [measurement] if self.hazard is None or measurement is None else self.hazard.change(measurement)
        for each in arriving:
            super().hear(each)
        return self

    def pass_s(self, seconds: float) -> "Flight":
        for _ in range(round(seconds / STEP_S)):
            self._carry_out()
            self._move()
            if self.hazard is not None:
                for each in self.hazard.insert():
                    TrialDriver.hear(self, each)
            super().pass_s(STEP_S)
            if self.has_second_source:
                self._see(self.altitude_m)
        return self

    def _see(self, altitude_m: float) -> None:
        seen_m, is_new = (altitude_m, True) if self.hazard is None else self.hazard.see(altitude_m)
        if seen_m is not None:
            self.give(SecondaryAltitudeReceived(seen_m, is_new=is_new, now_s=self.now_s))

    def _note(self, commands: tuple[Command, ...]) -> None:
        super()._note(commands)
        self.stops_m += [
            self.height_m
            for each in commands
            if isinstance(each, PerformAction) and each.action in (Action.MOTORS_OFF, Action.KILL)
        ]
        self.due += [(self.now_s + self.late_s, command) for command in commands]

    def _carry_out(self) -> None:
        arrived = [command for due_s, command in self.due if due_s <= self.now_s]
        self.due = [(due_s, command) for due_s, command in self.due if due_s > self.now_s]
        for command in arrived:
            match command:
                case RestoreGains():
                    self.give(GainsRestored(self.now_s))
                case PerformAction(action=action) if self.obeys:
                    self._obey(action)
                case SendGain(setting=setting) if self.obeys and not self.mute:
                    self.hear(Parameter(setting.parameter, setting.value))

    def _obey(self, action: Action) -> None:
        match action:
            case Action.ARM:
                self.armed = True
                self.give(ActionDone(Action.ARM, self.now_s))
            case Action.TAKE_OFF:
                self.wanted_m, self.lands = 3.0, False
            case Action.LAND:
                self.lands = True
            case Action.MOTORS_OFF | Action.KILL:
                self.armed, self.lost_control = False, self.height_m > LIFTED_M
                self.hear(CommandReply(DISARMING, accepted=True))

    def _move(self) -> None:
        """Climb or sink by at most 1 m/s to where it was told to; with its motors off in the air, fall."""
        if self.lost_control and self.height_m > 0.0:
            self.climb_rate_m_s = max(self.climb_rate_m_s - G_M_S2 * STEP_S, -self.height_m / STEP_S)
        elif self.lands:
            self.climb_rate_m_s = max(-0.8, min(0.0, -self.height_m / STEP_S))
        elif self.wanted_m is not None and self.armed:
            self.climb_rate_m_s = max(-1.0, min((self.wanted_m - self.altitude_m) / STEP_S, 1.0))
        else:
            self.climb_rate_m_s = 0.0


@dataclass
class Effect:
    """What a hazard does: to each message, beside them, and to the second source."""

    flight: Flight
    since_s: float = 0.0

    def begin(self) -> None:
        self.since_s = self.flight.now_s

    @property
    def lasted_s(self) -> float:
        return self.flight.now_s - self.since_s

    def change(self, measurement: Measurement) -> Iterable[Measurement]:
        return [measurement]

    def insert(self) -> Iterable[Measurement]:
        return ()

    def see(self, altitude_m: float) -> tuple[float | None, bool]:
        return altitude_m, True
