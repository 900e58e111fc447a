"""The gains of one vehicle: what it may hold, what it was given, what it was found to hold."""

from typing import Final

from app.core.policy import Gains
from app.vehicles.base import CheckItem
from app.vehicles.errors import InterruptedByOrderError, VehicleError
from app.vehicles.mavlink import parameters
from app.vehicles.mavlink.profiles.base import GainSet, check_gains
from app.vehicles.mavlink.radio import AutopilotLink
from app.vehicles.mavlink.signals import Setting


class GainStore:
    """`staged` are those that were written for the next flight and read back equal, None while there are none; `held`
    those that were read back last, whichever they were."""

    def __init__(self, radio: AutopilotLink, safe: Gains) -> None:
        """Raises GainsError for safe gains that the autopilot cannot hold."""
        self._radio = radio
        self._gain_set: GainSet | None = None
        self.safe: Final[Gains] = check_gains(safe, radio.profile.gain_sets[0])
        self.staged: dict[str, float] | None = None
        self.held: dict[str, float] = {}

    def stage(self, gains: Gains) -> dict[str, float]:
        """Raises GainsError for gains that may not be written (nothing is changed then), VehicleError for silence."""
        wanted = check_gains(gains, self._found())
        self.staged = None
        held = self._write(wanted)
        self.staged = held if held == wanted else None
        return dict(held)

    def read(self) -> dict[str, float]:
        """Raises VehicleError for silence."""
        self.held = parameters.read_gains(self._radio, self._found(), self.wanted)
        return dict(self.held)

    def restore(self) -> dict[str, float]:
        """Write the safe gains; what was read back. Raises VehicleError for silence."""
        self.staged = None
        return dict(self._write(self.safe))

    def restore_or_explain(self) -> str:
        """Restore the safe gains; why they cannot be verified, or nothing."""
        try:
            held = self.restore()
        except VehicleError as error:
            return str(error)
        return "" if held == self.safe else f"it holds {written(held)} instead of {written(self.safe)}."

    @property
    def wanted(self) -> Gains:
        """What the vehicle should hold now."""
        return self.safe if self.staged is None else self.staged

    @property
    def safe_settings(self) -> tuple[Setting, ...]:
        """The safe gains as an abort sends them."""
        return parameters.settings(self._found(), self.safe)

    def check(self) -> CheckItem:
        """Read the gains, and judge whether they are those that they should be."""
        try:
            held, found = self.read(), ""
        except InterruptedByOrderError:
            raise
        except VehicleError as error:
            held, found = {}, str(error)
        return CheckItem(
            name="gains",
            title="Gains",
            passed=held == self.wanted,
            found=found or written(held),
            needed=written(self.wanted),
            hint="" if held == self.wanted else "Restore its safe gains, then stage again.",
        )

    def _found(self) -> GainSet:
        """By the names that this vehicle has for them. Raises VehicleError when it answers to none."""
        if self._gain_set is None:
            self._gain_set = parameters.find_gain_set(self._radio)
        return self._gain_set

    def _write(self, wanted: Gains) -> dict[str, float]:
        self.held = parameters.write_gains(self._radio, self._found(), wanted)
        return self.held


def written(gains: Gains) -> str:
    return ", ".join(f"{name} {value:g}" for name, value in gains.items()) or "nothing"
