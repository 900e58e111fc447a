"""The paper's tables and the takeoffs behind them (its figures 7 and 11), flown again through the gate of a campaign.

Each table lists the gains of the paper's successive flights with the published error and a reference error, which was
measured once for this program on the vehicle that represents the table's: the autopilot's own vertical loop closed
around this program's JSBSim quadrotor for Table 1, the noise-free twin for Table 2. The paper flew Table 1 on
Paparazzi's JSBSim simulation, whose airframe it does not publish. The twin's parameters were fitted to the errors of
Table 2, so that its agreement with them is circular.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Final

from app.autopilots.registry import get_experiment
from app.core.definition import Definition
from app.core.experiments.base import prior_distribution
from app.core.formatting import percent
from app.core.policy import Gains
from app.core.records.trajectory import Samples, Trajectory
from app.core.tuning.evidence import Evidence
from app.core.tuning.gate import GateResult, check_policy, require_flyable
from app.figures.panels import Line, Panel, Plot, Style
from app.reproductions.campaigns import CAMPAIGNS, Run, campaign_notes, fly_campaign, gains_text, runs_of, step_numbers
from app.reproductions.results import OVERRULE, Progress, Result, Row, counted, curve
from app.vehicles.base import FlightOptions, OptionValue
from app.vehicles.registry import get_kind, open_vehicle

_CAMPAIGN: Final = Definition(experiment="takeoff", first_step_fraction=1.0)
"""The default campaign, without a step limit inside its bounds."""


def judge_takeoff(gains: Gains) -> GateResult:
    """Check a takeoff's gains as before the first flight. Takes a tenth of a second."""
    experiment = get_experiment(_CAMPAIGN.experiment)
    evidence = Evidence(definition=_CAMPAIGN, experiment=experiment, flights=())
    return check_policy(evidence, gains, spread=prior_distribution(experiment))


def overruled_for(gains: Gains, vehicle: str) -> str:
    """The reason for flying these gains on this kind of vehicle despite the gate's refusal; empty without a refusal.

    Raises GainsError if the refusal cannot be overruled.
    """
    return require_flyable(judge_takeoff(gains), overrule=OVERRULE, is_real=get_kind(vehicle).is_real)


VEHICLES: Final[Mapping[str, Mapping[str, OptionValue]]] = {"jsbsim": {}, "twin": {"scatter": 0.0}}
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


@dataclass(frozen=True, slots=True)
class Table:
    """A table of the paper; `vehicle` is the kind of vehicle that represents the paper's."""

    vehicle: str
    flights: tuple[PublishedFlight, ...]

    @property
    def series(self) -> dict[str, tuple[Run, ...]]:
        """The paper's runs by the kind of their start."""
        runs = [(flight.gains, flight.paper) for flight in self.flights]
        return {"default": runs_of(runs[:FROM_DEFAULT]), "simplex": runs_of(runs[FROM_DEFAULT:])}


