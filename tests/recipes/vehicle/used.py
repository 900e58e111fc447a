"""The vehicle is among those that can be chosen; the contract of all vehicles is tested with it besides."""

from app.vehicles.registry import VEHICLE_KINDS


def test_it_is_registered() -> None:
    assert VEHICLE_KINDS["laden"].title == "Laden twin"
