"""Execution of a trial: passes received packets and requests to the trial machine, and carries out its commands."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final, TypeVar

import numpy as np

from app.autopilots.commands import Action, Outgoing, read_parameter
from app.autopilots.measurements import Position
from app.vehicles.base import Sample, ShouldStop, VehicleError
from app.vehicles.flight_end import Requester, StopRequest
from app.vehicles.mavlink.events import (
    ActionRefused,
    Command,
    DuplicateVehicleDetected,
    Event,
    GainsRestored,
    PacketReceived,
    PerformAction,
    RecordSample,
    RequestGain,
    RestoreGains,
    SecondaryAltitudeReceived,
    SendGain,
    SetPointsPaused,
    StopRequested,
    Tick,
    WithdrawSetPoint,
)
from app.vehicles.mavlink.failures import NOT_DESCENDING, NOT_DESCENDING_AFTER_S
from app.vehicles.mavlink.observation import TrialObservation
from app.vehicles.mavlink.plan import Plan
from app.vehicles.mavlink.radio import AutopilotLink
from app.vehicles.mavlink.records import Reference, Scored, at_last_times, channels_of
from app.vehicles.mavlink.sent_commands import CommandSequence
from app.vehicles.mavlink.transports import LinkError
from app.vehicles.mavlink.trial_machine import advance, begin
from app.vehicles.mavlink.trial_state import LANDING, State

T = TypeVar("T")

LISTEN_S: Final = 0.01
"""Longest delay before the loop processes an abort."""
STREAM_EVERY_S: Final = 0.05
PAUSED_S: Final = 0.5
"""After a longer pause of the stream, the autopilot may have left its mode, and entered it again."""
SINKS_M: Final = 0.3
"""A vehicle that has descended by less than this in five seconds is not landing."""
STALL_S: Final = 0.2
"""After a stall of this program of this length, pending packets are received before silence is evaluated, wherever it
stalled."""
LONGEST_STALL_S: Final = 1.0
"""After a longer stall before the takeoff command, the request to fly may be out of date, so the flight is refused."""
_SAMPLE_EVERY_S: Final = 0.015
"""Minimum interval of live telemetry; records keep every sample."""


class TrialRunner:
    """One trial of a vehicle that stands disarmed on the ground with its gains confirmed.

    `restore` writes the safe gains, reads them back, and returns the problem, or an empty string. `look` returns the
    samples of the second source of altitude since the last call; `scored` is the source whose altitude is shown as the
    vehicle's in live telemetry; `reference` computes the autopilot's own reference, if it does not send it.

    Then it has flown: `trial` is its state, `samples` its record, `error` the first exception of the caller's
    functions. `offset_s` converts the vehicle's clock to ours, by the packet with the least latency.
    """

    def __init__(
        self,
        radio: AutopilotLink,
        plan: Plan,
        watch: TrialObservation,
        *,
        restore: Callable[[], str],
        on_sample: Callable[[Sample], None],
        should_stop: ShouldStop,
        scored: Scored,
        look: Callable[[], Sequence[SecondaryAltitudeReceived]],
        reference: Reference | None = None,
    ) -> None:
        self.reference = reference
        self._radio, self._restore, self._scored, self._look = radio, restore, scored, look
        self._loop = replace(radio.seen.loop)
        self.offset_s = float("inf")
        self._on_sample, self._should_stop = on_sample, should_stop
        self.samples: list[RecordSample] = []
        self._sequence: CommandSequence | None = None
        self._target = radio.target
        self._stream: tuple[Outgoing, ...] = ()
        self._streamed_s = float("-inf")
        self.error: BaseException | None = None
        self._shown_s = float("-inf")
        self._listened_s = self._sank_s = radio.clock.now_s()
        self._listens_first = False
        self._sank_to_m = float("inf")
        self.trial, self._begin_with = begin(plan, watch, radio.clock.now_s())

    @property
    def trouble(self) -> str:
        """Message that the vehicle does not land although commanded to; otherwise empty."""
        trial, now_s = self.trial, self._radio.clock.now_s()
        if trial.state not in LANDING or now_s - self._sank_s < NOT_DESCENDING_AFTER_S:
            return ""
        return NOT_DESCENDING if trial.watch.positions.is_airborne(now_s, trial.plan.ground_m) else ""

    def _note_sinking(self) -> None:
        """Note since when the vehicle has not descended by `SINKS_M`."""
        trial, altitude_m = self.trial, self.trial.watch.last.altitude_m
        if trial.state not in LANDING or altitude_m < self._sank_to_m - SINKS_M:
            self._sank_s, self._sank_to_m = self._radio.clock.now_s(), altitude_m

    def fly(self) -> None:
        """Run until the trial is over. Any exception, even one that would end the program, first lands the vehicle."""
        self._guarded(lambda: self._carry_out(self._begin_with, self._radio.clock.now_s()))
        while not self.trial.is_over:
            self._guarded(self._listen)
            self._guarded(self._evaluate)

    def _guarded(self, work: Callable[[], None]) -> None:
        try:
            work()
        except LinkError:  # counts as silence, which the trial machine detects
            self._radio.clock.wait_s(LISTEN_S)
            self._listened_s = self._radio.clock.now_s()
        except BaseException as error:  # noqa: BLE001 - kept for the caller; the vehicle comes first
            self.error = self.error or error

    def _kept(self, work: Callable[[], T]) -> T | None:
        """Result of a function of the caller; its exception is kept: the vehicle comes first."""
        try:
            return work()
        except BaseException as error:  # noqa: BLE001
            self.error = self.error or error
            return None

    def _listen(self) -> None:
        paused_s = self._keep_streaming()
        packets = self._radio.receive(LISTEN_S)
        now_s = self._radio.clock.now_s()
        stalled_s = now_s - self._listened_s
        if stalled_s > STALL_S:
            packets += self._radio.receive(LISTEN_S)
        self._listened_s = now_s
        if self.trial.state is State.ARM and stalled_s > LONGEST_STALL_S * self._radio.timeout_factor:
            why = f"Gainline stalled for {stalled_s:.0f} s, so the takeoff was not commanded."
            self._advance(ActionRefused(Action.ARM, why, now_s))
        for each in in_order(packets, self._look()):
            if isinstance(each, PacketReceived):  # each position gets the newest reports of the loop before it
                self._loop.note(each.measurement, each.now_s)
                if isinstance(each.measurement, Position):
                    self.offset_s = min(self.offset_s, each.now_s - each.measurement.time_boot_s)
            self._advance(each)
        if why := self._radio.link.duplicate_reason:
            self._advance(DuplicateVehicleDetected(why, self._radio.clock.now_s()))
        if paused_s and self._stream:  # a pilot who has taken over meanwhile has ended it
            self._advance(SetPointsPaused(paused_s, self._radio.clock.now_s()))
        if self._sequence is not None and (ended := self._sequence.proceed(packets)) is not None:
            self._sequence = None
            self._advance(ended)

    def _evaluate(self) -> None:
        if self.trial.state is State.RESTORE:  # an interruption ended the restoring, and no other event continues it
            self._advance(GainsRestored(self._radio.clock.now_s(), self._restored()))
        if (stop := self._wanted()) is not None:
            self._advance(StopRequested(stop, self._radio.clock.now_s()))
        now_s = self._radio.clock.now_s()
        self._listens_first = now_s - self._listened_s > STALL_S and not self._listens_first
        if not self._listens_first:
            self._advance(Tick(now_s))
        self._note_sinking()

    def _wanted(self) -> StopRequest | None:
        """Return the stop request. An internal error lands the vehicle; a request for motors off takes precedence."""
        stop = self._kept(self._should_stop)
        if self.error is None or (stop is not None and stop.motors_off):
            return stop
        words = f"internal error ({type(self.error).__name__}: {self.error})"
        if isinstance(self.error, KeyboardInterrupt):
            words = "interrupted from the keyboard"
        return StopRequest(words, by=Requester.INTERNAL_ERROR)

    def _advance(self, event: Event) -> None:
        before = self.trial.state
        self.trial, commands = advance(self.trial, event)
        if self.trial.state is not before:
            self._sequence, self._stream = None, ()  # the commands of the previous state are obsolete
        self._carry_out(commands, event.now_s)

    def _carry_out(self, commands: tuple[Command, ...], now_s: float) -> None:
        for command in commands:
            match command:
                case PerformAction():
                    self._perform(command)
                case WithdrawSetPoint():
                    self._sequence, self._stream = None, ()
                case SendGain(setting):
                    radio = self._radio
                    radio.send(radio.profile.set_parameter(radio.target, setting.parameter, setting.value))
                case RequestGain(parameter):
                    self._radio.send(read_parameter(self._radio.target, parameter))
                case RestoreGains():
                    self._advance(GainsRestored(self._radio.clock.now_s(), self._restored()))
                case RecordSample():
                    throttle, reference_m = self._loop.throttle_at(now_s), self._reference_m(command.position, now_s)
                    self._record_sample(replace(command, throttle=throttle, reference_m=reference_m))

    def _perform(self, command: PerformAction) -> None:
        action, (profile, target) = command.action, (self._radio.profile, self._radio.target)
        if command.altitude_m is not None:
            if action is Action.HOLD:  # all set points are flown where it hovers as it begins to hold the first
                last = self.trial.watch.last
                self._target = replace(self._target, north_m=last.north_m, east_m=last.east_m)
            target = self._target = replace(
                self._target, altitude_m=command.altitude_m, acceleration_m_s2=command.acceleration_m_s2
            )
            if not self._stream:
                self._streamed_s = self._radio.clock.now_s()
            self._stream = profile.stream(target)
        self._sequence = CommandSequence(action, profile.steps(action, target), self._radio)

    def _keep_streaming(self) -> float:
        """Send the set point again, if it is due: some autopilots leave the mode, and land, without a stream. Return
        how long none was sent, if that was too long: then none is sent any more; otherwise 0."""
        now_s = self._radio.clock.now_s()
        waited_s = now_s - self._streamed_s
        if not self._stream or waited_s < STREAM_EVERY_S:
            return 0.0
        if waited_s > PAUSED_S * self._radio.timeout_factor:
            return waited_s
        self._streamed_s = now_s
        self._radio.send(*self._stream)
        return 0.0

    def _reference_m(self, position: Position, now_s: float) -> float | None:
        """Return the autopilot's own reference at the time of receipt of a position, on the vehicle's datum; None if it
        is not known or needed."""
        trial = self.trial
        if len(trial.plan.set_points.times_s) == 1 or trial.commanded_boot_s is None:
            return None
        if self.reference is None:
            source = self._radio.profile.reference
            return self._loop.reference_at(source, position.altitude_m, now_s)
        time_s = np.array([position.time_boot_s - trial.commanded_boot_s])
        flown = at_last_times(trial.plan.takeoff, trial.set_points.changes)
        return float(self.reference(flown, time_s)[0]) + trial.plan.datum_m

    def _restored(self) -> str:
        try:
            return self._restore()
        except VehicleError as error:
            return str(error)
        except BaseException as error:  # noqa: BLE001 - kept for the caller; retried, because the gains come first
            self.error = self.error or error
            return self._restore()

    def _record_sample(self, sample: RecordSample) -> None:
        self.samples.append(sample)
        start_s = self.trial.commanded_boot_s
        if start_s is None or self.error is not None:
            return
        time_s = sample.position.time_boot_s - start_s
        if time_s >= 0.0 and time_s - self._shown_s >= _SAMPLE_EVERY_S:
            self._shown_s = time_s
            shown = Sample(time_s, channels_of(sample, self.trial.plan.datum_m, self._scored))
            self._kept(lambda: self._on_sample(shown))


def in_order(
    packets: Sequence[PacketReceived], samples: Sequence[SecondaryAltitudeReceived]
) -> list[PacketReceived | SecondaryAltitudeReceived]:
    """Return all events in the order of receipt, so that after a stall of this program old samples of the second source
    are not compared with newer positions of the vehicle."""
    return sorted((*packets, *samples), key=lambda event: event.now_s)
