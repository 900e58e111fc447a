"""Document and figure of the comparison."""

import platform
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Final

from app.core.definition import Definition, Start
from app.core.tuning.corrected_model import start_gains
from app.core.tuning.evidence import Evidence
from bench.targets.flying import EXPERIMENT
from bench.targets.methods import METHODS
from bench.targets.report import AT_FLIGHTS, TARGETS, Outcome
from bench.targets.results import Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TITLES: Final[Mapping[str, str]] = {
    "four-parameter": "Random vehicles that the model can describe",
    "further-physics": "Random vehicles with further physics",
    "twin": "The twin of the paper's drone, repeatedly",
}
LINES: Final[Mapping[str, str]] = {
    "four-parameter": """\
Hover throttle 0.45 … 0.75, motor lag 0 … 100 ms, start latency 0 … 0.4 s, drag 0 … 0.4 1/s, with the scatter of the
paper's flights.""",
    "further-physics": """\
As above, with effects that the model does not describe by default: a quadratic share of thrust of 0 … 1, ground effect
0 … 25 % fading over 0.2 … 0.6 m, measurement delay 0 … 40 ms, battery sag 0 … 3 % over the flight. Every tenth vehicle
flies in JSBSim, with gusts of 0.5 … 2 m/s and a noisy altimeter instead of the scatter.""",
    "twin": "One vehicle, with the scatter of the paper's flights, tuned with many seeds.",
}
_INTRODUCTION: Final = """\
# Flights to the target

The number of takeoffs that a method needs until the error with its recommended gains is within 5 % or 2 % of the lowest
that is possible on the vehicle.

- All methods search the same bounds, and tune the same vehicles with the same scatter. They start with the default
  gains; rows *from the simplex start* start with the optimum of the nominal model, found by Nelder–Mead before any
  flight (kp {kp}, ki {ki}, kd {kd}, the same for all vehicles): the start that the paper recommends if no good gains
  are known. Its own, kp 1624, ki 1356, kd 195, lies outside the bounds.
- The error compared is that of the gains that a method recommends after a number of flights, without noise. Gainline
  recommends the gains that it proposed last, the other methods the best that they have flown; after flight 1 that is
  the start. The lowest possible error is found by a search on the vehicle itself, without noise.
- A flight is unsafe if it rises above 3.75 m, is below 2.25 m more than 5 s after the command, or diverges. The first
  flight and repeated flights of the default gains do not count; first flights have a column of their own.
- *Gainline: calibrated* proposes and passes the gate as in a campaign. A refused proposal ends the tuning as a failure.
- *The paper's method* is the strategy `gradient`: the model corrected by a bias outside the loop, its gradient, and the
  line search from the best flight, with the gains raw as in the paper, or scaled. *No gate* is the method as published:
  every step is flown. With *Gainline's gate* it is flown as in a campaign: steps that the gate refuses are halved, and
  if none passes, the tuning ends with its best flight. Neither applies the paper's stop rule: both go on for ten
  flights, or until the model predicts no better step.
- *The simplex start alone* is one flight with these gains, and no tuning.
- The remaining methods fly whatever they ask for inside the bounds: they know neither the model nor the gate.
- Processor times of a proposal contain all that happens between two flights: with the gate also the fit of the
  vehicle's parameters, which it needs, and the prediction's interval. They were measured on two processors that other
  programs used at the same time; the longest ones contain the loading of compiled code.
- Methods with slow proposals tuned fewer vehicles, the first ones of each population.
- A method that ends early, or has fewer flights than the number in the column, is counted with its last
  recommendation.
- Shares have Wilson 95 % intervals.
- All of this but the last section is about takeoffs under Paparazzi; the
  [last section](#altitude-steps-under-arducopter-and-px4) is about altitude steps under ArduCopter and PX4.

![Share of vehicles within 5 % against flights]({figure})

Dashed: from the simplex start. Dotted: after the last flight. The paper's method is drawn without the gate.

To regenerate this page (takes hours; with `--results FILE` the second command can be interrupted and continued):

    ./dev exec uv pip install --require-hashes -r requirements/bench.txt
    ./dev exec python -m bench.flights_to_target --vehicles 200 --twins 400 --methods all --seed {seed} --out docs

Seed {seed}; {made}."""
_COLOURS: Final[Mapping[str, str]] = {
    "calibrated": "#000000",
    "calibrated-simplex": "#000000",
    "gradient-raw": "#56B4E9",
    "gradient-raw-simplex": "#56B4E9",
    "gradient": "#0072B2",
    "gradient-simplex": "#0072B2",
    "nelder-mead": "#E69F00",
    "finite-differences": "#8C564B",
    "tpe": "#009E73",
    "cma-es": "#D55E00",
    "gp": "#CC79A7",
    "bayes-opt": "#7F7F7F",
}
"""Okabe and Ito's palette, distinguishable also for colour-blind readers, with two neutral ones; methods without a
colour are not drawn."""


