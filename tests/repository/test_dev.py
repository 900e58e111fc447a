"""`./dev` as a person uses it."""

import ast
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DEV = ROOT / "dev"


def dev(*arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [DEV, *arguments],
        cwd="/",
        env={**os.environ, **variables},
        capture_output=True,
        text=True,
        check=False,
    )


def test_without_a_command_it_lists_its_commands() -> None:
    done = dev()
    assert done.returncode == 0
    assert "./dev up" in done.stdout
    assert "./dev test" in done.stdout


def test_help_of_a_command_sets_nothing_up(tmp_path: Path) -> None:
    """In a fresh checkout: nothing of it may be installed for a help text. Beside it is nothing, as in an image."""
    fresh = tmp_path / "dev"
    fresh.write_bytes(DEV.read_bytes())
    for command in ("up", "setup", "test", "api"):
        done = subprocess.run([sys.executable, fresh, command, "--help"], capture_output=True, text=True, check=False)
        assert (done.returncode, done.stderr) == (0, "")
        assert f"./dev {command}" in done.stdout
    assert not (tmp_path / ".dev").exists()


def test_an_unknown_command_is_refused() -> None:
    assert dev("fly").returncode == 2


def test_exec_is_the_command_in_the_locked_python_with_its_byte_code_cache() -> None:
    code = "import os, sys; print(sys.prefix, os.environ.get('PYTHONDONTWRITEBYTECODE'), sys.argv[1:]); sys.exit(7)"
    done = dev("exec", "python", "-c", code, "a b", "--help", PYTHONDONTWRITEBYTECODE="1")
    assert done.stdout == f"{ROOT / '.venv'} None ['a b', '--help']\n"
    assert done.returncode == 7


def test_exec_of_a_missing_command_says_so() -> None:
    done = dev("exec", "no-such-command")
    assert done.returncode == 1
    assert "no command 'no-such-command'" in done.stderr
    assert "./dev setup" in done.stderr


def test_the_private_node_comes_first() -> None:
    done = dev("exec", "node", "--print", "process.version")
    assert done.stdout.startswith("v24.")


def test_an_old_python_can_read_far_enough_to_be_told() -> None:
    ast.parse(DEV.read_text(), feature_version=(3, 7))
