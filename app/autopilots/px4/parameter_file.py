"""Parameter files as QGroundControl loads them."""

from typing import Final

from app.autopilots.parameter_file import ParameterFormat

_REAL32: Final = 9
"""MAV_PARAM_TYPE of a floating-point value."""

PARAMETER_FILE: Final = ParameterFormat(
    suffix=".params",
    comment="# {}",
    lines=lambda values, system: [
        "# Vehicle-Id Component-Id Name Value Type",
        *(f"{system}\t1\t{name}\t{value:g}\t{_REAL32}" for name, value in values.items()),
    ],
)
"""Vehicle, component, name, value and type, separated by tabs."""
