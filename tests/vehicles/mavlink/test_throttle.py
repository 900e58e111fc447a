"""The throttle that a vehicle reports: carried with the samples and recorded, and nothing else depends on it."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import ClassVar
from unittest import mock

import numpy as np
import pytest

from app.autopilots.autopilot import Autopilot
from app.autopilots.dialects import FieldValue, Message, number
from app.autopilots.measurements import Measurement, Throttle
from app.autopilots.registry import AUTOPILOTS
from app.autopilots.simulated.body import OutgoingMessage
from app.core.experiments.takeoff import Takeoff
from app.simdrone.fault_kinds import Fault
from app.vehicles.base import FlightOptions, FlightRecord, Sample
from tests.vehicles.flying import Watcher, never
from tests.vehicles.mavlink.replaying import FLOWN, messages
from tests.vehicles.mavlink.rigs import SAFE, LockstepRig
from tests.vehicles.mavlink.test_connected import connected

NAMES = sorted(AUTOPILOTS)
FLOWN_ON = ["paparazzi", *(pytest.param(other, marks=pytest.mark.complete) for other in ("ardupilot", "px4"))]
"""The everyday ring flies one of them."""
ORDER = FlightOptions(seed=1, window_s=12.0)
HUD: dict[str, FieldValue] = {"airspeed": 0.0, "groundspeed": 0.0, "heading": 0, "alt": 0.0, "climb": 0.0}
TARGET: dict[str, FieldValue] = {
    "time_boot_ms": 1000,
    "q": [1.0, 0.0, 0.0, 0.0],
    **dict.fromkeys(("body_roll_rate", "body_pitch_rate", "body_yaw_rate"), 0.0),
}


def measured(profile: Autopilot, kind: str, **fields: FieldValue) -> Measurement | None:
    """What the profile makes of a message that came over the wire."""
    codec = profile.dialect.codec(system=1, component=1)
    [message] = codec.parse(codec.pack(profile.dialect.message(kind, fields)))
    return profile.measure(message)


@pytest.mark.parametrize("autopilot", NAMES)
@pytest.mark.parametrize(("percent", "share"), [(0, 0.0), (62, 0.62), (100, 1.0), (101, None), (0xFFFF, None)], ids=str)
def test_percent_become_a_share_of_full_and_nothing_beyond(autopilot: str, percent: int, share: float | None) -> None:
    found = measured(AUTOPILOTS[autopilot], "VFR_HUD", **HUD, throttle=percent)
    assert found == (None if share is None else Throttle(share))


@pytest.mark.parametrize(
    ("thrust", "mask", "share"),
    [(0.5, 0, 0.5), (0.5, 64, None), (1.2, 0, None), (-0.1, 0, None), (float("nan"), 0, None)],
)
def test_px4_s_thrust_command_is_read_where_it_is_used_and_possible(
    thrust: float, mask: int, share: float | None
) -> None:
    found = measured(AUTOPILOTS["px4"], "ATTITUDE_TARGET", **TARGET, thrust=thrust, type_mask=mask)
    assert found == (None if share is None else Throttle(share, exact=True))


@pytest.mark.parametrize("gains", FLOWN)
def test_the_real_paparazzi_hovers_at_its_hover_throttle_and_reports_none_on_the_ground(
    gains: tuple[int, int, int],
) -> None:
    """One report every 1.3 s of two whole trials."""
    found = [AUTOPILOTS["paparazzi"].measure(each.message) for each in messages(gains, "VFR_HUD", from_vehicle=True)]
    shares = [each.share for each in found if isinstance(each, Throttle)]
    assert len(shares) == len(found) >= 59
    assert (shares[0], shares[-1]) == (0.0, 0.0)
    assert 0.6 <= float(np.median([share for share in shares if share > 0.0])) <= 0.65


Flown = tuple[FlightRecord, list[Sample], list[tuple[float, Message]]]


def flown(autopilot: str, fault: "type[Hostile] | None" = None) -> Flown:
    """The record of a trial with the safe gains, its live samples, and what was sent to the drone with its time."""
    return _flown(autopilot, "" if fault is None else fault.name)


@cache
def _flown(autopilot: str, fault: str) -> Flown:
    watcher = Watcher()
    with (
        mock.patch("app.simdrone.drone.FAULTS", {kind.name: kind for kind in Hostile.__subclasses__()}),
        LockstepRig(autopilot, faults=[f"{fault}@connect"] if fault else []) as rig,
    ):
        if autopilot != "paparazzi":
            rig.switch_on_failsafes()
        with connected(rig) as vehicle:
            vehicle.stage(SAFE[autopilot])
            record = vehicle.fly(ORDER, on_sample=watcher.see, should_stop=never)
        return record, watcher.samples, rig.heard


@pytest.mark.complete
@pytest.mark.parametrize("autopilot", FLOWN_ON)
def test_it_is_recorded_and_shown_live(autopilot: str) -> None:
    record, live, _ = flown(autopilot)
    flight = record.trajectory
    throttle = flight["throttle"]
    assert record.ending == "completed"
    assert np.allclose(throttle * 100.0, np.round(throttle * 100.0), atol=1e-9)
    assert throttle[flight.time_s < 0.0][0] == 0.0
    assert throttle[flight.time_s > 8.0] == pytest.approx(0.62, abs=0.06)
    assert {sample.channels["throttle"] for sample in live} <= set(throttle)
    assert len(live) > 500


def test_no_model_is_fitted_to_it_because_it_is_rare_and_rounded() -> None:
    record, _, _ = flown("paparazzi")
    takeoff = Takeoff()
    gains = takeoff.space.default
    assert takeoff.disturbances(record.trajectory, gains, takeoff.nominal_model) is None


@pytest.mark.complete
@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_it_is_requested_on_the_ground_only(autopilot: str) -> None:
    _, _, heard = flown(autopilot)
    of_hud = [at_s for at_s, message in heard if _requests(message, 74)]
    armed_s = min(at_s for at_s, message in heard if _is_command(message, 400) and number(message, "param1") == 1.0)
    disarmed_s = max(at_s for at_s, _ in heard)
    assert of_hud
    assert [at_s for at_s in of_hud if armed_s <= at_s < disarmed_s] == []


def _is_command(message: Message, code: int) -> bool:
    return message.get_type() == "COMMAND_LONG" and number(message, "command") == code


def _requests(message: Message, kind: int) -> bool:
    return _is_command(message, 511) and number(message, "param1") == kind


class Hostile(Fault):
    """Changes the reports of throttle."""

    name: ClassVar[str]

    def transform_messages(self, letters: Sequence[OutgoingMessage]) -> list[OutgoingMessage]:
        return [each for letter in letters for each in (self.changed(letter) if letter.kind == "VFR_HUD" else [letter])]

    def changed(self, letter: OutgoingMessage) -> list[OutgoingMessage]:
        raise NotImplementedError


class NoThrottle(Hostile):
    """VFR_HUD is never sent."""

    name = "no-throttle"

    def changed(self, letter: OutgoingMessage) -> list[OutgoingMessage]:
        return []


class ThrottleEnds(Hostile):
    """VFR_HUD is no longer sent once the drone is above 1 m."""

    name = "throttle-ends"
    ended = False

    def changed(self, letter: OutgoingMessage) -> list[OutgoingMessage]:
        self.ended = self.ended or self.drone.body.altitude_m > 1.0
        return [] if self.ended else [letter]


class WildThrottle(Hostile):
    """Full and none in turns."""

    name = "wild-throttle"
    count = 0

    def changed(self, letter: OutgoingMessage) -> list[OutgoingMessage]:
        self.count += 1
        return [with_throttle(letter, 100 * (self.count % 2))]


def with_throttle(letter: OutgoingMessage, percent: int) -> OutgoingMessage:
    return replace(letter, fields={**letter.fields, "throttle": percent})


@pytest.mark.complete
@pytest.mark.parametrize("autopilot", FLOWN_ON)
def test_a_vehicle_that_reports_none_has_none_rather_than_zero(autopilot: str) -> None:
    record, live, _ = flown(autopilot, NoThrottle)
    assert record.ending == "completed"
    assert "throttle" not in record.trajectory.channels
    assert [sample for sample in live if "throttle" in sample.channels] == []


@pytest.mark.complete
def test_a_report_that_is_too_old_is_not_shown_and_not_recorded() -> None:
    record, live, _ = flown("px4", ThrottleEnds)
    has = [sample.time_s for sample in live if "throttle" in sample.channels]
    has_not = [sample.time_s for sample in live if "throttle" not in sample.channels]
    left_s = next(sample.time_s for sample in live if sample["altitude_m"] > 1.0)
    assert max(has) == pytest.approx(left_s + 4.0, abs=0.2)
    assert min(has_not) > max(has)
    assert "throttle" not in record.trajectory.channels


@pytest.mark.complete
@pytest.mark.parametrize("autopilot", FLOWN_ON)
@pytest.mark.parametrize("fault", [WildThrottle, NoThrottle])
def test_nothing_that_is_sent_and_nothing_else_recorded_depends_on_it(autopilot: str, fault: type[Hostile]) -> None:
    usual, _, sent = flown(autopilot)
    record, _, sent_too = flown(autopilot, fault)
    assert [(at_s, message.get_msgbuf()) for at_s, message in sent_too] == [
        (at_s, message.get_msgbuf()) for at_s, message in sent
    ]
    np.testing.assert_array_equal(record.trajectory["altitude_m"], usual.trajectory["altitude_m"])
    assert (record.ending, record.reason) == (usual.ending, usual.reason)
