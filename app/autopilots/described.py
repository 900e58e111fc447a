"""What any recording gives for the description of its flight, and the loop with the parameters that it flew with."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from app.autopilots.ardupilot.logged_flight import HOLDS_ALTITUDE, ardupilot_loop_of
from app.autopilots.ardupilot.replica.parameters import in_older_names
from app.autopilots.px4.experiments import px4_loop
from app.autopilots.px4.logged_flight import LEFT_OUT_MODES, has_thrust_gains
from app.autopilots.px4.replica.parameters import in_accelerations
from app.autopilots.recording import EventKind, Recording, held
from app.autopilots.segments import find_landings, in_flight, within_limits
from app.core.analysis.description import LONGEST_GAP_S, FlightSignals
from app.core.analysis.loop import AltitudeLoop
from app.core.errors import InputError
from app.core.records.trajectory import Samples

_REFERENCES: Final = ("desired_altitude_m", "reference_m", "target_altitude_m", "set_point_m")
_THROTTLES: Final = ("thrust_target", "thrust", "demanded_throttle", "throttle")
"""The first is the vertical part."""
_LARGEST: Final = 1e6
_HOVER_PARAMETERS: Final = ("MOT_THST_HOVER", "MPC_THR_HOVER")


def signals_of(recording: Recording) -> FlightSignals | None:
    """The signals of a flight; None of a recording without an altitude."""
    if "altitude_m" not in recording.columns:
        return None
    time_s = recording.columns["altitude_m"].time_s
    altitude_m = _known(recording, ("altitude_m",), time_s)
    climb_rate_m_s = _known(recording, ("climb_rate_m_s",), time_s)
    throttle = within_limits(_known(recording, _THROTTLES, time_s) * _lean(recording, time_s))
    flown = in_flight(recording, altitude_m, throttle)
    slope_m_s = np.gradient(altitude_m, time_s) if len(time_s) > 1 else np.full(1, np.nan)
    biased = (climb_rate_m_s - slope_m_s)[flown]
    biased = biased[np.isfinite(biased)]
    climb_rate_m_s = climb_rate_m_s - np.median(biased) if biased.size else slope_m_s
    reference_m = _known(recording, _REFERENCES, time_s)
    if "reference_error_m" in recording.columns and np.ptp(recording.columns["reference_error_m"].values) > 0.0:
        reference_m = altitude_m + _known(recording, ("reference_error_m",), time_s)
    mode = recording.at("mode", time_s)
    holds = np.isin(mode, HOLDS_ALTITUDE) if recording.autopilot.name == "ardupilot" else ~np.isin(mode, LEFT_OUT_MODES)
    downs_s = [event.time_s for event in recording.events_of(EventKind.LANDING, EventKind.MOTORS_OFF)]
    return FlightSignals(
        time_s=time_s,
        altitude_m=altitude_m,
        climb_rate_m_s=climb_rate_m_s,
        reference_m=reference_m,
        throttle=throttle,
        flown=flown,
        held=flown & holds & np.isfinite(reference_m) & ~find_landings(time_s, altitude_m, climb_rate_m_s, downs_s),
        sensed_m_s2=_known(recording, ("acceleration_m_s2",), time_s),
        assumed_hover=next((each.value for each in recording.settings if each.name in _HOVER_PARAMETERS), None),
    )


def loop_of(recording: Recording, at_s: float, hover_throttle: float) -> AltitudeLoop | None:
    """The loop with the parameters at a time, of a vehicle that hovers with this throttle; None if the recording lacks
    its gains, or a replica does not have it."""
    given = dict(in_older_names(*each) for each in recording.parameters_at(at_s).items())
    thrust_gains_at = None
    if "thrust_target" in recording.columns and has_thrust_gains(recording):
        thrust_gains_at, given = hover_throttle, in_accelerations(given, hover_throttle)
    try:
        loop = _LOOPS[recording.autopilot.name](recording, given, thrust_gains_at)
    except (KeyError, InputError):
        return None
    return loop if all(given.get(name, -1.0) >= 0.0 for name in loop.space.bounds) else None


_LOOPS: Final[Mapping[str, Callable[[Recording, Mapping[str, float], float | None], AltitudeLoop]]] = {
    "ardupilot": lambda recording, given, _: ardupilot_loop_of(recording, given),
    "px4": lambda _, given, thrust_gains_at: replace(px4_loop(given), thrust_gains_at=thrust_gains_at),
}


def _known(recording: Recording, names: Sequence[str], time_s: Samples) -> Samples:
    """The first of these columns that there is, shape (n,); NaN where no report is near, or it is not plausible."""
    column = next((recording.columns[each] for each in names if each in recording.columns), None)
    if column is None:
        return np.full(len(time_s), np.nan)
    at_s = column.time_s
    nearest_s = at_s[np.searchsorted(0.5 * (at_s[1:] + at_s[:-1]), time_s)]
    values = column.at(time_s) if column.holds_s is None else held(at_s, column.values, time_s)
    return np.where((np.abs(time_s - nearest_s) <= LONGEST_GAP_S) & (np.abs(values) <= _LARGEST), values, np.nan)


def _lean(recording: Recording, time_s: Samples) -> Samples:
    """Cosine of the lean, shape (n,), by which the throttle carries less; 1 where that is not known or counted."""
    if "thrust_target" in recording.columns:
        return np.ones(len(time_s))
    roll, pitch = (np.radians(np.nan_to_num(_known(recording, (each,), time_s))) for each in ("roll_deg", "pitch_deg"))
    return np.asarray(np.cos(roll) * np.cos(pitch) * np.nan_to_num(_known(recording, ("lean",), time_s), nan=1.0))
