"""Connection to a vehicle with a MAVLink autopilot: its opening, preflight checks and release."""

from dataclasses import replace
from typing import Final

from app.autopilots.commands import Action
from app.vehicles.base import CheckItem, SafeGainsError, VehicleError
from app.vehicles.mavlink import preflight, preparation
from app.vehicles.mavlink.failures import HELP
from app.vehicles.mavlink.radio import LISTEN_S
from app.vehicles.mavlink.safe_gains import ANOTHER, SET_BY_HAND, SafeGainsVehicle
from app.vehicles.mavlink.sent_commands import RepeatedCommand
from app.vehicles.mavlink.trial_state import State

_FURTHER_OBSERVATIONS: Final = 3
"""Greatest number of further observations of a vehicle whose ground reference is set: one whose plan is just setting
it, and was not heard from the beginning, must set it again."""
_HEARD_WITHIN_S: Final = 5.0


class VehicleConnection(SafeGainsVehicle):
    """One vehicle on one link, between its flights.

    All changes of a vehicle in quarantine raise SafeGainsError, except Land and motors off.
    """

    # ---- opening

    def _open(self, *, observes: bool) -> None:
        self._parameters = self._trial_parameters()
        self._connect()
        if not observes:
            if self._quarantine.is_active:
                raise SafeGainsError(self.concern, hint=SET_BY_HAND)
            preflight.require(self.check())

    def _connect(self) -> None:
        self._identity.await_vehicle(str(self._options["address"]))
        self._plan_problem = self._identity.explore()
        self._quarantine.enter(State.PREFLIGHT)
        self._listen(0.0)
        if self._was_flying:
            self._take_up_landing()
        if not self._quarantine.is_active and self._has_set_safe_gains():
            self._quarantine.enter(State.SET_GAINS)
            self._quarantine.enter(State.IDLE)
            self._quarantine.requested, self._repeated, self._was_flying = "", None, False

    def _take_up_landing(self) -> None:
        """Repeat Land to a vehicle that the process that flew it left in the air, unless it may be another vehicle."""
        self._identify()
        self._was_flying = not self._identity.is_another
        if self._was_flying and not self._identity.missing_uid:
            self._quarantine.requested = (
                "The process that flew it ended in flight. Land is repeated if it still flies as in a trial; otherwise "
                f"it is only observed. If it does not descend, {HELP}."
            )
            self._repeated = RepeatedCommand(self._radio, Action.LAND, is_withheld=True)

    # ---- preflight checks

    def check(self) -> tuple[CheckItem, ...]:
        """Run all preflight checks, which takes two seconds or more; a failed check is an item of the result, not an
        error. Raises LinkError if the link is closed."""
        return self._check(preparation.WATCHED_S)[1]

    def _check(self, watched_s: float) -> tuple[preparation.GroundObservation, tuple[CheckItem, ...]]:
        radio, options = self._radio, self._options
        self._identify()
        if not radio.reports_armed and not self._quarantine.is_active:
            self._request_telemetry()
            preparation.make_armable(radio)
        watched = self._observe_standing(watched_s)
        for _ in range(_FURTHER_OBSERVATIONS):
            if self._quarantine.is_active or not (
                preparation.make_armable(radio) or preparation.set_ground_reference(radio, watched)
            ):
                break
            watched = self._observe_standing(watched_s)
        if not self._quarantine.is_active:
            preparation.confirm_stop(radio, watched)
        minimum_v, pinned = float(options["min_battery_v"]), self._identity.pinned
        items = preflight.evaluate_items(radio, watched, min_battery_v=minimum_v, plan_problem=self._plan_problem)
        if pinned is not None and pinned.uid:
            items = (*items, preflight.evaluate_uid(radio, pinned))
        if self._secondary is not None:
            items = (*items, preflight.evaluate_secondary(self._secondary, watched))
        if radio.profile.flying_blocks:
            radius_m, plan_radius_m = float(options["radius_m"]), float(options["plan_radius_m"])
            items = (*items, preflight.evaluate_distance(watched, radius_m=radius_m, plan_radius_m=plan_radius_m))
        items = (*items, self._gains.check())
        return watched.continued(radio), items

    def _observe_standing(self, watched_s: float) -> preparation.GroundObservation:
        watched = preparation.observe(self._radio, self._secondary, watched_s=watched_s)
        self._identify()
        return watched

    # ---- quarantine

    def release(self) -> None:
        """End the observation after a person has inspected the vehicle and its identity. It must be disarmed and hold
        its safe gains, read back. A vehicle that no longer reports a hardware id is accepted without one. Raises
        VehicleError, and changes nothing, if it is not received, is armed, does not hold them, or differs from the
        pinned one in a way that `concern` has not shown yet."""
        seen, identity = self._quarantine.why, self._identity
        self._await_heartbeat()
        self._identify()
        if (change := identity.change) not in seen:
            raise SafeGainsError(change, hint=ANOTHER)
        if (missing_uid := identity.missing_uid) not in seen:
            self._quarantine.add(missing_uid)
            raise SafeGainsError(missing_uid, hint=ANOTHER)
        if missing_uid or identity.is_another:
            self._parameters = self._trial_parameters()
        accepted = replace(self.identity, uid=self._radio.seen.uid)
        pinned, identity.pinned, self._decided = identity.pinned, accepted, True
        try:
            self._set_up()
        except BaseException:
            identity.pinned = pinned
            raise
        self._quarantine.end()
        self._quarantine.requested, self._repeated, self._was_flying = "", None, False

    def _await_heartbeat(self) -> None:
        since_s = self._radio.clock.now_s()
        while self._radio.seen.heartbeat_s < since_s:
            if self._radio.clock.now_s() - since_s > _HEARD_WITHIN_S * self._radio.timeout_factor:
                raise VehicleError(
                    "No heartbeat of the vehicle was received.",
                    hint="Check that it is on and in range, then try again.",
                )
            self._listen(LISTEN_S)
