"""`gainline reproduce`: the paper's experiments, tables and figures beside the published ones."""

from dataclasses import asdict
from itertools import groupby
from pathlib import Path
from typing import Final

from rich.console import Console
from rich.markup import escape

from app.cli.console import console, table, write_json
from app.reproductions.controller import run_controller
from app.reproductions.registry import REPRODUCTIONS, Reproduction
from app.reproductions.results import Result

ALL: Final = "all"


def reproduce(name: str, *, full: bool, trace: Path | None, json_out: Path | None) -> None:
    """Run one reproduction, or all in their order, and print measured, published and their ratio. Raises InputError
    for a trace that cannot be read."""
    chosen = tuple(REPRODUCTIONS.values()) if name == ALL else (REPRODUCTIONS[name],)
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
    out.print(f"\n[bold]{each.title}[/]\nIn the paper: {each.paper}\n")
    for group, rows in groupby(result.rows, key=lambda row: row.group):
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
        out.print(table(("", "unit", "measured", "paper", "ratio", "reference", ""), cells, title=group))
    for note in result.notes:
        out.print(f"[dim]{escape(note)}[/]")


def _number(value: float | None, digits: int) -> str:
    return "" if value is None else f"{value:.{digits}f}"


def _document(result: Result) -> dict[str, object]:
    """The result as JSON; each row includes its own figures beside the common ones."""
    rows = [
        {**{name: value for name, value in asdict(row).items() if name != "numbers"}, **row.numbers}
        for row in result.rows
    ]
    return {**asdict(result), "rows": rows}
