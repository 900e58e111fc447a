"""The paper's tables, flown again.

Each table is the gains of the paper's successive flights with the error it published, and the error that was measured
once for reference on the vehicle that stands for the table's: the original vertical loop closed around JSBSim for
Table 1, the noise-free twin for Table 2.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from types import MappingProxyType
from typing import Final

from app.core.errors import InputError, Problem
from app.core.experiments import get_experiment
from app.vehicles.base import FlightOrder, OptionValue
from app.vehicles.open import open_vehicle

VEHICLES: Final[Mapping[str, Mapping[str, OptionValue]]] = MappingProxyType({"jsbsim": {}, "twin": {"scatter": 0.0}})
"""What reproductions fly on, without noise."""


@dataclass(frozen=True, slots=True)
class PublishedFlight:
    """One row of a table: kp, ki, kd; the error published and the one of the reference measurement, both in m."""

    gains: tuple[int, int, int]
    paper: float
    reference: float


@dataclass(frozen=True, slots=True)
class Table:
    """A table of the paper; `vehicle` is the kind that stands for what it was flown on."""

    number: int
    title: str
    vehicle: str
    flights: tuple[PublishedFlight, ...]


TABLES: Final[Mapping[str, Table]] = MappingProxyType({
    "table1": Table(1, "Simulated AR.Drone 2 (the paper's Table 1)", "jsbsim", (
        PublishedFlight((283, 13, 82), 0.3775, 0.3267),
        PublishedFlight((285, 44, 82), 0.2006, 0.1873),
        PublishedFlight((286, 102, 82), 0.1596, 0.1515),
        PublishedFlight((499, 177, 42), 0.1733, 0.1788),
        PublishedFlight((324, 116, 75), 0.1521, 0.1467),
        PublishedFlight((1624, 1356, 195), 0.1006, 0.0928),
        PublishedFlight((1644, 1365, 155), 0.0966, 0.0925),
        PublishedFlight((1649, 1365, 175), 0.0940, 0.0919),
        PublishedFlight((1652, 1365, 195), 0.0946, 0.0929),
    )),
    "table2": Table(2, "Real AR.Drone 2 (the paper's Table 2)", "twin", (
        PublishedFlight((283, 13, 82), 0.5102, 0.5236),
        PublishedFlight((286, 60, 81), 0.2537, 0.2341),
        PublishedFlight((301, 133, 65), 0.2265, 0.2325),
        PublishedFlight((301, 135, 59), 0.2652, 0.2579),
        PublishedFlight((301, 134, 62), 0.2483, 0.2437),
        PublishedFlight((1624, 1356, 195), 0.1218, 0.1189),
        PublishedFlight((1599, 1366, 130), 0.1249, 0.1281),
        PublishedFlight((1612, 1361, 163), 0.1278, 0.1211),
    )),
})  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Reproduced:
    """One gain set of a table flown on one vehicle: errors in m, `ratio` measured over published.

    `reference` is the reference measurement, on the vehicle that stands for the table's own; None on the other one.
    """

    table: int
    vehicle: str
    gains: dict[str, float]
    paper: float
    measured: float
    ratio: float
    overshoot_m: float
    reference: float | None

    def as_json(self) -> dict[str, object]:
        return asdict(self)


def reproduce(
    table: str,
    *,
    vehicles: Sequence[str] | None = None,
    on_row: Callable[[Reproduced], None] | None = None,
) -> list[Reproduced]:
    """Fly every gain set of `table` (`table1`, `table2`), without noise, on each of `vehicles`.

    Both vehicles by default, first the one that stands for the table's own. `on_row` is told of each flight as it is
    scored. Raises InputError for an unknown table or vehicle.
    """
    if table not in TABLES:
        raise InputError(
            "There is no such table.",
            hint=f"Choose one of: {', '.join(TABLES)}.",
            problems=(Problem("table", f"unknown name {table!r}"),),
        )
    own = TABLES[table].vehicle
    kinds = vehicles if vehicles is not None else (own, *(kind for kind in VEHICLES if kind != own))
    if unknown := [kind for kind in kinds if kind not in VEHICLES]:
        raise InputError(
            "Tables are not reproduced on this vehicle.",
            hint=f"Choose among: {', '.join(VEHICLES)}.",
            problems=tuple(Problem("vehicle", f"unknown kind {kind!r}") for kind in unknown),
        )
    rows: list[Reproduced] = []
    for row in (row for kind in kinds for row in _flown(TABLES[table], kind)):
        rows.append(row)
        if on_row is not None:
            on_row(row)
    return rows


def _flown(table: Table, kind: str) -> Iterator[Reproduced]:
    experiment = get_experiment("takeoff")
    safe_gains = experiment.space.mapping(experiment.space.default)
    with open_vehicle(kind, VEHICLES[kind], safe_gains=safe_gains) as vehicle:
        for published in table.flights:
            gains = vehicle.stage(dict(zip(experiment.space.names, published.gains, strict=True)))
            flight = vehicle.fly(FlightOrder(seed=1), on_sample=lambda _: None, should_abort=lambda: None).trajectory
            measured = experiment.error(flight)
            overshoot = float((flight[experiment.output] - experiment.set_point(flight.time_s)).max())
            yield Reproduced(
                table=table.number,
                vehicle=kind,
                gains=gains,
                paper=published.paper,
                measured=measured,
                ratio=measured / published.paper,
                overshoot_m=overshoot,
                reference=published.reference if kind == table.vehicle else None,
            )
