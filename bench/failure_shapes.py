"""How well the shapes of failure are recognised, on simulated flights of random vehicles in which each is true.

    ./dev exec python -m bench.failure_shapes                  a few flights, against the limits
    ./dev exec python -m bench.failure_shapes --cases 50       the figures of docs/benchmarks.md
    ./dev exec python -m bench.failure_shapes --atlas          write the atlas of the page and of the documents

Every flight is written as ArduCopter's .bin or PX4's .ulg and read again. Counted are the flights with a shape in which
it is found, and those without it (of all other shapes, and healthy ones) in which it is wrongly found. What is true
comes from the simulation (bench/copters/failure_shapes.py). Exits with 1 beyond the limits.
"""

import argparse
import io
import json
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from app.autopilots.described import signals_of
from app.autopilots.log_readers import reader_of
from app.core.analysis.description import FlightSignals, describe
from app.core.analysis.shapes import FailureShape, FoundShape, find_shapes
from app.figures.panels import Plot
from app.log_library.shapes import ATLAS, plot_of
from app.logs.base import HEAD_BYTES
from bench.copters.failure_shapes import case_of

SEED: Final = 390
QUICK_CASES: Final = 6
HEALTHY: Final = "healthy"
LEAST_RECOGNISED: Final = 0.9
MOST_FALSE: Final = 0.05
IMAGES: Final = Path(__file__).parents[1] / "docs" / "images"
_ATLAS_SEED: Final = 7


@dataclass(frozen=True, slots=True)
class Result:
    """A flight: the shape that it was made for, which it has (None: some of it), and which were found."""

    made_for: FailureShape | None
    has: Mapping[FailureShape, bool | None]
    found: frozenset[FailureShape]


@dataclass(frozen=True, slots=True, kw_only=True)
class Share:
    """Of a shape: flights made for it and those among them in which it is found, flights without it and those in which
    it is found too."""

    made: int
    recognised: int
    others: int
    wrong: int

    @property
    def is_good(self) -> bool:
        return self.recognised >= LEAST_RECOGNISED * self.made and self.wrong <= MOST_FALSE * self.others


def judge(which: tuple[FailureShape | None, int], seed: int = SEED) -> Result:
    """Fly a case, write its log, read it, and look for shapes."""
    shape, number = which
    case = case_of(shape, number, seed)
    _, found = read_shapes(case.content)
    return Result(shape, {each: case.shows(each) for each in FailureShape}, frozenset(each.shape for each in found))


def read_shapes(content: bytes) -> tuple[FlightSignals, Sequence[FoundShape]]:
    """The signals and shapes of a log of a flight."""
    reader = reader_of(content[:HEAD_BYTES])
    assert reader is not None
    signals = signals_of(reader.read(io.BytesIO(content), None))
    assert signals is not None
    return signals, find_shapes(signals, describe(signals))


def shares_of(results: Sequence[Result]) -> dict[FailureShape, Share]:
    """Of each shape."""
    shares = {}
    for shape in FailureShape:
        made = [each for each in results if each.made_for is shape]
        others = [each for each in results if each.made_for is not shape and each.has[shape] is False]
        recognised, wrong = (sum(shape in each.found for each in group) for group in (made, others))
        shares[shape] = Share(made=len(made), recognised=recognised, others=len(others), wrong=wrong)
    return shares


def table_of(results: Sequence[Result]) -> str:
    """Rows: what the flights were made for; columns: how many of them each shape is found in; then the shares."""
    lines = ["| made for | " + " | ".join(FailureShape) + " |", "| --- " * (len(FailureShape) + 1) + "|"]
    for made_for in (*FailureShape, None):
        group = [each for each in results if each.made_for is made_for]
        counts = (str(sum(shape in each.found for each in group)) for shape in FailureShape)
        lines.append(f"| {made_for or HEALTHY} | " + " | ".join(counts) + " |")
    shares = shares_of(results).values()
    lines.append("| **recognised** | " + " | ".join(f"{each.recognised / each.made:.0%}" for each in shares) + " |")
    wrong = (f"{each.wrong / each.others:.1%} of {each.others}" for each in shares)
    lines.append("| **wrongly found** | " + " | ".join(wrong) + " |")
    return "\n".join(lines)


@dataclass(frozen=True, slots=True)
class _Drawn:
    """What of a shape's flight the atlas shows: a case, from some seconds before the shape is seen, for how long, one
    of so many tenths of a second, and which signals beside altitude and reference."""

    number: int
    before_s: float
    lasts_s: float
    tenths: int = 2
    beside: tuple[str, ...] = ("throttle_1",)


_DRAWN: Final[Mapping[FailureShape, _Drawn]] = {
    FailureShape.RINGING: _Drawn(7, 6.0, 20.0, 1),
    FailureShape.WINDUP: _Drawn(7, 4.5, 18.0, 1),
    FailureShape.HOVER_THROTTLE: _Drawn(0, 3.0, 24.0, beside=("throttle_1", "assumed_1")),
    FailureShape.SATURATED_CLIMB: _Drawn(1, 3.0, 18.0, 1),
    FailureShape.ESTIMATOR_JUMP: _Drawn(2, 5.0, 12.0, 1),
    FailureShape.VIBRATION: _Drawn(3, 0.0, 16.0, 1, ("sensed_m_s2",)),
    FailureShape.WIND: _Drawn(3, 0.0, 24.0),
}
_DIGITS: Final = 3


