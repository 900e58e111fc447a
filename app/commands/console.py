"""What the command line shows: tables like the paper's, and errors in plain words."""

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from app.errors import GainlineError, InputError, Problem

TO_STDOUT: Final = Path("-")
WIDTH_OF_A_FILE: Final = 200


def console(json_out: Path | None = None) -> Console:
    """Where tables go: standard output, unless that carries the JSON. Into a file or pipe nothing is cut off."""
    out = Console(stderr=json_out == TO_STDOUT, highlight=False, soft_wrap=True)
    if not out.is_terminal:
        out.width = max(out.width, WIDTH_OF_A_FILE)
    return out


def show_error(error: GainlineError) -> None:
    """What happened, what is to blame, what to do; on standard error."""
    err = Console(stderr=True, highlight=False, soft_wrap=True)
    err.print(f"[bold red]Error:[/] {escape(error.message)}")
    for problem in error.problems:
        err.print(f"  [bold]{escape(problem.field)}[/]: {escape(problem.reason)}")
    err.print(escape(error.hint))


def table(columns: Sequence[str], rows: Sequence[Sequence[str]], *, title: str) -> Table:
    """Numbers to the right, the first column named left; cells come formatted."""
    drawn = Table(title=title, title_justify="left", title_style="bold", box=SIMPLE_HEAD, pad_edge=False)
    for index, column in enumerate(columns):
        drawn.add_column(column, justify="left" if index == 0 else "right", no_wrap=True)
    for row in rows:
        drawn.add_row(*row)
    return drawn


def write_json(target: Path | None, document: Mapping[str, object]) -> None:
    """Write to a file, or to standard output for `-`. Raises InputError when the file cannot be written."""
    if target is None:
        return
    text = json.dumps(document, indent=2, allow_nan=False) + "\n"
    if target == TO_STDOUT:
        sys.stdout.write(text)
        return
    try:
        target.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(
            f"{target} could not be written: {error.strerror or error}.",
            problems=(Problem("--json", "cannot be written"),),
            hint="Name a file in a folder that exists and has room.",
        ) from error
