"""Every state of a flight against every loss: what holds, what is taken back, and what is said."""

from dataclasses import replace
from typing import TypedDict

import pytest

from app.common.errors import ConflictError
from app.common.states import TrialState, VehicleState
from app.flights.readiness import LOSSES, STEPS, LossKind, ReadinessStep, Standing, readiness_of, require_ready
from app.live.hub import VehicleReport
from app.live.messages import UnreadyReason, VehicleLinkState, VehicleStatus

MIN_BATTERY_V = 10.5


def status(
    state: VehicleLinkState = "connected",
    unready: UnreadyReason = "",
    *,
    age_s: float = 0.1,
    battery_v: float | None = 11.1,
    step: str = "record",
) -> VehicleStatus:
    return VehicleStatus(
        vehicle_id=1,
        state=state,
        at="2026-11-24T12:00:00Z",
        step=step,
        unready=unready,
        age_s=age_s,
        battery_v=battery_v,
    )


GOOD = VehicleReport(worker=True, status=status())


class Flags(TypedDict, total=False):
    take_off_requested: bool
    standing_down: bool
    abort_cause_open: bool
    has_not_landed: bool


REACHED: dict[str, tuple[TrialState, Flags, ReadinessStep | None]] = {
    "planned": (TrialState.PLANNED, {}, "control"),
    "staged": (TrialState.STAGED, {}, "staged"),
    "held": (TrialState.STAGED, {"take_off_requested": True}, "held"),
    "unstaging": (TrialState.STAGED, {"standing_down": True, "take_off_requested": True}, "control"),
    "in flight": (TrialState.FLYING, {"take_off_requested": True}, "in flight"),
    "lost": (TrialState.LOST, {}, "in flight"),
    "captured": (TrialState.CAPTURED, {}, "landed"),
    "valid": (TrialState.VALID, {}, "reviewed"),
    "aborted": (TrialState.ABORTED, {}, "reviewed"),
    "aborted, cause open": (TrialState.ABORTED, {"abort_cause_open": True}, "landed"),
    "invalid": (TrialState.INVALID, {}, "reviewed"),
    "fallen": (TrialState.CAPTURED, {"has_not_landed": True}, "landed"),
    "fallen, cause open": (TrialState.ABORTED, {"abort_cause_open": True, "has_not_landed": True}, "landed"),
    "fallen, aborted": (TrialState.ABORTED, {"has_not_landed": True}, "reviewed"),
    "fallen, invalid": (TrialState.INVALID, {"has_not_landed": True}, "reviewed"),
    "cancelled": (TrialState.CANCELLED, {}, None),
}

REPORTS: dict[str, tuple[VehicleReport, VehicleState, LossKind]] = {
    "no worker": (VehicleReport(worker=False, status=status()), VehicleState.READY, "worker away"),
    "never heard": (VehicleReport(worker=True), VehicleState.READY, "not connected"),
    "connecting": (VehicleReport(worker=True, status=status("connecting")), VehicleState.READY, "not connected"),
    "disconnected": (GOOD, VehicleState.DISCONNECTED, "not connected"),
    "process hangs": (VehicleReport(worker=True, status=status("not answering")), VehicleState.READY, "process silent"),
    "old status": (VehicleReport(worker=True, status=status(age_s=2.1)), VehicleState.READY, "process silent"),
    "no heartbeat": (VehicleReport(worker=True, status=status("gone")), VehicleState.READY, "link silent"),
    "silent for 2 s": (
        VehicleReport(worker=True, status=status(unready="link silent")),
        VehicleState.READY,
        "link silent",
    ),
    "restarted": (
        VehicleReport(worker=True, status=status(unready="gains unknown")),
        VehicleState.READY,
        "gains unknown",
    ),
    "low battery": (
        VehicleReport(worker=True, status=status(battery_v=10.4)),
        VehicleState.READY,
        "battery low",
    ),
    "quarantined": (GOOD, VehicleState.QUARANTINED, "quarantined"),
}


def standing(
    state: TrialState, flags: Flags, vehicle: VehicleState = VehicleState.READY, *, has_control: bool = True
) -> Standing:
    return Standing(
        trial=state, vehicle=vehicle, has_link=True, has_control=has_control, min_battery_v=MIN_BATTERY_V, **flags
    )


def held_of(name: str) -> tuple[ReadinessStep, ...]:
    """Steps that hold: all up to the reached one, without the landing of a vehicle that fell."""
    _, flags, reached = REACHED[name]
    return tuple(step for step in up_to(reached) if step != "landed" or "has_not_landed" not in flags)


def up_to(step: ReadinessStep | None) -> tuple[ReadinessStep, ...]:
    return () if step is None else STEPS[: STEPS.index(step) + 1]


@pytest.mark.parametrize("name", REACHED)
def test_without_a_loss_every_step_up_to_the_reached_one_holds(name: str) -> None:
    state, flags, _ = REACHED[name]
    found = readiness_of(standing(state, flags), GOOD)
    assert (found.steps, found.losses) == (held_of(name), ())
    assert found.lost == (("landed",) if name == "lost" or name.startswith("fallen") else ())
    assert found.is_ready == (name == "staged")


