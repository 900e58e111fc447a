"""Output of the command line: tables like the paper's, and errors."""

import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from app.common.errors import GainlineError, InputError, Problem
from app.common.schemas import without_control_characters

TO_STDOUT: Final = Path("-")
WIDTH_OF_A_FILE: Final = 200


def console(json_out: Path | None = None) -> Console:
    """Console for tables: standard output, unless that carries the JSON. In a file or pipe nothing is truncated."""
    out = Console(stderr=json_out == TO_STDOUT, highlight=False, soft_wrap=True)
    if not out.is_terminal:
        out.width = max(out.width, WIDTH_OF_A_FILE)
    return out


def show_error(error: GainlineError) -> None:
    """Print an error to standard error: what happened, the fields concerned, what to do."""
    err = Console(stderr=True, highlight=False, soft_wrap=True)
    err.print(f"[bold red]Error:[/] {escape(error.message)}")
    for problem in error.problems:
        err.print(f"  [bold]{escape(problem.field)}[/]: {escape(problem.reason)}")
    err.print(escape(error.hint))


def shown(text: str) -> str:
    """A text of a log or file as a console prints it as it is: without control characters, and no markup."""
    return escape(without_control_characters(text))


def table(columns: Sequence[str], rows: Sequence[Sequence[str]], *, title: str) -> Table:
    """Table of formatted cells: the first column aligned left, the others right."""
    drawn = Table(title=shown(title), title_justify="left", title_style="bold", box=SIMPLE_HEAD, pad_edge=False)
    for index, column in enumerate(columns):
        drawn.add_column(shown(column), justify="left" if index == 0 else "right", no_wrap=True)
    for row in rows:
        drawn.add_row(*map(shown, row))
    return drawn


def write_json(target: Path | None, document: Mapping[str, object]) -> None:
    """Write JSON to a file, or to standard output for `-`. Raises InputError when the file cannot be written."""
    if target is None:
        return
    text = json.dumps(document, indent=2, allow_nan=False) + "\n"
    if target == TO_STDOUT:
        sys.stdout.write(text)
        return
    with writing("--json", target):
        target.write_text(text, encoding="utf-8")


@contextmanager
def writing(option: str, target: Path) -> Iterator[None]:
    """Raise InputError where the output file, given with `option`, cannot be written."""
    try:
        yield
    except OSError as error:
        raise InputError(
            f"{target} could not be written: {error.strerror or error}.",
            problems=(Problem(option, "cannot be written"),),
            hint="Choose a file in an existing folder with enough free space.",
        ) from error


@contextmanager
def reading(file: Path, needed: str) -> Iterator[None]:
    """Raise InputError where the input file cannot be opened or read; `needed` names the kind of file with its
    article."""
    try:
        yield
    except OSError as error:
        raise InputError(
            f"{file} could not be read: {error.strerror or error}.", hint=f"Give {needed} that this user can read."
        ) from error
