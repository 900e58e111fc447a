"""Gains and other parameters of the vehicle, written and read back with one request in flight and five attempts of
0.5 s each; and the parameters that a trial changes for its takeoff and restores afterwards.
"""

import json
import os
import re
from collections import ChainMap
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Final

from app.autopilots import commands
from app.autopilots.autopilot import GainParameter, GainSet, check_gains
from app.autopilots.commands import Outgoing, Setting
from app.autopilots.measurements import Parameter
from app.core.policy import Gains
from app.vehicles.base import CheckItem, Identity, InterruptedByOrderError, VehicleError, find_mismatch
from app.vehicles.flight_end import FAILURE_TEXTS
from app.vehicles.mavlink.addresses import Address
from app.vehicles.mavlink.failures import Failure
from app.vehicles.mavlink.radio import ATTEMPTS, REPLY_TIMEOUT_S, AutopilotLink

LIST_ATTEMPTS: Final = 3
LIST_ENDS_S: Final = 2.0
"""The list has ended if no parameter has arrived for this long."""


def read_gains(radio: AutopilotLink, gain_set: GainSet, requested: Gains) -> dict[str, float]:
    """Return the gains on the vehicle, exactly as in `requested` where they are equal in single precision. Raises
    VehicleError if the vehicle does not reply."""
    held_now: dict[str, float] = {}
    for gain in gain_set:
        wire = read_parameter(radio, gain.parameter)
        if wire is None:
            raise _unconfirmed(gain)
        held_now[gain.gain] = gain.read(wire, requested[gain.gain])
    return held_now


def read_parameter(radio: AutopilotLink, parameter: str, *, attempts: int = ATTEMPTS) -> float | None:
    """Return the value of a parameter, None if the vehicle does not reply."""
    return _request_parameter(radio, commands.read_parameter(radio.target, parameter), parameter, attempts=attempts)


def write_parameter(radio: AutopilotLink, parameter: str, value: float) -> float | None:
    """Write a parameter; return the value in the vehicle's reply, None if it does not reply."""
    return _request_parameter(radio, radio.profile.set_parameter(radio.target, parameter, value), parameter)


def read_loop(radio: AutopilotLink, names: Iterable[str], may_lack: Collection[str]) -> dict[str, float]:
    """Return those of these parameters that the vehicle has. Raises VehicleError that names those it does not report
    although every release has them: only some releases lack the others, `may_lack`."""
    read = {name: read_parameter(radio, name) for name in names}
    if missing := [name for name, value in read.items() if value is None and name not in may_lack]:
        raise VehicleError(
            f"The vehicle did not report {', '.join(missing)}, of the loop that is tuned.",
            hint="Check the link, then try again.",
        )
    return {name: value for name, value in read.items() if value is not None}


def read_all(radio: AutopilotLink) -> dict[str, float]:
    """Read all parameters of the vehicle as a list; those that are lost are requested one by one. Raises VehicleError
    if none arrive, or not all."""
    received: dict[int, Parameter] = {}
    radio.listen(0.0)
    for _ in range(LIST_ATTEMPTS):
        if not received:
            radio.send(commands.list_parameters(radio.target))
            received = _list(radio)
    for place in [place for place in range(_count(received)) if place not in received]:
        received |= _fetched(radio, place)
    if not received or not _is_complete(received):
        raise VehicleError(
            f"Not all of its parameters were received: {len(received)} of {_count(received) or 'an unknown number'}.",
            hint="Check the link, and that no other program requests them, then try again.",
        )
    return {received[place].name: received[place].value for place in sorted(received)}


def _list(radio: AutopilotLink) -> dict[int, Parameter]:
    """Receive the list until it is complete or no more parameters arrive."""
    received: dict[int, Parameter] = {}
    last_s = radio.clock.now_s()
    while radio.clock.now_s() - last_s < LIST_ENDS_S * radio.timeout_factor and not _is_complete(received):
        packets = radio.listen(radio.reply_timeout_s)
        found = [each.measurement for each in packets if isinstance(each.measurement, Parameter)]
        if listed := {each.place: each for each in found if each.place is not None}:
            received |= listed
            last_s = radio.clock.now_s()
    return received


def _fetched(radio: AutopilotLink, place: int) -> dict[int, Parameter]:
    answer = radio.request(
        commands.read_parameter(radio.target, "", place), lambda it: isinstance(it, Parameter) and it.place == place
    )
    return {place: answer} if isinstance(answer, Parameter) else {}


def _count(received: Mapping[int, Parameter]) -> int:
    return max((each.count for each in received.values()), default=0)


def _is_complete(received: Mapping[int, Parameter]) -> bool:
    return bool(received) and len(received) >= _count(received)


def settings(gain_set: GainSet, gains: Gains) -> tuple[Setting, ...]:
    """Return the gains in the order for sending in flight: those that clear an integrator come last."""
    ordered = sorted(gain_set, key=lambda gain: gain.integrates)
    return tuple(Setting(gain.parameter, gain.sent(gains[gain.gain])) for gain in ordered)


def _request_parameter(
    radio: AutopilotLink, request: Outgoing, parameter: str, *, attempts: int = ATTEMPTS
) -> float | None:
    answer = radio.request(request, lambda it: isinstance(it, Parameter) and it.name == parameter, attempts=attempts)
    return answer.value if isinstance(answer, Parameter) else None


def _unconfirmed(gain: GainParameter) -> VehicleError:
    return VehicleError(
        f"{FAILURE_TEXTS[Failure.PARAMETER]} {gain.parameter} was requested {ATTEMPTS} times, every "
        f"{REPLY_TIMEOUT_S:g} s.",
        hint="Check that the vehicle is connected and that its system id and aircraft id are correct.",
    )


