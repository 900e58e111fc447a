"""Land and motors off outside of a trial: repeated until the vehicle says that it has obeyed."""

from typing import Final

from app.vehicles.errors import VehicleError
from app.vehicles.mavlink.limits import DESCENDING_M_S, REPEAT_S, land_every_s
from app.vehicles.mavlink.measurements import confirms_motors_off
from app.vehicles.mavlink.radio import AutopilotLink
from app.vehicles.mavlink.signals import Action, PacketReceived

STOPPING_S: Final = 5.0
"""For so long an order to stop the motors is repeated: later, somebody may be flying it by hand."""


class RepeatedCommand:
    """Once the vehicle has obeyed nothing more is sent: somebody else may fly it again."""

    def __init__(self, radio: AutopilotLink, action: Action) -> None:
        """Sends it. Raises VehicleError when it takes a block of a flight plan that is not known."""
        self._radio, self._action = radio, action
        self._asked_s = radio.clock.now_s()
        self._answered = False
        self._is_over = False
        self._send()

    def proceed(self, heard: list[PacketReceived]) -> None:
        """Take in what came, and send it again when it is due."""
        if self._action is Action.KILL:
            settings = self._radio.profile.stop_settings
            self._answered = self._answered or any(confirms_motors_off(each.measurement, settings) for each in heard)
        now_s = self._radio.clock.now_s()
        is_late = self._action is Action.KILL and now_s - self._asked_s > STOPPING_S
        self._is_over = self._is_over or is_late or self._is_obeyed()
        if not self._is_over and now_s - self._sent_s >= self._every_s(now_s):
            self._send()

    def _every_s(self, now_s: float) -> float:
        if self._action is Action.LAND:
            return land_every_s(now_s - self._asked_s, self._radio.profile.land_again_s)
        return REPEAT_S

    def _send(self) -> None:
        """Every message once, waiting for no answer."""
        self._sent_s = self._radio.clock.now_s()
        try:
            steps = self._radio.profile.steps(self._action, self._radio.aim)
        except KeyError as error:
            raise VehicleError(
                f"The vehicle cannot be told to {self._action} from here: it did not name a block {error}.",
                hint="Land it with the remote control or its own ground station.",
            ) from error
        for step in steps:
            self._radio.send(*step.sends)

    def _is_obeyed(self) -> bool:
        """By what came since it was given: the motors stand, by two heartbeats or by one and an answer; or, where it
        was to land, it does."""
        seen = self._radio.seen
        if seen.heartbeat is None or seen.heartbeat_s <= self._asked_s:
            return False
        if not seen.heartbeat.armed and (self._answered or self._radio.is_disarmed):
            return True
        return self._action is Action.LAND and self._is_landing(seen.heartbeat.mode)

    def _is_landing(self, mode: str) -> bool:
        seen, profile = self._radio.seen, self._radio.profile
        if self._radio.block in profile.landing_blocks or mode in profile.landing_modes - profile.flying_modes:
            return True
        at_s, last = seen.positions[-1] if seen.positions else (float("-inf"), None)
        return last is not None and at_s > self._asked_s and last.climb_rate_m_s < DESCENDING_M_S
