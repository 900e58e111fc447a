"""`gainline reproduce` and `gainline controller`: the paper's experiments, tables and figures beside the published
ones, and the replica of the autopilot's vertical loop beside recordings of the real one.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict
from itertools import groupby, product
from pathlib import Path
from types import MappingProxyType
from typing import BinaryIO, Final

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from app.autopilots.loop_check import Result as CheckResult
from app.autopilots.loop_checks import CHECKS, autopilot_of, examine_file
from app.autopilots.paparazzi.log import read_paparazzi
from app.autopilots.paparazzi.loop_check import TOLERANCE_UNITS, LogCheck, check_log, parse_gains
from app.autopilots.paparazzi.profile import PAPARAZZI
from app.autopilots.paparazzi.replica.simulation import TIME_TOLERANCE_S, TOLERANCES
from app.cli.console import console, show_error, table, write_json
from app.common.errors import InputError
from app.core.formatting import format_gains
from app.reproductions.controller import run_controller
from app.reproductions.registry import REPRODUCTIONS, Reproduction, get_reproduction
from app.reproductions.results import Result

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
    return {**result.as_json(), "rows": rows}


def replay_files(files: Sequence[Path], json_out: Path | None) -> bool:
    """Replay every file and print rows and the largest difference of each signal, a table for each autopilot; returns
    whether all are readable and agree."""
    checked: dict[Path, CheckResult] = {}
    for file in files:
        try:
            checked[file] = examine_file(file)
        except InputError as error:
            show_error(error)
    for autopilot, (difference, differences) in product(CHECKS, _DIFFERENCES.items()):
        if own := {
            file: each for file, each in checked.items() if each.autopilot == autopilot.name and differences(each)
        }:
            title = f"{autopilot.title}: {difference} between recording and replica"
            console(json_out).print(_replays_table(title, differences, own))
    write_json(json_out, {"files": [_replay_document(file, each) for file, each in checked.items()]})
    return len(checked) == len(files) and all(each.passed for each in checked.values())


Differences = Callable[[CheckResult], dict[str, float]]


def _replays_table(title: str, differences: Differences, checked: Mapping[Path, CheckResult]) -> Table:
    names = list(dict.fromkeys(signal.name for each in checked.values() for signal in each.signals))
    rows = [
        (
            file.name,
            str(each.rows),
            *("" if (found := differences(each).get(name)) is None else f"{found:.3g}" for name in names),
            _verdict(each),
        )
        for file, each in checked.items()
    ]
    return table(("file", "rows", *names, ""), rows, title=title)


def _largest_differences(checked: CheckResult) -> dict[str, float]:
    return {signal.name: signal.largest_difference for signal in checked.signals}


def _median_differences(checked: CheckResult) -> dict[str, float]:
    """Of the signals that are judged by it."""
    medians = {signal.name: signal.median_difference for signal in checked.signals}
    return {name: median for name, median in medians.items() if median is not None}


_DIFFERENCES: Final[Mapping[str, Differences]] = MappingProxyType(
    {"largest difference": _largest_differences, "median difference": _median_differences}
)


def _verdict(checked: CheckResult) -> str:
    if not checked.passed:
        return f"differs from row {checked.first_different_row} on"
    return "exact" if _exact(checked) else "agrees"


def _exact(checked: CheckResult) -> bool:
    return all(signal.verdict == "exact" for signal in checked.signals)


def _replay_document(file: Path, checked: CheckResult) -> dict[str, object]:
    return {
        "file": str(file),
        "autopilot": checked.autopilot,
        "rows": checked.rows,
        "passed": checked.passed,
        "exact": _exact(checked),
        "largest_difference": _largest_differences(checked),
        "median_difference": _median_differences(checked),
        "tolerance": {signal.name: signal.tolerance for signal in checked.signals},
        "first_different_row": checked.first_different_row,
        "notes": list(checked.notes),
    }


def check_files(files: Sequence[Path], given: str | None, json_out: Path | None) -> bool:
    """Compare Paparazzi logs that have VERT_LOOP with the replica; returns whether all are readable and agree."""
    gains = None if given is None else parse_gains(given, field="--gains")
    out = console(json_out)
    checked: dict[Path, LogCheck] = {}
    for file in files:
        try:
            checked[file] = _check(file, gains)
        except InputError as error:
            show_error(error)
        else:
            _print(out, file, checked[file])
    write_json(json_out, {"files": [_as_json(file, each) for file, each in checked.items()]})
    return len(checked) == len(files) and all(each.passed for each in checked.values())


def _check(file: Path, given: Mapping[str, float] | None) -> LogCheck:
    try:
        with ExitStack() as opened:
            beside = file.with_suffix(".log")
            companion = opened.enter_context(beside.open("rb")) if beside != file and beside.is_file() else None
            data = opened.enter_context(file.open("rb"))
            _refuse_other_autopilots(file, data)
            return check_log(read_paparazzi(data, companion), name=file.name, given=given)
    except OSError as error:
        raise InputError(
            f"{file} could not be read: {error.strerror or error}.", hint="Use a readable Paparazzi .data file."
        ) from error


def _refuse_other_autopilots(file: Path, data: BinaryIO) -> None:
    other = autopilot_of(data)
    if other is not None and other is not PAPARAZZI:
        raise InputError(
            f"{file} is a recording of {other.title}; this command reads those of Paparazzi.",
            hint=f"Compare it with the replica of {other.title}: gainline controller replay {file}",
        )


def _print(out: Console, file: Path, checked: LogCheck) -> None:
    commands, simulation, first_s = checked.commands, checked.simulation, checked.commands.first_different_s
    tilted = f" ({commands.tilted} of them tilted by up to {commands.largest_tilt_deg:.1f}°)" if commands.tilted else ""
    rows = [
        ("bit-exact commands", f"{commands.exact} of {commands.rows}{tilted}"),
        ("of them with an r33 rounded to one count above level", str(commands.rounded)),
        *((f"exact with the {name} one step apart", str(count)) for name, count in commands.stale.items()),
        ("different commands", f"{commands.different}{'' if first_s is None else f', the first at {first_s:.3f} s'}"),
    ]
    if simulation is None:
        rows.append(("reference and integrator", "not simulated: no command in the log, or another command within 2 s"))
    else:
        rows.append(
            ("simulated from the command at", f"{simulation.command_s:.3f} s for {simulation.duration_s:.1f} s")
        )
        rows += [
            (
                f"{name} beyond ±{1000 * TIME_TOLERANCE_S:g} ms",
                f"{value:.4f} (allowed {TOLERANCES[name]:g}) {TOLERANCE_UNITS[name]}",
            )
            for name, value in simulation.largest_difference.items()
        ]
    out.print(table(("", ""), rows, title=f"{file.name}, {checked.gains_text}"))
    for note in checked.gain_notes:
        out.print(note)
    if checked.better_gains is not None:
        out.print(f"More commands match with {format_gains(checked.better_gains)}: were other gains flown?")
    out.print("The replica agrees." if checked.passed else "[bold]The replica differs.[/]")


def _as_json(file: Path, checked: LogCheck) -> dict[str, object]:
    return {
        "file": str(file),
        "passed": checked.passed,
        "gains": checked.gains,
        "flown": [asdict(each) for each in checked.flown],
        "gains_from": checked.gains_from,
        "commands": {**asdict(checked.commands), "stale": dict(checked.commands.stale)},
        "simulation": None if checked.simulation is None else asdict(checked.simulation),
        "tolerances": {**TOLERANCES, "time_s": TIME_TOLERANCE_S},
    }
