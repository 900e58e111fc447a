"""A vehicle with a MAVLink autopilot, between opening and closing: staging gains, flying, and the record."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Final

import numpy as np

from app.autopilots.autopilot import AutopilotError
from app.autopilots.commands import Action
from app.core.experiments.step_sequence import SETTLED_FOR_S
from app.core.policy import Gains
from app.vehicles.base import Condition, FlightOptions, FlightRecord, Sample, ShouldStop, VehicleError
from app.vehicles.flight_end import FlightEnd, Landing, cause_text, withdrawn_by
from app.vehicles.mavlink import parameters, preflight, preparation, records
from app.vehicles.mavlink.connection import VehicleConnection
from app.vehicles.mavlink.events import RecordSample
from app.vehicles.mavlink.failures import HELP, Failure
from app.vehicles.mavlink.observation import TrialObservation
from app.vehicles.mavlink.plan import Plan
from app.vehicles.mavlink.records import Reference, simulate_reference, with_flown_set_points
from app.vehicles.mavlink.sent_commands import RepeatedCommand, set_up
from app.vehicles.mavlink.set_point_schedule import referred_from_s, with_hold
from app.vehicles.mavlink.transports import LinkError
from app.vehicles.mavlink.trial import TrialRunner
from app.vehicles.mavlink.trial_state import State, Trial

STANDSTILL_S: Final = 1.0
"""Observation before arming, because a long time may have passed since the gains were staged."""

_STAGE_AGAIN: Final = "Press Stage gains so that they are written and read back again."


class MavlinkVehicle(VehicleConnection):
    """One vehicle on one link.

    Every flight ends with the safe gains read back, or in quarantine: then all further changes of the vehicle raise
    SafeGainsError, except Land and motors off.
    """

    kind: Final = records.SOURCE
    _datum_m = 0.0
    _flight: TrialRunner | None = None
    _is_starting = False
    _hover_throttle: float | None = None

    @property
    def _is_flying(self) -> bool:
        return self._flight is not None

    def condition(self) -> Condition:
        """Return the state last received, without waiting. Altitude counts as in a record."""
        state = self._quarantine.state if self._flight is None else self._flight.trial.state
        problem = self._radio.link.log_problem
        troubles = (
            f"The telemetry log {problem}." if problem else "",
            "It restarted: its gains have not been read since."
            if self._gains.have_restarted and self._flight is None
            else "",
            self._secondary.trouble if self._secondary is not None else "",
            self._flight.trouble if self._flight is not None else "",
            self._repeated.trouble if self._repeated is not None else "",
        )
        return self._status_reader.read(
            step=self._quarantine.reported_step(state, is_flying=self._is_starting or self._is_flying),
            datum_m=self._datum_m if self._flight is None else self._flight.trial.plan.datum_m,
            held=self._gains.held,
            trouble=" ".join(trouble for trouble in troubles if trouble),
        )

    # ---- staging

    def stage(self, gains: Gains) -> dict[str, float]:
        """Write every gain and return the values read back. Raises GainsError, and changes nothing, for gains that may
        not be written; VehicleError if the vehicle does not confirm them; SafeGainsError in quarantine."""
        self._quarantine.require_none()
        self._identify()
        self._renew_telemetry()
        self._quarantine.require_none()
        self._identity.require_uid()
        preparation.require_disarmed(self._radio)
        if self._quarantine.state is State.IDLE:
            self._quarantine.enter(State.SET_GAINS)
        try:
            return self._gains.stage(gains)
        except VehicleError:
            self._restore_or_quarantine()
            raise

    def confirm_staged(self) -> None:
        """Read the staged gains again after a silence. Raises VehicleError if it restarted meanwhile, does not send its
        position, or does not report the staged gains; SafeGainsError if it may only be observed."""
        self._quarantine.require_none()
        self._identify()
        self._request_telemetry()
        watched = preparation.observe(self._radio, self._secondary, watched_s=STANDSTILL_S)
        restarted = self._gains.have_restarted
        self._identify()
        self._quarantine.require_none()
        self._identity.require_uid()
        if not watched.positions:
            raise VehicleError("The vehicle does not send its position, so it may have restarted.", hint=_STAGE_AGAIN)
        if restarted or self._gains.staged is None:
            raise VehicleError("The vehicle restarted.", hint=_STAGE_AGAIN)
        if (held := self._gains.read()) != self._gains.staged:
            raise VehicleError(
                f"The vehicle holds {parameters.written(held)}, not the staged gains.", hint=_STAGE_AGAIN
            )

    # ---- flying

    def fly(
        self,
        order: FlightOptions,
        *,
        on_sample: Callable[[Sample], None],
        should_stop: ShouldStop,
    ) -> FlightRecord:
        """Arm, take off, fly to the set points, record for `order.record_s`, land, disarm, restore the safe gains.

        `order.speed` and `order.seed` are ignored. `should_stop` is called once the vehicle is ready for arming, and
        then every 10 ms. Raises VehicleError, with `not_flown` set, if no gains were staged, the vehicle is not ready
        or no longer holds the staged gains, or could not be commanded to take off. An exception from `on_sample` or
        `should_stop` lands the vehicle, and is raised again once it is on the ground.
        """
        self._is_starting, self.has_stopped = True, None
        try:
            self._quarantine.require_none()
            self._require_staged()
            self._loop: dict[str, float] = {}
            self._radio.target = replace(self._radio.target, altitude_m=order.set_points.altitudes_m[0])
            if _flies_steps(order):
                self._prepare_set_points(order)
            ground = self._observe_ground(order)
            self._require_staged()  # again: a restart meanwhile leaves none
            reference = self._reference(order, ground.altitude_m)
            profile, target = self._radio.profile, self._radio.target
            further = profile.set_point_settings if _flies_steps(order) else ()
            self._parameters.set((*profile.take_off_settings(target), *further))
            stop = should_stop()
        except BaseException as error:
            if isinstance(error, VehicleError):
                error.not_flown = True
            self._restore_or_quarantine()
            raise
        finally:
            self._is_starting = False
        if stop is not None:
            self.has_stopped = self._radio.is_disarmed
            self._restore_or_quarantine()
            return self._not_begun(ground, withdrawn_by(stop))
        flown = self._fly(ground, order, reference, on_sample, should_stop)
        if flown.error is not None:
            raise flown.error
        return self._record(flown, ground)

    def _require_staged(self) -> None:
        if self._gains.staged is None:
            raise VehicleError(
                "No gains were staged, or the vehicle has restarted since: it was not flown.",
                hint="Stage the gains, check the read-back, then fly.",
            )

    def _prepare_set_points(self, order: FlightOptions) -> None:
        """Request the telemetry that a flight with several set points needs, and read the parameters of its loop, which
        the replica would otherwise replace by defaults. The reference is computed once: the first computation may take
        seconds, which must not pass after the ground was observed."""
        radio, profile = self._radio, self._radio.profile
        if (reference := self._reference(order, 0.0)) is not None:
            reference(order.set_points, np.zeros(1))
        self._identify()
        self._quarantine.require_none()
        set_up(radio, tuple(each.step(radio.target) for each in profile.set_point_telemetry))
        if profile.loop_parameters:
            self._loop = parameters.read_loop(radio, profile.loop_parameters[self._gains.release], profile.may_lack)

    def _reference(self, order: FlightOptions, ground_m: float) -> Reference | None:
        """Return the function that computes the autopilot's own reference; None if it sends that, or if it is not
        needed."""
        if not _flies_steps(order) or self._radio.profile.reference != "replica":
            return None
        return lambda set_points, time_s: simulate_reference(set_points, ground_m, time_s, order.record_s)

    def _observe_ground(self, order: FlightOptions) -> preparation.GroundObservation:
        """Return where it stands. Raises VehicleError if it is not ready to fly, SafeGainsError if it is armed."""
        radio = self._radio
        further = radio.profile.set_point_requirements if _flies_steps(order) else ()
        requirements = [preflight.evaluate_requirement(radio, requirement) for requirement in further]
        watched, items = self._check(STANDSTILL_S)
        try:
            limits = radio.profile.hover_limits(self._loop)
        except AutopilotError as error:
            raise VehicleError(error.message, hint=error.hint) from error
        hover = preflight.evaluate_hover(self._hover_throttle, limits)
        self._quarantine.require_none()
        if radio.profile.flying_blocks:
            time = preflight.evaluate_flight_time(order.record_s, plan_time_s=float(self._options["plan_time_s"]))
            items = (*items, time)
        preflight.require((*items, *requirements, *hover, preflight.evaluate_set_points(order.set_points)))
        return watched

    def _fly(
        self,
        ground: preparation.GroundObservation,
        order: FlightOptions,
        reference: Reference | None,
        on_sample: Callable[[Sample], None],
        should_stop: ShouldStop,
    ) -> TrialRunner:
        last = ground.last
        self._radio.target = replace(self._radio.target, east_m=last.east_m, north_m=last.north_m)
        self._quarantine.enter(State.ARM)
        plan = self._plan(order, ground)
        self._gains.staged = self._repeated = None
        watch = TrialObservation.begin(
            self._radio.clock.now_s(),
            last=last,
            battery_v=self._radio.seen.battery_v,
            stood_s=STANDSTILL_S,
            reports_landing=self._radio.seen.reports_landing,
        )
        if self._secondary is not None:
            self._secondary.align(ground.secondary_m, ground.altitude_m)
        flown = self._flight = TrialRunner(
            self._radio,
            plan,
            watch,
            restore=self._restore_all,
            on_sample=on_sample,
            should_stop=should_stop,
            scored=self._scored,
            look=list if self._secondary is None else self._secondary.take_samples,
            reference=reference,
        )
        try:
            flown.fly()
        finally:
            self._datum_m, self._flight = flown.trial.plan.datum_m, None
        self._quarantine.state, self._quarantine.why = flown.trial.state, flown.trial.why
        if self._repeated is None:  # else it is of a request during the restoring of the safe gains
            self.has_stopped = self._radio.is_disarmed or flown.trial.has_confirmed_stop
        if self._quarantine.state is State.QUARANTINE:
            self._keep_landing(flown.trial)
        return flown

    def _plan(self, order: FlightOptions, ground: preparation.GroundObservation) -> Plan:
        """Return the plan of a flight from there, with the set points of the order."""
        profile, target = self._radio.profile, self._radio.target
        holds = _flies_steps(order) and profile.holds_first
        return Plan(
            autopilot=profile,
            safe_gains=self._gains.safe_settings,
            trial_gains=self._gains.staged_settings,
            blocks={number: name for name, number in target.blocks.items()},
            ground_m=0.0,
            set_point_m=target.altitude_m,
            set_points=with_hold(order.set_points) if holds else order.set_points,
            record_s=order.record_s,
            min_battery_v=float(self._options["min_battery_v"]),
            radius_m=float(self._options["radius_m"]),
            timeout_factor=self._radio.timeout_factor,
        ).on_ground_at(ground.altitude_m)

    def _keep_landing(self, trial: Trial) -> None:
        """Keep commanding Land to a vehicle that did not land within its trial, while it is armed and no pilot flies
        it."""
        by_hand = trial.watch.modes.find_taken_over(trial.plan) is not None
        is_disarmed = self._radio.is_disarmed or trial.has_confirmed_stop
        if not by_hand and not is_disarmed and self._repeated is None:
            with suppress(LinkError):
                self._repeated = RepeatedCommand(self._radio, Action.LAND, by_person=False)
                self._quarantine.requested = f"Land is still being repeated. If the vehicle does not descend, {HELP}."

    # ---- records

    @property
    def _scored(self) -> records.Scored:
        return "mocap" if self._options["scored_source"] == "mocap" else "vehicle"

    def _record(self, flown: TrialRunner, ground: preparation.GroundObservation) -> FlightRecord:
        """Return the record. Raises VehicleError if the vehicle was never commanded to take off, unless the operator
        aborted."""
        trial, start_s = flown.trial, flown.trial.commanded_boot_s
        if start_s is None and trial.failure is Failure.OPERATOR:
            landed = trial.contact if trial.watch.climb.lifted else Landing.STAYED
            return self._not_begun(ground, replace(records.end_of(trial), landed=landed))
        if start_s is None:
            why = cause_text(records.end_of(trial))
            refusal = VehicleError(why, hint="Inspect the vehicle, correct this, then fly again.")
            refusal.not_flown = True
            raise refusal
        plan = trial.plan
        own = with_flown_set_points(
            records.trajectory_of(flown.samples, start_s, plan.datum_m, referred_from_s=referred_from_s(plan)),
            plan.takeoff,
            trial.set_points.changes,
            ground_m=plan.ground_m - plan.datum_m,
            reference=flown.reference,
        )
        if records.ending_of(trial) == "completed":
            found = records.hover_throttle_of(own, until_s=referred_from_s(plan) + SETTLED_FOR_S)
            self._hover_throttle = self._hover_throttle if found is None else found
        both = records.AlignedRecord(trajectory=own)
        if self._secondary is not None:
            zero_s, name = start_s + flown.offset_s, self._secondary.name
            both = records.add_secondary_altitude(
                both.trajectory, self._secondary.seen, name=name, zero_s=zero_s, scored=self._scored
            )
        lands = self._repeated is not None and self._repeated.action is Action.LAND
        return FlightRecord(
            trajectory=both.trajectory,
            ending=records.ending_of(trial),
            end=records.end_of(
                trial, "Land was still being repeated when this record ended." if lands else "", both.remark
            ),
            settings={**self._options, **self._loop, **both.settings},
        )

    def _not_begun(self, ground: preparation.GroundObservation, end: FlightEnd) -> FlightRecord:
        """Return the record of an abort before any command: a single instant on the ground."""
        sample = RecordSample(ground.last, ground.altitude_m, self._radio.seen.battery_v)
        datum_m = ground.altitude_m if self._radio.profile.climbs_from_ground else 0.0
        trajectory = records.trajectory_of((sample,), ground.last.time_boot_s, datum_m)
        return FlightRecord(trajectory=trajectory, ending="aborted", end=end, settings=self._options)


def _flies_steps(order: FlightOptions) -> bool:
    """Whether set points follow the takeoff's."""
    return len(order.set_points.times_s) > 1
