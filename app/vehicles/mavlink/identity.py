"""Identity of the vehicle that answers, and of the one that is expected."""

from dataclasses import dataclass, replace
from typing import Final

from app.autopilots import commands
from app.autopilots.autopilot import AutopilotError
from app.autopilots.measurements import Heartbeat, Version
from app.autopilots.registry import AUTOPILOTS
from app.core.formatting import capitalised
from app.vehicles.base import Identity, VehicleError
from app.vehicles.flight_end import FAILURE_TEXTS
from app.vehicles.mavlink.failures import Failure
from app.vehicles.mavlink.parameters import read_parameter
from app.vehicles.mavlink.radio import HEARTBEAT_WITHIN_S, LISTEN_S, AutopilotLink

_AUTOPILOT: Final = 1
"""Usual component of an autopilot (MAV_COMP_ID_AUTOPILOT1): another one may pose as it."""
_VERSION_ATTEMPTS: Final = 2
_UID_ATTEMPTS: Final = 10
"""Attempts if the vehicle is known to report its hardware id: twice as many as for a parameter."""


@dataclass(slots=True)
class VehicleIdentity:
    """Identity of the vehicle on a link beside the `pinned` one, which is known to a person; None before the first."""

    _radio: AutopilotLink
    pinned: Identity | None

    @property
    def reported(self) -> Identity:
        """Identity as reported, which may take some time; parts not reported are those of the pinned identity."""
        radio, seen = self._radio, self._radio.seen
        return Identity(
            system_id=radio.target.system, autopilot=radio.profile.name, version=seen.version, uid=seen.uid
        ).completed_by(self.pinned)

    @property
    def change(self) -> str:
        """How the vehicle differs from the pinned one, in what both report; empty if it does not."""
        version, uid, pinned = self._radio.seen.version, self._radio.seen.uid, self.pinned
        if pinned is None:
            return ""
        if self.is_another:
            return (
                f"Another vehicle answers, and nothing is written to it: its hardware id is {uid} instead of "
                f"{pinned.uid}. Register it as a new vehicle, or release it to accept it in place of this one."
            )
        if not version or not pinned.version or version == pinned.version:
            return ""
        return f"Its firmware has changed from version {pinned.version} to {version}."

    @property
    def is_another(self) -> bool:
        """Whether its hardware id differs from the pinned one, if both are known."""
        uid, pinned = self._radio.seen.uid, self.pinned
        return pinned is not None and bool(uid and pinned.uid) and uid != pinned.uid

    @property
    def missing_uid(self) -> str:
        """The problem that a vehicle with a pinned hardware id has reported none since it was last absent; empty if it
        has."""
        if self.pinned is None or not self.pinned.uid or self._radio.seen.uid:
            return ""
        return "It did not report its hardware id, so it may be another vehicle; nothing was written."

    def require_uid(self) -> None:
        """Raise VehicleError if the pinned hardware id is known, and this vehicle has not reported its own."""
        if missing_uid := self.missing_uid:
            raise VehicleError(
                missing_uid, hint="Try again. If it no longer reports one, connect it again and release it."
            )

    def request(self) -> None:
        """Request version and hardware id, if neither has been received since the vehicle was last absent. Some never
        reply, and Paparazzi sends them unrequested; if the pinned vehicle has a hardware id, it is requested for 5
        s."""
        radio = self._radio
        radio.listen(0.0)
        radio.forget_absent(radio.clock.now_s())
        is_needed = bool(self.missing_uid)
        if radio.profile.reports_version and (is_needed or not (radio.seen.version or radio.seen.uid)):
            attempts = _UID_ATTEMPTS if is_needed else _VERSION_ATTEMPTS
            request = commands.request_version(radio.target)
            radio.request(request, lambda reply: isinstance(reply, Version), attempts=attempts)

    def await_vehicle(self, address: str) -> None:
        """Wait for a heartbeat of the right autopilot, sending nothing. Raises VehicleError if none arrives within 5 s
        (longer if the vehicle's clock is fast), or if it is of another vehicle than the pinned one."""
        radio, within_s = self._radio, HEARTBEAT_WITHIN_S * self._radio.timeout_factor
        until_s = radio.clock.now_s() + within_s
        other: Heartbeat | None = None
        while radio.clock.now_s() < until_s:
            heard = [each.measurement for each in radio.listen(LISTEN_S) if isinstance(each.measurement, Heartbeat)]
            for heartbeat in (each for each in heard if each.autopilot == radio.profile.autopilot):
                if heartbeat.component == _AUTOPILOT:
                    return self._set_target(heartbeat)
                if other is None:
                    until_s = radio.clock.now_s() + radio.silence_s
                    other = heartbeat
        if other is not None:
            return self._set_target(other)
        if makes := radio.link.other_makes:
            raise VehicleError(
                f"{_named(makes)} {'answers' if len(makes) == 1 else 'answer'} at {address}, not "
                f"{radio.profile.title}; nothing was sent.",
                hint="If this is the vehicle, register it again as what it is: a vehicle's autopilot cannot be "
                "changed. Otherwise check that no other vehicle sends to this address.",
            )
        raise VehicleError(
            f"{FAILURE_TEXTS[Failure.NO_HEARTBEAT]} Waited {within_s:g} s at {address} for {radio.profile.title}.",
            hint="Check that the vehicle is on, that it sends to this computer's port, and that the right autopilot is "
            "selected.",
        )

    def _set_target(self, heartbeat: Heartbeat) -> None:
        radio, pinned = self._radio, self.pinned
        if pinned is not None and pinned.system_id != heartbeat.system:
            raise VehicleError(
                f"Another vehicle answers: system {heartbeat.system} instead of {pinned.system_id}.",
                hint="Connect the registered vehicle, or register this one.",
            )
        radio.target = replace(
            radio.target,
            system=heartbeat.system,
            component=heartbeat.component,
            aircraft=radio.target.aircraft or heartbeat.system,
        )

    def explore(self) -> str:
        """Read the flight plan, the firmware's version and the names of what the vehicle has, changing nothing; return
        the plan's problem, or an empty string."""
        radio, problem = self._radio, ""
        try:
            radio.target = replace(radio.target, blocks=radio.profile.explore(radio.request, radio.target))
        except (AutopilotError, VehicleError) as error:
            problem = str(error)
        radio.send(*radio.profile.conclude(radio.target))
        self.request()
        has = tuple(name for name in radio.profile.stop_settings if self._has(name))
        newer = {
            requirement.parameter: requirement.newer_name
            for requirement in radio.profile.requirements
            if requirement.newer_name and not self._has(requirement.parameter) and self._has(requirement.newer_name)
        }
        radio.target = replace(radio.target, stop_settings=has, newer_names=newer)
        return problem

    def _has(self, parameter: str) -> bool:
        return read_parameter(self._radio, parameter, attempts=2) is not None


def _named(makes: frozenset[int]) -> str:
    """The autopilots with these MAV_AUTOPILOT."""
    titles = {profile.autopilot: profile.title for profile in AUTOPILOTS.values()}
    names = " and ".join(titles.get(make, f"another autopilot ({make})") for make in sorted(makes))
    return capitalised(names)
