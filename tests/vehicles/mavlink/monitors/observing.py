"""What is remembered of messages, one after the other."""

from app.autopilots.measurements import Measurement, Position
from app.vehicles.mavlink.failures import Failure, Finding
from app.vehicles.mavlink.observation import TrialObservation
from tests.vehicles.mavlink.walking import PLAN

START_S = 10.0


def failure_of(finding: Finding | None) -> Failure | None:
    return None if finding is None else finding.failure


def watch_of(*altitudes_m: float, every_s: float = 0.02, climb_rate_m_s: float = 0.0) -> TrialObservation:
    """What is remembered of these altitudes, one after the other from 10 s on, of a vehicle that was at the first."""
    last = Position(START_S - every_s, altitudes_m[0], climb_rate_m_s)
    watch = TrialObservation.begin(START_S, last=last)
    for number, altitude_m in enumerate(altitudes_m):
        at_s = START_S + number * every_s
        watch, _ = watch.update(Position(at_s, altitude_m, climb_rate_m_s), at_s, PLAN)
    return watch


def told(watch: TrialObservation, *measurements: Measurement | None, at_s: float) -> TrialObservation:
    for measurement in measurements:
        watch, _ = watch.update(measurement, at_s, PLAN)
    return watch
