"""Parameters beside the gains that a take-off needs otherwise than they are: set for a trial, and put back after it."""

import json
from pathlib import Path

from app.vehicles.errors import VehicleError
from app.vehicles.mavlink.parameters import read_parameter, write_parameter
from app.vehicles.mavlink.radio import Radio
from app.vehicles.mavlink.signals import Setting


class TrialParameters:
    """What they were before is remembered until they are that again, as read back; in the file `owed`, where there is
    one, also beyond this process."""

    def __init__(self, radio: Radio, owed: Path | None = None) -> None:
        """Raises VehicleError when the file cannot be read."""
        self._radio, self._owed = radio, owed
        self._before = {} if owed is None else _read(owed)

    def set(self) -> None:
        """Raises VehicleError when the vehicle does not tell what it has, or does not take what a take-off needs, or
        when what it has cannot be kept."""
        for setting in self._radio.profile.take_off_settings(self._radio.aim):
            held = read_parameter(self._radio, setting.parameter)
            if held is None:
                raise _unset(setting)
            if held != setting.value:
                self._before.setdefault(setting.parameter, held)
                self._keep()
                if not self._write(setting):
                    raise _unset(setting)

    def put_back(self) -> str:
        """Why they are not as they were, or nothing."""
        for name, value in tuple(self._before.items()):
            if not self._write(Setting(name, value)):
                return f"{name} was {value:g}, and could not be put back."
            del self._before[name]
            self._keep()
        return ""

    def _write(self, setting: Setting) -> bool:
        """Whether it is read back."""
        write_parameter(self._radio, setting.parameter, setting.value)
        return read_parameter(self._radio, setting.parameter) == setting.value

    def _keep(self) -> None:
        if self._owed is None:
            return
        try:
            if self._before:
                fresh = self._owed.with_suffix(".new")
                fresh.write_text(json.dumps(self._before), encoding="utf-8")
                fresh.replace(self._owed)
            else:
                self._owed.unlink(missing_ok=True)
        except OSError as error:
            raise _not_kept(self._owed, error) from error


def _read(owed: Path) -> dict[str, float]:
    try:
        return {str(name): float(value) for name, value in json.loads(owed.read_text(encoding="utf-8")).items()}
    except FileNotFoundError:
        return {}
    except (OSError, ValueError, TypeError, AttributeError) as error:
        raise _not_kept(owed, error) from error


def _not_kept(owed: Path, error: Exception) -> VehicleError:
    return VehicleError(
        f"What the vehicle has to be given back is kept in {owed}, which cannot be used: {error}.",
        hint="See that there is room on the disk. If the file is damaged, set the take-off altitude as it was by hand, "
        "and remove the file.",
    )


def _unset(setting: Setting) -> VehicleError:
    return VehicleError(
        f"The vehicle could not be set up: {setting.parameter} is not {setting.value:g}, as its take-off needs.",
        hint="See that the vehicle is still there and that nobody else writes its parameters; then try again.",
    )
