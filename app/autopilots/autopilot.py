"""What is known of one autopilot: gains on board and which values may be written, modes, requirements, how its messages
are read, and what is sent to it."""

import math
import struct
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Final, Literal

from app.autopilots import commands, mavlink
from app.autopilots.commands import Action, Ask, MessageRequest, Outgoing, Setting, Step, Target
from app.autopilots.dialects import Dialect, Message
from app.autopilots.measurements import Measurement, VehicleEvent
from app.autopilots.parameter_file import NAMES_AND_VALUES, ParameterFormat
from app.core.errors import GainlineError, GainsError, Problem
from app.core.experiments.base import Experiment
from app.core.policy import Gain, Gains, shortened

ReferenceSource = Literal["replica", "error", "target"]
"""Source of an autopilot's own reference: the replica of its loop computes it; it sends its altitude error; it is the
position target, which it sends."""


class AutopilotError(GainlineError):
    """A vehicle cannot be flown by what is known of its autopilot."""


@dataclass(frozen=True, slots=True)
class GainParameter:
    """A gain by its name here and on the vehicle, the range of values that may be written (autopilots accept any), and
    the `factor` from the gain to the vehicle's value. `whole`: the vehicle keeps only the integer part. `integrates`:
    writing it may clear an integrator, so it is sent last in flight."""

    gain: str
    parameter: str
    lower: float
    upper: float
    factor: float = 1.0
    whole: bool = False
    integrates: bool = False

    def sent(self, value: float) -> float:
        """Return the value to send, in single precision."""
        sent = value * self.factor
        return float(struct.unpack("<f", struct.pack("<f", sent))[0]) if math.isfinite(sent) else sent

    def read(self, wire: float, requested: float | None = None) -> float:
        """Return the gain for a value of the vehicle, to the seven digits of single precision; exactly `requested` if
        the value is the one sent for it."""
        if self.whole:
            return int(wire)
        return (
            requested if requested is not None and wire == self.sent(requested) else float(f"{wire / self.factor:.7g}")
        )

    def logged(self, value: float) -> float:
        """Return the gain for a value in a log: as it is there, or if it has a factor to seven digits."""
        return value if self.factor == 1.0 else self.read(value)

    def refusal(self, value: float) -> str | None:
        """Return why this value may not be written, or None if it may."""
        if not self.lower <= value <= self.upper:
            return f"must be between {self.lower:g} and {self.upper:g}, got {shortened(value)}"
        return f"must be a whole number of counts, got {value:g}" if self.whole and value != int(value) else None


GainSet = tuple[GainParameter, ...]


_SAME: Final[Mapping[str, tuple[str, float]]] = MappingProxyType({})


def on_board(gains: Sequence[Gain], *, integrating: str, names: Mapping[str, tuple[str, float]] = _SAME) -> GainSet:
    """Return the gains of an experiment, with its ranges, as parameters of a release. `names`: those that have another
    name on board, and the factor to their value there. `integrating`: the one that clears an integrator."""
    return tuple(
        GainParameter(
            gain.name, parameter, gain.lower, gain.upper, factor, gain.integer, integrates=gain.name == integrating
        )
        for gain in gains
        for parameter, factor in (names.get(gain.name, (gain.name, 1.0)),)
    )


@dataclass(frozen=True, slots=True)
class Requirement:
    """Part of a failsafe that must be enabled before a flight: a parameter with one of these values, or else at least
    `least`, by default above zero, at most `most`, and with all of these `bits`; or, if there are any `clear_bits`,
    without these. `what`: these values, with their effect in brackets. `newer_name`: the parameter's name in newer
    releases. `may_lack`: older releases lack it, and what it sets."""

    parameter: str
    what: str
    values: frozenset[float] = frozenset()
    bits: int = 0
    clear_bits: int = 0
    least: float = math.ulp(0.0)
    most: float = math.inf
    newer_name: str = ""
    may_lack: bool = False

    def is_met(self, value: float) -> bool:
        if self.values:
            return value in self.values
        if self.clear_bits:
            return not int(value) & self.clear_bits
        return self.least <= value <= self.most and int(value) & self.bits == self.bits


@dataclass(frozen=True, slots=True)
class ModeParameter:
    """Parameter that holds the vehicle's mode: `flying` is its value in flight, `modes` are others, named as in
    Heartbeat."""

    name: str
    flying: float
    modes: Mapping[float, str]


@dataclass(frozen=True, slots=True)
class HoverLimits:
    """Least and largest hover throttle that a loop can find in flight, and that in words; they follow from `parameter`,
    which may be at most `most`."""

    low: float
    high: float
    words: str
    parameter: str
    most: float


class ArmingChecks:
    """Latest results of a vehicle's own arming checks by its events; these are of one that reports them as status texts
    alone."""

    @property
    def arming_modes(self) -> frozenset[str]:
        """Modes in which it may arm; none without results."""
        return frozenset()

    def take(self, event: VehicleEvent) -> None:
        """Note an event."""

    def failing(self, _mode: str) -> tuple[str, ...]:
        """Return the components that prevent arming in this mode."""
        return ()


