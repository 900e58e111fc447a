"""Condition of a vehicle as last received, for people."""

from collections import deque
from collections.abc import Mapping
from typing import Final

from app.vehicles.base import Condition
from app.vehicles.mavlink.radio import AutopilotLink
from app.vehicles.mavlink.reception import LinkHealth

RATE_OVER_S: Final = 2.0
LOSS_OVER_S: Final = 10.0
_COUNT_EVERY_S: Final = 1.0
_MAX_AGE_S: Final = 2.0


class StatusReader:
    """Reads the state of a vehicle without sending or waiting. Losses are counted over about the last ten seconds."""

    def __init__(self, radio: AutopilotLink) -> None:
        self._radio = radio
        opened = (radio.clock.now_s(), LinkHealth())
        self._counts: deque[tuple[float, LinkHealth]] = deque([opened], maxlen=round(LOSS_OVER_S / _COUNT_EVERY_S) + 1)

    def read(self, *, step: str, datum_m: float, held: Mapping[str, float], trouble: str) -> Condition:
        """Return the current state; altitude counts from `datum_m` on the vehicle's own datum."""
        radio, now_s = self._radio, self._radio.clock.now_s()
        health, heartbeat = radio.link.health, radio.seen.heartbeat
        recent = [(at_s, position) for at_s, position in radio.seen.positions if now_s - at_s <= RATE_OVER_S]
        last = recent[-1][1] if recent and now_s - recent[-1][0] < _MAX_AGE_S else None
        return Condition(
            step=step,
            packet_age_s=_age(now_s, health.last_packet_s),
            heartbeat_age_s=_age(now_s, health.last_heartbeat_s),
            armed=None if heartbeat is None else heartbeat.armed,
            mode="" if heartbeat is None else self._mode(heartbeat.mode),
            altitude_m=None if last is None else last.altitude_m - datum_m,
            climb_rate_m_s=None if last is None else last.climb_rate_m_s,
            battery_v=radio.seen.battery_v,
            position_hz=len(recent) / RATE_OVER_S,
            lost_share=self._lost_share(now_s, health),
            held=dict(held),
            said=radio.seen.status_texts[-1] if radio.seen.status_texts else "",
            said_age_s=_age(now_s, radio.seen.status_text_s),
            trouble=trouble,
            restarts=radio.seen.restarts,
        )

    def _mode(self, number: str) -> str:
        """Return the display name of the mode, or of the block if the vehicle flies by a flight plan."""
        profile = self._radio.profile
        name = profile.mode_names.get(number, number)
        return name if number in profile.modes_without_land else self._radio.block or name

    def _lost_share(self, now_s: float, health: LinkHealth) -> float | None:
        if now_s - self._counts[-1][0] >= _COUNT_EVERY_S:
            self._counts.append((now_s, health))
        _, first = self._counts[0]
        lost, received = health.lost - first.lost, health.received - first.received
        return lost / (lost + received) if lost + received else None


def _age(now_s: float, then_s: float | None) -> float | None:
    return None if then_s is None else max(now_s - then_s, 0.0)
