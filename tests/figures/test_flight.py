from dataclasses import replace

import numpy as np
import pytest

from app.figures.data import Curve
from app.figures.flight import FlightFigure, FlightRecordData
from tests.figures.builders import REFERENCE, SET_POINT, TIME_S, climb, layout, trace, traces

THRUST = Curve(TIME_S, np.full_like(TIME_S, 0.63))
RECORD = FlightRecordData(
    number=3,
    output_title="Altitude",
    output_unit="m",
    curve=climb(0.4),
    set_point=SET_POINT,
    reference=REFERENCE,
    predicted=climb(0.3),
    best=climb(0.2),
    best_number=2,
    inputs={"Thrust": THRUST, "Feed-forward": THRUST},
)


def test_a_flight_is_drawn_over_prediction_best_and_goal_with_its_commands_below() -> None:
    card = FlightFigure(RECORD).compute()
    assert [one["meta"]["role"] for one in traces(card)] == [
        "set point",
        "reference",
        "best",
        "prediction",
        "flight",
        "input",
        "input",
    ]
    assert max(trace(card, "flight")["y"]) == pytest.approx(climb(0.4).values.max(), abs=1e-4)
    assert [one["yaxis"] for one in traces(card) if one["meta"]["role"] == "input"] == ["y2", "y2"]
    assert card.summary == "Altitude of flight 3: highest 3.40 m at 2.0 s."


def test_an_imported_flight_without_commands_uses_the_whole_height() -> None:
    card = FlightFigure(replace(RECORD, inputs={})).compute()
    assert layout(card)["yaxis"]["domain"] == [0.0, 1.0]


def test_a_flight_without_a_record_is_shown_as_such() -> None:
    assert FlightFigure(replace(RECORD, curve=None)).not_ready() == "There is no record of this flight yet."


def test_the_table_reads_the_record_at_even_times() -> None:
    card = FlightFigure(RECORD).compute()
    assert card.table is not None
    assert [column.name for column in card.table.columns] == [
        "time_s",
        "measured",
        "set_point",
        "predicted",
        "thrust",
        "feed-forward",
    ]
    assert list(card.table.rows[0]) == pytest.approx([0.0, 0.0073, 3.0, 0.0055, 0.63, 0.63], abs=1e-4)