@dataclass(frozen=True, slots=True)
class ChecksRequest:
    """Command to run the arming checks and send the results as events, of which the last has the number `last`."""

    command: int
    last: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Autopilot:
    """One autopilot as data and pure functions: it decides what is sent, not when. The defaults are those of autopilots
    that fly by modes, without a flight plan in blocks, and execute Land and the command that stops the motors in every
    mode."""

    name: str
    title: str
    project: str = ""
    """Its project, of which logs may be of other vehicles too, if that has another name."""
    experiments: tuple[Experiment, ...]
    """Experiments that tune its gains, the default first."""
    dialect: Dialect
    autopilot: int
    """MAV_AUTOPILOT in its heartbeats."""
    label: str
    """Title where vehicles are registered, with the vehicle that usually has it."""
    address: str = "udpin:127.0.0.1:14550"
    """Usual address of a vehicle."""
    simulated_address: str = "udpin:127.0.0.1:14550"
    """Usual address of a simulated one."""
    sends_to_port: bool = False
    """Whether it sends to a fixed port of this computer, which an address over UDP must name."""
    heartbeat_s: float = 1.0
    lift_off_s: float
    """Time after the takeoff command for which it may still stand on the ground."""
    land_again_s: float = 1.0
    """Interval at which Land may be repeated, if every command restarts the landing: the time that the landing takes on
    the ground to end."""
    climbs_from_ground: bool = True
    """Whether the altitude commanded is above the place of takeoff, rather than above the autopilot's origin."""
    reference: ReferenceSource
    """Where its own reference comes from."""

    flying_modes: frozenset[str]
    following_modes: frozenset[str]
    """Modes that it may be in once it follows set points."""
    hovering_modes: frozenset[str] = frozenset()
    """Flying modes that it enters after the climb; none if it climbs and hovers in one mode."""
    landing_modes: frozenset[str]
    automatic_modes: frozenset[str]
    """Modes in which it flies by itself. In any other, known or not, a pilot flies it."""
    mode_names: Mapping[str, str]
    """Display names of its modes by their names in `Heartbeat`; others are displayed by those."""
    modes_without_land: Mapping[str, str] = field(default_factory=dict)
    """Modes in which it does not execute Land, with a description of its behaviour in them."""
    mode_parameter: ModeParameter | None = None
    """Its mode as a parameter, if its heartbeats do not distinguish all modes."""

    arming_blocks: frozenset[str] = frozenset()
    """Blocks of its flight plan, if it has one, in which it stands on the ground before the takeoff."""
    ground_blocks: tuple[str, ...] = ()
    """Blocks of its flight plan that set its ground reference, in order: it passes through them by itself, and the
    reference is set once it enters the last; none if arming sets the reference."""
    flying_blocks: frozenset[str] = frozenset()
    landing_blocks: frozenset[str] = frozenset()
    landed_blocks: frozenset[str] = frozenset()
    """Those of them that it enters once it has landed."""

    gain_sets: tuple[GainSet, ...]
    """The gains by their names in the releases of the autopilot, newest last; in the order of its experiment."""
    logs_own_names: bool = False
    """Whether recordings have the gains by their names here, rather than by those of the releases."""
    sends_integers_bytewise: bool = False
    """Whether the value of an integer parameter is its four bytes, in place of a float."""
    parameter_component: int = 1
    """Component that a PARAM_SET names, by default that of autopilots. Some vehicles, such as MAVSDK's, ignore one to
    all components (0)."""
    loop_parameters: tuple[tuple[str, ...], ...] = ()
    """Parameters of its vertical loop for each of `gain_sets`, which are kept with a flight with several set points.
    None if the replica of its loop has no parameters but its gains."""
    parameter_file: ParameterFormat = NAMES_AND_VALUES
    """How gains are written into a file for it."""
    further_gains: tuple[str, ...] = ()
    """Gains beside those that its experiments tune, and those of other releases, from the outer loops to the inner."""
    self_written: str = r"\Z.\A"
    """Names, as a pattern, of parameters that it writes by itself; by default none."""
    in_names_of: Callable[[Mapping[str, float], Collection[str]], Mapping[str, float]] = lambda values, _own: values
    """Returns parameters by the names and in the units of a release that has these names."""
    may_lack: frozenset[str] = frozenset()
    """Those of them that some releases lack, whose replica then has their default."""
    hover_limits: Callable[[Mapping[str, float]], HoverLimits | None] = lambda _parameters: None
    """Returns what its loop can find in flight with these parameters of it; None without limits: it keeps to what it is
    told or has learned. Raises AutopilotError for a parameter out of its range."""

    requirements: tuple[Requirement, ...] = ()
    set_point_requirements: tuple[Requirement, ...] = ()
    """Further requirements of flights with several set points."""
    stop_settings: tuple[str, ...] = ()
    """Settings that stop the motors, by their names in the releases; none if a command always does."""
    takeoff_parameter: str = ""
    """Parameter for the altitude of a takeoff; none if the command contains it."""
    set_point_settings: tuple[Setting, ...] = ()
    """Parameters required for a flight with several set points."""

    readers: mavlink.Readers
    """How its messages are read."""
    telemetry: tuple[MessageRequest, ...] = ()
    """Messages asked for, without lasting changes."""
    set_point_telemetry: tuple[MessageRequest, ...] = ()
    """Further ones for a flight with several set points."""
    sends_hardware_id: bool = True
    """Whether the id that it sends with its version is that of its board."""
    reports_version: bool = True
    """Whether it replies to a request for its version; otherwise it sends that unrequested, or never."""
    arming_checks: Callable[[], ArmingChecks] = ArmingChecks
    checks: ChecksRequest | None = None
    """None if unsupported: failed checks are then reported as status texts."""

    steps: Callable[[Action, Target], tuple[Step, ...]]
    """Returns the steps of an action. Raises KeyError if it needs a block of the flight plan that the target lacks."""
    holds_first: bool = True
    """Whether it must hold its first set point by position targets (`Action.HOLD`) before it flies to others."""
    needs_stream: bool = False
    """Whether it must receive its position target all the time while it follows set points."""
    armable_mode: tuple[float, ...] = ()
    """Mode, by its parameters of a command, that it must be switched to from all automatic ones but `hovering_modes`,
    and from a pilot's mode in which it reports that it does not arm; none if arming begins with its mode."""
    explore: Callable[[Ask, Target], Mapping[str, int]] = lambda _ask, _target: {}
    """Returns the blocks of the flight plan, if there is one. Raises AutopilotError if a required one is missing."""
    conclude: Callable[[Target], tuple[Outgoing, ...]] = lambda _target: ()
    """Returns the messages that end an exploration, successful or not."""
    refer_to_ground: Callable[[Target], tuple[Step, ...]] = lambda _target: ()
    """Returns the steps by which its flight plan sets the ground reference anew; none if the plan cannot."""

    @property
    def logged_gains(self) -> tuple[GainSet, ...]:
        """The gains by their names in recordings."""
        if not self.logs_own_names:
            return self.gain_sets
        return tuple(tuple(replace(gain, parameter=gain.gain) for gain in gains) for gains in self.gain_sets)

    def measure(self, message: Message) -> Measurement | None:
        """Read a message; None if it contains no measurement."""
        return mavlink.read(self.readers, message)

    def prepare(self, target: Target, telemetry_hz: float) -> tuple[Step, ...]:
        """Return the steps that request telemetry, positions at this rate."""
        return tuple(each.step(target, telemetry_hz) for each in self.telemetry)

    def make_armable(self, target: Target, mode: str, *, may_arm: bool | None) -> tuple[Step, ...]:
        """Return the steps out of a mode in which it does not arm; none for other modes. `may_arm` is what it reports,
        None if nothing."""
        leaves = mode not in self.hovering_modes if mode in self.automatic_modes else may_arm is False
        step = Step((commands.set_mode(target, *self.armable_mode),), awaits="command 176", needed=False)
        return (step,) if self.armable_mode and leaves else ()

    def take_off_settings(self, target: Target) -> tuple[Setting, ...]:
        """Return the parameters required for a takeoff to the altitude of `target`."""
        return (Setting(self.takeoff_parameter, target.altitude_m),) if self.takeoff_parameter else ()

    def stream(self, target: Target) -> tuple[Outgoing, ...]:
        """Return the messages that it must receive all the time while it follows set points."""
        return (commands.position_target(target),) if self.needs_stream else ()

    def set_parameter(self, target: Target, parameter: str, value: float) -> Outgoing:
        """Return the message that sets a floating-point parameter, the type of all gains."""
        return commands.set_parameter(target, parameter, value, component=self.parameter_component)


def check_gains(gains: Gains, gain_set: GainSet) -> dict[str, float]:
    """Return the gains, complete and in order. Raises GainsError for those that may not be written, because autopilots
    do not check."""
    refusals = {gain.gain: gain.refusal for gain in gain_set}
    require_accepted(gains, refusals, "These gains may not be written to the vehicle.", ", each within its range")
    return {gain.gain: int(gains[gain.gain]) if gain.whole else float(gains[gain.gain]) for gain in gain_set}


def require_accepted(
    gains: Gains, refusals: Mapping[str, Callable[[float], str | None]], happened: str, needed: str
) -> None:
    """Raise GainsError that names every unknown or missing gain, and each whose value has a refusal by its name;
    `needed` ends the sentence that asks for accepted values."""
    problems = [Problem(f"gains.{name}", "is not a gain of this vehicle") for name in gains if name not in refusals]
    for name, refusal in refusals.items():
        reason = refusal(gains[name]) if name in gains else "is missing"
        if reason is not None:
            problems.append(Problem(f"gains.{name}", reason))
    if problems:
        raise GainsError(happened, problems=tuple(problems), hint=f"Send {', '.join(refusals)}{needed}.")