def summary(found: Mapping[str, Outcome], target: float) -> list[str]:
    """Return the rows of one table."""
    columns = ["method", "vehicles", "flights", *(f"flight {number}" for number in AT_FLIGHTS), "median"]
    lines = [f"| {' | '.join(columns)} |", f"| {' | '.join(['---'] * len(columns))} |"]
    for name, outcome in found.items():
        shares = [str(outcome.reached(target, number)) for number in AT_FLIGHTS]
        cells = [
            METHODS[name].title,
            str(len(outcome.courses)),
            str(outcome.budget),
            *shares,
            outcome.median_flights(target),
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def safety(found: Mapping[str, Outcome]) -> list[str]:
    """Return the table of unsafe flights and computation times."""
    columns = (
        "method",
        "first flight unsafe",
        "unsafe, of all flights after the first",
        "unsafe flights per vehicle until within 5 %",
        "processor time of a proposal, median and longest",
        "ended by a refusal",
    )
    lines = [f"| {' | '.join(columns)} |", f"| {' | '.join(['---'] * len(columns))} |"]
    for name, outcome in found.items():
        middle, longest = outcome.compute_s
        lines.append(
            f"| {METHODS[name].title} | {outcome.unsafe_starts} | {outcome.unsafe_flights.rounded(1)} "
            f"| {outcome.unsafe_on_the_way(0.05):.2f} "
            f"| {_duration(middle)}, {_duration(longest)} | {outcome.refused} |"
        )
    return lines


def own_lines(outcome: Outcome) -> list[str]:
    """Return the sentences on Gainline's own proposals."""
    lines = [
        "Share of Gainline's proposals within the target, each flight counted separately: "
        + "; ".join(
            f"flight {number} within 5 % {outcome.standing(0.05, number)}, within 2 % {outcome.standing(0.02, number)}"
            for number in (2, 3)
        )
        + "."
    ]
    if outcome.coverage.of:
        lines.append(
            f"The predicted 90 % interval contained the error of {outcome.coverage} of {outcome.coverage.of} flights."
        )
    return lines


def page(all_found: Mapping[str, Mapping[str, Outcome]], results: Results, seed: int, figure: str) -> str:
    """Return the page in Markdown."""
    start = start_gains(Evidence(definition=Definition(start=Start(kind="simplex")), experiment=EXPERIMENT, flights=()))
    lines = [_INTRODUCTION.format(figure=figure, seed=seed, made=_made(results, seed), **start)]
    for population, found in all_found.items():
        lines += ["", f"## {TITLES[population]}", "", LINES[population]]
        for target in TARGETS:
            lines += ["", f"Within {target:.0%} of the vehicle's own optimum:".replace("%", " %"), ""]
            lines += summary(found, target)
        lines += ["", *safety(found)]
        if "calibrated" in found:
            lines += ["", *own_lines(found["calibrated"])]
    return "\n".join([*lines, ""])


def with_steps(text: str, steps: str) -> str:
    """A page with another section on altitude steps, its last; without one if `steps` is empty."""
    own, _, _ = text.partition(f"\n{_STEPS}")
    return f"{own}\n{steps}" if steps else own


def steps_of(text: str) -> str:
    """The section on altitude steps of a page; empty if it has none."""
    _, found, rest = text.partition(f"\n{_STEPS}")
    return f"{_STEPS}{rest}" if found else ""


_STEPS: Final = "## Altitude steps"


def _made(results: Results, seed: int) -> str:
    """Return the dates of the flights and the versions of the libraries."""
    made: dict[str, set[str]] = {}
    for task in results:
        if task.seed == seed and isinstance(stamp := results[task]["made"], dict):
            for name, value in stamp.items():
                made.setdefault(str(name), set()).add(str(value))
    days = sorted(made.pop("day", set()))
    libraries = ", ".join(f"{name} {' and '.join(sorted(values))}" for name, values in sorted(made.items()))
    when = days[0] if len(days) == 1 else f"{days[0]} … {days[-1]}"
    return f"flown on {when} with Python {platform.python_version()}{', ' if libraries else ''}{libraries}"


def _duration(seconds: float) -> str:
    if seconds != seconds:  # noqa: PLR0124 - no number
        return "–"
    return f"{seconds * 1e3:.0f} ms" if seconds < 0.9995 else f"{seconds:.1f} s"


def draw(all_found: Mapping[str, Mapping[str, Outcome]], file: Path, target: float = 0.05) -> None:
    """Share of vehicles within the target against flights, a panel for each population, as SVG."""
    import matplotlib as mpl  # noqa: PLC0415 - of the group `bench`
    from matplotlib.figure import Figure  # noqa: PLC0415

    shown = [name for name in all_found if name != "twin"]
    with mpl.rc_context({"svg.hashsalt": "flights-to-target", "svg.fonttype": "none", "font.size": 9}):
        figure = Figure(figsize=(11.0, 5.2), layout="constrained", facecolor="white")
        panels = figure.subplots(1, len(shown), sharey=True, squeeze=False)[0]
        for axes, population in zip(panels, shown, strict=True):
            _panel(axes, TITLES[population], all_found[population], target)
        panels[0].set_ylabel(f"vehicles within {target * 100:.0f} % of their own optimum")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=2, frameon=False)
        file.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(file, format="svg", metadata={"Date": None})


