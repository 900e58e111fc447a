"""A recorded signal beside that of a replica, to be drawn."""

from dataclasses import dataclass

Curve = tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Overlaid:
    """One signal over time, recorded and from the replica, of equal length.

    `differing_s` and `differing` are time and value of each mark where the recorded signal differs.
    """

    label: str
    digits: int
    time_s: Curve
    recorded: Curve
    replica: Curve
    differing_s: Curve = ()
    differing: Curve = ()
