"""Parameters beside the gains that a take-off needs otherwise than they are: set for a trial, and put back after it."""

from app.vehicles.errors import VehicleError
from app.vehicles.mavlink.parameters import read_parameter, write_parameter
from app.vehicles.mavlink.radio import Radio
from app.vehicles.mavlink.signals import Setting


class TrialParameters:
    """What they were before is remembered until they are that again, as read back."""

    def __init__(self, radio: Radio) -> None:
        self._radio = radio
        self._before: dict[str, float] = {}

    def set(self) -> None:
        """Raises VehicleError when the vehicle does not tell what it has, or does not take what a take-off needs."""
        for setting in self._radio.profile.take_off_settings(self._radio.aim):
            held = read_parameter(self._radio, setting.parameter)
            if held is None:
                raise _unset(setting)
            if held != setting.value:
                self._before.setdefault(setting.parameter, held)
                if not self._write(setting):
                    raise _unset(setting)

    def put_back(self) -> str:
        """Why they are not as they were, or nothing."""
        for name, value in tuple(self._before.items()):
            if not self._write(Setting(name, value)):
                return f"{name} was {value:g}, and could not be put back."
            del self._before[name]
        return ""

    def _write(self, setting: Setting) -> bool:
        """Whether it is read back."""
        write_parameter(self._radio, setting.parameter, setting.value)
        return read_parameter(self._radio, setting.parameter) == setting.value


def _unset(setting: Setting) -> VehicleError:
    return VehicleError(
        f"The vehicle could not be set up: {setting.parameter} is not {setting.value:g}, as its take-off needs.",
        hint="See that the vehicle is still there and that nobody else writes its parameters; then try again.",
    )
