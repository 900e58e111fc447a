"""Commands sent to the vehicle without waiting: the steps of an action or a preparation, awaited and repeated; Land and
motors off outside a trial, repeated until telemetry confirms them.
"""

from itertools import takewhile
from typing import Final, Literal

from app.autopilots.commands import TARGET, Action, Step
from app.autopilots.measurements import CommandReply, Heartbeat, Measurement, Parameter, TargetAltitude
from app.vehicles.base import VehicleError
from app.vehicles.mavlink.events import ActionDone, ActionRefused, PacketReceived, confirms_motors_off
from app.vehicles.mavlink.failures import DESCENDING_M_S, NOT_DESCENDING, NOT_DESCENDING_AFTER_S, REPEAT_S, land_every_s
from app.vehicles.mavlink.radio import JUST_HEARD_S, AutopilotLink

STOPPING_S: Final = 5.0
"""Time for which the command to stop the motors is repeated; later, a pilot may be flying the vehicle."""
SINKING_S: Final = 1.0
"""Time of descent after which the vehicle counts as landing, longer than a gust."""
LANDED_WITHIN_S: Final = 20.0
"""Longer than a landing takes: a flight after a landing of this length was begun by somebody else."""
UNHEARD_S: Final = 60.0
"""Time for which a command is repeated to a vehicle of which nothing is received, after the worker's end."""
_SAME_TARGET_M: Final = 0.01

_Flown = Literal["by a pilot", "as in a trial", "otherwise"]
"""How a vehicle is flown, by its mode and block. A pilot flies it in every mode that is not known to be automatic."""


class CommandSequence:
    """Steps in progress: each begins when the previous one was acknowledged; no method waits. `description` names the
    steps in messages, by default by the action."""

    def __init__(self, action: Action, steps: tuple[Step, ...], radio: AutopilotLink, *, description: str = "") -> None:
        self._action, self._radio, self._description = action, radio, description or action
        self._steps = list(steps)
        self._sent_s: list[float] = []
        self._replied_s: float | None = None
        self._begun_s = radio.clock.now_s()
        self._send()

    def proceed(self, packets: list[PacketReceived]) -> ActionDone | ActionRefused | None:
        """Process packets and send the next messages; return the result once the sequence has ended. Packets received
        before the messages were sent are no replies to them."""
        for each in packets:
            if (
                self._steps
                and self._sent_s
                and each.now_s >= self._begun_s
                and (accepted := self._verdict(each.measurement)) is not None
            ):
                if not accepted and self._steps[0].needed:
                    return self._refused(each.measurement)
                self._replied_s = each.now_s
                self._next(each.now_s)
        now_s = self._radio.clock.now_s()
        while self._steps and not self._steps[0].awaits and now_s - self._begun_s >= self._steps[0].pause_s:
            self._next(now_s)
        if not self._steps:
            return ActionDone(self._action, now_s, tuple(self._sent_s), self._replied_s)
        return self._send_again(now_s)

    def _send_again(self, now_s: float) -> ActionRefused | None:
        """Send messages that were withheld until now, or that were not answered; return the result if they may not be
        repeated."""
        step = self._steps[0]
        if not self._sent_s:
            self._send()
        elif step.awaits and now_s - self._sent_s[-1] >= self._radio.reply_timeout_s:
            if len(self._sent_s) < step.attempts:
                self._send()
            elif not step.needed:
                self._next(now_s)
            elif step.attempts > 1:
                why = f"The vehicle did not reply to the command to {self._description}."
                return ActionRefused(self._action, why, self._radio.clock.now_s())
        return None

    def _verdict(self, measurement: Measurement | None) -> bool | None:
        """Return whether a reply accepts the step; None if it is not one to it, or a refusal that is not final."""
        step = self._steps[0]
        accepted = _verdict(step, measurement)
        is_final = not step.persists or len(self._sent_s) >= step.attempts
        return accepted if accepted or is_final else None

    def _next(self, replied_s: float) -> None:
        """Begin the next step. One that sends nothing awaits what follows the previous reply."""
        self._steps.pop(0)
        if self._steps:
            self._sent_s, self._replied_s = [], None
            self._begun_s = replied_s
            self._send()

    def _send(self) -> None:
        if self._steps and self._may_send(self._steps[0]):
            now_s = self._radio.clock.now_s()
            if self._steps[0].sends and not self._sent_s:
                self._begun_s = now_s
            self._sent_s.append(now_s)
            self._radio.send(*self._steps[0].sends)

    def _may_send(self, step: Step) -> bool:
        """Whether a heartbeat that has just arrived reports one of the modes in which the step may be sent: since an
        older one, a pilot may have taken over."""
        seen = self._radio.seen
        if not step.modes:
            return True
        is_new = self._radio.clock.now_s() - seen.heartbeat_s <= JUST_HEARD_S * self._radio.timeout_factor
        is_new = is_new and seen.heartbeat_s > self._radio.paused_until_s
        return is_new and seen.heartbeat is not None and seen.heartbeat.mode in step.modes

    def _refused(self, measurement: Measurement | None) -> ActionRefused:
        why = measurement.why if isinstance(measurement, CommandReply) else ""
        texts = f" Its messages: {' / '.join(self._radio.seen.status_texts)}." if self._radio.seen.status_texts else ""
        return ActionRefused(
            self._action, f"The vehicle refused to {self._description} ({why}).{texts}", self._radio.clock.now_s()
        )


