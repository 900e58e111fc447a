"""The paper's tables and the takeoffs behind them (its figures 7 and 11), flown again through the gate of a campaign.

Each table lists the gains of the paper's successive flights with the published error and a reference error, which was
measured once for this program on the vehicle that represents the table's: the autopilot's own vertical loop closed
around this program's JSBSim quadrotor for Table 1, the noise-free twin for Table 2. The paper flew Table 1 on
Paparazzi's JSBSim simulation, whose airframe it does not publish. The twin's parameters were fitted to the errors of
Table 2, so that its agreement with them is circular.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np

from app.core.definition import Definition
from app.core.experiments import get_experiment
from app.core.experiments.base import prior_distribution
from app.core.formatting import percent
from app.core.policy import Gains
from app.core.records.trajectory import Samples, Trajectory
from app.core.tuning.gate import GateResult, check_policy, require_flyable
from app.figures.panels import Line, Panel, Plot, Style
from app.reproductions.campaigns import (
    CAMPAIGNS,
    Campaign,
    Run,
    Step,
    campaign_notes,
    campaign_rows,
    fly_campaign,
    step_numbers,
    steps_between,
)
from app.reproductions.results import OVERRULE, Progress, Result, Row, curve
from app.vehicles.base import FlightOptions, OptionValue, Vehicle
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
    """One row of a table: kp, ki, kd; the published error and that of the reference measurement, both in m.

    `is_legible` is false if the error cannot be read in the text of the paper and was inferred.
    """

    gains: tuple[int, int, int]
    paper: float
    reference: float
    is_legible: bool = True

    @property
    def run(self) -> Run:
        return Run(self.gains, self.paper)


@dataclass(frozen=True, slots=True)
class Table:
    """A table of the paper; `vehicle` is the kind of vehicle that represents the paper's."""

    number: int
    title: str
    vehicle: str
    flights: tuple[PublishedFlight, ...]

    @property
    def series(self) -> tuple[tuple[PublishedFlight, ...], tuple[PublishedFlight, ...]]:
        """The flights from the default gains, and those from the simplex's."""
        return self.flights[:FROM_DEFAULT], self.flights[FROM_DEFAULT:]