@pytest.mark.parametrize("loss", REPORTS)
@pytest.mark.parametrize("name", ["planned", "staged", "held", "unstaging"])
def test_before_take_off_a_loss_takes_steps_back_and_refuses_the_take_off(name: str, loss: str) -> None:
    state, flags, reached = REACHED[name]
    report, vehicle, kind = REPORTS[loss]
    found = readiness_of(standing(state, flags, vehicle), report)
    kept = LOSSES[kind].keeps
    assert found.steps == kept[: len(up_to(reached))]
    assert found.steps + found.lost == up_to(reached)
    text = LOSSES[kind]
    way_on = (text.way_on_planned if name == "planned" else "") or text.way_on
    assert [(each.kind, each.what, each.way_on) for each in found.losses] == [(kind, text.what, way_on)]
    assert not found.is_ready
    with pytest.raises(ConflictError) as refused:
        require_ready(found)
    assert str(refused.value) == f"{text.what} {way_on}"


@pytest.mark.parametrize("loss", REPORTS)
@pytest.mark.parametrize("name", ["in flight"])
def test_in_flight_a_loss_takes_nothing_back_and_says_what_to_do_now(name: str, loss: str) -> None:
    state, flags, _ = REACHED[name]
    report, vehicle, kind = REPORTS[loss]
    found = readiness_of(standing(state, flags, vehicle), report)
    assert (found.steps, found.lost) == (up_to("in flight"), ())
    text = LOSSES[kind]
    expected = [(kind, text.what_in_flight, text.way_on_in_flight)] if text.what_in_flight else []
    assert [(each.kind, each.what, each.way_on) for each in found.losses] == expected
    assert "Stage" not in "".join(each.way_on for each in found.losses)


def test_a_vehicle_that_still_arms_is_not_in_flight_yet_but_is_spoken_of_as_one_that_may_take_off() -> None:
    state, flags, _ = REACHED["in flight"]
    checking, arming, silent, taking_off = (
        readiness_of(standing(state, flags), VehicleReport(worker=True, status=heard))
        for heard in (status(step="preflight"), status(step="arm"), status("gone", step="arm"), status(step="take-off"))
    )
    assert checking.steps == up_to("held")
    assert (arming.steps, arming.losses, arming.is_ready) == (up_to("held"), (), False)
    assert [each.what for each in silent.losses] == [LOSSES["link silent"].what_in_flight]
    assert taking_off.steps == up_to("in flight")


def test_a_vehicle_on_the_ground_has_not_taken_off_yet_and_later_has_landed() -> None:
    state, flags, _ = REACHED["in flight"]
    on_ground = VehicleReport(worker=True, status=status(step="idle"))
    restoring = VehicleReport(worker=True, status=status(step="restore"))
    starting, over = (replace(standing(state, flags), flown_for_s=flown_for_s) for flown_for_s in (0.5, 20.0))
    assert readiness_of(starting, on_ground).steps == up_to("held")
    assert readiness_of(over, on_ground).steps == up_to("landed")
    assert readiness_of(over, restoring).steps == up_to("landed")


def test_a_vehicle_whose_link_is_lost_is_not_said_to_have_landed() -> None:
    """Observed defect: “Landed” was ticked beside “Land is repeated until the vehicle descends”."""
    state, flags, _ = REACHED["in flight"]
    over = replace(standing(state, flags), flown_for_s=20.0)
    for lost in (status(step="idle", unready="link silent"), status("gone", step="restore")):
        assert readiness_of(over, VehicleReport(worker=True, status=lost)).steps == up_to("in flight")


@pytest.mark.parametrize("loss", REPORTS)
@pytest.mark.parametrize("name", list(REACHED)[list(REACHED).index("lost") :])
def test_once_the_flight_is_over_a_loss_changes_nothing(name: str, loss: str) -> None:
    state, flags, _ = REACHED[name]
    report, vehicle, _ = REPORTS[loss]
    assert readiness_of(standing(state, flags, vehicle), report).steps == held_of(name)
    assert readiness_of(standing(state, flags, vehicle), report).losses == ()


@pytest.mark.parametrize("name", ["staged", "held"])
def test_control_that_ends_takes_everything_back(name: str) -> None:
    state, flags, reached = REACHED[name]
    found = readiness_of(standing(state, flags, has_control=False), GOOD)
    assert (found.steps, found.lost) == ((), up_to(reached))
    assert [each.kind for each in found.losses] == ["control ended"]


def test_a_vehicle_whose_preflight_check_has_failed_is_never_ready() -> None:
    """Observed defect: “Staged, ready to fly” beside a failed check, and the takeoff was refused after its start."""
    staged = replace(standing(TrialState.STAGED, {}), failed_checks=("Failsafe", "Fence"))
    found = readiness_of(staged, GOOD)
    assert (found.steps, found.lost, found.is_ready) == (("control", "staged"), (), False)
    [loss] = found.losses
    assert (loss.kind, loss.what) == ("checks failed", "A preflight check has failed: Failsafe, Fence.")
    assert loss.way_on.startswith("Unstage the flight"), "Check now is disabled while it is staged"
    [loss] = readiness_of(replace(staged, trial=TrialState.PLANNED), GOOD).losses
    assert "nstage" not in loss.way_on
    assert readiness_of(replace(staged, trial=TrialState.FLYING), GOOD).losses == ()


