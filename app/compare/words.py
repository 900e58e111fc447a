"""Formatting of numbers and flights in sentences."""

from collections import Counter
from collections.abc import Mapping, Sequence

from app.core.statistics import Group
from app.core.strategies.history import format_gains
from app.core.wording import plus_minus
from app.db.models import CampaignRow, TrialRow


def measured(value: float, standard_error: float | None, unit: str) -> str:
    """`0.105 ± 0.012 m`, with as many digits as the uncertainty justifies; the value alone if it has none."""
    return plus_minus(value, standard_error, unit) if standard_error else f"{value:.3f} {unit}"


def percent(confidence: float) -> str:
    """A confidence as a percentage; `more than 99 %` instead of a value that rounds to certainty."""
    return "more than 99 %" if confidence > 0.995 else f"{100.0 * confidence:.0f} %"


def flights(count: int) -> str:
    return "1 flight" if count == 1 else f"{count} flights"


def named(group: Group, name: str) -> str:
    """`flight 3 (kp 400, ki 20, kd 100; 2 flights)`: a flight with its gains and their number of flights."""
    return f"{name} ({format_gains(group.gains)}; {flights(group.size)})"


def capitalised(sentence: str) -> str:
    return sentence[:1].upper() + sentence[1:]


def names_of(rows: Sequence[TrialRow], campaigns: Mapping[int, CampaignRow]) -> list[str]:
    """`flight 3`; with the campaign's name if there are several, and with its id if two have the same name."""
    used = {row.campaign_id: campaigns[row.campaign_id].name for row in rows}
    if len(used) == 1:
        return [f"flight {row.number}" for row in rows]
    alike = Counter(used.values())
    return [
        f"flight {row.number} of {(name := used[row.campaign_id])}"
        + (f" (campaign {row.campaign_id})" if alike[name] > 1 else "")
        for row in rows
    ]


def file_stem(rows: Sequence[TrialRow]) -> str:
    """`compare-campaign-3-flights-1-4-campaign-5-flight-2`; only the number of flights if that would be too long."""
    numbers: dict[int, list[int]] = {}
    for row in rows:
        numbers.setdefault(row.campaign_id, []).append(row.number)
    parts = [
        f"campaign-{campaign_id}-flight{'s' if len(flown) > 1 else ''}-{'-'.join(map(str, flown))}"
        for campaign_id, flown in numbers.items()
    ]
    stem = "-".join(["compare", *parts])
    return stem if len(stem) <= 80 else f"compare-{len(rows)}-flights"
