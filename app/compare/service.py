"""Comparison of flights: what differs between them, its effect on the error, and their curves."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from sqlalchemy.orm import Session

from app.campaigns import history
from app.campaigns.trials.schemas import GroupBrief
from app.compare.compared_flights import (
    ComparisonFlight,
    file_stem,
    gain_differences,
    setting_differences,
    settings_of,
    sides_of,
    vehicle_name,
)
from app.compare.schemas import ComparedFlight, FlightComparison
from app.compare.verdicts import compare_pairs, find_leading_pair, list_notes, overall_verdict
from app.core.records.trajectory import CHANNEL_UNITS, Samples
from app.db import trajectories
from app.figures.base import Card, card_of
from app.figures.comparison import ComparedCurve, ComparisonData, ComparisonFigure
from app.figures.data import Curve
from app.figures.theme import ThemeName

GRID_STEP_S: Final = 0.02


def compare_flights(session: Session, trial_ids: Sequence[int]) -> FlightComparison:
    """Compare the flights. Raises InputError naming those that cannot be compared."""
    sides = sides_of(session, trial_ids)
    flown = history.latest_flights(session, trial_ids)
    settings = [settings_of(side, flown[side.row.id].battery if side.row.id in flown else "") for side in sides]
    leading = find_leading_pair(sides)
    verdict, sentence = overall_verdict(leading)
    return FlightComparison(
        error_unit=sides[0].experiment.error_unit,
        verdict=verdict,
        sentence=sentence,
        notes=list_notes(sides),
        flights=[
            ComparedFlight.view_of(
                side.row,
                trial_id=side.row.id,
                label=side.label,
                name=side.name,
                campaign_name=side.campaign.name,
                vehicle=vehicle_name(side.campaign),
                is_real=side.campaign.vehicle.is_real,
                experiment=side.experiment.title,
                group=None
                if side.group is None
                else GroupBrief(
                    mean=side.group.mean, standard_error=side.group.known_error(side.scatter), n=side.group.size
                ),
                scatter=side.scatter.reported,
                settings=own,
            )
            for side, own in zip(sides, settings, strict=True)
        ],
        gains=gain_differences(sides),
        settings=setting_differences(settings),
        pairs=compare_pairs(sides, leading),
        file_stem=file_stem([side.row for side in sides]),
    )


def comparison_figure(session: Session, trial_ids: Sequence[int], theme: ThemeName) -> Card:
    """The curves over the set point. Raises InputError naming the flights that cannot be compared."""
    return card_of(ComparisonFigure(_drawn(session, sides_of(session, trial_ids)), theme))


def export_curves(session: Session, trial_ids: Sequence[int]) -> tuple[str, str]:
    """File name and CSV of the curves, every 0.02 s from the command to the end of the longest record.

    Linear between samples, empty outside a record. Raises InputError naming the flights that cannot be compared.
    """
    sides = sides_of(session, trial_ids)
    data = _drawn(session, sides)
    ends = [float(flight.curve.time_s[-1]) for flight in data.flights if flight.curve is not None]
    grid = np.arange(round(max(ends, default=0.0) / GRID_STEP_S) + 1, dtype=np.float64) * GRID_STEP_S
    unit = data.output_unit
    columns = {"time_s": [f"{second:.2f}" for second in grid], f"set_point_{unit}": _column(data.set_point, grid)}
    for side, flight in zip(sides, data.flights, strict=True):
        title = f"campaign_{side.campaign.id}_flight_{side.row.number}_{side.experiment.output}"
        columns[title] = _column(flight.curve, grid)
    lines = [",".join(columns), *(",".join(cells) for cells in zip(*columns.values(), strict=True))]
    return f"{file_stem([side.row for side in sides])}.csv", "\n".join(lines) + "\n"


def _column(curve: Curve | None, grid: Samples) -> list[str]:
    if curve is None or len(curve.time_s) == 0:
        return [""] * len(grid)
    values = np.interp(grid, curve.time_s, curve.values, left=np.nan, right=np.nan)
    return ["" if np.isnan(value) else f"{value:.6g}" for value in values]


def _drawn(session: Session, sides: Sequence[ComparisonFlight]) -> ComparisonData:
    experiment = sides[0].experiment
    recorded = [side.row.trajectory_id for side in sides if side.row.trajectory_id is not None]
    records = trajectories.trajectories_of(session, recorded)
    unit = CHANNEL_UNITS[experiment.output]
    return ComparisonData(
        output_title=experiment.output.removesuffix(f"_{unit}").replace("_", " ").capitalize(),
        output_unit=unit,
        error_unit=experiment.error_unit,
        set_point=Curve(experiment.grid_s, experiment.set_point(experiment.grid_s)),
        flights=tuple(
            ComparedCurve(
                trial_id=side.row.id,
                label=side.label,
                name=side.name,
                curve=None
                if side.row.trajectory_id is None
                else Curve(
                    records[side.row.trajectory_id].time_s, records[side.row.trajectory_id][side.experiment.output]
                ),
                error=side.row.error,
            )
            for side in sides
        ),
    )
