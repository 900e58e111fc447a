"""Status of a connected vehicle, as its process publishes it, and its readiness for the flight that it waits for."""

import datetime as dt
from dataclasses import asdict, replace
from typing import Final, Literal

from app.live.messages import SILENT_AFTER_S, UnreadyReason, VehicleStatus
from app.vehicles.base import Condition, ConnectedVehicle

Staging = Literal["none", "staged", "silent", "lost"]
"""Of the flight that waits for its takeoff: nothing staged, the staged gains read back, a silence since then, or the
gains no longer on the vehicle."""

LOST_AFTER_S: Final = 3.0
"""A vehicle without a heartbeat for this long is shown as gone."""


def status_of(vehicle_id: int, vehicle: ConnectedVehicle, staging: Staging, *, speed: float) -> VehicleStatus:
    """The vehicle's status now, its ages in the time of the ground; `speed` is that of its clock."""
    known = vehicle.condition()
    age_s = _in_ground_time(known.heartbeat_age_s, speed)
    condition = replace(
        known,
        packet_age_s=_in_ground_time(known.packet_age_s, speed),
        heartbeat_age_s=age_s,
        said_age_s=_in_ground_time(known.said_age_s, speed),
        held=dict(known.held),
    )
    return VehicleStatus(
        vehicle_id=vehicle_id,
        state="gone" if age_s is None or age_s > LOST_AFTER_S else "connected",
        at=status_time(),
        concern=vehicle.concern,
        unready=_unready(condition, staging),
        **asdict(condition),
    )


def is_silent(condition: Condition) -> bool:
    """Whether nothing was received from the vehicle for long."""
    return condition.packet_age_s is None or condition.packet_age_s > SILENT_AFTER_S


def status_time() -> str:
    """The present time as a VehicleStatus has it."""
    return dt.datetime.now(dt.UTC).isoformat()


def _unready(condition: Condition, staging: Staging) -> UnreadyReason:
    is_blind = staging == "staged" and not condition.position_hz
    if staging == "silent" or is_blind or is_silent(condition):
        return "link silent"
    return "gains unknown" if staging == "lost" or not condition.held else ""


def _in_ground_time(age_s: float | None, speed: float) -> float | None:
    return None if age_s is None else age_s / speed
