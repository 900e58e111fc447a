"""`gainline reproduce`: runs the paper's experiments, tables and figures, and compares the results with the published
ones."""

from collections.abc import Sequence
from dataclasses import asdict
from itertools import groupby
from pathlib import Path
from typing import Final

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from app.commands.console import console, table, write_json
from app.studies.controller import run_controller
from app.studies.reproductions import REPRODUCTIONS, Reproduction, get_reproduction
from app.studies.results import Result, Row

ALL: Final = "all"


def reproduce(name: str, *, full: bool, trace: Path | None, json_out: Path | None) -> None:
    """Run one reproduction, or all in their order, and print measured, published and their ratio. Raises InputError."""
    chosen = tuple(REPRODUCTIONS.values()) if name == ALL else (get_reproduction(name),)
    documents = []
    for each in chosen:
        result = _run(each, full, trace if each.name == "controller" else None)
        _show(each, result, json_out)
        documents.append({"name": each.name, "title": each.title, "paper": each.paper, **_document(result)})
    write_json(json_out, documents[0] if name != ALL else {"reproductions": documents})


def _run(each: Reproduction, full: bool, trace: Path | None) -> Result:
    with Console(stderr=True).status(f"{each.title} …") as status:

        def tell(share: float, doing: str) -> None:
            status.update(f"{each.title}: {share:4.0%}  {escape(doing)}")

        return each.run(tell, full) if trace is None else run_controller(tell, trace)


def _show(each: Reproduction, result: Result, json_out: Path | None) -> None:
    out = console(json_out)
    out.print(f"\n[bold]{each.title}[/]\n{each.paper}\n")
    for group, rows in groupby(result.rows, key=lambda row: row.group):
        out.print(_table(group, list(rows)))
    for note in result.notes:
        out.print(f"[dim]{escape(note)}[/]")


def _table(group: str, rows: Sequence[Row]) -> Table:
    cells = [
        (
            row.label,
            row.unit,
            f"{row.measured:.{row.digits}f}",
            _number(row.paper, row.digits),
            _number(row.ratio, 3),
            _number(row.reference, row.digits),
            row.note,
        )
        for row in rows
    ]
    return table(("", "unit", "measured", "paper", "ratio", "reference", ""), cells, title=group)


def _number(value: float | None, digits: int) -> str:
    return "" if value is None else f"{value:.{digits}f}"


def _document(result: Result) -> dict[str, object]:
    """The result as JSON; each row includes its own figures beside the common ones."""
    rows = [{**_plain(row), **row.numbers} for row in result.rows]
    return {**result.as_json(), "rows": rows}


def _plain(row: Row) -> dict[str, object]:
    return {name: value for name, value in asdict(row).items() if name != "numbers"}
