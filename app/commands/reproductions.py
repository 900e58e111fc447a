"""`gainline reproduce`: the paper's tables, flown again."""

from pathlib import Path

from rich.console import Console

from app.commands.console import console, table, write_json
from app.studies.reproductions import TABLES, Reproduced, reproduce


def reproduce_table(name: str, json_out: Path | None) -> None:
    """Fly the gain sets of a table on both simulations and print published, measured and their ratio."""
    with Console(stderr=True).status("flying …") as status:
        rows = reproduce(name, on_row=lambda row: status.update(f"{row.vehicle}: {_gains(row)}"))
    cells = [
        (
            row.vehicle,
            _gains(row),
            f"{row.paper:.4f}",
            f"{row.measured:.4f}",
            f"{row.ratio:.3f}",
            "" if row.reference is None else f"{row.reference:.4f}",
            f"{row.overshoot_m:.3f}",
        )
        for row in rows
    ]
    console(json_out).print(
        table(
            ("vehicle", "kp, ki, kd", "paper m", "measured m", "ratio", "reference m", "overshoot m"),
            cells,
            title=TABLES[name].title,
        )
    )
    write_json(json_out, {"rows": [row.as_json() for row in rows]})


def _gains(row: Reproduced) -> str:
    return ", ".join(f"{value:g}" for value in row.gains.values())
