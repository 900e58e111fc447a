"""`gainline analyze`: from the log of a flight to gains, with what the model says of them."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Final

from rich.console import Console
from rich.markup import escape

from app.cli.console import console, table, unwritable_error, write_json
from app.cli.files import unreadable_error
from app.common.errors import InputError, Problem
from app.core.analysis.analysis import Analysis, Assessment, analyze
from app.core.analysis.margin import EXTRA_LAG_S, LARGEST_MARGIN, REQUIRED_MARGIN
from app.core.analysis.proposal import LARGEST_ACTIVITY
from app.core.control.ardupilot_parameters import Parameters
from app.core.formatting import percent
from app.logs.ardupilot_flight import read_ardupilot_flight

_HOVER_DIFFERENCE: Final = 0.1


def analyze_log(file: Path, *, json_out: Path | None, params_out: Path | None) -> None:
    """Print the analysis of a log, and write it and the proposed parameters where asked for.

    Raises InputError for a log that cannot be analysed, and for a parameter file where nothing is proposed.
    """
    try:
        with file.open("rb") as stream:
            flight = read_ardupilot_flight(stream, name=file.name)
    except OSError as error:
        raise unreadable_error(file, error, ".bin log of ArduCopter") from error
    analysis = analyze(flight)
    _print(console(json_out), file, analysis, flight.parameters)
    write_json(json_out, _document(file, analysis))
    if params_out is not None:
        _write_parameters(params_out, analysis, file.name)


def _print(out: Console, file: Path, analysis: Analysis, parameters: Parameters) -> None:
    behaviour, estimate = analysis.behaviour, analysis.estimate
    mean, deviation = estimate.mean, estimate.deviation
    out.print(f"[bold]{escape(file.name)}[/]")
    out.print(
        f"Flight: {behaviour.duration_s:.0f} s analysed, reference moves by {behaviour.reference_range_m:.1f} m. "
        f"Deviation from it {1e3 * behaviour.error_m:.1f} mm in the mean, "
        f"{1e3 * behaviour.largest_deviation_m:.0f} mm at most. Throttle {behaviour.throttle_mean:.3f} in the mean"
        + (f", at a limit in {percent(behaviour.saturated_share)} of the rows." if behaviour.saturated_share else ".")
    )
    out.print(
        f"Vehicle: hover throttle {mean.hover_throttle:.3f}, thrust slope {mean.thrust_slope:.2f} ± "
        f"{max(deviation.thrust_slope, 0.01):.2f}, lag of the motors {1e3 * mean.motor_lag_s:.0f} ± "
        f"{1e3 * deviation.motor_lag_s:.0f} ms, drag {mean.drag_1_s:.2f} ± {max(deviation.drag_1_s, 0.01):.2f} 1/s. "
        f"Accelerations that it does not explain: {estimate.residual_m_s2:.2f} m/s² rms."
    )
    if abs(mean.hover_throttle / parameters.hover_throttle - 1.0) > _HOVER_DIFFERENCE:
        out.print(
            f"MOT_THST_HOVER was {parameters.hover_throttle:.3f} in flight: {mean.hover_throttle:.3f} would fit better."
        )
    present, *others = analysis.assessments
    listed = [present, *([analysis.proposed] if analysis.proposed else []), *others]
    columns = ("gains", *present.gains, "predicted error", "90 % interval", "throttle activity", "margin")
    out.print(table(columns, [_row(each) for each in listed], title="This flight with other gains"))
    out.print(
        f"Throttle activity is relative to the gains flown, at most {LARGEST_ACTIVITY:g} in a proposal. The margin is "
        "the factor on P and I of the acceleration controller at which the loop rings with "
        f"{1e3 * EXTRA_LAG_S:.0f} ms more lag, at least {REQUIRED_MARGIN:g} in a proposal."
    )
    if analysis.at_limit:
        out.print(f"At an end of the range searched: {', '.join(analysis.at_limit)}.")
    out.print(escape(analysis.answer))


def _row(each: Assessment) -> tuple[str, ...]:
    predicted = each.prediction
    margin = "< 1" if not each.margin else f"{each.margin:.1f}" if each.margin < LARGEST_MARGIN else "> 8"
    return (
        each.name,
        *(f"{value:g}" for value in each.gains.values()),
        f"{1e3 * predicted.error_m:.1f} mm",
        f"{1e3 * predicted.low_m:.1f} … {1e3 * predicted.high_m:.1f} mm",
        f"{each.activity:.2f}",
        margin,
    )


def _document(file: Path, analysis: Analysis) -> Mapping[str, object]:
    estimate = analysis.estimate
    return {
        "file": file.name,
        "behaviour": asdict(analysis.behaviour),
        "vehicle": {
            "mean": asdict(estimate.mean),
            "standard_deviation": asdict(estimate.deviation),
            "residual_m_s2": estimate.residual_m_s2,
        },
        "answer": analysis.answer,
        "assessments": [asdict(each) for each in analysis.assessments],
        "proposed": asdict(analysis.proposed) if analysis.proposed else None,
        "insufficient": analysis.insufficient,
        "at_limit": list(analysis.at_limit),
    }


def _write_parameters(target: Path, analysis: Analysis, file_name: str) -> None:
    content = analysis.parameter_file(file_name)
    if content is None:
        raise InputError(
            "No parameter file was written, because no gains are proposed.",
            hint=analysis.insufficient or "",
            problems=(Problem("--params", "has nothing to write"),),
        )
    try:
        target.write_text(content, encoding="utf-8")
    except OSError as error:
        raise unwritable_error("--params", target, error) from error
