"""Answers as they are stored: compressed JSON, whose figures are thinned until it is small."""

from dataclasses import replace
from typing import Final, get_args

import zstandard
from pydantic import ValidationError

from app.common.errors import StorageError
from app.figures.base import Card, card_of
from app.figures.panels import Line, PanelsFigure, Plot
from app.figures.theme import ThemeName
from app.log_library.library_schemas import AnalysedContent, StoredAnswer
from app.log_library.schemas import Part

LARGEST_BYTES: Final = 35 * 2**10
_LARGEST_JSON_BYTES: Final = 2**24
_LEAST_POINTS: Final = 100
_LEVEL: Final = 12


def pack(found: AnalysedContent) -> bytes:
    """An answer with its figures, of which every other point is left out until it is at most `LARGEST_BYTES`."""
    stored = StoredAnswer.view_of(found)
    compressor = zstandard.ZstdCompressor(level=_LEVEL)
    while len(packed := compressor.compress(stored.model_dump_json().encode())) > LARGEST_BYTES:
        points = max(len(line.x) for plots in stored.plots.values() for each in plots for line in _lines(each))
        if points < _LEAST_POINTS:
            break
        thinner = {part: [_thinned(each, points // 2) for each in plots] for part, plots in stored.plots.items()}
        stored = stored.model_copy(update={"plots": thinner})
    return packed


def _lines(plot: Plot) -> list[Line]:
    return [line for panel in plot.panels for line in panel.lines]


def _thinned(plot: Plot, points: int) -> Plot:
    """The plot with every other point of the lines with more than so many."""

    def shorter(line: Line) -> Line:
        return replace(line, x=line.x[::2], y=line.y[::2]) if len(line.x) > points else line

    panels = (replace(panel, lines=tuple(map(shorter, panel.lines))) for panel in plot.panels)
    return replace(plot, panels=tuple(panels))


def unpack(packed: bytes) -> StoredAnswer:
    """A stored answer. Raises StorageError if it is damaged, or has the form of another version."""
    try:
        content = zstandard.ZstdDecompressor().decompress(packed, max_output_size=_LARGEST_JSON_BYTES)
        return StoredAnswer.model_validate_json(content)
    except (zstandard.ZstdError, ValidationError) as error:
        raise StorageError(
            "A stored answer cannot be read: it is damaged, or another version of Gainline wrote it.",
            hint="Analyse the log again.",
        ) from error


def cards(stored: StoredAnswer) -> dict[ThemeName, dict[Part, list[Card]]]:
    """The figures of an answer, by theme."""
    return {
        theme: {
            part: [card_of(PanelsFigure(each, theme_name=theme)) for each in plots]
            for part, plots in stored.plots.items()
        }
        for theme in get_args(ThemeName)
    }
