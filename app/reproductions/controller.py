"""The paper's Fig. 6: a recorded run of the autopilot's vertical loop compared with its replica."""

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.core.control.vertical_guidance import OUTPUTS, RATE_HZ, LoopTrace, replayed
from app.figures.panels import Panel, Plot
from app.reproductions.results import Progress, Result, Row, curve

RECORDED_TAKEOFF: Final = Path(__file__).parent / "data" / "takeoff_default.csv.gz"
"""A takeoff at the default gains, computed by the autopilot's own code."""

_PANELS: Final = {
    "figure6-reference": ("the reference model, in counts", ("z_ref", "zd_ref", "zdd_ref")),
    "figure6-commands": ("the commands, in counts", ("ff_cmd", "fb_cmd", "thrust")),
}


def run_controller(on_progress: Progress, trace_file: Path = RECORDED_TAKEOFF) -> Result:
    """Replay a recorded run and compare every output of every step. Raises InputError if the file is not a trace."""

    from app.autopilots.paparazzi.replica_check import read_loop_trace  # noqa: PLC0415 - imports the readers of logs

    on_progress(0.0, "reading the recorded run")
    trace = read_loop_trace(trace_file)
    on_progress(0.3, f"replaying {len(trace)} steps")
    computed = replayed(trace)
    apart = np.abs(computed - trace.outputs)
    different = np.flatnonzero(apart.any(axis=1))
    rows = tuple(
        Row(
            group=f"Largest difference over {len(trace)} steps",
            label=signal,
            unit="counts",
            measured=float(difference.max()),
            reference=0.0,
            digits=0,
            note=f"recorded {recorded.min()} … {recorded.max()}",
            numbers={"rows": float(len(trace))},
        )
        for signal, difference, recorded in zip(OUTPUTS, apart.T, trace.outputs.T, strict=True)
    )
    on_progress(1.0, "compared")
    verdict = (
        f"The first difference is in row {different[0]}"
        if different.size
        else f"All {len(trace)} steps are exact in all {len(OUTPUTS)} signals"
    )
    return Result(
        rows=rows,
        figures={name: _plot(title, signals, trace, computed) for name, (title, signals) in _PANELS.items()},
        notes=(
            (
                f"{verdict}. The paper's own copy of the controller differs visibly at the start of the feedback "
                "command, because its integrator was not initialised, and by rounding elsewhere."
            ),
        ),
    )


def _plot(title: str, signals: tuple[str, ...], trace: LoopTrace, computed: NDArray[np.int64]) -> Plot:
    time_s = np.arange(len(trace)) / RATE_HZ
    shown = [OUTPUTS.index(signal) for signal in signals]
    largest = int(np.abs(computed - trace.outputs)[:, shown].max())
    finding = "no difference anywhere" if largest == 0 else f"largest difference {largest} counts"
    return Plot(
        title=title,
        summary=f"Recorded and replayed {', '.join(signals)} overlaid: {finding}. z is positive downward.",
        x_title="Time since the start of the recording (s)",
        panels=tuple(
            Panel(
                y_title=signal,
                digits=0,
                lines=(
                    curve("Recorded", "recorded", time_s, trace.outputs[:, OUTPUTS.index(signal)]),
                    curve("Replica", "replica", time_s, computed[:, OUTPUTS.index(signal)]),
                ),
            )
            for signal in signals
        ),
    )
