"""Parameters beside the gains that a take-off needs otherwise than they are: set for a trial, and put back after it."""

import json
import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from app.vehicles.base import Identity, VehicleError
from app.vehicles.mavlink.addresses import Address
from app.vehicles.mavlink.events import Setting
from app.vehicles.mavlink.parameters import read_parameter, write_parameter
from app.vehicles.mavlink.radio import AutopilotLink


@dataclass(frozen=True, slots=True)
class ChangedParameter:
    """What a parameter was before a trial, and what it was set to."""

    before: float
    during: float


def files_for(folder: Path, address: Address, vehicle: Identity, *, is_simulated: bool) -> tuple[Path, ...]:
    """Where it is kept for this vehicle, whoever flies it, for those of one type may have one address by turns; then
    the files that were kept under other addresses of the same hardware id. Simulated vehicles may all tell the same
    one, so their address is part of who they are."""
    identity = _joined(f"{vehicle.autopilot} {vehicle.system_id} {vehicle.uid}")
    own = folder / f"{_joined(str(address))}-{identity}.json"
    if is_simulated or not vehicle.uid:
        return (own,)
    return own, *sorted(file for file in folder.glob(f"*-{identity}.json") if file != own)


def _joined(described: str) -> str:
    return "-".join(re.findall(r"[A-Za-z0-9.]+", described))


class TrialParameters:
    """What was changed is remembered until it is put back, as read back; in the first of the files that `files` names
    once the vehicle is known, where there is one, also beyond this process. All of them are read. A value is put back
    only if it is still the one that the trial set: any other, somebody has set since.
    """

    def __init__(self, radio: AutopilotLink, files: Callable[[], tuple[Path, ...]] = tuple) -> None:
        self._radio, self._named = radio, files
        self._changed: dict[str, ChangedParameter] | None = None

    def set(self) -> None:
        """Raises VehicleError when the vehicle does not tell what it has, or does not take what a take-off needs, or
        when what it has cannot be kept."""
        for setting in self._radio.profile.take_off_settings(self._radio.aim):
            held = read_parameter(self._radio, setting.parameter)
            if held is None:
                raise _unset(setting)
            if held != setting.value:
                self._keep({setting.parameter: ChangedParameter(held, setting.value)} | self._remembered())
                if not self._write(setting):
                    raise _unset(setting)

    def restore(self) -> str:
        """Why they are not as they were, or nothing."""
        try:
            for name, changed in tuple(self._remembered().items()):
                held = read_parameter(self._radio, name)
                if held is None or (held == changed.during and not self._write(Setting(name, changed.before))):
                    return f"{name} was {changed.before:g}, and could not be put back."
                self._keep({other: one for other, one in self._remembered().items() if other != name})
        except VehicleError as error:
            return str(error)
        return ""

    def _write(self, setting: Setting) -> bool:
        """Whether it is read back."""
        write_parameter(self._radio, setting.parameter, setting.value)
        return read_parameter(self._radio, setting.parameter) == setting.value

    # ---- beyond this process

    @cached_property
    def _files(self) -> tuple[Path, ...]:
        return self._named()

    def _remembered(self) -> dict[str, ChangedParameter]:
        """What this process has changed, or one before it on a vehicle of this make and system id. Raises VehicleError
        when the file cannot be read."""
        if self._changed is None:
            read = [self._read(file) for file in self._files]
            self._changed = {name: one for changed in reversed(read) for name, one in changed.items()}
        return self._changed

    def _read(self, file: Path) -> dict[str, ChangedParameter]:
        try:
            kept = json.loads(file.read_text(encoding="utf-8"))
            if kept["vehicle"] != self._vehicle():
                return {}
            return {
                str(name): ChangedParameter(float(one[0]), float(one[1])) for name, one in kept["parameters"].items()
            }
        except FileNotFoundError:
            return {}
        except (OSError, ArithmeticError, ValueError, TypeError, LookupError, AttributeError) as error:
            raise _unusable(file, error) from error

    def _keep(self, changed: dict[str, ChangedParameter]) -> None:
        """On disk first. Raises VehicleError when it cannot be."""
        if self._files:
            own, *others = self._files
            try:
                self._store(own, changed)
                for other in others:
                    other.unlink(missing_ok=True)
            except OSError as error:
                raise _unusable(own, error) from error
        self._changed = changed

    def _store(self, file: Path, changed: dict[str, ChangedParameter]) -> None:
        if not changed:
            file.unlink(missing_ok=True)
            return
        parameters = {name: [one.before, one.during] for name, one in changed.items()}
        file.parent.mkdir(mode=0o700, exist_ok=True)
        fresh = file.with_suffix(".new")
        with fresh.open("w", encoding="utf-8") as writing:
            json.dump({"vehicle": self._vehicle(), "parameters": parameters}, writing)
            writing.flush()
            os.fsync(writing.fileno())
        fresh.replace(file)

    def _vehicle(self) -> str:
        return f"{self._radio.profile.name} {self._radio.aim.system}"


def _unusable(file: Path, error: Exception) -> VehicleError:
    return VehicleError(
        f"What a trial has set on the vehicle is kept in {file}, which cannot be used: {error}.",
        hint="See that there is room on the disk. If the file is damaged, see by hand that the vehicle's take-off "
        "parameters are as they should be, and remove it.",
    )


def _unset(setting: Setting) -> VehicleError:
    return VehicleError(
        f"The vehicle could not be set up: {setting.parameter} is not {setting.value:g}, as its take-off needs.",
        hint="See that the vehicle is still there and that nobody else writes its parameters; then try again.",
    )
