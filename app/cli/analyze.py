"""`gainline analyze`: from the log of a flight to gains, with what the model says of them."""

from pathlib import Path

from rich.console import Console
from rich.markup import escape

from app.cli.console import console, reading, table, write_json, writing
from app.cli.files import companion_of
from app.common.errors import InputError, Problem
from app.log_analyses.content import ANALYSED, analyze_content
from app.log_analyses.schemas import LogAnswer


def analyze_log(file: Path, *, json_out: Path | None, params_out: Path | None) -> None:
    """Print the analysis of a log, and write it and the proposed parameters where asked for.

    Raises InputError for a log that cannot be analysed, and for a parameter file where nothing is proposed.
    """
    with reading(file, ANALYSED):
        beside = companion_of(file)
        content, companion = file.read_bytes(), None if beside is None else beside.read_bytes()
    answer, _ = analyze_content(content, companion, file.name)
    _print(console(json_out), answer)
    write_json(json_out, answer.model_dump(mode="json"))
    if params_out is not None:
        _write_parameters(params_out, answer)


def _print(out: Console, answer: LogAnswer) -> None:
    out.print(f"[bold]{escape(answer.file_name)}[/]")
    out.print(escape(f"Flight: {', '.join(answer.flight)}."))
    out.print(escape(f"Vehicle: {', '.join(answer.vehicle)}."))
    out.print(table(answer.gains.columns, answer.gains.rows, title="This flight with other gains"))
    for note in answer.notes:
        out.print(escape(note), style="dim")
    out.print(escape(answer.answer))


def _write_parameters(target: Path, answer: LogAnswer) -> None:
    if answer.parameter_file is None:
        raise InputError(
            "No parameter file was written, because nothing is proposed.",
            hint=answer.answer,
            problems=(Problem("--params", "has nothing to write"),),
        )
    with writing("--params", target):
        target.write_text(answer.parameter_file.content, encoding="utf-8")
