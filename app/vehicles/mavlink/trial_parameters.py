"""Parameters, in addition to the gains, that a trial changes for its take-off and restores afterwards."""

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
    """Value of a parameter before and during a trial."""

    before: float
    during: float


def files_for(folder: Path, address: Address, vehicle: Identity, *, is_simulated: bool) -> tuple[Path, ...]:
    """Return the file for this vehicle, and then those of the same hardware id under other addresses.

    The file is named by address and identity, because vehicles of one type may use one address in turn. Simulated
    vehicles may all report the same hardware id, so only the file of their address is used.
    """
    identity = _joined(f"{vehicle.autopilot} {vehicle.system_id} {vehicle.uid}")
    own = folder / f"{_joined(str(address))}-{identity}.json"
    if is_simulated or not vehicle.uid:
        return (own,)
    return own, *sorted(file for file in folder.glob(f"*-{identity}.json") if file != own)


def _joined(described: str) -> str:
    return "-".join(re.findall(r"[A-Za-z0-9.]+", described))


class TrialParameters:
    """Changes of parameters by trials, kept until the old values are restored and read back.

    `files` is called once the vehicle is known. All the files are read; changes are stored in the first, so that they
    survive this process; without files they are kept in memory. A value is restored only if it is still the one that
    the trial set, because any other was set by somebody else since.
    """

    def __init__(self, radio: AutopilotLink, files: Callable[[], tuple[Path, ...]] = tuple) -> None:
        self._radio, self._named = radio, files
        self._changed: dict[str, ChangedParameter] | None = None

    def set(self) -> None:
        """Set the parameters for take-off. Raises VehicleError if the vehicle does not report the current values or
        does not accept the new ones, or if the current values cannot be stored."""
        for setting in self._radio.profile.take_off_settings(self._radio.target):
            held = read_parameter(self._radio, setting.parameter)
            if held is None:
                raise _unset(setting)
            if held != setting.value:
                self._keep({setting.parameter: ChangedParameter(held, setting.value)} | self._remembered())
                if not self._write(setting):
                    raise _unset(setting)

    def restore(self) -> str:
        """Restore the old values; return the problem, or an empty string."""
        try:
            for name, changed in tuple(self._remembered().items()):
                held = read_parameter(self._radio, name)
                if held is None or (held == changed.during and not self._write(Setting(name, changed.before))):
                    return f"{name} could not be restored to {changed.before:g}."
                self._keep({other: one for other, one in self._remembered().items() if other != name})
        except VehicleError as error:
            return str(error)
        return ""

    def _write(self, setting: Setting) -> bool:
        """Write a parameter; return whether the value was read back."""
        write_parameter(self._radio, setting.parameter, setting.value)
        return read_parameter(self._radio, setting.parameter) == setting.value

    # ---- storage

    @cached_property
    def _files(self) -> tuple[Path, ...]:
        return self._named()

    def _remembered(self) -> dict[str, ChangedParameter]:
        """Return the changes of this process, or of an earlier one on a vehicle with this autopilot and system id.
        Raises VehicleError if a file cannot be read."""
        if self._changed is None:
            read = [self._read(file) for file in self._files]
            self._changed = {name: one for changed in reversed(read) for name, one in changed.items()}
        return self._changed

    def _read(self, file: Path) -> dict[str, ChangedParameter]:
        try:
            stored = json.loads(file.read_text(encoding="utf-8"))
            if stored["vehicle"] != self._vehicle():
                return {}
            return {
                str(name): ChangedParameter(float(one[0]), float(one[1])) for name, one in stored["parameters"].items()
            }
        except FileNotFoundError:
            return {}
        except (OSError, ArithmeticError, ValueError, TypeError, LookupError, AttributeError) as error:
            raise _unusable(file, error) from error

    def _keep(self, changed: dict[str, ChangedParameter]) -> None:
        """Keep the changes, on disk first. Raises VehicleError if they cannot be stored."""
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
        return f"{self._radio.profile.name} {self._radio.target.system}"


def _unusable(file: Path, error: Exception) -> VehicleError:
    return VehicleError(
        f"The file {file}, which keeps parameters that a trial changed on the vehicle, cannot be used: {error}.",
        hint="Check that the disk is not full. If the file is damaged, correct the vehicle's take-off parameters by "
        "hand, then delete the file.",
    )


def _unset(setting: Setting) -> VehicleError:
    return VehicleError(
        f"The vehicle could not be set up: the take-off needs {setting.parameter} = {setting.value:g}.",
        hint="Check that the vehicle is connected and that no other program writes its parameters, then try again.",
    )
