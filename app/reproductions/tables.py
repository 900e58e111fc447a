"""The paper's tables and the takeoffs behind them (its figures 7 and 11), flown again through the gate of a campaign.

Each table lists the gains of the paper's successive flights with the published error and a reference error, which was
measured once on the vehicle that represents the table's: the original vertical loop closed around JSBSim for Table 1,
the noise-free twin for Table 2.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from app.core.definition import Definition
from app.core.experiments import get_experiment
from app.core.experiments.base import prior_distribution
from app.core.policy import Gains
from app.core.records.trajectory import Samples, Trajectory
from app.core.tuning.gate import GateResult, check_policy, require_flyable
from app.figures.panels import Line, Panel, Plot, Style
from app.reproductions.results import OVERRULE, Progress, Result, Row, curve
from app.vehicles.base import FlightOptions, OptionValue
from app.vehicles.registry import get_kind, open_vehicle

_CAMPAIGN: Final = Definition(experiment="takeoff", first_step_fraction=1.0)
"""The default campaign, without a step limit inside its bounds."""


def judge_takeoff(gains: Gains) -> GateResult:
    """Check a takeoff's gains as before the first flight. Takes a tenth of a second."""
    experiment = get_experiment(_CAMPAIGN.experiment)
    return check_policy(_CAMPAIGN, experiment, experiment.space, gains, (), spread=prior_distribution(experiment))


def overruled_for(gains: Gains, vehicle: str) -> str:
    """The reason for flying these gains on this kind of vehicle despite the gate's refusal; empty without a refusal.

    Raises GainsError if the refusal cannot be overruled.
    """
    return require_flyable(judge_takeoff(gains), overrule=OVERRULE, is_real=get_kind(vehicle).is_real)


VEHICLES: Final[Mapping[str, Mapping[str, OptionValue]]] = MappingProxyType({"jsbsim": {}, "twin": {"scatter": 0.0}})
"""Vehicles used by reproductions, with options for flights without noise."""

FROM_DEFAULT: Final = 5
"""Number of flights in each table that start from the default gains; the others start from the simplex's."""
LEFT_WINDOW: Final = ((0.0, 30.0), (0.0, 3.7))
RIGHT_WINDOW: Final = ((1.0, 10.0), (2.7, 3.15))
"""Time (s) and altitude (m) shown: the whole takeoff (left), and the overshoot alone (right)."""
_RUNS: Final[tuple[Style, ...]] = ("run 1", "run 2", "run 3", "run 4", "run 5")


@dataclass(frozen=True, slots=True)
class PublishedFlight:
    """One row of a table: kp, ki, kd; the published error and that of the reference measurement, both in m."""

    gains: tuple[int, int, int]
    paper: float
    reference: float


@dataclass(frozen=True, slots=True)
class Table:
    """A table of the paper; `vehicle` is the kind of vehicle that represents the paper's."""

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
class Takeoff:
    """One gain set of a table flown on one vehicle: its error and its overshoot above the set point, both in m.

    `overruled` is the reason for flying it although the gate refuses it.
    """

    published: PublishedFlight
    gains: dict[str, float]
    measured: float
    overshoot_m: float
    overruled: str
    trajectory: Trajectory


def run_table(name: str, figure: str, on_progress: Progress) -> Result:
    """Fly a table on both vehicles; `figure` is the name of the paper's figure of these flights."""
    table = TABLES[name]
    kinds = (table.vehicle, *(kind for kind in VEHICLES if kind != table.vehicle))
    total, rows, own = len(kinds) * len(table.flights), [], []
    for kind in kinds:
        for takeoff in _flown(table, kind):
            rows.append(_row(table, kind, takeoff))
            if kind == table.vehicle:
                own.append(takeoff)
            on_progress(len(rows) / total, f"{kind}: {_label(takeoff.gains)} flown")
    return Result(
        rows=tuple(rows),
        figures={
            f"{figure}-left": _plot(table, own[:FROM_DEFAULT], default=True),
            f"{figure}-right": _plot(table, own[FROM_DEFAULT:], default=False),
        },
        notes=(
            (
                "Flown without noise. The reference is Gainline's own target: within 1.5 % on the JSBSim "
                "quadrotor, within 1 % on the twin."
            ),
            (
                "Every gain set is checked by a campaign's gate first. ki = 1356 and similar values can overflow "
                f"and are flown by overruling the gate. The recorded reason: {OVERRULE}. The gate cannot be "
                "overruled on a real vehicle."
            ),
        ),
    )


