"""Campaign files: the fields of `POST /api/campaigns` and a description, as YAML, with the command line's changes to
them (`--vehicle`, `--strategy`, `--start`, `--set name=value`). Errors name the line.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Field, ValidationError

from app.autopilots.registry import EXPERIMENTS, experiment_of, get_experiment
from app.campaigns.definitions import check_campaign
from app.campaigns.schemas import NewCampaign
from app.common.errors import InputError, Problem
from app.common.schemas import Number, Text
from app.core.definition import Definition
from app.core.policy import shortened
from app.core.tuning.definition_checks import MAX_FLIGHTS
from app.core.tuning.strategies import STRATEGIES
from app.core.tuning.strategies.manual import MANUAL
from app.vehicles.registry import get_kind

if TYPE_CHECKING:
    from ruamel.yaml.comments import CommentedMap


PRESETS_DIR: Final = Path(__file__).parent / "presets"
MAX_FILE_BYTES: Final = 2**20


class CampaignFile(NewCampaign):
    """Content of a campaign file; omitted fields have the same defaults as in the API.

    `gains` are the sets that `gainline run` flies one after another under the strategy `manual`.
    """

    description: Text = ""
    gains: Annotated[list[dict[str, Number]], Field(max_length=MAX_FLIGHTS)] = Field(default_factory=list)


def preset_names() -> tuple[str, ...]:
    """Names of the campaigns that come with the program, the shortest first: of those with the same vehicle and
    experiment, the first one is the default."""
    return tuple(sorted((path.stem for path in PRESETS_DIR.glob("*.yaml")), key=lambda name: (len(name), name)))


def read_preset(name: str) -> CampaignFile:
    """Read the preset of that name, one of `preset_names`."""
    return read_campaign_file(PRESETS_DIR / f"{name}.yaml")


def read_named(source: str) -> CampaignFile:
    """Read the preset of that name, else the file at that path. Raises what `read_campaign_file` raises."""
    return read_preset(source) if source in preset_names() else read_campaign_file(Path(source))


def read_campaign_file(path: Path) -> CampaignFile:
    """Read and check a campaign file. Raises InputError with the line of each problem."""
    document = _load(path)
    try:
        file = CampaignFile.model_validate(document)
    except ValidationError as error:
        problems = tuple(_located(document, entry["loc"], entry["msg"]) for entry in error.errors())
        raise _no_campaign(path, problems) from error
    if file.definition.start.kind == "campaign":
        reason = (
            "'campaign' needs the other campaign's database: create this campaign in the dashboard or through the API"
        )
        raise _no_campaign(path, (_located(document, ("definition", "start", "kind"), reason),))
    try:
        definition, _ = check_campaign(file.definition, file.vehicle)
        gains_by_hand(file, definition)
    except InputError as error:
        problems = tuple(
            _located(document, [int(step) if step.isdecimal() else step for step in each.field.split(".")], each.reason)
            for each in error.problems
        )
        raise _no_campaign(path, problems) from error
    return file


def gains_by_hand(
    file: CampaignFile, definition: Definition, *, within_bounds: bool = False
) -> tuple[dict[str, float], ...]:
    """The gain sets to be flown, each complete and in the experiment's order.

    Raises InputError that names each invalid gain (`gains.0.kp`), and when the strategy does not use given gains.
    """
    if file.gains and definition.strategy != MANUAL.name:
        raise InputError(
            "These gains cannot be used with this strategy.",
            problems=(Problem("gains", f"are computed by the strategy {definition.strategy!r}"),),
            hint=f"Leave them out, or choose the strategy {MANUAL.name!r}.",
        )
    space = experiment_of(definition).space.narrowed(definition.bounds)
    accept = space.check if within_bounds else space.complete
    return tuple(accept(gains, field=f"gains.{place}") for place, gains in enumerate(file.gains))


def _no_campaign(path: Path, problems: tuple[Problem, ...]) -> InputError:
    return InputError(
        f"{path.name} is not a valid campaign file.",
        problems=problems,
        hint="Correct the lines listed; docs/campaign-files.md describes the fields.",
    )


def _load(path: Path) -> "CommentedMap":
    from ruamel.yaml import YAML
    from ruamel.yaml.comments import CommentedMap
    from ruamel.yaml.error import MarkedYAMLError, YAMLError

    try:
        if path.stat().st_size > MAX_FILE_BYTES:
            raise InputError(f"{path.name} is larger than 1 MiB.", hint="Use a campaign file, not a flight record.")
        document = YAML(typ="rt").load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(
            f"{path} could not be read: {error.strerror or error}.",
            hint=f"Use a YAML file, or a preset: {', '.join(preset_names())}.",
        ) from error
    except MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark is not None else 1
        raise InputError(
            f"{path.name} is not YAML.",
            problems=(Problem(f"line {line}", str(error.problem)),),
            hint="Correct this line.",
        ) from error
    except (YAMLError, UnicodeDecodeError) as error:
        raise InputError(f"{path.name} is not YAML: {error}.", hint="Use a UTF-8 YAML file.") from error
    if not isinstance(document, CommentedMap):
        raise InputError(
            f"{path.name} is not a valid campaign file.",
            hint="Start it with `name: …` on line 1.",
            problems=(Problem("line 1", "must contain fields: `name: …` and so on"),),
        )
    return document


def _located(document: "CommentedMap", where: Sequence[str | int], reason: str) -> Problem:
    return Problem(f"line {_line(document, where)}, {'.'.join(str(part) for part in where)}", reason)


def _line(document: "CommentedMap", where: Sequence[str | int]) -> int:
    """Line of the deepest part of `where` that the file holds, counted from 1."""
    from ruamel.yaml.comments import CommentedMap, CommentedSeq

    node: object = document
    line = 1
    for part in where:
        if isinstance(node, CommentedMap) and part in node:
            line = node.lc.key(part)[0] + 1
        elif isinstance(node, CommentedSeq) and isinstance(part, int) and part < len(node):
            line = node.lc.item(part)[0] + 1
        else:
            break
        node = node[part]
    return line


def with_settings(file: CampaignFile, settings: Mapping[tuple[str, ...], object]) -> CampaignFile:
    """The file with some fields replaced, each given by its path. Raises InputError when the result is not a valid
    campaign."""
    document = file.model_dump()
    for path, value in settings.items():
        node = document
        for part in path[:-1]:
            node = node[part]
        node[path[-1]] = value
    try:
        return CampaignFile.model_validate(document)
    except ValidationError as error:
        problems = tuple(
            Problem(".".join(map(str, entry["loc"])), f"{entry['msg']}, got {shortened(entry['input'])}")
            for entry in error.errors()
        )
        raise InputError(
            "These settings do not define a valid campaign.", problems=problems, hint="Correct the settings listed."
        ) from error


SettingPath = tuple[str, ...]


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
    mavlink:udp:127.0.0.1:4245. Each of `gains` is a set to fly with the strategy manual. Raises InputError that
    names what cannot be used.
    """
    chosen: dict[SettingPath, object] = {}
    if vehicle is not None:
        kind, _, address = vehicle.partition(":")
        options = file.vehicle.options if kind == file.vehicle.kind else {}
        chosen[("vehicle", "kind")] = kind
        chosen[("vehicle", "options")] = options | ({"address": address} if address else {})
    if strategy is not None and strategy != file.definition.strategy:
        chosen |= {("definition", "strategy"): strategy, ("definition", "options"): {}}
    if start is not None:
        chosen[("definition", "start")] = (
            {"kind": start}
            if start in ("default", "simplex")
            else {
                "kind": "given",
                "gains": _gains(start, file.definition.experiment, "--start", "default, simplex, or "),
            }
        )
    if gains:
        chosen[("gains",)] = [_gains(text, file.definition.experiment, "--gains") for text in gains]
    numbers = {("definition", "seed"): seed, ("definition", "stop", "max_flights"): max_flights}
    chosen |= {path: number for path, number in numbers.items() if number is not None}
    changed = with_settings(file, chosen)
    return with_settings(changed, _assignments(changed, settings)) if settings else changed


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
            "Invalid gains.",
            problems=(Problem(option, f"is not a gain set: {text!r}"),),
            hint=f"Use {others}every gain by name, {example}, or only the numbers in this order.",
        )
    return dict(zip(names, values, strict=True))


