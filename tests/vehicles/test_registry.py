from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pytest

import app.vehicles.registry as opening
from app.core.errors import InputError, Problem
from app.core.policy import Gains
from app.vehicles.base import SafeGainsError, Vehicle, VehicleError, find_mismatch
from app.vehicles.kinds import Options, VehicleKind
from app.vehicles.registry import VEHICLE_KINDS, check_options, get_kind, open_vehicle
from app.vehicles.simulated import SimulatedVehicle, Simulation
from tests.vehicles.flying import SAFE, TUNED


def does_not_fly(_options: object, _seed: int) -> Simulation:
    raise VehicleError("It does not fly.", hint="It is a test.")


class StubbornVehicle(SimulatedVehicle):
    """A vehicle that takes experimental gains and then keeps them."""

    closed = False

    def read_gains(self) -> dict[str, float]:
        return dict(TUNED)

    def close(self) -> None:
        self.closed = True


def opened_stubborn(_options: Options, safe_gains: Gains, _folder: Path | None) -> Vehicle:
    return StubbornVehicle("stubborn", safe_gains, {}, does_not_fly)


STUBBORN = VehicleKind(
    name="stubborn",
    title="Stubborn",
    line="",
    is_real=False,
    experiments=("takeoff",),
    options=(),
    open=opened_stubborn,
)


def test_a_vehicle_that_keeps_experimental_gains_is_reported_loudly(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(opening, "VEHICLE_KINDS", {**VEHICLE_KINDS, "stubborn": STUBBORN})
    held: list[Vehicle] = []
    with (
        pytest.raises(SafeGainsError, match="does not hold its safe gains"),
        open_vehicle("stubborn", {}, safe_gains=SAFE) as vehicle,
    ):
        held.append(vehicle)
    assert isinstance(held[0], StubbornVehicle)
    assert held[0].closed


def test_a_flight_made_elsewhere_cannot_be_flown_here() -> None:
    with pytest.raises(VehicleError) as refusal, open_vehicle("import", {}, safe_gains=SAFE):
        pass
    assert "is flown outside Gainline" in refusal.value.message
    assert "time_s and altitude_m" in refusal.value.hint
    assert not VEHICLE_KINDS["import"].can_fly


def test_an_unknown_kind_names_the_field_and_the_choices() -> None:
    with pytest.raises(InputError) as refusal:
        get_kind("balloon")
    (problem,) = refusal.value.problems
    assert problem == Problem("vehicle.kind", "must be one of jsbsim, twin, lti, mavlink, import, got 'balloon'")


def test_options_are_completed_with_their_defaults() -> None:
    options = check_options("twin", {"scatter": 0})
    defaults = {option.name: option.default for option in VEHICLE_KINDS["twin"].options}
    assert options == defaults | {"scatter": 0.0}


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"scatter": -0.1}, "must be between 0 and 5 ×, got -0.1"),
        ({"quadratic_share": 2.0}, "must be between 0 and 1, got 2"),
        ({"scatter": float("nan")}, "must be a finite number, got nan"),
        ({"scatter": "much"}, "must be a number, got 'much'"),
        ({"scatter": True}, "must be a number, got True"),
        ({"scatter": None}, "must be a number, got None"),
    ],
)
def test_an_impossible_option_is_refused_with_its_reason(options: Mapping[str, object], reason: str) -> None:
    with pytest.raises(InputError) as refusal:
        check_options("twin", options, field="campaign.vehicle")
    (name,) = options
    assert [(p.field, p.reason) for p in refusal.value.problems] == [(f"campaign.vehicle.options.{name}", reason)]


def test_every_wrong_option_is_named_at_once() -> None:
    with pytest.raises(InputError) as refusal:
        check_options("jsbsim", {"mass_kg": 9, "colour": "red", "wind_m_s": -1})
    assert {problem.field.rpartition(".")[2] for problem in refusal.value.problems} == {"mass_kg", "colour", "wind_m_s"}


@pytest.mark.parametrize("kind", VEHICLE_KINDS)
def test_every_default_option_is_within_its_own_range(kind: str) -> None:
    options = VEHICLE_KINDS[kind].options
    assert check_options(kind, {option.name: option.default for option in options}) == check_options(kind, {})


class DeafVehicle(SimulatedVehicle):
    """A vehicle whose link breaks once it has experimental gains, and whose closing then fails too."""

    def stage(self, gains: Gains) -> dict[str, float]:
        if self.read_gains() != SAFE:
            raise ConnectionError("the link is gone")
        return super().stage(gains)

    def close(self) -> None:
        raise VehicleError("The link cannot be closed.", hint="It is gone.")


def opened_deaf(_options: Options, safe_gains: Gains, _folder: Path | None) -> Vehicle:
    return DeafVehicle("deaf", safe_gains, {}, does_not_fly)


def test_safe_gains_that_cannot_even_be_sent_are_reported_as_loudly(monkeypatch: pytest.MonkeyPatch) -> None:
    deaf = replace(STUBBORN, name="deaf", open=opened_deaf)
    monkeypatch.setattr(opening, "VEHICLE_KINDS", {**VEHICLE_KINDS, "deaf": deaf})
    with (
        pytest.raises(SafeGainsError, match=r"could not be set\. the link is gone\.") as loud,
        open_vehicle("deaf", {}, safe_gains=SAFE) as vehicle,
    ):
        vehicle.stage(TUNED)
    assert "Do not fly it" in loud.value.hint


@pytest.mark.parametrize(
    ("held", "mismatch"),
    [
        ({"kp": 283, "ki": 0.123456789}, ""),
        ({"kp": 300, "ki": 0.12345678}, "kp is 300 instead of 283, ki is 0.12345678 instead of 0.123456789"),
        ({"kp": 283}, "ki is missing instead of 0.123456789"),
        ({"kp": 283, "ki": 0.123456789, "kd": 1}, "kd is 1 instead of none"),
    ],
)
def test_gains_that_were_read_back_are_compared_by_name(held: dict[str, float], mismatch: str) -> None:
    assert find_mismatch(held, {"kp": 283, "ki": 0.123456789}) == mismatch
