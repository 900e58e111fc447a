"""Campaign files: what ships, and what is wrong by line."""

from dataclasses import fields, replace
from pathlib import Path

import pytest

from app.campaigns.campaign_files import CampaignFile, gains_by_hand, preset_names, read_campaign_file, read_preset
from app.campaigns.definitions import check_campaign
from app.common.errors import InputError
from app.core.definition import Definition


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "campaign.yaml"
    path.write_text(text)
    return path


def checked(file: CampaignFile) -> Definition:
    return check_campaign(file.definition, file.vehicle)[0]


@pytest.mark.parametrize("name", preset_names())
def test_every_preset_is_a_campaign_that_can_be_created(name: str) -> None:
    file = read_preset(name)
    definition = checked(file)
    of_its_own = {
        "f16-pitch-tracking": "pitch-tracking",
        "ardrone-altitude-steps": "altitude-steps",
        "ardupilot-altitude-steps": "altitude-steps-ardupilot",
        "px4-altitude-steps": "altitude-steps-px4",
        "paper-f16-pitch-tracking": "pitch-tracking",
    }
    assert definition.experiment == of_its_own.get(name, "takeoff")
    assert not file.gains


def test_the_papers_presets_fly_the_papers_method_and_the_others_do_not() -> None:
    raw = {"scaled": False, "bias": "outside"}
    starts = {}
    for name in preset_names():
        file, definition = read_preset(name), checked(read_preset(name))
        is_papers = name.startswith("paper-")
        assert file.name.startswith("The paper's method") == is_papers
        assert (definition.strategy == "gradient") == (definition.stop.kind == "paper") == is_papers
        assert ("not the paper's" in file.description) != is_papers
        if is_papers:
            assert dict(definition.options) == raw
            starts[name] = definition.start.kind
    assert starts == {
        "paper-ardrone-takeoff": "default",
        "paper-ardrone-takeoff-simplex": "simplex",
        "paper-f16-pitch-tracking": "simplex",
    }


def test_the_gain_sets_of_a_file_are_complete_and_in_the_experiments_order(tmp_path: Path) -> None:
    text = "name: x\ndefinition: {strategy: manual}\ngains:\n  - {kd: 82, kp: 283, ki: 13}\n"
    file = read_campaign_file(written(tmp_path, text))
    assert [list(gains.items()) for gains in gains_by_hand(file, checked(file))] == [
        [("kp", 283), ("ki", 13), ("kd", 82)]
    ]


def test_a_name_is_all_that_a_campaign_file_needs(tmp_path: Path) -> None:
    file = read_campaign_file(written(tmp_path, "name: Tuesday\n"))
    assert (file.vehicle.kind, file.definition.strategy, file.definition.stop.max_flights) == (
        "jsbsim",
        "calibrated",
        7,
    )


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("name: x\nvehicle:\n  kind: jsbsim\n  colour: red\n", "line 4, vehicle.colour"),
        ("name: x\ndefinition:\n  seed: -4\n", "line 3, definition.seed"),
        ("name: x\ndefinition:\n  bounds:\n    kp: [1, .nan]\n", "line 4, definition.bounds.kp.1"),
        ("name: x\ndefinition:\n  bounds:\n    kp: [10, 5]\n", "line 4, definition.bounds.kp"),
        ("name: x\n\ndefinition:\n  strategy: prayer\n", "line 4, definition.strategy"),
        ("name: x\ndefinition:\n  stop: {max_flights: 0}\n", "line 3, definition.stop.max_flights"),
        ("name: x\nvehicle:\n  kind: twin\n  options: {wind: 3}\n", "line 4, vehicle.options.wind"),
        ("name: x\ndefinition: {strategy: manual}\ngains:\n  - {kp: 283, ki: 13}\n", "line 4, gains.0.kd"),
        ("name: x\ndefinition: {strategy: gradient}\ngains:\n  - {kp: 1, ki: 1, kd: 1}\n", "line 3, gains"),
        (
            "name: x\nvehicle: {kind: mavlink}\ndefinition: {experiment: takeoff-px4}\n",
            "line 3, definition.experiment",
        ),
        (
            "name: x\nvehicle:\n  kind: mavlink\n  options: {autopilot: px4}\n",
            "line 1, definition.experiment",
        ),
        ("vehicle: {kind: twin}\n", "line 1, name"),
        ("name: x\nname: y\n", "line 2"),
        ("name: [x\n", "line 2"),
        ("- name\n", "line 1"),
        ("", "line 1"),
    ],
)
def test_what_is_wrong_is_named_by_line_and_field(tmp_path: Path, text: str, named: str) -> None:
    with pytest.raises(InputError) as refused:
        read_campaign_file(written(tmp_path, text))
    assert named in [problem.field for problem in refused.value.problems]


def test_a_missing_file_is_reported(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file"):
        read_campaign_file(tmp_path / "absent.yaml")


def test_a_binary_file_is_not_yaml(tmp_path: Path) -> None:
    path = tmp_path / "record.yaml"
    path.write_bytes(bytes(range(256)))
    with pytest.raises(InputError, match="not YAML"):
        read_campaign_file(path)


DOCUMENT = (Path(__file__).parents[2] / "docs" / "campaign-files.md").read_text(encoding="utf-8")


def test_the_documented_example_holds_the_defaults_and_names_every_field(tmp_path: Path) -> None:
    example = DOCUMENT.split("```yaml\n")[1].split("```")[0]
    documented = checked(read_campaign_file(written(tmp_path, example)))
    default = checked(read_campaign_file(written(tmp_path, "name: x\n")))
    assert replace(documented, options={}, bounds={}) == default
    unnamed = [field.name for field in fields(documented) if f"  {field.name}: " not in example.replace(":\n", ": ")]
    assert unnamed == ["safe_gains"], "the vehicle's, not the file's"
