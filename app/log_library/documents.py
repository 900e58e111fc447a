"""An analysed log as one HTML file that needs neither Gainline nor a network."""

from contextlib import suppress
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Final

from sqlalchemy.orm import Session

from app.common.errors import InputError, StorageError
from app.documents import html
from app.log_library import comparisons, stored_logs
from app.log_library.texts import changed_texts, measured_texts, parts_of

_TEMPLATE: Final = Path(__file__).parent / "templates" / "log.html.j2"


def document_of(session: Session, log_id: int, plotly: str) -> html.Document:
    """The document of a stored log: its answer, and the comparison with the log before it of the same vehicle, if any.

    `plotly` is the source of the chart library. Raises NotFoundError, StorageError.
    """
    analysis, comparison = stored_logs.get_analysis(session, log_id), None
    with suppress(InputError, StorageError):  # nothing is before it, or nothing that it can be compared with
        comparison = comparisons.compare(session, log_id, None)
    figures = {
        part: [replace(card, name=f"{part}-{number}") for number, card in enumerate(drawn, start=1)]
        for part, drawn in analysis.figures["light"].items()
    }
    cards, filters = [*chain(*figures.values())], {"changed": changed_texts, "measured": measured_texts}
    content = {"answer": analysis, "parts": parts_of(analysis), "figures_of": figures, "comparison": comparison}
    return html.render(_TEMPLATE, cards, plotly, filters, content)


def file_name(log_id: int) -> str:
    """File name of a document."""
    return f"log-{log_id}.html"
