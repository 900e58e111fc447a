"""Numbers, gains and times as printed in a report: with digits that match the uncertainty, and with units."""

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Final

from app.common.schemas import Interval
from app.core.definition import OptionValue
from app.core.formatting import decimals

NOTHING: Final = "–"


def number(value: float | None, digits: int = 3) -> str:
    """`0.132`; with a true minus sign, and a dash for None."""
    return NOTHING if value is None else f"{value:.{digits}f}".replace("-", "−")


def plus_minus(value: float | None, uncertainty: float | None, unit: str) -> str:
    """`0.132 ± 0.007 m`; the value alone if its uncertainty is not known."""
    if value is None:
        return NOTHING
    after = f" {unit}" if unit else ""
    if uncertainty is None or uncertainty <= 0:
        return number(value) + after
    digits = decimals(uncertainty)
    return f"{number(value, digits)} ± {number(uncertainty, digits)}{after}"


def interval(span: Interval | None) -> str:
    """`0.093 … 0.118`."""
    return NOTHING if span is None else f"{number(span.lower)} … {number(span.upper)}"


def gain(value: float) -> str:
    """An integer gain in full, any other with four significant digits."""
    text = f"{value:.0f}" if float(value).is_integer() else f"{value:.4g}"
    return text.replace("-", "−")


def gains(values: Mapping[str, float]) -> str:
    """`kp 283, ki 13, kd 82`."""
    return ", ".join(f"{name} {gain(value)}" for name, value in values.items())


def percent(share: float) -> str:
    return f"{100 * share:.3g} %"


def option(value: OptionValue, unit: str = "") -> str:
    """A setting: yes or no for switches, numbers in short form, texts unmodified."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    text = f"{value:g}".replace("-", "−") if isinstance(value, int | float) else value
    return f"{text} {unit}" if unit else text


def instant(at: datetime | None) -> str:
    """`22 Nov 2026, 14:03 CET (13:03 UTC)` in this machine's time zone; UTC alone if the zone is at UTC."""
    if at is None:
        return NOTHING
    here = at.astimezone()
    there = at.astimezone(UTC)
    local = f"{here.day} {here:%b %Y, %H:%M}"
    if not here.utcoffset():
        return f"{local} UTC"
    utc = f"{there:%H:%M}" if there.date() == here.date() else f"{there.day} {there:%b, %H:%M}"
    return f"{local} {here.tzname()} ({utc} UTC)"


def count(amount: int, noun: str) -> str:
    return f"{amount} {noun}{'' if amount == 1 else 's'}"
