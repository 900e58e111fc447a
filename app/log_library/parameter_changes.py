"""Which parameters of a vehicle differ between two of its logs, the most telling first."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from app.autopilots.autopilot import Autopilot


class ParameterGroup(StrEnum):
    """Gains, further parameters of the altitude loop, all others, those that the autopilot writes by itself, and those
    that one log lacks: whether they changed is unknown. In the order in which they are listed."""

    GAIN = "gain"
    LOOP = "loop"
    OTHER = "other"
    SELF_WRITTEN = "self-written"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class ParameterChange:
    """A parameter by the name and in the unit of the newer log, and its values; None where a log lacks it."""

    name: str
    before: float | None
    after: float | None
    group: ParameterGroup


def parameter_changes(
    autopilot: Autopilot, old: Mapping[str, float], new: Mapping[str, float]
) -> list[ParameterChange]:
    """All differences of two logs' parameters by the firmware's names, as `final_parameters` has them: gains in their
    usual order, from the outer loops to the inner, the rest by name."""
    before, places = autopilot.in_names_of(old, new.keys()), _places(autopilot)
    is_self_written, order = re.compile(autopilot.self_written), list(ParameterGroup)

    def place_of(name: str) -> tuple[ParameterGroup, int]:
        (usual_name,) = autopilot.in_names_of({name: 0.0}, ())
        written = ParameterGroup.SELF_WRITTEN if is_self_written.fullmatch(name) else ParameterGroup.OTHER
        group, place = places.get(usual_name, (written, 0))
        return group if name in before and name in new else ParameterGroup.UNKNOWN, place

    differing = {
        name: place_of(name) for name in before.keys() | new.keys() if _differ(before.get(name), new.get(name))
    }
    return [
        ParameterChange(name, before.get(name), new.get(name), group)
        for name, (group, _) in sorted(
            differing.items(), key=lambda each: (order.index(each[1][0]), each[1][1], each[0])
        )
    ]


def _places(autopilot: Autopilot) -> dict[str, tuple[ParameterGroup, int]]:
    """Group and place in it of gains and of the loop's other parameters, by the oldest names."""
    gains = [*(each.parameter for each in autopilot.logged_gains[0]), *autopilot.further_gains]
    loop = [name for names in autopilot.loop_parameters for name in names if name not in gains]
    listed = ((ParameterGroup.LOOP, loop), (ParameterGroup.GAIN, gains))
    return {name: (group, place) for group, names in listed for place, name in enumerate(names)}


def _differ(old: float | None, new: float | None) -> bool:
    """Whether values differ, fractions in single precision, as which all autopilots have them: a log may be text."""
    if old is None or new is None or old == new or float(new).is_integer():
        return old != new
    return bool(np.float32(old) != np.float32(new))
