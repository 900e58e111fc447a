"""The benchmark of the failure shapes: its count, and the atlas that it writes."""

import json
from collections.abc import Mapping
from typing import Any

import pytest

from app.core.analysis.shapes import FailureShape
from app.log_library.shapes import ATLAS, plot_of
from bench.failure_shapes import IMAGES, Result, image_of, judge, shares_of, table_of, trace_of

RINGING, WIND = FailureShape.RINGING, FailureShape.WIND
LARGEST_ATLAS_BYTES, LARGEST_IMAGES_BYTES = 25_000, 200_000


def result(made_for: FailureShape | None, *found: FailureShape, **has: bool | None) -> Result:
    none: Mapping[FailureShape, bool | None] = dict.fromkeys(FailureShape, False)
    return Result(made_for, {**none, **{FailureShape(name): value for name, value in has.items()}}, frozenset(found))


def test_the_shares_count_what_is_true_and_leave_out_what_is_partly_so() -> None:
    results = [
        result(RINGING, RINGING, ringing=True),
        result(RINGING, WIND, ringing=True, wind=None),
        result(WIND, WIND, RINGING, wind=True),
        result(None),
    ]
    shares = shares_of(results)
    assert (shares[RINGING].made, shares[RINGING].recognised, shares[RINGING].wrong, shares[RINGING].others) == (
        2,
        1,
        1,
        2,
    )
    assert (shares[WIND].made, shares[WIND].recognised, shares[WIND].wrong, shares[WIND].others) == (1, 1, 0, 2)
    assert (shares[RINGING].is_good, shares[WIND].is_good) == (False, True)
    every = [*results, *(result(each, **{each: True}) for each in FailureShape)]
    assert "| healthy | 0 | 0 | 0 | 0 | 0 | 0 | 0 |" in table_of(every)


def test_the_atlas_and_its_images_are_small_and_of_every_shape() -> None:
    atlas: dict[str, dict[str, Any]] = json.loads(ATLAS.read_text())
    assert list(atlas) == list(FailureShape)
    assert ATLAS.stat().st_size <= LARGEST_ATLAS_BYTES
    images = sorted(IMAGES.glob("failure-shape-*.svg"))
    assert sum(each.stat().st_size for each in images) <= LARGEST_IMAGES_BYTES
    drawn = {image_of(plot_of(FailureShape(name), trace)) for name, trace in atlas.items()}
    assert drawn == {each.read_text() for each in images}


@pytest.mark.complete
def test_the_atlas_is_what_the_benchmark_writes() -> None:
    """To the digits in it: another processor may round otherwise."""
    committed, written = json.loads(ATLAS.read_text())[RINGING], trace_of(RINGING)
    assert committed.keys() == written.keys()
    assert written["numbers"] == pytest.approx(committed["numbers"], rel=0.01)
    assert written["altitude_m"] == pytest.approx(committed["altitude_m"], abs=0.01)


@pytest.mark.complete
@pytest.mark.parametrize("shape", [*FailureShape, None])
def test_a_simulated_flight_is_recognised_from_its_file(shape: FailureShape | None) -> None:
    found = judge((shape, 0)).found
    assert shape in found if shape else not found
