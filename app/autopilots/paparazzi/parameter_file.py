"""Gains as a section of an airframe file."""

from typing import Final

from app.autopilots.parameter_file import ParameterFormat

PARAMETER_FILE: Final = ParameterFormat(
    suffix=".xml",
    comment="<!-- {} -->",
    lines=lambda values, _system: [
        '<section name="GUIDANCE_V" prefix="GUIDANCE_V_">',
        *(f'  <define name="{name}" value="{value:g}"/>' for name, value in values.items()),
        "</section>",
    ],
    named=lambda gain: f"HOVER_{gain.upper()}",
)
