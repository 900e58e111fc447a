"""`gainline controller replay`: recorded runs of the autopilot's vertical loop against the replica."""

from collections.abc import Sequence
from pathlib import Path

from app.commands.console import console, show_error, table, write_json
from app.core.control.replay import OUTPUTS, Replay, replay_trace
from app.errors import InputError
from app.logs.loop_trace import read_loop_trace


def replay_files(files: Sequence[Path], json_out: Path | None) -> bool:
    """Replay every file and print rows and largest difference of each column; whether all are readable and exact."""
    replays: dict[Path, Replay] = {}
    for file in files:
        try:
            replays[file] = replay_trace(read_loop_trace(file))
        except InputError as error:
            show_error(error)
    rows = [
        (
            file.name,
            str(replay.rows),
            *(str(replay.largest_difference[column]) for column in OUTPUTS),
            "exact" if replay.exact else f"differs from row {replay.first_different_row} on",
        )
        for file, replay in replays.items()
    ]
    if rows:
        console(json_out).print(
            table(("file", "rows", *OUTPUTS, ""), rows, title="Largest difference between recording and replica")
        )
    write_json(json_out, {"files": [_document(file, replay) for file, replay in replays.items()]})
    return len(replays) == len(files) and all(replay.exact for replay in replays.values())


def _document(file: Path, replay: Replay) -> dict[str, object]:
    return {
        "file": str(file),
        "rows": replay.rows,
        "exact": replay.exact,
        "largest_difference": dict(replay.largest_difference),
        "first_different_row": replay.first_different_row,
    }