TABLES: Final[Mapping[str, Table]] = MappingProxyType({
    "table1": Table(1, "Simulated AR.Drone 2 (the paper's Table 1)", "jsbsim", (
        PublishedFlight((283, 13, 82), 0.3775, 0.3267),
        PublishedFlight((285, 44, 82), 0.2006, 0.1873),
        PublishedFlight((286, 102, 82), 0.1596, 0.1515),
        PublishedFlight((499, 177, 42), 0.1733, 0.1788, is_legible=False),
        PublishedFlight((324, 116, 75), 0.1521, 0.1467),
        PublishedFlight((1624, 1356, 195), 0.1006, 0.0928),
        PublishedFlight((1644, 1365, 155), 0.0966, 0.0925, is_legible=False),
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
_SOURCES: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType({
    "table1": (
        (
            "The paper flew Table 1 on Paparazzi's JSBSim simulation and does not publish its airframe; the one here "
            "is Gainline's own."
        ),
        (
            "Two published errors are illegible in the text of the accepted manuscript: run 4 from the default gains "
            "appears as 0.1722 and 0.1755, run 2 from the simplex's as 0.0900. 0.1733 and 0.0966 are inferred: "
            "elsewhere in this table the text has 0.2775 for 0.3775 and 1044 for 1644, and the paper calls 0.0940 its "
            "best."
        ),
    ),
    "table2": (
        "The twin's parameters were fitted to the errors of this very table, so its agreement with them is circular.",
    ),
})  # fmt: skip
"""Where a table's vehicle and its published errors come from, as far as it limits the comparison."""


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


def run_table(
    name: str, figure: str, on_progress: Progress, *, campaigns: Mapping[str, Definition] = CAMPAIGNS
) -> Result:
    """Fly a table on both vehicles, and the campaigns on its own; `figure` is the name of the paper's figure."""
    table = TABLES[name]
    kinds = (table.vehicle, *(kind for kind in VEHICLES if kind != table.vehicle))
    total = len(kinds) * len(table.flights) + sum(each.stop.max_flights for each in campaigns.values())
    rows: list[Row] = []
    own: list[Takeoff] = []
    done = 0

    def tell(doing: str) -> None:
        nonlocal done
        done += 1
        on_progress(done / total, doing)

    for kind in kinds:
        steps = _published_steps(table) if kind == table.vehicle else [None] * len(table.flights)
        for takeoff, step in zip(_flown(table, kind), steps, strict=True):
            rows.append(_row(table, kind, takeoff, step))
            if kind == table.vehicle:
                own.append(takeoff)
            tell(f"{kind}: {_label(takeoff.gains)} flown")
    flown = list(_campaigns(table, campaigns, tell))
    return Result(
        rows=(*rows, *(row for campaign in flown for row in campaign_rows(table.vehicle, campaign))),
        figures={
            f"{figure}-left": _plot(table, own[:FROM_DEFAULT], default=True),
            f"{figure}-right": _plot(table, own[FROM_DEFAULT:], default=False),
        },
        notes=(
            _describe_reference(table, own),
            *_SOURCES[name],
            (
                "Every gain set is checked by a campaign's gate first. ki = 1356 and similar values can overflow "
                f"and are flown by overruling the gate. The recorded reason: {OVERRULE}. The gate cannot be "
                "overruled on a real vehicle."
            ),
            *(campaign_notes(*flown) if flown else ()),
        ),
    )


def _describe_reference(table: Table, own: Sequence[Takeoff]) -> str:
    measured = np.array([takeoff.measured for takeoff in own])
    from_reference, from_paper = (
        float(np.abs(measured / np.array(errors) - 1.0).max())
        for errors in zip(*((takeoff.published.reference, takeoff.published.paper) for takeoff in own), strict=True)
    )
    return (
        f"Flown without noise. On {table.vehicle} the errors are within {percent(from_reference, 1)} of the reference, "
        f"which Gainline measured once itself, and within {percent(from_paper)} of the paper."
    )


def _published_steps(table: Table) -> list[Step | None]:
    """The step to each of the paper's flights; None for the first of each series."""
    return [step for part in table.series for step in (None, *steps_between([flight.run for flight in part]))]


def _campaigns(table: Table, campaigns: Mapping[str, Definition], tell: Callable[[str], None]) -> Iterator[Campaign]:
    experiment = get_experiment("takeoff")
    default, simplex = table.series
    with open_vehicle(
        table.vehicle, VEHICLES[table.vehicle], safe_gains=experiment.space.mapping(experiment.space.default)
    ) as vehicle:

        def fly(gains: Gains) -> Trajectory:
            flight = _fly(vehicle, gains)
            tell(f"{table.vehicle}: campaign, {_label(gains)} flown")
            return flight

        for title, definition in campaigns.items():
            published = default if definition.start.kind == "default" else simplex
            yield fly_campaign(title, definition, [flight.run for flight in published], fly)


def _row(table: Table, kind: str, flown: Takeoff, step: Step | None) -> Row:
    own = kind == table.vehicle
    inferred = () if flown.published.is_legible else ("published error inferred",)
    return Row(
        group=f"{kind}, which represents the paper's vehicle" if own else f"{kind}, for comparison",
        label=_label(flown.gains),
        unit="m",
        measured=flown.measured,
        paper=flown.published.paper,
        reference=flown.published.reference if own else None,
        ratio=flown.measured / flown.published.paper,
        note="; ".join(
            (f"overshoot {flown.overshoot_m:.3f} m", *([] if step is None else [f"step {step}"]), *inferred)
        ),
        gains=flown.gains,
        numbers={"overshoot_m": flown.overshoot_m, **step_numbers(step)},
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
            flight = _fly(vehicle, wanted)
            yield Takeoff(
                published=published,
                gains=wanted,
                measured=experiment.error(flight),
                overshoot_m=float((flight[experiment.output] - experiment.set_point(flight.time_s)).max()),
                overruled=overruled,
                trajectory=flight,
            )


def _fly(vehicle: Vehicle, gains: Gains) -> Trajectory:
    vehicle.stage(gains)
    return vehicle.fly(FlightOptions(seed=1), on_sample=lambda _: None, should_stop=lambda: None).trajectory