TABLES: Final[Mapping[str, Table]] = {
    "table1": Table("jsbsim", (
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
    "table2": Table("twin", (
        PublishedFlight((283, 13, 82), 0.5102, 0.5236),
        PublishedFlight((286, 60, 81), 0.2537, 0.2341),
        PublishedFlight((301, 133, 65), 0.2265, 0.2325),
        PublishedFlight((301, 135, 59), 0.2652, 0.2579),
        PublishedFlight((301, 134, 62), 0.2483, 0.2437),
        PublishedFlight((1624, 1356, 195), 0.1218, 0.1189),
        PublishedFlight((1599, 1366, 130), 0.1249, 0.1281),
        PublishedFlight((1612, 1361, 163), 0.1278, 0.1211),
    )),
}  # fmt: skip
_SOURCES: Final = {
    "table1": "The paper does not publish the airframe of its simulation. Two errors are illegible in the text of its "
    "accepted manuscript: run 4 from the default gains appears as 0.1722 and 0.1755, run 2 from the simplex's, 0.0900. "
    "0.1733 and 0.0966 are inferred: the text also has 0.2775 for 0.3775, 1044 for 1644, and calls 0.0940 the best.",
    "table2": "The twin was fitted to the errors of this very table, so its agreement with them is circular.",
}
"""What limits the comparison of each table with the paper."""


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


def run_table(name: str, figure: str, on_progress: Progress, *, campaigns: Sequence[str] = tuple(CAMPAIGNS)) -> Result:
    """Fly a table on both vehicles, and the campaigns on its own; `figure` is the name of the paper's figure."""
    table = TABLES[name]
    kinds = (table.vehicle, *(kind for kind in VEHICLES if kind != table.vehicle))
    tell = counted(on_progress, len(kinds) * len(table.flights) + len(campaigns))
    flown = {kind: list(_flown(table, kind, tell)) for kind in kinds}
    own, ended = flown[table.vehicle], []
    with _simulated(table.vehicle) as fly:
        for title in campaigns:
            ended.append(fly_campaign(title, table.series[CAMPAIGNS[title].start.kind], fly))
            tell(f"{table.vehicle}: campaign {title} flown")
    return Result(
        rows=(
            *(row for kind in kinds for row in _rows(table, kind, flown[kind])),
            *(row for campaign in ended for row in campaign.rows(table.vehicle)),
        ),
        figures={
            f"{figure}-left": _plot(table, own[:FROM_DEFAULT], default=True),
            f"{figure}-right": _plot(table, own[FROM_DEFAULT:], default=False),
        },
        notes=(
            _describe_reference(table, own),
            _SOURCES[name],
            (
                "Every gain set is checked by a campaign's gate first. ki = 1356 and similar values can overflow "
                f"and are flown by overruling the gate. The recorded reason: {OVERRULE}. The gate cannot be "
                "overruled on a real vehicle."
            ),
            *(campaign_notes(*ended) if ended else ()),
        ),
    )


def _describe_reference(table: Table, own: Sequence[Takeoff]) -> str:
    from_reference = max(abs(each.measured / each.published.reference - 1.0) for each in own)
    from_paper = max(abs(each.measured / each.published.paper - 1.0) for each in own)
    return (
        f"Flown without noise. On {table.vehicle} the errors are within {percent(from_reference, 1)} of the reference, "
        f"which Gainline measured once itself, and within {percent(from_paper)} of the paper."
    )


def _rows(table: Table, kind: str, flown: Sequence[Takeoff]) -> Iterator[Row]:
    """Those of the table's own vehicle also have the steps between the paper's runs."""
    own = kind == table.vehicle
    runs = (run for part in table.series.values() for run in part)
    for each, run in zip(flown, runs, strict=True):
        step = run.step if own else None
        note = f"overshoot {each.overshoot_m:.3f} m" + (f"; step {step}" if step else "")
        yield Row(
            group=f"{kind}, which represents the paper's vehicle" if own else f"{kind}, for comparison",
            label=gains_text(each.gains.values()),
            unit="m",
            measured=each.measured,
            paper=each.published.paper,
            reference=each.published.reference if own else None,
            ratio=each.measured / each.published.paper,
            note=note if each.published.is_legible else f"{note}; published error inferred",
            gains=each.gains,
            numbers={"overshoot_m": each.overshoot_m, **step_numbers(step)},
            overruled=each.overruled,
        )


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
                        _until(
                            f"Run {number}",
                            style,
                            flown.trajectory,
                            flown.trajectory["altitude_m"],
                            last_s,
                            note=f"{gains_text(flown.gains.values())}: {flown.measured:.4f} m, published "
                            f"{flown.published.paper:.4f} m",
                        )
                        for number, (style, flown) in enumerate(zip(_RUNS, shown, strict=False), start=1)
                    ),
                    _until("Reference", "reference", first, first["reference_m"], last_s),
                    _until("Set point", "goal", first, experiment.set_point(first.time_s), last_s),
                ),
            ),
        ),
    )


def _until(name: str, style: Style, flight: Trajectory, values: Samples, last_s: float, *, note: str = "") -> Line:
    shown = flight.time_s <= last_s
    return curve(name, style, flight.time_s[shown], values[shown], note=note)


def _flown(table: Table, kind: str, tell: Callable[[str], None]) -> Iterator[Takeoff]:
    experiment = get_experiment("takeoff")
    with _simulated(kind) as fly:
        for published in table.flights:
            wanted = dict(zip(experiment.space.names, map(float, published.gains), strict=True))
            overruled = overruled_for(wanted, kind)
            flight = fly(wanted)
            tell(f"{kind}: {gains_text(wanted.values())} flown")
            yield Takeoff(
                published=published,
                gains=wanted,
                measured=experiment.error(flight),
                overshoot_m=float((flight[experiment.output] - experiment.set_point(flight.time_s)).max()),
                overruled=overruled,
                trajectory=flight,
            )


@contextmanager
def _simulated(kind: str) -> Iterator[Callable[[Gains], Trajectory]]:
    """A function that flies gains on this kind of vehicle, without noise."""
    space = get_experiment("takeoff").space
    with open_vehicle(kind, VEHICLES[kind], safe_gains=space.mapping(space.default)) as vehicle:

        def fly(gains: Gains) -> Trajectory:
            vehicle.stage(gains)
            return vehicle.fly(FlightOptions(seed=1), on_sample=lambda _: None, should_stop=lambda: None).trajectory

        yield fly
