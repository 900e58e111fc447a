"""Land, outside of a trial: repeated until the vehicle's telemetry agrees."""

from typing import Final

from app.vehicles.errors import VehicleError
from app.vehicles.mavlink.radio import Radio
from app.vehicles.mavlink.signals import Action

REPEAT_S: Final = 1.0
_DESCENDING_M_S: Final = -0.2


class Landing:
    """Once the vehicle has obeyed nothing more is sent: somebody else may fly it again."""

    def __init__(self, radio: Radio) -> None:
        """Sends Land. Raises VehicleError when the vehicle has none that is known."""
        self._radio = radio
        self._sent_s = float("-inf")
        self._asked_s = radio.clock.now_s()
        self.is_over = False
        self._send()

    def proceed(self) -> None:
        """Send it again when it is due."""
        self.is_over = self.is_over or self._agrees()
        if not self.is_over and self._radio.clock.now_s() - self._sent_s >= REPEAT_S:
            self._send()

    def _send(self) -> None:
        self._sent_s = self._radio.clock.now_s()
        send_now(self._radio, Action.LAND)

    def _agrees(self) -> bool:
        """By what came since it was asked."""
        seen, profile = self._radio.seen, self._radio.profile
        if self._radio.block in profile.landing_blocks:
            return True
        if seen.heartbeat is not None and seen.heartbeat_s > self._asked_s:
            lands = seen.heartbeat.mode in profile.landing_modes - profile.flying_modes
            if lands or not seen.heartbeat.armed:
                return True
        at_s, last = seen.positions[-1] if seen.positions else (float("-inf"), None)
        return last is not None and at_s > self._asked_s and last.climb_rate_m_s < _DESCENDING_M_S


def send_now(radio: Radio, action: Action) -> None:
    """Every message of an action, once, waiting for no answer. Raises VehicleError when it takes a block of a flight
    plan that is not known."""
    try:
        steps = radio.profile.steps(action, radio.aim)
    except KeyError as error:
        raise VehicleError(
            f"The vehicle cannot be told to {action} from here: its flight plan did not name a block {error}.",
            hint="Land it with the remote control or its own ground station.",
        ) from error
    for step in steps:
        radio.send(*step.sends)