def test_a_vehicle_that_was_not_heard_again_after_its_flight_is_not_said_to_have_landed() -> None:
    """Observed defect: “Landed” and “Reviewed” were ticked for a drone last heard at 3.2 m."""
    found = readiness_of(replace(standing(TrialState.INVALID, {}), was_lost_in_flight=True), GOOD)
    assert (found.steps, found.lost) == (up_to("in flight"), ("landed",))


@pytest.mark.parametrize("name", ["planned", "staged", "held", "unstaging", "in flight", "cancelled"])
def test_a_landing_that_was_not_reached_cannot_be_lost(name: str) -> None:
    """A trial that is planned again is flown by a vehicle that stands on the ground."""
    state, flags, reached = REACHED[name]
    found = readiness_of(replace(standing(state, flags), has_not_landed=True), GOOD)
    assert (found.steps, found.lost) == (up_to(reached), ())


@pytest.mark.parametrize("name", ["staged", "held"])
def test_who_watches_another_operators_flight_sees_what_it_has_reached_and_cannot_fly_it(name: str) -> None:
    """Observed defects: a second tab said “Control: lost” although the operator in the first one had it, and another
    browser “Control: done” as soon as the operator had staged."""
    state, flags, reached = REACHED[name]
    watched = replace(standing(state, flags, has_control=False), is_controlled_by_other=True)
    found = readiness_of(watched, GOOD)
    assert (found.steps, found.lost, found.is_ready) == (up_to(reached)[1:], (), False)
    assert [each.kind for each in found.losses] == ["controlled by other"]
    assert [each.kind for each in readiness_of(watched, VehicleReport(worker=False)).losses] == [
        "worker away",
        "controlled by other",
    ]


@pytest.mark.parametrize(("is_controlled_by_other", "kind"), [(True, "controlled by other"), (False, "control ended")])
def test_who_may_not_command_the_vehicle_is_not_told_to_take_control(
    is_controlled_by_other: bool, kind: LossKind
) -> None:
    """Observed defect: a browser with read-only access was told to take over."""
    watched = replace(standing(TrialState.STAGED, {}, has_control=False), is_controlled_by_other=is_controlled_by_other)
    [own] = readiness_of(watched, GOOD).losses
    [read_only] = readiness_of(replace(watched, may_command=False), GOOD).losses
    assert (own.kind, read_only.kind) == (kind, kind)
    assert ("ake" in own.way_on, "ake c" in read_only.way_on, "ake o" in read_only.way_on) == (True, False, False)


def test_a_flight_that_was_never_staged_is_not_to_be_staged_again() -> None:
    """Observed defect: “stage the flight again” for a planned flight whose vehicle had restarted."""
    for report, vehicle, _ in REPORTS.values():
        for loss in readiness_of(standing(TrialState.PLANNED, {}, vehicle), report).losses:
            assert "again." not in loss.way_on, loss.kind
            assert "read back" not in loss.way_on, loss.kind


@pytest.mark.parametrize("report", ["connecting", "restarted"])
def test_a_quarantined_vehicle_has_one_way_on(report: str) -> None:
    """Its release needs the connection, and reads the gains back."""
    found = readiness_of(standing(TrialState.PLANNED, {}, VehicleState.QUARANTINED), REPORTS[report][0])
    assert [each.kind for each in found.losses] == ["quarantined"]


@pytest.mark.parametrize("battery_v", [MIN_BATTERY_V, None])
def test_a_battery_at_its_minimum_or_not_reported_yet_takes_nothing_back(battery_v: float | None) -> None:
    report = VehicleReport(worker=True, status=status(battery_v=battery_v))
    assert readiness_of(standing(TrialState.STAGED, {}), report).is_ready


def test_control_that_was_never_taken_is_no_loss() -> None:
    found = readiness_of(standing(TrialState.PLANNED, {}, has_control=False), GOOD)
    assert (found.steps, found.lost, found.losses) == ((), (), ())


def test_a_simulation_without_a_link_needs_only_the_worker() -> None:
    linkless = Standing(trial=TrialState.PLANNED, vehicle=VehicleState.READY, has_link=False, has_control=True)
    assert readiness_of(linkless, VehicleReport(worker=True)).losses == ()
    [away] = readiness_of(linkless, VehicleReport(worker=False)).losses
    assert (away.kind, "tage" in away.way_on) == ("worker away", False)
    [away] = readiness_of(replace(linkless, trial=TrialState.FLYING), VehicleReport(worker=False)).losses
    assert (away.kind, "remote control" in away.way_on) == ("worker away", False)


def test_every_loss_that_can_be_met_in_flight_says_what_the_operator_does_then() -> None:
    for kind, text in LOSSES.items():
        assert bool(text.what_in_flight) == bool(text.way_on_in_flight), kind
        assert text.what, kind
        assert text.way_on, kind