def _panel(axes: "Axes", title: str, found: Mapping[str, Outcome], target: float) -> None:
    for name, colour in _COLOURS.items():
        if name not in found:
            continue
        outcome, is_own = found[name], name.startswith("calibrated")
        last = outcome.budget
        numbers = list(range(1, (60 if is_own else last) + 1))
        shares = [outcome.reached(target, number) for number in numbers]
        low, high = zip(*(share.interval for share in shares), strict=True)
        values, line = [share.value for share in shares], "--" if name.endswith("simplex") else "-"
        axes.fill_between(numbers, low, high, step="post", color=colour, alpha=0.12, linewidth=0)
        weight, own = (2.6, last) if is_own else (1.5, len(numbers))
        label = METHODS[name].title
        axes.step(numbers[:own], values[:own], where="post", color=colour, lw=weight, ls=line, label=label)
        axes.step(numbers[own - 1 :], values[own - 1 :], where="post", color=colour, lw=1.0, ls=":")
    axes.set_xscale("log")
    axes.set_xlim(1, 60)
    axes.set_ylim(-0.01, 1.01)
    ticks = [1, 2, 3, 5, 10, 20, 40, 60]
    axes.set_xticks(ticks, labels=[str(tick) for tick in ticks])
    axes.minorticks_off()
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:.0%}".replace("%", " %"))
    axes.set_xlabel("flights")
    axes.set_title(title, fontsize=10)
    axes.grid(alpha=0.25)
