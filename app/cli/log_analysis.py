"""`gainline analyze`: what a flight log answers."""

from pathlib import Path

import typer
from rich.console import Console

from app.cli.console import console, reading, shown, table, write_json, writing
from app.common.errors import InputError, Problem
from app.log_library.content import ANALYSED, analyze_content
from app.log_library.schemas import LogAnswer, PartTexts
from app.log_library.texts import answers_nothing, parts_of
from app.logs.formats import companion_of


def analyze_log(file: Path, *, gains: str, vehicle: int | None, json_out: Path | None, params_out: Path | None) -> None:
    """Print the analysis of a log, and write it and the proposed parameters where asked for.

    Raises InputError for a file that cannot be read, and for a parameter file where nothing is proposed; exits with 1
    for a log that answers nothing.
    """
    content, companion = read_log(file)
    answer = analyze_content(content, companion, file.name, gains, vehicle).answer
    print_answer(console(json_out), answer)
    write_json(json_out, answer.model_dump(mode="json"))
    write_parameters(params_out, answer.texts.tuning)
    if answers_nothing(answer):
        raise typer.Exit(1)


def read_log(file: Path) -> tuple[bytes, bytes | None]:
    """A log and its companion. Raises InputError for a file that cannot be read."""
    with reading(file, ANALYSED):
        beside = companion_of(file)
        return file.read_bytes(), None if beside is None else beside.read_bytes()


def print_answer(out: Console, answer: LogAnswer) -> None:
    """Print the parts of an answer as they are written for a person."""
    about = [each for each in (answer.autopilot, answer.release, answer.frame) if each]
    out.print(f"[bold]{shown(answer.file_name)}[/] ({shown(', '.join(about))})")
    for _, title, texts in parts_of(answer):
        _print_part(out, title, texts)
        out.print()


def _print_part(out: Console, title: str, texts: PartTexts) -> None:
    out.print(shown(f"{title}: {texts.answer}"))
    for reason in texts.reasons:
        out.print(shown(f"  {reason}"))
    for facts in texts.facts:
        out.print(shown(f"{facts.title}: {', '.join(facts.values)}."))
    for shape in texts.shapes:
        out.print(shown(f"{shape.title}: {shape.found}"), style="yellow")
        out.print(shown(f"  {shape.advice}"))
    if texts.table is not None:
        out.print(table(texts.table.columns, texts.table.rows, title=texts.table.title))
    for note in texts.notes:
        out.print(shown(note), style="dim")


def write_parameters(target: Path | None, texts: PartTexts) -> None:
    """Write the proposed parameters where asked for. Raises InputError where nothing is proposed."""
    if target is None:
        return
    if texts.parameter_file is None:
        raise InputError(
            "No parameter file was written, because nothing is proposed.",
            hint=texts.answer,
            problems=(Problem("--params", "has nothing to write"),),
        )
    with writing("--params", target):
        target.write_text(texts.parameter_file.content, encoding="utf-8")
