from pathlib import Path

import pytest

from app.core.records.trajectory import CHANNEL_UNITS
from app.vehicles.base import OptionValue
from app.vehicles.registry import VEHICLE_KINDS

PAGE = (Path(__file__).parents[2] / "docs" / "vehicles.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("kind", VEHICLE_KINDS)
def test_every_vehicle_and_option_is_described_with_its_default(kind: str) -> None:
    assert f"## `{kind}`" in PAGE
    for option in VEHICLE_KINDS[kind].options:
        start = f"| `{option.name}` | {_shown(option.default)}"
        limits = "|" if option.lower is None else f"| {option.lower:g} … {option.upper:g} |"
        assert any(line.startswith(start) and limits in line for line in PAGE.splitlines()), option.name


def _shown(default: OptionValue) -> str:
    """As the page writes it: texts as code, nothing for an empty one."""
    if isinstance(default, bool):
        return str(default).lower()
    return f"{default:g}" if isinstance(default, int | float) else f"`{default}`" if default else ""


def test_every_column_of_an_uploaded_flight_is_described() -> None:
    for name in ("time_s", *CHANNEL_UNITS):
        assert f"`{name}`" in PAGE
