from dataclasses import replace

import numpy as np
import pytest

from app.core.records.flight_events import FlightEvent
from app.figures.data import NO_CURVE, Curve, Range
from app.figures.flight import ChannelPanel, FlightFigure, FlightRecordData
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
    panels=(ChannelPanel(title="Throttle (of full)", curves={"Thrust": THRUST, "Feed-forward": THRUST}),),
    events=(FlightEvent(0.0, "Command"), FlightEvent(0.4, "Lift-off")),
)


def test_a_flight_is_drawn_over_prediction_best_and_goal_with_its_commands_below() -> None:
    card = FlightFigure(RECORD).compute()
    assert [one["meta"]["role"] for one in traces(card)] == [
        "set point",
        "reference",
        "best",
        "prediction",
        "flight",
        "deviation",
        "input",
        "input",
    ]
    assert max(trace(card, "flight")["y"]) == pytest.approx(climb(0.4).values.max(), abs=1e-4)
    assert [one["yaxis"] for one in traces(card) if one["meta"]["role"] == "input"] == ["y3", "y3"]
    assert card.summary == "Altitude of flight 3: highest 3.40 m at 2.0 s."


def test_a_flight_scored_against_the_reference_has_its_deviation_from_that() -> None:
    card = FlightFigure(replace(RECORD, reference=RECORD.curve, by_reference=True)).compute()
    assert set(trace(card, "deviation")["y"]) == {0.0}


def test_steps_have_reference_and_deviation_from_the_first_step_on_in_a_panel_of_their_size() -> None:
    steps = Curve(TIME_S, np.where(TIME_S < 10.0, 3.0, 2.0))
    flown = Curve(TIME_S, np.where(TIME_S < 8.0, 0.0, steps.values + 0.03))
    record = replace(RECORD, set_point=steps, reference=steps, curve=flown, by_reference=True)
    card = FlightFigure(record).compute()
    assert min(trace(card, "reference")["x"]) == min(trace(card, "deviation")["x"]) == pytest.approx(10.0, abs=0.05)
    assert layout(card)["yaxis2"]["range"] == pytest.approx([-0.033, 0.033])
    aborted = Curve(TIME_S[TIME_S < 5.0], flown.values[TIME_S < 5.0])
    ended = FlightFigure(replace(record, curve=aborted, reference=aborted)).compute()
    assert (trace(ended, "deviation")["x"], layout(ended)["yaxis2"]["range"][1]) == ([], pytest.approx(0.66))


def test_an_imported_flight_without_commands_has_only_its_deviation_below() -> None:
    card = FlightFigure(replace(RECORD, panels=())).compute()
    assert [name for name in layout(card) if name.startswith("yaxis")] == ["yaxis", "yaxis2"]
    assert layout(card)["yaxis2"]["domain"][0] == pytest.approx(0.0)


def test_a_tracking_error_is_not_drawn_a_second_time_as_its_own_deviation() -> None:
    zero = Curve(TIME_S, np.zeros_like(TIME_S))
    card = FlightFigure(replace(RECORD, set_point=zero, reference=None, panels=())).compute()
    assert layout(card)["yaxis"]["domain"] == [0.0, 1.0]
    assert "deviation" not in {one["meta"]["role"] for one in traces(card)}


def test_a_pinned_note_stands_at_its_time_shortened_and_without_markup() -> None:
    long = FlightEvent(9.0, "the battery was swapped for the one with the <b>red</b> tape")
    drawn = layout(FlightFigure(replace(RECORD, notes=(FlightEvent(2.5, "wobble"), long))).compute())
    assert [shape["x0"] for shape in drawn["shapes"]][-2:] == [2.5, 9.0]
    short, shortened = drawn["annotations"][-2:]
    assert (short["x"], short["text"], short["hovertext"]) == (2.5, "wobble", "wobble")
    assert shortened["text"] == "the battery was swapped for the one…"
    assert shortened["hovertext"].endswith("&lt;b&gt;red&lt;/b&gt; tape")


def test_all_panels_share_one_time_axis_so_that_one_cursor_reads_them_all() -> None:
    card = FlightFigure(RECORD).compute()
    drawn = layout(card)
    assert {one.get("xaxis", "x") for one in traces(card)} == {"x"}
    assert (drawn["hovermode"], drawn["hoversubplots"], drawn["xaxis"]["anchor"]) == ("x unified", "axis", "y3")
    bounds = [drawn[name]["domain"] for name in ("yaxis", "yaxis2", "yaxis3")]
    assert bounds[0][0] > bounds[1][1] > bounds[1][0] > bounds[2][1]


def test_events_stand_on_the_time_line() -> None:
    drawn = layout(FlightFigure(RECORD).compute())
    assert [(one["text"], one["x"]) for one in drawn["annotations"]] == [("Command", 0.0), ("Lift-off", 0.4)]
    assert [one["x0"] for one in drawn["shapes"]] == [0.0, 0.4]


def test_names_of_near_events_stand_neither_on_each_other_nor_on_the_next_line() -> None:
    events = tuple(FlightEvent(at, name) for at, name in ((0.0, "Command"), (0.4, "Lift-off"), (0.6, "Abort")))
    drawn = layout(FlightFigure(replace(RECORD, events=events)).compute())
    command, lift_off, abort = drawn["annotations"]
    assert (command["xanchor"], lift_off["xanchor"], lift_off["yshift"]) == ("right", "left", 0)
    assert abort["yshift"] < -60
    assert drawn["xaxis"]["range"][0] < -0.02 * RECORD.set_point.time_s[-1]


def test_throttle_is_marked_where_it_is_saturated_but_not_at_rest_before_it_starts() -> None:
    command = np.full_like(TIME_S, 0.6)
    command[TIME_S < 0.5] = 0.0
    command[(TIME_S >= 1.0) & (TIME_S <= 2.0)] = 1.0
    command[(TIME_S >= 4.0) & (TIME_S <= 4.5)] = 0.0
    panel = ChannelPanel(
        title="Throttle (of full)", curves={"Throttle": Curve(TIME_S, command)}, limits=Range(0.0, 1.0)
    )
    marked = trace(FlightFigure(replace(RECORD, panels=(panel,))).compute(), "saturated")
    assert marked["x"] == [pytest.approx(1.0), pytest.approx(2.0), None, pytest.approx(4.0), pytest.approx(4.5)]
    assert marked["y"] == [1.0, 1.0, None, 0.0, 0.0]


def test_a_flight_without_a_record_is_shown_as_such() -> None:
    assert FlightFigure(replace(RECORD, curve=NO_CURVE)).not_ready() == "There is no record of this flight yet."
    lost = replace(RECORD, curve=NO_CURVE, is_over=True)
    assert FlightFigure(lost).not_ready() == "No record of this flight was received."


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


def test_throttle_that_is_never_at_a_limit_is_not_marked() -> None:
    panel = ChannelPanel(title="Throttle (of full)", curves={"Throttle": THRUST}, limits=Range(0.0, 1.0))
    card = FlightFigure(replace(RECORD, panels=(panel,))).compute()
    assert "saturated" not in {one["meta"]["role"] for one in traces(card)}