def _row(table: Table, kind: str, flown: Takeoff) -> Row:
    own = kind == table.vehicle
    return Row(
        group=f"{kind}, which represents the paper's vehicle" if own else f"{kind}, for comparison",
        label=_label(flown.gains),
        unit="m",
        measured=flown.measured,
        paper=flown.published.paper,
        reference=flown.published.reference if own else None,
        ratio=flown.measured / flown.published.paper,
        note=f"overshoot {flown.overshoot_m:.3f} m",
        gains=flown.gains,
        numbers={"overshoot_m": flown.overshoot_m},
        overruled=flown.overruled,
    )


def _label(gains: Mapping[str, float]) -> str:
    return ", ".join(f"{value:g}" for value in gains.values())


def _plot(table: Table, shown: Sequence[Takeoff], *, default: bool) -> Plot:
    """Takeoffs of one of the table's two series on its own vehicle."""
    experiment = get_experiment("takeoff")
    (first_s, last_s), height = LEFT_WINDOW if default else RIGHT_WINDOW
    first = shown[0].trajectory
    best = min(range(len(shown)), key=lambda index: shown[index].measured)
    return Plot(
        title="from the default gains" if default else "from the simplex's gains",
        summary=f"Altitude of {len(shown)} takeoffs on {table.vehicle}; run {best + 1} is best, "
        f"{shown[best].measured:.4f} m.",
        x_title="Time since the command (s)",
        x_range=(first_s, last_s),
        panels=(
            Panel(
                y_title="Altitude (m)",
                y_range=height,
                lines=(
                    *(
                        _takeoff(f"Run {number}", style, flown, last_s)
                        for number, (style, flown) in enumerate(zip(_RUNS, shown, strict=False), start=1)
                    ),
                    _until("Reference", "reference", first, first["reference_m"], last_s),
                    _until("Set point", "goal", first, experiment.set_point(first.time_s), last_s),
                ),
            ),
        ),
    )


def _takeoff(name: str, style: Style, flown: Takeoff, last_s: float) -> Line:
    note = f"{_label(flown.gains)}: {flown.measured:.4f} m, published {flown.published.paper:.4f} m"
    return _until(name, style, flown.trajectory, flown.trajectory["altitude_m"], last_s, note=note)


def _until(name: str, style: Style, flight: Trajectory, values: Samples, last_s: float, *, note: str = "") -> Line:
    shown = flight.time_s <= last_s
    return curve(name, style, flight.time_s[shown], values[shown], note=note)


def _flown(table: Table, kind: str) -> Iterator[Takeoff]:
    experiment = get_experiment("takeoff")
    safe_gains = experiment.space.mapping(experiment.space.default)
    with open_vehicle(kind, VEHICLES[kind], safe_gains=safe_gains) as vehicle:
        for published in table.flights:
            wanted = dict(zip(experiment.space.names, map(float, published.gains), strict=True))
            overruled = overruled_for(wanted, kind)
            gains = vehicle.stage(wanted)
            flight = vehicle.fly(FlightOptions(seed=1), on_sample=lambda _: None, should_stop=lambda: None).trajectory
            yield Takeoff(
                published=published,
                gains=gains,
                measured=experiment.error(flight),
                overshoot_m=float((flight[experiment.output] - experiment.set_point(flight.time_s)).max()),
                overruled=overruled,
                trajectory=flight,
            )
