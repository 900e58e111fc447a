"""Changes to a campaign file from the command line: `--vehicle`, `--strategy`, `--start`, `--set name=value`."""

from collections.abc import Mapping, Sequence

from app.campaigns.files import CampaignFile, with_settings
from app.common.errors import InputError, Problem
from app.core.experiments import get_experiment
from app.core.strategies import STRATEGIES
from app.vehicles.open import get_kind

Path = tuple[str, ...]


def override(
    file: CampaignFile,
    *,
    vehicle: str | None = None,
    strategy: str | None = None,
    start: str | None = None,
    seed: int | None = None,
    max_flights: int | None = None,
    gains: Sequence[str] = (),
    settings: Sequence[str] = (),
) -> CampaignFile:
    """The file with the values given on the command line in place of its own.

    Another vehicle or strategy starts from its default options; `vehicle` may include an address, as in
    mavlink:udp:127.0.0.1:4245. Each of `gains` is a set to be flown by hand. Raises InputError that names what cannot
    be used.
    """
    chosen: dict[Path, object] = {}
    if vehicle is not None:
        kind, _, address = vehicle.partition(":")
        options = file.vehicle.options if kind == file.vehicle.kind else {}
        chosen[("vehicle", "kind")] = kind
        chosen[("vehicle", "options")] = options | ({"address": address} if address else {})
    if strategy is not None and strategy != file.definition.strategy:
        chosen |= {("definition", "strategy"): strategy, ("definition", "options"): {}}
    if start is not None:
        chosen[("definition", "start")] = _start(start, file.definition.experiment)
    if gains:
        chosen[("gains",)] = [_gains(text, file.definition.experiment, "--gains") for text in gains]
    if seed is not None:
        chosen[("definition", "seed")] = seed
    if max_flights is not None:
        chosen[("definition", "stop", "max_flights")] = max_flights
    changed = with_settings(file, chosen)
    return with_settings(changed, _assignments(changed, settings)) if settings else changed


def _start(text: str, experiment: str) -> Mapping[str, object]:
    if text in ("default", "simplex"):
        return {"kind": text}
    return {"kind": "given", "gains": _gains(text, experiment, "--start", "default, simplex, or ")}


def _gains(text: str, experiment: str, option: str, others: str = "") -> dict[str, float]:
    """Parse a gain set: NAME=NUMBER,… in any order, or numbers in the experiment's order."""
    space = get_experiment(experiment).space
    parts = text.split(",")
    pairs = [part.partition("=") for part in parts]
    named = all(separator for _, separator, _ in pairs)
    names = [name.strip() for name, _, _ in pairs] if named else list(space.names)
    try:
        values = [float(number if named else part) for part, (_, _, number) in zip(parts, pairs, strict=True)]
    except ValueError:
        values = []
    if len(values) != len(names) or len(set(names)) != len(names):
        example = ",".join(f"{name}={value:g}" for name, value in space.mapping(space.default).items())
        raise InputError(
            "These gains cannot be used.",
            problems=(Problem(option, f"cannot be {text!r}"),),
            hint=f"Give {others}every gain by its name, {example}, or the numbers alone in this order.",
        )
    return dict(zip(names, values, strict=True))


def _assignments(file: CampaignFile, settings: Sequence[str]) -> dict[Path, object]:
    known = _known(file)
    chosen: dict[Path, object] = {}
    problems: list[Problem] = []
    for setting in settings:
        name, separator, text = setting.partition("=")
        if name not in known:
            problems.append(Problem(f"--set {name}", f"is not a setting here; there are {', '.join(sorted(known))}"))
        elif not separator or not text:
            problems.append(Problem(f"--set {name}", "needs a value, as in name=value"))
        else:
            chosen[known[name]] = _value(text)
    if problems:
        raise InputError(
            "These settings cannot be used.",
            problems=tuple(problems),
            hint="Settings belong to the chosen vehicle, strategy and stop rule.",
        )
    return chosen


def _known(file: CampaignFile) -> dict[str, Path]:
    """Path of each setting, by its name on the command line."""
    strategy = STRATEGIES.get(file.definition.strategy)
    return {
        "first_step_fraction": ("definition", "first_step_fraction"),
        "step_fraction": ("definition", "step_fraction"),
        "stop": ("definition", "stop", "kind"),
        "improvement": ("definition", "stop", "improvement"),
        **{option.name: ("vehicle", "options", option.name) for option in get_kind(file.vehicle.kind).options},
        **{option.name: ("definition", "options", option.name) for option in (strategy.options if strategy else ())},
    }


def _value(text: str) -> object:
    """Parse a YAML scalar: number, true/false, or text."""
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        value: object = YAML(typ="safe", pure=True).load(text)
    except YAMLError:
        return text
    return value if isinstance(value, bool | int | float) else text