def _verdict(step: Step, measurement: Measurement | None) -> bool | None:
    """Return whether a reply accepts the step; None if it is not a reply to it."""
    match measurement:
        case CommandReply(to=to, accepted=accepted) if to == step.awaits:
            return accepted
        case Parameter(name=name) if name == step.awaits:
            return True
        case Heartbeat(mode=mode) if f"mode {mode}" in (step.awaits, step.shown_by):
            return True
        case TargetAltitude(altitude_m=altitude_m) if step.awaits == TARGET:
            return True if abs(altitude_m - step.altitude_m) < _SAME_TARGET_M else None
        case _:
            return None


def set_up(radio: AutopilotLink, steps: tuple[Step, ...]) -> None:
    """Carry out steps on the ground and wait for them. Raises VehicleError if they are refused."""
    sequence = CommandSequence(Action.ARM, steps, radio, description="be set up")
    while (ended := sequence.proceed(radio.listen(radio.reply_timeout_s / 10.0))) is None:
        pass
    if isinstance(ended, ActionRefused):
        raise VehicleError(
            f"The vehicle could not be set up. {ended.why}", hint="Correct what it reports, then try again."
        )


class RepeatedCommand:
    """Land or motors off, sent again until telemetry confirms it.

    Motors off ends once the motors have stopped, or after some seconds. Land ends once the motors have stopped, a pilot
    flies the vehicle, or it has had the time to land; while the vehicle is landing, nothing is sent. `is_withheld`:
    it waits until two heartbeats agree that the vehicle is flown as in a trial. `has_stopped`: the vehicle has
    confirmed that its motors have stopped.
    """

    def __init__(
        self, radio: AutopilotLink, action: Action, *, by_person: bool = True, is_withheld: bool = False
    ) -> None:
        """Send the command, unless it `is_withheld`; if it is not `by_person`, wait while the newest heartbeat shows a
        manual mode. Raises VehicleError if it needs a block of the flight plan that is unknown."""
        self._radio, self.action = radio, action
        self._requested_s = radio.clock.now_s()
        self._answered = False
        self._flown: _Flown = "otherwise"
        self._flown_since_s = self._requested_s
        self._landing_since_s: float | None = None
        self.is_withheld = is_withheld
        self.is_over = self.has_stopped = False
        self._sent_s = float("-inf")
        if not is_withheld and (by_person or not self._is_in_pilots_mode()):
            self._send()

    @property
    def trouble(self) -> str:
        """Message that the vehicle does not land although commanded to; otherwise empty."""
        waits = self.action is Action.LAND and self._radio.clock.now_s() - self._requested_s > NOT_DESCENDING_AFTER_S
        is_done = self.is_withheld or self.is_over or self._landing_since_s is not None
        return NOT_DESCENDING if waits and not is_done else ""

    @property
    def is_unheard(self) -> bool:
        """Whether it was repeated for UNHEARD_S, of the vehicle's time, without a packet from the vehicle."""
        heard_s = self._radio.link.health.last_packet_s
        since_s = self._requested_s if heard_s is None else max(self._requested_s, heard_s)
        return self._radio.clock.now_s() - since_s >= UNHEARD_S

    def proceed(self, packets: list[PacketReceived]) -> None:
        """Process packets, and send the command again if it is due."""
        for each in packets:
            self._note(each)
        now_s = self._radio.clock.now_s()
        is_late = self.action is Action.KILL and now_s - self._requested_s > STOPPING_S
        self.has_stopped = self.has_stopped or self._has_stopped()
        self.is_over = self.is_over or is_late or self.has_stopped or self._has_landed(now_s)
        lands_every_s = land_every_s(now_s - self._requested_s, self._radio.profile.land_again_s)
        is_due = now_s - self._sent_s >= (lands_every_s if self.action is Action.LAND else REPEAT_S)
        held_up = self.is_withheld or self._landing_since_s is not None or self._may_be_by_hand(now_s)
        if is_due and not held_up and not self.is_over:
            self._send()

    def _is_in_pilots_mode(self) -> bool:
        heartbeat = self._radio.seen.heartbeat
        return heartbeat is not None and self._flown_by(heartbeat) == "by a pilot"

    def _flown_by(self, heartbeat: Heartbeat) -> _Flown:
        """Return how the vehicle is flown. A block that it entered before the link was opened is not known."""
        profile, block = self._radio.profile, self._radio.block
        if heartbeat.mode not in profile.automatic_modes:
            return "by a pilot"
        is_trials_mode = heartbeat.mode in profile.flying_modes | profile.following_modes | profile.landing_modes
        is_trials_block = not block or block in profile.flying_blocks | profile.landing_blocks
        return "as in a trial" if heartbeat.armed and is_trials_mode and is_trials_block else "otherwise"

    def _may_be_by_hand(self, now_s: float) -> bool:
        """Whether the newest heartbeat shows a manual mode and is not overdue: Land would override the pilot."""
        is_recent = now_s - self._radio.seen.heartbeat_s < self._radio.confirmation_s
        return self.action is Action.LAND and is_recent and self._is_in_pilots_mode()

    def _note(self, packet: PacketReceived) -> None:
        profile = self._radio.profile
        if self.action is Action.KILL:
            self._answered = self._answered or confirms_motors_off(packet.measurement, profile.stop_settings)
        elif isinstance(packet.measurement, Heartbeat):
            if (flown := self._flown_by(packet.measurement)) != self._flown:
                self._flown, self._flown_since_s = flown, packet.now_s
            elif packet.now_s - self._flown_since_s >= self._radio.confirmation_s:
                self.is_over = self.is_over or flown == "by a pilot"
                if self.is_withheld and flown == "as in a trial":
                    self.is_withheld, self._requested_s = False, packet.now_s

    def _send(self) -> None:
        """Send every message once, without waiting for a reply."""
        self._sent_s = self._radio.clock.now_s()
        try:
            steps = self._radio.profile.steps(self.action, self._radio.target)
        except KeyError as error:
            raise VehicleError(
                f"Gainline cannot command the vehicle to {self.action}: its flight plan listed no block {error}.",
                hint="Land it with the remote control or its own ground station.",
            ) from error
        for step in steps:
            self._radio.send(*step.sends)

    def _has_stopped(self) -> bool:
        """Whether the motors have stopped, by two heartbeats since the command, or by one and a reply."""
        seen = self._radio.seen
        if seen.heartbeat is None or seen.heartbeat_s <= self._requested_s:
            return False
        return not seen.heartbeat.armed and (self._answered or self._radio.is_disarmed)

    def _has_landed(self, now_s: float) -> bool:
        if not self._is_landing(now_s):
            self._landing_since_s = None
        elif self._landing_since_s is None:
            self._landing_since_s = now_s
        return self._landing_since_s is not None and now_s - self._landing_since_s >= LANDED_WITHIN_S

    def _is_landing(self, now_s: float) -> bool:
        """Whether the vehicle is landing, by the newest messages since the command; if it flies again, Land is sent."""
        if self.is_withheld or self.action is Action.KILL:
            return False
        seen, profile = self._radio.seen, self._radio.profile
        if seen.block_s > self._requested_s and self._radio.block in profile.landing_blocks:
            return True
        landing_modes = profile.landing_modes - profile.flying_modes
        if seen.heartbeat is not None and seen.heartbeat_s > self._requested_s and seen.heartbeat.mode in landing_modes:
            return True
        since_s = max(self._requested_s, now_s - SINKING_S)
        recent = [each for _, each in takewhile(lambda entry: entry[0] > since_s, reversed(seen.positions))]
        return (
            now_s - self._requested_s >= SINKING_S
            and len(recent) > 1
            and all(position.climb_rate_m_s < DESCENDING_M_S for position in recent)
        )
