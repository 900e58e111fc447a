from app.autopilots.measurements import Battery
from tests.vehicles.mavlink.monitors.observing import failure_of, told, watch_of


def test_a_battery_is_low_after_a_second_below_the_limit() -> None:
    watch = told(watch_of(3.0), Battery(10.4), at_s=10.1)
    assert watch.battery.find(11.1) is None
    assert failure_of(watch.battery.find(11.2)) == "F7"
    assert told(watch, Battery(10.6), at_s=10.9).battery.find(11.2) is None


def test_a_battery_without_a_reading_for_ten_seconds_counts_as_low() -> None:
    watch = told(watch_of(3.0), Battery(12.0), at_s=10.1)
    assert watch.battery.find(20.0) is None
    assert failure_of(watch.battery.find(20.2)) == "F7"