class GainStore:
    """Safe gains, staged gains and held gains of a vehicle. `staged` were written for the next flight and read back
    equal, None without such gains; `held` are those read back last, empty if they are unknown."""

    def __init__(self, radio: AutopilotLink, safe: Gains) -> None:
        """Check the safe gains. Raises GainsError if the autopilot cannot hold them."""
        self._radio = radio
        self.safe: Final[Gains] = check_gains(safe, radio.profile.gain_sets[0])
        self.staged: dict[str, float] | None = None
        self.held: dict[str, float] = {}
        self._restarts = radio.seen.restarts

    @property
    def have_restarted(self) -> bool:
        """Whether the vehicle has restarted since its gains were last read."""
        return self._radio.seen.restarts != self._restarts

    def forget(self) -> None:
        """Take the gains on the vehicle as unknown until they are read again."""
        self.staged, self.held = None, {}

    def stage(self, gains: Gains) -> dict[str, float]:
        """Write gains for the next flight and return those read back. Raises GainsError, and changes nothing, for gains
        that may not be written; VehicleError if the vehicle does not reply."""
        wanted = check_gains(gains, self._gain_set)
        self.staged = None
        held = self._write(wanted)
        self.staged = held if held == wanted else None
        return dict(held)

    def read(self) -> dict[str, float]:
        """Read the gains. Raises VehicleError if the vehicle does not reply."""
        return dict(self._note(self._radio.seen.restarts, read_gains(self._radio, self._gain_set, self.wanted)))

    def restore(self) -> str:
        """Write the safe gains and read them back; return why they cannot be verified, or an empty string."""
        self.staged = None
        try:
            held = self._write(self.safe)
        except VehicleError as error:
            return str(error)
        mismatch = find_mismatch(held, self.safe)
        return mismatch and f"Its safe gains are not set: {mismatch}."

    @property
    def wanted(self) -> Gains:
        """Gains that the vehicle should hold now."""
        return self.safe if self.staged is None else self.staged

    @property
    def release(self) -> int:
        """Place of its gains among the profile's sets, which are those of its releases."""
        return self._radio.profile.gain_sets.index(self._gain_set)

    @property
    def safe_settings(self) -> tuple[Setting, ...]:
        """Safe gains in the order in which an abort sends them."""
        return settings(self._gain_set, self.safe)

    @property
    def staged_settings(self) -> tuple[Setting, ...]:
        """Staged gains, which it was seen to hold; none without staged ones."""
        return () if self.staged is None else settings(self._gain_set, self.staged)

    def check(self) -> CheckItem:
        """Read the gains and check that they are those wanted."""
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
            needed=written({name: self.wanted[name] for name in held or self.wanted}),
            hint="" if held == self.wanted else "Restore its safe gains, then stage again.",
        )

    @cached_property
    def _gain_set(self) -> GainSet:
        """Its gains by the names on this vehicle. Raises VehicleError if it has none of the known names."""
        radio = self._radio
        for gain_set in radio.profile.gain_sets:
            if read_parameter(radio, gain_set[0].parameter) is not None:
                return gain_set
        tried = ", ".join(gain_set[0].parameter for gain_set in radio.profile.gain_sets)
        raise VehicleError(
            f"{FAILURE_TEXTS[Failure.PARAMETER]} It did not reply to requests for {tried}.",
            hint=f"Check that it runs {radio.profile.title}, and that no other program requests its parameters.",
        )

    def _write(self, wanted: Gains) -> dict[str, float]:
        """Write all gains, then return those read back. Raises VehicleError if the vehicle does not reply."""
        radio = self._radio
        restarts, gain_set = radio.seen.restarts, self._gain_set
        for gain in gain_set:
            if write_parameter(radio, gain.parameter, gain.sent(wanted[gain.gain])) is None:
                raise _unconfirmed(gain)
        return self._note(restarts, read_gains(radio, gain_set, wanted))

    def _note(self, restarts: int, held: dict[str, float]) -> dict[str, float]:
        self._restarts, self.held = restarts, held
        return held


def written(gains: Gains) -> str:
    return ", ".join(f"{name} {value:g}" for name, value in gains.items()) or "nothing"


# ---- parameters of the takeoff


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

    def set(self, settings: tuple[Setting, ...]) -> None:
        """Set the parameters for a flight. Raises VehicleError if the vehicle does not report the current values or
        does not accept the new ones, or if the current values cannot be stored."""
        for setting in settings:
            held = read_parameter(self._radio, setting.parameter)
            if held is None:
                raise _unset(setting)
            if held != setting.value:
                self._keep({setting.parameter: ChangedParameter(held, setting.value)} | self._changed)
                if not self._write(setting):
                    raise _unset(setting)

    def restore(self) -> str:
        """Restore the old values; return the problem, or an empty string."""
        try:
            for name, changed in tuple(self._changed.items()):
                held = read_parameter(self._radio, name)
                if held is None or (held == changed.during and not self._write(Setting(name, changed.before))):
                    return f"{name} could not be restored to {changed.before:g}."
                self._keep({other: one for other, one in self._changed.items() if other != name})
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

    @cached_property
    def _changed(self) -> dict[str, ChangedParameter]:
        """The changes of this process, or of an earlier one on a vehicle with this autopilot and system id. Raises
        VehicleError if a file cannot be read."""
        return dict(ChainMap(*map(self._read, self._files)))

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
        hint="Check that the disk is not full. If the file is damaged, correct the vehicle's takeoff parameters by "
        "hand, then delete the file.",
    )


def _unset(setting: Setting) -> VehicleError:
    return VehicleError(
        f"The vehicle could not be set up: the flight needs {setting.parameter} = {setting.value:g}.",
        hint="Check that the vehicle is connected and that no other program writes its parameters, then try again.",
    )