def _assignments(file: CampaignFile, settings: Sequence[str]) -> dict[SettingPath, object]:
    known = _known(file)
    chosen: dict[SettingPath, object] = {}
    problems: list[Problem] = []
    for setting in settings:
        name, separator, text = setting.partition("=")
        if name not in known:
            problems.append(
                Problem(f"--set {name}", f"is not a setting of this campaign; available: {', '.join(sorted(known))}")
            )
        elif not separator or not text:
            problems.append(Problem(f"--set {name}", "needs a value, as in name=value"))
        else:
            chosen[known[name]] = _value(text)
    if problems:
        raise InputError(
            "Invalid settings.",
            problems=tuple(problems),
            hint="--set takes settings of the chosen vehicle, experiment, strategy and stop rule.",
        )
    return chosen


def _known(file: CampaignFile) -> dict[str, SettingPath]:
    """Path of each setting, by its name on the command line."""
    strategy, experiment = STRATEGIES.get(file.definition.strategy), EXPERIMENTS.get(file.definition.experiment)
    described = (
        (("vehicle", "options"), get_kind(file.vehicle.kind).options),
        (("definition", "experiment_options"), experiment.options if experiment else ()),
        (("definition", "options"), strategy.options if strategy else ()),
    )
    return {
        "first_step_fraction": ("definition", "first_step_fraction"),
        "step_fraction": ("definition", "step_fraction"),
        "stop": ("definition", "stop", "kind"),
        "confidence": ("definition", "stop", "confidence"),
        "improvement": ("definition", "stop", "improvement"),
        **{option.name: (*path, option.name) for path, options in described for option in options},
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
