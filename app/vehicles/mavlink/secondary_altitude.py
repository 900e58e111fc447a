"""Comparison of the second source of altitude with the vehicle's own, as pure functions."""

from dataclasses import dataclass, replace
from typing import Final

from app.vehicles.mavlink.events import SecondaryAltitudeReceived
from app.vehicles.mavlink.failures import Failure, Finding

MAX_DIFFERENCE_M: Final = 0.3
APART_S: Final = 0.3

_MAX_AGE_S: Final = 0.5
_ATTENDED_S: Final = 0.1
"""Longest time before a sample that it accounts for: samples delayed by a stall may arrive at once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SecondaryAltitude:
    """State of the second source; times in s by the ground's clock. `altitude_m` is on the vehicle's datum, None before
    the first valid sample; `blind_s` is the time for which its samples have not been new."""

    received_s: float
    altitude_m: float | None = None
    blind_s: float = 0.0
    apart_m: float = 0.0
    apart_since_s: float | None = None


def update(second: SecondaryAltitude, sample: SecondaryAltitudeReceived, vehicle_m: float | None) -> SecondaryAltitude:
    """Return the state after a sample of the source, with the vehicle's own altitude `vehicle_m` (None: unknown)."""
    waited_s = min(max(sample.now_s - second.received_s, 0.0), _ATTENDED_S)
    second = replace(second, received_s=max(sample.now_s, second.received_s))
    if not sample.is_new:
        return replace(second, blind_s=second.blind_s + waited_s)
    apart_m = 0.0 if vehicle_m is None else abs(sample.altitude_m - vehicle_m)
    since_s = (
        (second.apart_since_s if second.apart_since_s is not None else sample.now_s)
        if apart_m > MAX_DIFFERENCE_M
        else None
    )
    return replace(second, altitude_m=sample.altitude_m, blind_s=0.0, apart_m=apart_m, apart_since_s=since_s)


def current_altitude_m(second: SecondaryAltitude | None, now_s: float) -> float | None:
    """Return the source's altitude; None while its samples are not new, or none arrive."""
    if second is None or second.blind_s > 0.0 or now_s - second.received_s > _MAX_AGE_S:
        return None
    return second.altitude_m


def find_blind(second: SecondaryAltitude | None, now_s: float, *, stuck_s: float, silent_s: float) -> Finding | None:
    """Find a source whose samples have not been new for `stuck_s`, or that has sent none for `silent_s`."""
    why = ""
    if second is not None and second.blind_s > stuck_s:
        why = f"The second source of altitude did not track it for more than {stuck_s:g} s."
    elif second is not None and now_s - second.received_s > silent_s:
        why = f"Nothing was received from the second source of altitude for {silent_s:g} s."
    return Finding(failure=Failure.FROZEN, why=why) if why else None


def find_disagreement(second: SecondaryAltitude | None) -> Finding | None:
    if second is None or second.apart_since_s is None or second.received_s - second.apart_since_s <= APART_S:
        return None
    why = f"They were {second.apart_m:.2f} m apart, over {MAX_DIFFERENCE_M:g} m for {APART_S:g} s."
    return Finding(failure=Failure.DISAGREEMENT, why=why)
