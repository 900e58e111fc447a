"""Where a vehicle stands, by what was heard of it on the ground."""

from dataclasses import replace

import pytest

from app.autopilots.autopilot import AutopilotError, HoverLimits
from app.autopilots.measurements import Position
from app.autopilots.registry import AUTOPILOTS
from app.core.models.set_points import SetPoints
from app.vehicles.mavlink.preflight import evaluate_hover, evaluate_set_points
from app.vehicles.mavlink.preparation import GroundObservation, find_reception

HEARD = tuple(Position(60.0 + 0.02 * count, 0.1, 0.0) for count in range(100))
STRANGE = (replace(HEARD[0], time_boot_s=3661.0), replace(HEARD[0], time_boot_s=0.2))


@pytest.mark.parametrize("strange", STRANGE, ids=["an hour ahead", "of a boot"])
@pytest.mark.parametrize("after", [0, 1])
def test_one_position_by_another_clock_is_not_where_its_record_begins(strange: Position, after: int) -> None:
    """All that it says itself would be taken for that of a vehicle which has rebooted."""
    positions = (*HEARD[: len(HEARD) - after], strange, *HEARD[len(HEARD) - after :])
    last = GroundObservation(positions, 2.0).last
    assert last in HEARD
    assert last.time_boot_s > 61.9


def test_a_single_position_is_the_last_one() -> None:
    assert GroundObservation(HEARD[:1], 2.0).last == HEARD[0]


@pytest.mark.parametrize(("push_m_s2", "passed"), [(2.0, True), (2.5, False)])
def test_a_push_is_limited(push_m_s2: float, passed: bool) -> None:
    item = evaluate_set_points(SetPoints((0.0, 21.0, 24.0), (3.0, 3.0, 3.0), (0.0, -push_m_s2, 0.0)))
    assert (item.passed, item.found) == (passed, f"set points from 3 to 3 m, pushed by {push_m_s2:g} m/s²")
    assert item.needed.endswith("; at most 2 m/s²")


@pytest.mark.parametrize(("hover", "hint"), [(0.62, ""), (0.742, "Set MPC_THR_HOVER to 0.74. "), (0.85, "to 0.80. ")])
def test_the_hover_throttle_of_the_last_flight_must_be_within_what_px4_finds(hover: float, hint: str) -> None:
    (item,) = evaluate_hover(hover, AUTOPILOTS["px4"].hover_limits({"MPC_THR_HOVER": 0.5}))
    assert (item.passed, bool(item.hint)) == (not hint, bool(hint))
    assert hint in item.hint
    assert item.needed.startswith("within MPC_THR_HOVER ± HTE_THR_RANGE, 0.30 … 0.70")


def test_a_hover_throttle_that_is_not_known_or_has_no_limits_is_not_checked() -> None:
    assert (
        evaluate_hover(None, HoverLimits(0.3, 0.7, "", "", 0.8))
        == evaluate_hover(0.9, AUTOPILOTS["px4"].hover_limits({}))
        == ()
    )
    for name in ("ardupilot", "paparazzi"):
        assert evaluate_hover(0.9, AUTOPILOTS[name].hover_limits({"MOT_THST_HOVER": 0.3})) == ()


def test_a_range_that_px4_cannot_have_is_a_refusal_of_the_flight() -> None:
    with pytest.raises(AutopilotError, match="HTE_THR_RANGE: must be 0 to 1"):
        AUTOPILOTS["px4"].hover_limits({"MPC_THR_HOVER": 0.5, "HTE_THR_RANGE": 1.5})


def test_copies_that_arrive_late_are_not_the_last_position_on_the_ground() -> None:
    """Seen: every packet again 3 s later; the flight began by the clock of the copies, and saw no lift-off."""
    own = [Position(100.0 + 0.02 * place, 0.1, 0.0) for place in range(50)]
    copies = [replace(each, time_boot_s=each.time_boot_s - 3.0) for each in own]
    mixed = tuple(position for pair in zip(own, copies, strict=True) for position in pair)
    stray = (*mixed, Position(4000.0, 0.1, 0.0))
    assert GroundObservation(stray, 2.0).last == own[-1]


STEADY = [(160.0 + 0.02 * count, HEARD[count]) for count in range(100)]


@pytest.mark.parametrize("off_s", [-3.0, -0.5, -0.3, 0.3, 2.0])
@pytest.mark.parametrize("place", [0, 50, 99])
def test_one_false_stamp_is_no_lost_position(off_s: float, place: int) -> None:
    at_s, position = STEADY[place]
    false = (at_s, replace(position, time_boot_s=position.time_boot_s + off_s))
    rate_hz, lost_share = find_reception([*STEADY[:place], false, *STEADY[place + 1 :]], 162.0)
    assert rate_hz == pytest.approx(50.0, rel=0.03)
    assert lost_share == pytest.approx(0.0, abs=0.015)


def test_positions_that_arrive_at_once_after_a_stall_are_no_more_per_second() -> None:
    rate_hz, lost_share = find_reception([(161.9, position) for _, position in STEADY], 162.0)
    assert rate_hz == pytest.approx(50.0)
    assert lost_share == 0.0


def test_positions_that_arrive_in_pairs_swapped_are_all_there() -> None:
    swapped = [STEADY[count + (1 if count % 2 == 0 else -1)][1] for count in range(100)]
    rate_hz, lost_share = find_reception([(160.0 + 0.02 * count, each) for count, each in enumerate(swapped)], 162.0)
    assert rate_hz == pytest.approx(50.0)
    assert lost_share == 0.0


def test_positions_at_intervals_that_differ_by_half_are_not_lost() -> None:
    """px4_refused_in_offboard.tlog: 16, 20 and 24 ms."""
    stamps_s = [0.02 * count + 0.004 * (count % 2) for count in range(100)]
    heard = [(160.0 + stamp_s, Position(60.0 + stamp_s, 0.1, 0.0)) for stamp_s in stamps_s]
    assert find_reception(heard, 162.0)[1] == 0.0


def test_every_third_position_lost_is_a_third_at_any_rate_and_repeated_ones_do_not_hide_it() -> None:
    received = [each for count, each in enumerate(STEADY) if count % 3]
    twice = ((at_s + late_s, position) for at_s, position in received for late_s in (0.0, 0.1))
    copies = [each for each in sorted(twice, key=lambda each: each[0]) if each[0] < 162.0]
    fast = [(at_s / 4.0, replace(position, time_boot_s=position.time_boot_s / 4.0)) for at_s, position in received]
    for heard, until_s, expected_hz in ((received, 162.0, 33.3), (copies, 162.0, 33.3), (fast, 40.5, 133.3)):
        rate_hz, lost_share = find_reception(heard, until_s)
        assert rate_hz == pytest.approx(expected_hz, rel=0.06)
        assert lost_share == pytest.approx(1 / 3, abs=0.01)


def test_nothing_received_lately_is_no_rate() -> None:
    assert find_reception(STEADY, 164.0) == find_reception(STEADY[:1], 160.0) == (0.0, 0.0)
