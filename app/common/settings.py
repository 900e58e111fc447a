"""Settings, and the only reader of the environment: every field is also a variable, such as `GAINLINE_DATA_DIR`."""

import ipaddress
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Final

from pydantic import BeforeValidator, Field, ValidationError
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

from app.core.errors import InputError, Problem

APP: Final = Path(__file__).resolve().parents[1]
CHECKOUT: Final = APP.parent


def default_data_dir() -> Path:
    """`var` in a checkout; otherwise the platform's folder for application data."""
    if (CHECKOUT / "dev").is_file() and (CHECKOUT / "pyproject.toml").is_file():
        return CHECKOUT / "var"
    home = os.environ.get("XDG_DATA_HOME", "")
    return (Path(home) if home else Path.home() / ".local" / "share") / "gainline"


def default_ui_dir() -> Path:
    """The built UI: inside an installed package, or from the last build in a checkout."""
    packaged = APP / "ui"
    return packaged if packaged.is_dir() else CHECKOUT / "frontend" / "dist"


def is_loopback(host: str) -> bool:
    """Whether only this computer reaches a server that listens there; a name other than localhost may be any
    address."""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _listed(given: object) -> object:
    return [part for part in (part.strip() for part in given.split(",")) if part] if isinstance(given, str) else given


Hosts = Annotated[frozenset[str], NoDecode, BeforeValidator(_listed)]
"""Given as comma-separated text."""


class Settings(BaseSettings):
    """Settings of a server. Command-line options override variables, variables override these defaults."""

    model_config = SettingsConfigDict(env_prefix="GAINLINE_", frozen=True, extra="forbid")

    data_dir: Path = Field(
        default_factory=default_data_dir, description="folder of the database and of the worker's socket"
    )
    host: str = Field(default="127.0.0.1", description="address of the dashboard")
    port: int = Field(default=8000, ge=0, le=65535, description="port of the dashboard; 0 selects a free one")
    ui_dir: Path = Field(default_factory=default_ui_dir, description="folder of the built dashboard")
    max_upload_bytes: int = Field(default=48 * 2**20, ge=2**16, description="largest flight record accepted")
    log_file_bytes: int = Field(default=2**30, ge=0, description="what all stored files of logs may take")
    lease_s: float = Field(
        default=30.0, gt=0, description="silence of a worker after which its job is given to another"
    )
    simulation_hosts: Hosts = Field(
        default=frozenset(), description="further hosts on which simulated vehicles run, separated by commas"
    )
    log_level: str = Field(default="info", description="minimum level of log messages")

    @property
    def database_file(self) -> Path:
        return self.data_dir / "gainline.sqlite3"


def read_settings(given: Mapping[str, str | int | Path]) -> Settings:
    """Read the environment's settings, overridden by `given`. Raises InputError that names what cannot be used."""
    try:
        return Settings.model_validate(given)
    except ValidationError as error:
        problems = tuple(Problem(_setting_name(str(entry["loc"][0]), given), entry["msg"]) for entry in error.errors())
        raise InputError(
            "Invalid settings.",
            problems=problems,
            hint="Correct the option or variable listed; docs/operations.md lists them all.",
        ) from error


def _setting_name(field: str, given: Mapping[str, str | int | Path]) -> str:
    return f"--{field.replace('_', '-')}" if field in given else f"GAINLINE_{field.upper()}"
