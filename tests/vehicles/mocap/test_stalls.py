"""What a program that stood still for a while makes of everything that came meanwhile, all at once."""

import numpy as np

from app.autopilots.measurements import Position
from app.vehicles.mavlink.events import PacketReceived, SecondaryAltitudeReceived
from app.vehicles.mavlink.trial import in_order
from app.vehicles.mavlink.trial_state import State
from tests.vehicles.mavlink.walking import TrialDriver


def test_sources_that_agreed_throughout_a_climb_are_held_against_each_other_in_the_order_in_which_they_spoke() -> None:
    walk = TrialDriver().arm()
    walk.climb_rate_m_s = 2.0
    walk.pass_s(0.5)
    walk.give(SecondaryAltitudeReceived(walk.altitude_m, True, walk.now_s))
    missed_s = np.arange(0.02, 0.8, 0.02).tolist()
    up_m = [walk.altitude_m + walk.climb_rate_m_s * at_s for at_s in missed_s]
    both = list(zip(missed_s, up_m, strict=True))
    heard = [
        PacketReceived(Position(walk.boot_s + at_s, m, walk.climb_rate_m_s), walk.now_s + at_s) for at_s, m in both
    ]
    sighted = [SecondaryAltitudeReceived(m, True, walk.now_s + at_s) for at_s, m in both]
    for event in in_order(heard, sighted):
        walk.give(event)
    assert (walk.state, walk.trial.failure) == (State.RECORD, None)
