"""The container files, as far as they can be checked without Docker; .ci/compose-run starts the processes."""

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from ruamel.yaml import YAML

from app.common.settings import Settings

ROOT = Path(__file__).resolve().parents[2]
PROGRAMS = Path(sys.executable).parent
SERVICES: dict[str, dict[str, Any]] = YAML(typ="safe").load(ROOT / "docker-compose.yml")["services"]


def run(*command: str) -> None:
    done = subprocess.run([PROGRAMS / command[0], *command[1:]], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_compose_file_keeps_to_the_compose_specification() -> None:
    run("check-jsonschema", "--builtin-schema", "vendor.compose-spec", "docker-compose.yml")


def test_the_dockerfile_passes_its_linter() -> None:
    run("hadolint", "--no-color", "Dockerfile")


def test_every_stage_begins_with_the_base_image_of_one_digest() -> None:
    lines = (ROOT / "Dockerfile").read_text(encoding="utf-8").splitlines()
    [base] = [line for line in lines if line.startswith("ARG BASE=")]
    assert re.fullmatch(r"ARG BASE=python:3\.13-slim-trixie@sha256:[0-9a-f]{64}", base)
    stages = [line.split()[1] for line in lines if line.startswith("FROM ")]
    assert len(stages) == 2
    assert set(stages) == {"${BASE}"}


@pytest.mark.parametrize("name", SERVICES)
def test_a_container_writes_its_volume_only_gains_no_rights_and_has_a_limit_of_memory(name: str) -> None:
    service = SERVICES[name]
    assert service["read_only"] is True
    assert [mount.partition(":")[0] for mount in service["tmpfs"]] == ["/tmp"]
    assert service["cap_drop"] == ["ALL"]
    assert service["security_opt"] == ["no-new-privileges:true"]
    assert service["mem_limit"] == "${GAINLINE_MEMORY:-4g}"
    assert not {"privileged", "cap_add", "devices", "pid", "ipc"} & set(service)


def test_one_service_serves_one_works_and_one_is_a_simulated_drone_for_who_asks() -> None:
    assert {name: service["command"] for name, service in SERVICES.items()} == {
        "web": ["gainline", "serve", "--no-worker"],
        "worker": ["gainline", "worker"],
        "sim-drone": ["gainline", "sim-drone", "--autopilot", "paparazzi"],
    }
    assert [name for name, service in SERVICES.items() if "profiles" in service] == ["sim-drone"]


def test_server_worker_and_simulated_drone_are_on_the_hosts_loopback_for_nobody_else() -> None:
    for service in SERVICES.values():
        assert service["network_mode"] == "host"
        assert service["environment"]["GAINLINE_HOST"] == "127.0.0.1"
        assert "ports" not in service


@pytest.mark.parametrize("name", SERVICES)
def test_every_command_of_the_compose_file_is_understood(name: str) -> None:
    run(*SERVICES[name]["command"], "--help")


@pytest.mark.parametrize("name", SERVICES)
def test_every_variable_of_the_compose_file_is_a_setting(name: str) -> None:
    variables = {each for each in SERVICES[name]["environment"] if each.startswith("GAINLINE_")}
    assert variables <= {f"GAINLINE_{field.upper()}" for field in Settings.model_fields}


@pytest.mark.parametrize("name", SERVICES)
def test_the_data_folder_lies_on_the_one_volume(name: str) -> None:
    assert SERVICES[name]["volumes"] == [f"data:{SERVICES[name]['environment']['GAINLINE_DATA_DIR']}"]
