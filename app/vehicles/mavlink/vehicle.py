"""A vehicle with a MAVLink autopilot, between opening and closing."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from app.core.clock import Clock
from app.core.experiments.step_sequence import SETTLED_FOR_S
from app.core.policy import Gains
from app.vehicles.base import (
    CheckItem,
    Condition,
    FlightOptions,
    FlightRecord,
    Identity,
    SafeGainsError,
    Sample,
    ShouldStop,
    VehicleError,
)
from app.vehicles.end_texts import cause_text, requested
from app.vehicles.flight_end import FlightEnd, Landing, withdrawn_by
from app.vehicles.kinds import Options
from app.vehicles.mavlink import addresses, limit_checks, parameters, preflight, records
from app.vehicles.mavlink import observation as watching
from app.vehicles.mavlink.altitude_sources import AlignedAltitudeSource, AltitudeSource
from app.vehicles.mavlink.boot_clock import RESTARTED_S
from app.vehicles.mavlink.events import Action, PacketReceived, RecordSample, Setting
from app.vehicles.mavlink.failures import HELP, Failure
from app.vehicles.mavlink.flown_set_points import Reference, simulate_reference, with_flown_set_points
from app.vehicles.mavlink.opening import limits_of, open_radio
from app.vehicles.mavlink.parameters import GainStore, TrialParameters, files_for, written
from app.vehicles.mavlink.preflight import Ground
from app.vehicles.mavlink.radio import StatusReader
from app.vehicles.mavlink.records import AlignedRecord, Scored, add_secondary_altitude
from app.vehicles.mavlink.repeated_command import STOPPING_S, RepeatedCommand
from app.vehicles.mavlink.set_point_schedule import referred_from_s, with_hold
from app.vehicles.mavlink.transports import LinkError, Transport
from app.vehicles.mavlink.trial import TrialResult, TrialRunner
from app.vehicles.mavlink.trial_machine import Plan, Trial
from app.vehicles.mavlink.trial_reactions import QUARANTINE_STATES, TRANSITIONS, State

STANDSTILL_S: Final = 1.0
"""Observation before arming, because a long time may have passed since the gains were staged."""

_LISTEN_S: Final = 0.1
_FURTHER_OBSERVATIONS: Final = 3
"""Greatest number of further observations of a vehicle whose ground reference is set: one whose plan is just setting
it, and was not heard from the beginning, must set it again."""
_POSITIONS_CEASED_S: Final = 2.0
_HEARD_WITHIN_S: Final = 5.0
_ON_THE_GROUND: Final = frozenset({State.CONNECT, State.PREFLIGHT, State.SET_GAINS})
_ANOTHER: Final = "Check which vehicle it is, then try again."
_LAND_REPEATED: Final = f"Land is still being repeated. If the vehicle does not descend, {HELP}."
_LEFT: Final = (
    "The process that flew it ended in flight. Land is repeated if it still flies as in a trial; otherwise it is only "
    f"observed. If it does not descend, {HELP}."
)
_NOT_STOPPED: Final = f"The vehicle has not confirmed within {STOPPING_S:g} s that its motors stopped."
_DROPPED: Final = "The vehicle was not known to be on the ground: inspect it before it flies again."
_LAND_WAS_REPEATED: Final = "Land was still being repeated when this record ended."
_RESTARTED: Final = "It restarted: its gains have not been read since."
_STAGE_AGAIN: Final = "Press Stage gains so that they are written and read back again."
_SET_BY_HAND: Final = "Set its gains by hand, read them back, then release it."


class MavlinkVehicle:
    """One vehicle on one link.

    Every flight ends with the safe gains read back, or in quarantine: then all further changes of the vehicle raise
    SafeGainsError, except Land and motors off.
    """

    kind: Final = records.SOURCE

    def __init__(
        self,
        options: Options,
        safe_gains: Gains,
        *,
        is_real: bool,
        clock: Clock | None = None,
        identity: Identity | None = None,
        observes: bool = False,
        decided: bool = True,
        was_flying: bool = False,
        trial_parameters: Path | None = None,
        source: AltitudeSource | None = None,
        transport: Transport | None = None,
        on_wait: Callable[[], None] = lambda: None,
    ) -> None:
        """Connect, wait for the vehicle (with a given `identity`, for that one), and write the safe gains once it is
        known to be disarmed. Unless a person has `decided` on these safe gains for this very vehicle, they are only
        compared with those that it holds, which may be its owner's; if they differ, nothing is written.

        A vehicle that `was_flying` in a trial when the process that flew it ended gets Land while it is flown as in a
        trial, and no heartbeats of a ground station until then.

        `clock` is the vehicle's time, by default that of its options; `source` is a second source of altitude, which is
        closed with the vehicle; `transport` replaces the address and the thread that reads it. The folder
        `trial_parameters` keeps the parameters that a trial changes in addition to the gains, so that the next
        connection can restore them if this process dies. `on_wait` is called while waiting for the vehicle on the
        ground; an exception from it ends the operation.

        With `observes`, a vehicle that is armed or does not hold its safe gains stays connected and is only observed
        (see `concern`). Otherwise it raises SafeGainsError, and a vehicle that is not ready to fly VehicleError. Raises
        VehicleError if no vehicle or another one answers, GainsError for safe gains that it cannot hold.
        """
        self.is_real: Final = is_real
        self._options = dict(options)
        self._state = State.CONNECT
        self._why = self._requested = self._plan_problem = ""
        self._pinned = identity
        self._datum_m = 0.0
        self._flight: TrialRunner | None = None
        self._repeated: RepeatedCommand | None = None
        self._is_restoring = self._is_starting = False
        self.has_stopped: bool | None = False
        self._was_flying = was_flying
        self._loop: dict[str, float] = {}
        self._hover_throttle: float | None = None
        self._secondary = None if source is None else AlignedAltitudeSource(source)
        hear, wait, silent = None if source is None else source.on_message, self._while_waiting, self._is_silent
        self._on_wait = on_wait
        self._radio = open_radio(options, clock, on_message=hear, on_wait=wait, is_silent=silent, transport=transport)
        self._status_reader = StatusReader(self._radio)
        self._telemetry_requested_s = self._radio.clock.now_s()
        try:
            self._gains = GainStore(self._radio, safe_gains)
            self._decided = decided
            self._parameters_folder = trial_parameters
            self._parameters = self._trial_parameters()
            self._connect()
            if not observes:
                self._require_ready()
        except BaseException:
            self._radio.link.close()
            raise

    # ---- interface of every vehicle

    @property
    def safe_gains(self) -> Gains:
        return self._gains.safe

    def stage(self, gains: Gains) -> dict[str, float]:
        """Write every gain and return the values read back. Raises GainsError, and changes nothing, for gains that may
        not be written; VehicleError if the vehicle does not confirm them; SafeGainsError in quarantine."""
        self._require_not_quarantined()
        self._identify()
        self._renew_telemetry()
        self._require_not_quarantined()
        self._require_uid()
        preflight.require_disarmed(self._radio)
        if self._state is State.IDLE:
            self._enter(State.SET_GAINS)
        try:
            return self._gains.stage(gains)
        except VehicleError:
            self._restore_or_quarantine()
            raise

    def read_gains(self) -> dict[str, float]:
        """Return the gains that the vehicle holds now."""
        return self._gains.read()

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
            self._require_not_quarantined()
            self._require_staged()
            self._loop = {}
            self._radio.target = replace(self._radio.target, altitude_m=order.set_points.altitudes_m[0])
            if _flies_steps(order):
                self._prepare_set_points(order)
            ground = self._observe_ground(STANDSTILL_S, order)
            self._require_staged()  # again: a restart meanwhile leaves none
            reference = self._reference(order, ground)
            self._parameters.set(self._settings(order))
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

    def close(self) -> None:
        """Close the link; the vehicle is left unchanged."""
        self._radio.link.close()
        if self._secondary is not None:
            self._secondary.source.close()

    # ---- interface of a vehicle whose link stays open

    @property
    def identity(self) -> Identity:
        """Identity as reported, which may take some time; parts not reported are those of the pinned identity."""
        radio, seen = self._radio, self._radio.seen
        reported = Identity(
            system_id=radio.target.system, autopilot=radio.profile.name, version=seen.version, uid=seen.uid
        )
        return reported.completed_by(self._pinned)

    @property
    def concern(self) -> str:
        """Reason why the vehicle may only be observed; empty if it may fly."""
        if self._state not in QUARANTINE_STATES:
            return ""
        return " ".join(part for part in (self._why, self._requested) if part)

    @property
    def has_standing_order(self) -> bool:
        """Whether a command of `land` or `motors_off` is still being repeated to a vehicle that may be armed, and was
        not repeated for a minute without a packet from it."""
        repeated = self._repeated
        if repeated is None or repeated.is_withheld:
            return False
        return not (repeated.is_over or repeated.is_unheard or self._radio.is_disarmed)

    def condition(self) -> Condition:
        """Return the state last received, without waiting. Altitude counts as in a record."""
        step = self._state if self._flight is None else self._flight.state
        problem = self._radio.link.log_problem
        troubles = (
            f"The telemetry log {problem}." if problem else "",
            _RESTARTED if self._gains.have_restarted and self._flight is None else "",
            self._secondary.source.trouble if self._secondary is not None else "",
            self._flight.trouble if self._flight is not None else "",
            self._repeated.trouble if self._repeated is not None else "",
        )
        return self._status_reader.read(
            step=self._reported_step(step),
            datum_m=self._datum_m if self._flight is None else self._flight.datum_m,
            held=self._gains.held,
            trouble=" ".join(trouble for trouble in troubles if trouble),
        )

    def _reported_step(self, state: State) -> str:
        """The step of a trial: what comes before arming is one step, and none without a trial."""
        if state not in _ON_THE_GROUND:
            return state.value
        return (State.PREFLIGHT if self._is_starting or self._flight is not None else State.IDLE).value

    def attend(self, timeout_s: float) -> None:
        """Receive for `timeout_s` while sending the ground station's heartbeats. A command of `land` or `motors_off` is
        repeated every second until telemetry confirms it. If only heartbeats arrive, telemetry is requested again,
        which takes longer. Raises LinkError if the link is closed."""
        until_s = self._radio.clock.now_s() + timeout_s
        while (left_s := until_s - self._radio.clock.now_s()) > 0.0:
            packets = self._radio.receive(min(left_s, _LISTEN_S))
            self._check_identity()
            self._repeat_command(packets)
            self._was_flying = self._was_flying and not self._radio.is_disarmed
        self._renew_telemetry()

    def confirm_staged(self) -> None:
        """Read the staged gains again after a silence. Raises VehicleError if it restarted meanwhile, does not send its
        position, or does not report the staged gains; SafeGainsError if it may only be observed."""
        self._require_not_quarantined()
        self._identify()
        preflight.prepare(self._radio, float(self._options["telemetry_hz"]))
        watched = preflight.observe(self._radio, self._secondary, watched_s=STANDSTILL_S)
        restarted = self._gains.have_restarted
        self._identify()
        self._require_not_quarantined()
        self._require_uid()
        if not watched.positions:
            raise VehicleError("The vehicle does not send its position, so it may have restarted.", hint=_STAGE_AGAIN)
        if restarted or self._gains.staged is None:
            raise VehicleError("The vehicle restarted.", hint=_STAGE_AGAIN)
        if (held := self._gains.read()) != self._gains.staged:
            raise VehicleError(f"The vehicle holds {written(held)}, not the staged gains.", hint=_STAGE_AGAIN)

    def check(self) -> tuple[CheckItem, ...]:
        """Run all preflight checks, which takes two seconds or more; a failed check is an item of the result, not an
        error. Raises LinkError if the link is closed."""
        return self._check(preflight.WATCHED_S)[1]

    def parameters(self, on_progress: Callable[[int, int], None]) -> dict[str, float]:
        """Read every parameter; `on_progress` receives how many have arrived, and the total. Raises VehicleError if
        they do not arrive, SafeGainsError while the vehicle is only observed."""
        self._require_not_quarantined()
        return parameters.read_all(self._radio, on_progress)

    def restore(self) -> dict[str, float]:
        """Write the safe gains and return the values read back, which are equal; a vehicle that is only observed stays
        so. Raises SafeGainsError if it is armed, is another one, or does not accept them; VehicleError if it does not
        report its known hardware id."""
        self._identify()
        preflight.require_disarmed(self._radio)
        if preflight.is_another(self._radio, self._pinned):
            raise SafeGainsError(self.concern, hint=_ANOTHER)
        self._require_uid()
        if problem := self._restore_all():
            raise SafeGainsError(f"The vehicle does not accept its earlier values. {problem}", hint=_SET_BY_HAND)
        return dict(self._gains.held)

    def change_safe_gains(self, safe_gains: Gains) -> None:
        """Replace the safe gains by those of a person, write them and read them back. Until a person has decided on
        this vehicle, they are only compared, as on connection. A vehicle that is only observed stays so, and its
        release writes them. A failure becomes the `concern`. Raises GainsError, and changes nothing, for gains that the
        vehicle cannot hold."""
        changed = GainStore(self._radio, safe_gains)
        changed.held, self._gains = self._gains.held, changed
        if self._decided and self._state in QUARANTINE_STATES:
            return
        if self._has_set_safe_gains() and self._state in QUARANTINE_STATES:
            self._enter(State.IDLE)
            self._why = ""

    def _restore_all(self) -> str:
        """Restore the safe gains and the other parameters of a trial; return the problem, or an empty string."""
        return self._gains.restore_or_explain() or self._parameters.restore()

    def land(self, words: str) -> None:
        """Command the vehicle to land at once, in any state. Raises VehicleError if it cannot be commanded."""
        self._requested, self.has_stopped = requested("Land", words), bool(self.has_stopped)
        self._repeated = RepeatedCommand(self._radio, Action.LAND)

    def motors_off(self, words: str) -> None:
        """Stop the motors at once, at any height. A vehicle that may have been in the air, or that does not confirm it,
        is only observed from then on."""
        self._requested, self.has_stopped = requested("Motors off", words), None
        self._repeated = RepeatedCommand(self._radio, Action.KILL)
        if self._flight is None and not self._radio.is_disarmed:
            self._doubt_stop(_DROPPED)

    def _doubt_stop(self, why: str) -> None:
        self._requested = f"{self._requested} {why}"
        self._observe(self._why if self._state in QUARANTINE_STATES else "")

    def log_to(self, path: Path | None) -> None:
        """Record all packets from now on, in both directions, in this telemetry log; None ends the log. Raises
        LinkError if the file cannot be opened; the previous log then continues."""
        self._radio.link.log_to(path)

    def release(self) -> None:
        """End the observation after a person has inspected the vehicle and its identity. It must be disarmed and hold
        its safe gains, read back. A vehicle that no longer reports a hardware id is accepted without one. Raises
        VehicleError, and changes nothing, if it is not received, is armed, does not hold them, or differs from the
        pinned one in a way that `concern` has not shown yet."""
        seen = self._why
        self._await_heartbeat()
        self._identify()
        if (change := preflight.identity_change(self._radio, self._pinned)) not in seen:
            raise SafeGainsError(change, hint=_ANOTHER)
        if (missing_uid := preflight.find_missing_uid(self._radio, self._pinned)) not in seen:
            self._why = f"{seen} {missing_uid}".strip()
            raise SafeGainsError(missing_uid, hint=_ANOTHER)
        if missing_uid or preflight.is_another(self._radio, self._pinned):
            self._parameters = self._trial_parameters()
        accepted = replace(self.identity, uid=self._radio.seen.uid)
        pinned, self._pinned, self._decided = self._pinned, accepted, True
        try:
            self._set_up()
        except BaseException:
            self._pinned = pinned
            raise
        if self._state in QUARANTINE_STATES:
            self._enter(State.IDLE)
        self._why = self._requested = ""
        self._repeated, self._was_flying = None, False

    # ---- connecting

    def _connect(self) -> None:
        preflight.await_vehicle(self._radio, str(self._options["address"]), self._pinned)
        self._plan_problem = preflight.read_vehicle_info(self._radio)
        self._enter(State.PREFLIGHT)
        self._listen(0.0)
        if self._was_flying:
            self._take_up_landing()
        if self._state in QUARANTINE_STATES:
            return
        if self._has_set_safe_gains():
            self._enter(State.SET_GAINS)
            self._enter(State.IDLE)
            self._requested, self._repeated, self._was_flying = "", None, False

    def _take_up_landing(self) -> None:
        """Repeat Land to a vehicle that the process that flew it left in the air, unless it may be another vehicle."""
        self._identify()
        self._was_flying = not preflight.is_another(self._radio, self._pinned)
        if self._was_flying and not preflight.find_missing_uid(self._radio, self._pinned):
            self._requested = _LEFT
            self._repeated = RepeatedCommand(self._radio, Action.LAND, is_withheld=True)

    def _is_silent(self) -> bool:
        """Whether a vehicle that was left in the air gets no heartbeats of a ground station, so that the failsafe that
        its preflight checks have read back lands it: until Land is repeated, it is down, or somebody decides."""
        repeated = self._repeated
        return self._was_flying and (repeated is None or (repeated.is_withheld and not repeated.is_over))

    def _has_set_safe_gains(self) -> bool:
        """Write or compare the safe gains; return whether the vehicle holds them and nothing else was found. Otherwise
        it is only observed."""
        was_observed = self._state in QUARANTINE_STATES
        try:
            self._set_up()
        except VehicleError as error:
            self._observe(str(error) if not self._decided else f"Its safe gains could not be verified. {error}")
            return False
        if self._state in QUARANTINE_STATES and not was_observed:
            return False
        self._decided = True
        self._pinned = self.identity
        return True

    def _set_up(self) -> None:
        """Set up telemetry and safe gains. Raises VehicleError if the vehicle is armed, refuses, does not accept its
        safe gains, or holds others that no person has decided to overwrite."""
        preflight.require_disarmed(self._radio)
        preflight.prepare(self._radio, float(self._options["telemetry_hz"]))
        if self._decided:
            self.restore()
        elif (found := self._gains.read()) != self._gains.safe:
            raise SafeGainsError(
                f"It holds {written(found)}, but its safe gains are {written(self._gains.safe)}; nothing was written.",
                hint="If its current gains are safe, save them as its safe gains. Otherwise release it, which writes "
                "the safe gains.",
            )
        elif problem := self._parameters.restore():
            raise SafeGainsError(problem, hint=_SET_BY_HAND)

    def _trial_parameters(self) -> TrialParameters:
        """Return the trial parameters of the vehicle that is connected when they are first needed."""
        if self._parameters_folder is None:
            return TrialParameters(self._radio)
        folder, address = self._parameters_folder, addresses.parse(str(self._options["address"]))
        is_simulated = bool(self._options["simulated"])
        return TrialParameters(
            self._radio, lambda: files_for(folder, address, self.identity, is_simulated=is_simulated)
        )

    def _require_ready(self) -> None:
        """Raise SafeGainsError while it may only be observed, VehicleError if it is not ready to fly."""
        if self._state in QUARANTINE_STATES:
            raise SafeGainsError(self.concern, hint=_SET_BY_HAND)
        preflight.require(self.check())

    def _observe(self, why: str) -> None:
        if self._state not in QUARANTINE_STATES:
            self._enter(State.OBSERVE)
        self._why, self._gains.staged = why, None

    def _await_heartbeat(self) -> None:
        since_s = self._radio.clock.now_s()
        while self._radio.seen.heartbeat_s < since_s:
            if self._radio.clock.now_s() - since_s > _HEARD_WITHIN_S * self._radio.timeout_factor:
                raise VehicleError(
                    "No heartbeat of the vehicle was received.",
                    hint="Check that it is on and in range, then try again.",
                )
            self._listen(_LISTEN_S)

    def _identify(self) -> None:
        """Identify the vehicle before anything is written: after an absence it may be another one."""
        preflight.identify(self._radio, self._pinned)
        self._listen(0.0)
        if self._pinned is not None and self._state not in QUARANTINE_STATES:
            self._pinned = self._pinned.completed_by(self.identity)

    def _renew_telemetry(self) -> None:
        """Request telemetry again from a vehicle on the ground of which only heartbeats have arrived for 2 s, and
        receive long enough to notice a restart: a restarted ArduPilot sends nothing else, and only the time of its
        positions shows the restart."""
        seen = self._radio.seen
        position_s = seen.positions[-1][0] if seen.positions else float("-inf")
        without_s = seen.heartbeat_s - max(position_s, self._telemetry_requested_s)
        if without_s <= _POSITIONS_CEASED_S * self._radio.timeout_factor or not self._is_at_rest:
            return
        self._telemetry_requested_s = self._radio.clock.now_s()
        with suppress(VehicleError):  # a closed link fails again in the next operation
            self._identify()
            if self._is_at_rest:
                preflight.prepare(self._radio, float(self._options["telemetry_hz"]))
                until_s = self._radio.clock.now_s() + 2.0 * RESTARTED_S
                while self._radio.clock.now_s() < until_s:
                    self._listen(_LISTEN_S)

    @property
    def _is_at_rest(self) -> bool:
        """Whether it is disarmed, may be commanded, and is not being landed or stopped."""
        return self._state not in QUARANTINE_STATES and self._radio.is_disarmed and self._repeated is None

    def _require_uid(self) -> None:
        """Raise VehicleError if the pinned hardware id is known, and this vehicle has not reported its own."""
        if missing_uid := preflight.find_missing_uid(self._radio, self._pinned):
            raise VehicleError(
                missing_uid, hint="Try again. If it no longer reports one, connect it again and release it."
            )

    def _listen(self, timeout_s: float) -> None:
        """Receive between flights. A vehicle that somebody else arms, or that reports another version or hardware id
        than the pinned one, is only observed from then on."""
        self._radio.listen(timeout_s)
        self._check_identity()

    def _check_identity(self) -> None:
        if self._gains.have_restarted:
            self._gains.forget()
        armed = preflight.ARMED if self._radio.is_armed else ""
        change = preflight.identity_change(self._radio, self._pinned)
        if self._state not in QUARANTINE_STATES:
            if why := f"{armed} {change}".strip():
                self._observe(why)
        elif change not in self._why:
            self._why = f"{self._why} {change}"

    def _while_waiting(self, packets: list[PacketReceived]) -> None:
        """Repeat a pending Land or motors off and accept new commands during operations that wait. Restoring the safe
        gains is never interrupted."""
        self._repeat_command(packets)
        try:
            self._on_wait()
        except VehicleError:
            if not self._is_restoring:
                raise

    def _repeat_command(self, packets: list[PacketReceived]) -> None:
        if (repeated := self._repeated) is None:
            return
        try:
            repeated.proceed(packets)
        except LinkError:
            raise
        except VehicleError as error:  # its flight plan is not known
            self._requested, self._repeated = str(error), None
        if self.has_stopped is None and self._flight is None and repeated.action is Action.KILL and repeated.is_over:
            self.has_stopped = repeated.has_stopped
            if not repeated.has_stopped:
                self._doubt_stop(_NOT_STOPPED)

    # ---- flying

    def _require_staged(self) -> None:
        if self._gains.staged is None:
            raise VehicleError(
                "No gains were staged, or the vehicle has restarted since: it was not flown.",
                hint="Stage the gains, check the read-back, then fly.",
            )

    def _observe_ground(self, watched_s: float, order: FlightOptions) -> Ground:
        """Return where it stands. Raises VehicleError if it is not ready to fly, SafeGainsError if it is armed."""
        needed = preflight.evaluate_set_point_requirements(self._radio) if _flies_steps(order) else ()
        watched, items = self._check(watched_s)
        if self._radio.profile.flying_blocks:
            plan_time_s = float(self._options["plan_time_s"])
            items = (*items, preflight.evaluate_flight_time(order.record_s, plan_time_s=plan_time_s))
        hover = preflight.evaluate_hover(self._hover_throttle, self._radio.profile.hover_limits(self._loop))
        items = (*items, *needed, *hover, preflight.evaluate_set_points(order.set_points))
        self._require_not_quarantined()
        preflight.require(items)
        return watched.ground

    def _check(self, watched_s: float) -> tuple[preflight.GroundObservation, tuple[CheckItem, ...]]:
        self._identify()
        if not preflight.reports_armed(self._radio) and self._state not in QUARANTINE_STATES:
            preflight.prepare(self._radio, float(self._options["telemetry_hz"]))
            preflight.make_armable(self._radio)
        watched = self._observe_standing(watched_s)
        for _ in range(_FURTHER_OBSERVATIONS):
            if self._state in QUARANTINE_STATES or not (
                preflight.make_armable(self._radio) or preflight.set_ground_reference(self._radio, watched)
            ):
                break
            watched = self._observe_standing(watched_s)
        if self._state not in QUARANTINE_STATES:
            preflight.confirm_stop(self._radio, watched)
        minimum_v = float(self._options["min_battery_v"])
        items = preflight.evaluate_items(self._radio, watched, min_battery_v=minimum_v, plan_problem=self._plan_problem)
        if self._pinned is not None and self._pinned.uid:
            items = (*items, preflight.evaluate_uid(self._radio, self._pinned))
        if self._secondary is not None:
            items = (*items, preflight.evaluate_secondary(self._secondary, watched))
        if self._radio.profile.flying_blocks:
            radius_m, plan_radius_m = float(self._options["radius_m"]), float(self._options["plan_radius_m"])
            items = (*items, preflight.evaluate_distance(watched, radius_m=radius_m, plan_radius_m=plan_radius_m))
        items = (*items, self._gains.check())
        return watched.continued(self._radio), items

    def _observe_standing(self, watched_s: float) -> preflight.GroundObservation:
        watched = preflight.observe(self._radio, self._secondary, watched_s=watched_s)
        self._identify()
        return watched

    def _settings(self, order: FlightOptions) -> tuple[Setting, ...]:
        """Return the parameters that the flight needs."""
        profile, target = self._radio.profile, self._radio.target
        settings = profile.take_off_settings(target)
        return (*settings, *profile.set_point_settings(target)) if _flies_steps(order) else settings

    def _prepare_set_points(self, order: FlightOptions) -> None:
        """Request the telemetry that a flight with several set points needs, and read the parameters of its loop, which
        the replica would otherwise replace by defaults. The first computation of a reference may take seconds, which
        must not pass after the ground was observed."""
        if self._radio.profile.reference == "replica":
            simulate_reference(order.set_points, 0.0, np.zeros(1), order.record_s)
        self._identify()
        self._require_not_quarantined()
        preflight.prepare_set_points(self._radio)
        profile = self._radio.profile
        if profile.loop_parameters:
            names = profile.loop_parameters[self._gains.release]
            self._loop = parameters.read_loop(self._radio, names, profile.may_lack)

    def _reference(self, order: FlightOptions, ground: Ground) -> Reference | None:
        """Return the function that computes the autopilot's own reference; None if it sends that, or if it is not
        needed."""
        if not _flies_steps(order) or self._radio.profile.reference != "replica":
            return None
        ground_m = ground.altitude_m

        return lambda set_points, time_s: simulate_reference(set_points, ground_m, time_s, order.record_s)

    def _fly(
        self,
        ground: Ground,
        order: FlightOptions,
        reference: Reference | None,
        on_sample: Callable[[Sample], None],
        should_stop: ShouldStop,
    ) -> TrialResult:
        last = ground.last
        self._radio.target = replace(self._radio.target, east_m=last.east_m, north_m=last.north_m)
        self._enter(State.ARM)
        plan = replace(self._plan_of(order, ground), trial_gains=self._gains.staged_settings)
        self._gains.staged = self._repeated = None
        watch = watching.begin(
            self._radio.clock.now_s(),
            last=last,
            battery_v=self._radio.seen.battery_v,
            stood_s=STANDSTILL_S,
            reports_landing=self._radio.seen.reports_landing,
        )
        if self._secondary is not None:
            self._secondary.align(ground.secondary_m, ground.altitude_m)
        self._flight = TrialRunner(
            self._radio,
            plan,
            watch,
            restore=self._restore_all,
            on_sample=on_sample,
            should_stop=should_stop,
            channels=lambda sample, datum_m: records.channels_of(sample, datum_m, self._scored),
            look=list if self._secondary is None else self._secondary.take_samples,
            reference=reference,
        )
        try:
            flown = self._flight.fly()
        finally:
            self._datum_m, self._flight = self._flight.datum_m, None
        self._state, self._why = flown.trial.state, flown.trial.why
        if self._repeated is None:  # else it is of a request during the restoring of the safe gains
            self.has_stopped = self._radio.is_disarmed or flown.trial.has_confirmed_stop
        if self._state is State.QUARANTINE:
            self._keep_landing(flown.trial)
        return flown

    def _keep_landing(self, trial: Trial) -> None:
        """Keep commanding Land to a vehicle that did not land within its trial, while it is armed and no pilot flies
        it."""
        by_hand = limit_checks.find_taken_over(trial.watch, trial.plan.limits) is not None
        is_disarmed = self._radio.is_disarmed or trial.has_confirmed_stop
        if not by_hand and not is_disarmed and self._repeated is None:
            with suppress(LinkError):
                self._repeated = RepeatedCommand(self._radio, Action.LAND, by_person=False)
                self._requested = _LAND_REPEATED

    def _plan_of(self, order: FlightOptions, ground: Ground) -> Plan:
        """Return the plan with the set points of the order."""
        profile = self._radio.profile
        plan = replace(self._plan(ground), record_s=order.record_s, set_points=order.set_points)
        if not _flies_steps(order) or not profile.holds_first:
            return plan
        return replace(
            plan,
            set_points=with_hold(order.set_points),
            holds_first=True,
            following_modes=profile.following_modes,
        )

    def _plan(self, ground: Ground) -> Plan:
        profile = self._radio.profile
        plan = Plan(
            safe_gains=self._gains.safe_settings,
            ground_m=0.0,
            climbs_from_ground=profile.climbs_from_ground,
            lift_off_s=profile.lift_off_s,
            land_again_s=profile.land_again_s,
            stop_settings=profile.stop_settings,
            mode_parameter=profile.mode_parameter,
            limits=limits_of(self._options, self._radio),
        )
        return plan.on_ground_at(ground.altitude_m)

    def _restore_or_quarantine(self) -> None:
        """Restore the safe gains, because the staged gains are not flown; quarantine the vehicle if they cannot be
        verified. A vehicle that is armed keeps its gains, and is observed."""
        if self._state in QUARANTINE_STATES:
            return
        self._is_restoring = True
        try:
            self.restore()
        except VehicleError as error:
            self._check_identity()
            if self._state not in QUARANTINE_STATES:
                self._enter(State.QUARANTINE)
                self._why = f"Its safe gains could not be verified. {error}"
        finally:
            self._is_restoring = False

    # ---- records

    @property
    def _scored(self) -> Scored:
        return "mocap" if self._options["scored_source"] == "mocap" else "vehicle"

    def _record(self, flown: TrialResult, ground: Ground) -> FlightRecord:
        """Return the record. Raises VehicleError if the vehicle was never commanded to take off, unless the operator
        aborted."""
        trial, start_s = flown.trial, flown.trial.commanded_boot_s
        if start_s is None and trial.failure is Failure.OPERATOR:
            landed = trial.contact if trial.watch.lifted else Landing.STAYED
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
            trial.changes,
            ground_m=plan.ground_m - plan.datum_m,
            reference=flown.reference,
        )
        if records.ending_of(trial) == "completed":
            found = records.hover_throttle_of(own, until_s=referred_from_s(plan) + SETTLED_FOR_S)
            self._hover_throttle = self._hover_throttle if found is None else found
        both = AlignedRecord(trajectory=own)
        if self._secondary is not None:
            zero_s, name = start_s + flown.offset_s, self._secondary.source.name
            both = add_secondary_altitude(
                both.trajectory, self._secondary.seen, name=name, zero_s=zero_s, scored=self._scored
            )
        lands = self._repeated is not None and self._repeated.action is Action.LAND
        return FlightRecord(
            trajectory=both.trajectory,
            ending=records.ending_of(trial),
            end=records.end_of(trial, _LAND_WAS_REPEATED if lands else "", both.remark),
            settings={**self._options, **self._loop, **both.settings},
        )

    def _not_begun(self, ground: Ground, end: FlightEnd) -> FlightRecord:
        """Return the record of an abort before any command: a single instant on the ground."""
        sample = RecordSample(ground.last, ground.altitude_m, self._radio.seen.battery_v)
        trajectory = records.trajectory_of((sample,), ground.last.time_boot_s, self._plan(ground).datum_m)
        return FlightRecord(trajectory=trajectory, ending="aborted", end=end, settings=self._options)

    # ---- states

    def _require_not_quarantined(self) -> None:
        if self._state is State.QUARANTINE:
            raise SafeGainsError(
                f"{self._why} Nothing is written to a vehicle that may be in the air.",
                hint="Land it if it is flying, check that its motors have stopped, verify its gains, then release it.",
            )
        if self._state is State.OBSERVE:
            raise SafeGainsError(
                f"The vehicle is only observed. {self.concern}",
                hint="Check that it is on the ground with its motors stopped, then release it.",
            )

    def _enter(self, state: State) -> None:
        if state not in TRANSITIONS[self._state]:
            raise AssertionError(f"A vehicle cannot go from {self._state} to {state}.")
        self._state = state


def _flies_steps(order: FlightOptions) -> bool:
    """Whether set points follow the takeoff's."""
    return len(order.set_points.times_s) > 1
