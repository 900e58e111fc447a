"""`gainline analyze`: what a flight log answers."""

from pathlib import Path

import typer
from rich.console import Console
from rich.markup import escape

from app.cli.console import console, reading, table, write_json, writing
from app.common.errors import InputError, Problem
from app.core.analysis.analysis import Grade
from app.log_library.content import ANALYSED, analyze_content
from app.log_library.schemas import PartTexts, Refusal
from app.logs.formats import companion_of


def analyze_log(file: Path, *, gains: str, vehicle: int | None, json_out: Path | None, params_out: Path | None) -> None:
    """Print the analysis of a log, and write it and the proposed parameters where asked for.

    Raises InputError for a file that cannot be read, and for a parameter file where nothing is proposed; exits with 1
    for a log that answers nothing.
    """
    with reading(file, ANALYSED):
        beside = companion_of(file)
        content, companion = file.read_bytes(), None if beside is None else beside.read_bytes()
    answer = analyze_content(content, companion, file.name, gains, vehicle).answer
    out = console(json_out)
    about = [each for each in (answer.autopilot, answer.release, answer.frame) if each]
    out.print(f"[bold]{escape(answer.file_name)}[/] ({escape(', '.join(about))})")
    is_refused, is_compared = answer.tuning.grade is Grade.REFUSED, not isinstance(answer.replica, Refusal)
    tuning = (f"Gains ({answer.tuning.grade})", answer.texts.tuning)
    replica = ("Replica of the controller", answer.texts.replica)
    for title, texts in (replica, tuning) if is_refused and is_compared else (tuning, replica):
        _print_part(out, title, texts)
        out.print()
    write_json(json_out, answer.model_dump(mode="json"))
    if params_out is not None:
        _write_parameters(params_out, answer.texts.tuning)
    if is_refused and not is_compared:
        raise typer.Exit(1)


def _print_part(out: Console, title: str, texts: PartTexts) -> None:
    out.print(escape(f"{title}: {texts.answer}"))
    for reason in texts.reasons:
        out.print(escape(f"  {reason}"))
    for facts in texts.facts:
        out.print(escape(f"{facts.title}: {', '.join(facts.values)}."))
    for shape in texts.shapes:
        out.print(escape(f"{shape.title}: {shape.found}\n  {shape.advice}"))
    if texts.table is not None:
        out.print(table(texts.table.columns, texts.table.rows, title=texts.table.title))
    for note in texts.notes:
        out.print(escape(note), style="dim")


def _write_parameters(target: Path, texts: PartTexts) -> None:
    if texts.parameter_file is None:
        raise InputError(
            "No parameter file was written, because nothing is proposed.",
            hint=texts.answer,
            problems=(Problem("--params", "has nothing to write"),),
        )
    with writing("--params", target):
        target.write_text(texts.parameter_file.content, encoding="utf-8")
