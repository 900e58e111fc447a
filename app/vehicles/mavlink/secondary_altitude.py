"""A second source of altitude held against the vehicle's own: a pure memory, and the rules that it is to keep."""

from dataclasses import dataclass, replace
from typing import Final

from app.vehicles.mavlink.events import SecondaryAltitudeReceived
from app.vehicles.mavlink.failures import Failure, Finding

MAX_DIFFERENCE_M: Final = 0.3
APART_S: Final = 0.3

_MAX_AGE_S: Final = 0.5
_ATTENDED_S: Final = 0.1
"""The most that one sighting tells of the time before it: what a stall delayed may come at once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SecondaryAltitude:
    """What the second source showed so far; times in s by the ground's clock. `altitude_m` is on the vehicle's datum,
    None until it saw the vehicle; `blind_s`: for how long it has been heard without seeing anything new."""

    heard_s: float
    altitude_m: float | None = None
    blind_s: float = 0.0
    apart_m: float = 0.0
    apart_since_s: float | None = None


def update(second: SecondaryAltitude, sighted: SecondaryAltitudeReceived, vehicle_m: float | None) -> SecondaryAltitude:
    """The memory after the source spoke, while the vehicle says that it is at `vehicle_m` (None: it does not say)."""
    waited_s = min(max(sighted.now_s - second.heard_s, 0.0), _ATTENDED_S)
    second = replace(second, heard_s=max(sighted.now_s, second.heard_s))
    if not sighted.is_new:
        return replace(second, blind_s=second.blind_s + waited_s)
    apart_m = 0.0 if vehicle_m is None else abs(sighted.altitude_m - vehicle_m)
    since_s = (
        (second.apart_since_s if second.apart_since_s is not None else sighted.now_s)
        if apart_m > MAX_DIFFERENCE_M
        else None
    )
    return replace(second, altitude_m=sighted.altitude_m, blind_s=0.0, apart_m=apart_m, apart_since_s=since_s)


def current_altitude_m(second: SecondaryAltitude | None, now_s: float) -> float | None:
    """Where the source sees the vehicle; None while it sees nothing new, or nothing at all."""
    if second is None or second.blind_s > 0.0 or now_s - second.heard_s > _MAX_AGE_S:
        return None
    return second.altitude_m


def find_blind(second: SecondaryAltitude | None, now_s: float, *, stuck_s: float, silent_s: float) -> Finding | None:
    """A source that says nothing new for `stuck_s` while it is heard, or nothing at all for `silent_s`."""
    why = ""
    if second is not None and second.blind_s > stuck_s:
        why = f"The second source of altitude did not see it for more than {stuck_s:g} s."
    elif second is not None and now_s - second.heard_s > silent_s:
        why = f"Nothing came from the second source of altitude for {silent_s:g} s."
    return Finding(failure=Failure.FROZEN, why=why) if why else None


def find_disagreement(second: SecondaryAltitude | None) -> Finding | None:
    if second is None or second.apart_since_s is None or second.heard_s - second.apart_since_s <= APART_S:
        return None
    why = f"They were {second.apart_m:.2f} m apart, over {MAX_DIFFERENCE_M:g} m for {APART_S:g} s."
    return Finding(failure=Failure.DISAGREEMENT, why=why)