def trace_of(shape: FailureShape) -> dict[str, Any]:
    """The flight of a shape in the atlas: signals at even times, and the numbers that are found in it."""
    drawn = _DRAWN[shape]
    signals, found = read_shapes(case_of(shape, drawn.number, _ATLAS_SEED).content)
    shown = next(each for each in found if each.shape is shape)
    begin_s, step_s = max(shown.since_s - drawn.before_s, float(signals.time_s[0])), 0.1 * drawn.tenths
    at_s = begin_s + step_s * np.arange(round(drawn.lasts_s / step_s))
    at_s = at_s[at_s <= signals.time_s[-1]]
    columns = {
        "altitude_m": signals.altitude_m,
        "reference_m": signals.reference_m,
        "throttle_1": signals.throttle,
        "sensed_m_s2": signals.sensed_m_s2,
        "assumed_1": np.full(len(signals.time_s), signals.assumed_hover, dtype=np.float64),
    }
    return {
        "numbers": {name: float(f"{value:.4g}") for name, value in shown.numbers.items()},
        "since_s": round(shown.since_s - begin_s, 1),
        "step_s": round(step_s, 1),
        **{
            name: np.round(np.interp(at_s, signals.time_s, columns[name]), _DIGITS).tolist()
            for name in ("altitude_m", "reference_m", *drawn.beside)
        },
    }


def write_atlas() -> None:
    """The atlas of the page, and an image of each shape for the documents."""
    atlas = {shape: trace_of(shape) for shape in FailureShape}
    ATLAS.write_text(json.dumps(atlas, separators=(",", ":")) + "\n")
    for shape, trace in atlas.items():
        (IMAGES / f"failure-shape-{shape.replace('_', '-')}.svg").write_text(image_of(plot_of(shape, trace)))


_WIDTH, _HEIGHT, _LEFT, _TOP, _GAP = 640.0, 120.0, 46.0, 20.0, 30.0
_GREY: Final = "#808080"
_PENS: Final = {"goal": f'stroke="{_GREY}" stroke-dasharray="6 4"', "measured": 'stroke="#3b7dd8"'}
"""Legible on white and on black."""


def image_of(plot: Plot) -> str:
    """A figure as a small SVG."""
    parts = []
    for number, panel in enumerate(plot.panels):
        top = _TOP + number * (_HEIGHT + _GAP)
        dashed = "".join(f", dashed: {each.name}" for each in panel.lines if each.style == "goal")
        every = [value for line in panel.lines for value in line.y]
        room = 0.05 * (max(every) - min(every))
        low, high = min(every) - room, max(every) + room
        parts.append(_text(_LEFT, top - 6.0, f"{panel.y_title}{dashed}"))
        parts += [_text(0.0, y, f"{value:.3g}") for y, value in ((top + 10.0, high), (top + _HEIGHT, low))]
        parts.append(
            f'<path d="M{_LEFT:g} {top:g}V{top + _HEIGHT:g}H{_WIDTH:g}" fill="none" stroke="{_GREY}" stroke-width="1"/>'
        )
        for line in panel.lines:
            places = zip(line.x, line.y, strict=True)
            points = " ".join(
                f"{_LEFT + (_WIDTH - _LEFT) * x / line.x[-1]:.0f},{top + _HEIGHT * (high - y) / (high - low):.1f}"
                for x, y in places
            )
            parts.append(f'<polyline points="{points}" fill="none" stroke-width="1.5" {_PENS[line.style]}/>')
    bottom = _TOP + len(plot.panels) * (_HEIGHT + _GAP)
    parts.append(_text(_LEFT, bottom - _GAP + 16.0, f"0 to {plot.panels[0].lines[0].x[-1]:.0f} s"))
    size = f'viewBox="0 0 {_WIDTH:g} {bottom:g}" width="{_WIDTH:g}"'
    return "\n".join([f'<svg xmlns="http://www.w3.org/2000/svg" {size}>', *parts, "</svg>\n"])


def _text(x: float, y: float, text: str) -> str:
    return f'<text x="{x:.0f}" y="{y:.0f}" font-family="sans-serif" font-size="12" fill="{_GREY}">{text}</text>'


def main() -> int:
    parser = argparse.ArgumentParser(prog="bench.failure_shapes")
    parser.add_argument("--cases", type=int, default=QUICK_CASES)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--atlas", action="store_true")
    options = parser.parse_args()
    if options.atlas:
        write_atlas()
        return 0
    cases = [(shape, number) for shape in (*FailureShape, None) for number in range(options.cases)]
    with ProcessPoolExecutor() as pool:
        results = list(pool.map(partial(judge, seed=options.seed), cases, chunksize=4))
    print(table_of(results))
    return int(not all(each.is_good for each in shares_of(results).values()))


if __name__ == "__main__":
    sys.exit(main())
