from tests.vehicles.mavlink.monitors.observing import failure_of, told, watch_of
from tests.vehicles.mavlink.walking import PLAN


def test_a_second_without_any_packet_is_a_lost_link() -> None:
    watch = watch_of(3.0)
    assert watch.link.find(PLAN, watch.modes.heartbeat_s, 11.0) is None
    assert failure_of(watch.link.find(PLAN, watch.modes.heartbeat_s, 11.01)) == "F5"


def test_any_packet_keeps_the_link_but_three_missed_heartbeats_lose_it() -> None:
    watch = told(watch_of(3.0), None, at_s=11.7)
    assert watch.link.find(PLAN, watch.modes.heartbeat_s, 11.74) is None
    assert failure_of(watch.link.find(PLAN, watch.modes.heartbeat_s, 11.8)) == "F5"
