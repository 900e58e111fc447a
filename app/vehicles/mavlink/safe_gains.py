"""The safe gains of a vehicle with a MAVLink autopilot, and what else a trial changes: written, compared, and restored,
also by the process after one that died.
"""

from typing import Final

from app.core.policy import Gains
from app.vehicles.base import SafeGainsError, VehicleError
from app.vehicles.mavlink import addresses, preparation
from app.vehicles.mavlink.observed_vehicle import ObservedVehicle
from app.vehicles.mavlink.parameters import GainStore, TrialParameters, files_for, written
from app.vehicles.mavlink.trial_state import State

ANOTHER: Final = "Check which vehicle it is, then try again."
SET_BY_HAND: Final = "Set its gains by hand, read them back, then release it."


class SafeGainsVehicle(ObservedVehicle):
    """An observed vehicle with its safe gains."""

    _parameters: TrialParameters

    def restore(self) -> dict[str, float]:
        """Write the safe gains and return the values read back, which are equal; a vehicle that is only observed stays
        so. Raises SafeGainsError if it is armed, is another one, or does not accept them; VehicleError if it does not
        report its known hardware id."""
        self._identify()
        preparation.require_disarmed(self._radio)
        if self._identity.is_another:
            raise SafeGainsError(self.concern, hint=ANOTHER)
        self._identity.require_uid()
        if problem := self._restore_all():
            raise SafeGainsError(f"The vehicle does not accept its earlier values. {problem}", hint=SET_BY_HAND)
        return dict(self._gains.held)

    def change_safe_gains(self, safe_gains: Gains) -> None:
        """Replace the safe gains by those of a person, write them and read them back. Until a person has decided on
        this vehicle, they are only compared, as on connection. A vehicle that is only observed stays so, and its
        release writes them. A failure becomes the `concern`. Raises GainsError, and changes nothing, for gains that the
        vehicle cannot hold."""
        changed = GainStore(self._radio, safe_gains)
        changed.held, self._gains = self._gains.held, changed
        if self._decided and self._quarantine.is_active:
            return
        if self._has_set_safe_gains() and self._quarantine.is_active:
            self._quarantine.end()

    def _restore_all(self) -> str:
        """Restore the safe gains and the other parameters of a trial; return the problem, or an empty string."""
        return self._gains.restore() or self._parameters.restore()

    def _restore_or_quarantine(self) -> None:
        """Restore the safe gains, because the staged gains are not flown; quarantine the vehicle if they cannot be
        verified. A vehicle that is armed keeps its gains, and is observed."""
        if self._quarantine.is_active:
            return
        self._is_restoring = True
        try:
            self.restore()
        except VehicleError as error:
            self._check_identity()
            if not self._quarantine.is_active:
                self._quarantine.begin(State.QUARANTINE, f"Its safe gains could not be verified. {error}")
        finally:
            self._is_restoring = False

    def _has_set_safe_gains(self) -> bool:
        """Write or compare the safe gains; return whether the vehicle holds them and nothing else was found. Otherwise
        it is only observed."""
        was_observed = self._quarantine.is_active
        try:
            self._set_up()
        except VehicleError as error:
            self._observe(str(error) if not self._decided else f"Its safe gains could not be verified. {error}")
            return False
        if self._quarantine.is_active and not was_observed:
            return False
        self._decided = True
        self._identity.pinned = self.identity
        return True

    def _set_up(self) -> None:
        """Set up telemetry and safe gains. Raises VehicleError if the vehicle is armed, refuses, does not accept its
        safe gains, or holds others that no person has decided to overwrite."""
        preparation.require_disarmed(self._radio)
        self._request_telemetry()
        if self._decided:
            self.restore()
        elif (found := self._gains.read()) != self._gains.safe:
            raise SafeGainsError(
                f"It holds {written(found)}, but its safe gains are {written(self._gains.safe)}; nothing was written.",
                hint="If its current gains are safe, save them as its safe gains. Otherwise release it, which writes "
                "the safe gains.",
            )
        elif problem := self._parameters.restore():
            raise SafeGainsError(problem, hint=SET_BY_HAND)

    def _trial_parameters(self) -> TrialParameters:
        """Return the trial parameters of the vehicle that is connected when they are first needed."""
        if self._parameters_folder is None:
            return TrialParameters(self._radio)
        folder, address = self._parameters_folder, addresses.parse(str(self._options["address"]))
        is_simulated = bool(self._options["simulated"])
        return TrialParameters(
            self._radio, lambda: files_for(folder, address, self.identity, is_simulated=is_simulated)
        )
