"""Steps of an action or a preparation: sent, awaited and repeated, without waiting."""

from typing import Final

from app.autopilots.commands import TARGET, Action, Step
from app.autopilots.measurements import CommandReply, Heartbeat, Measurement, Parameter, TargetAltitude
from app.vehicles.base import VehicleError
from app.vehicles.mavlink.events import ActionDone, ActionRefused, PacketReceived
from app.vehicles.mavlink.radio import JUST_HEARD_S, AutopilotLink

_SAME_TARGET_M: Final = 0.01


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
                return self._unanswered()
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

    def _unanswered(self) -> ActionRefused:
        why = f"The vehicle did not reply to the command to {self._description}."
        return ActionRefused(self._action, why, self._radio.clock.now_s())


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
