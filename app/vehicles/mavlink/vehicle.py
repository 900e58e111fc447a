"""A vehicle that speaks MAVLink, between opening and closing."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Final

from app.core.clock import Clock
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
from app.vehicles.kinds import Options
from app.vehicles.mavlink import addresses, limit_checks, parameters, preflight, records
from app.vehicles.mavlink import observation as watching
from app.vehicles.mavlink.altitude_sources import AlignedAltitudeSource, AltitudeSource
from app.vehicles.mavlink.events import Action, PacketReceived, RecordSample
from app.vehicles.mavlink.failures import HELP, Failure
from app.vehicles.mavlink.opening import limits_of, open_radio
from app.vehicles.mavlink.parameters import GainStore, written
from app.vehicles.mavlink.preflight import Ground
from app.vehicles.mavlink.records import AlignedRecord, Scored, add_secondary_altitude
from app.vehicles.mavlink.repeated_command import RepeatedCommand
from app.vehicles.mavlink.status import StatusReader
from app.vehicles.mavlink.transports import LinkError, Transport
from app.vehicles.mavlink.trial import TrialResult, TrialRunner
from app.vehicles.mavlink.trial_machine import Plan, Trial
from app.vehicles.mavlink.trial_parameters import TrialParameters, files_for
from app.vehicles.mavlink.trial_transitions import QUARANTINE_STATES, TRANSITIONS, State

STANDSTILL_S: Final = 1.0
"""Watched once more before arming, for between staging and flying a person may have taken his time."""

_LISTEN_S: Final = 0.1
_HEARD_WITHIN_S: Final = 5.0
_ON_THE_GROUND: Final = frozenset({State.CONNECT, State.PREFLIGHT, State.SET_GAINS})
_ANOTHER: Final = "See which vehicle it is, then ask again."
_KEPT_LANDING: Final = f"It goes on being told to land. If it does not come down, {HELP}."
_SET_BY_HAND: Final = "Set its gains by hand, read them back, then release it."


class MavlinkVehicle:
    """One vehicle at the other end of one link.

    Whatever ends a flight ends it with the safe gains read back, or in quarantine: then everything further that would
    change the vehicle raises SafeGainsError, apart from Land and motors off.
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
        trial_parameters: Path | None = None,
        source: AltitudeSource | None = None,
        transport: Transport | None = None,
        on_wait: Callable[[], None] = lambda: None,
    ) -> None:
        """Connect, wait for the vehicle (the one of that `identity`, where it is given), and write the safe gains, once
        it is known to be disarmed. Unless they were `decided` by a person for this very vehicle, they are only compared
        with what it holds, which may be its owner's; where that differs, nothing is written.

        `clock` is the vehicle's time, by default that of its options; `source` is a second source of altitude, which is
        closed with the vehicle; `transport` takes the place of the address, and of the thread that reads it. The folder
        `trial_parameters` keeps what a trial changes beside the gains, for whoever connects next if this process dies.
        `on_wait` is called while the vehicle is waited for on the ground; what it raises ends what is under way.

        With `observes`, a vehicle that is armed or does not hold its safe gains is kept, and only observed (`concern`);
        without, it raises SafeGainsError, and VehicleError for one that is not ready to fly. Raises VehicleError when
        nobody answers or somebody else does, GainsError for safe gains that it cannot hold.
        """
        self.is_real: Final = is_real
        self._options = dict(options)
        self._state = State.CONNECT
        self._why = self._asked = self._plan_problem = ""
        self._pinned = identity
        self._datum_m = 0.0
        self._flight: TrialRunner | None = None
        self._order: RepeatedCommand | None = None
        self._gives_back = False
        self._lookout = None if source is None else AlignedAltitudeSource(source)
        overhear = None if source is None else source.on_message
        self._on_wait = on_wait
        self._radio = open_radio(options, clock, overhear=overhear, on_wait=self._while_waiting, transport=transport)
        self._gauges = StatusReader(self._radio)
        try:
            self._gains = GainStore(self._radio, safe_gains)
            self._decided = decided
            self._kept_in = trial_parameters
            self._parameters = self._trial_parameters()
            self._connect()
            if not observes:
                self._require_ready()
        except BaseException:
            self._radio.link.close()
            raise

    # ---- as every vehicle

    @property
    def safe_gains(self) -> Gains:
        return self._gains.safe

    def stage(self, gains: Gains) -> dict[str, float]:
        """Write every gain and return what was read back. Raises GainsError for gains that may not be written (nothing
        is changed then), VehicleError when the vehicle does not confirm, SafeGainsError in quarantine."""
        self._require_not_quarantined()
        self._identify()
        self._require_not_quarantined()
        self._require_uid()
        if self._state is State.IDLE:
            self._enter(State.SET_GAINS)
        try:
            return self._gains.stage(gains)
        except VehicleError:
            self._give_back()
            raise

    def read_gains(self) -> dict[str, float]:
        """What the vehicle holds now."""
        return self._gains.read()

    def fly(
        self,
        order: FlightOptions,  # noqa: ARG002 - the vehicle owns its time, and chance is its own
        *,
        on_sample: Callable[[Sample], None],
        should_stop: ShouldStop,
    ) -> FlightRecord:
        """Arm, take off to 3 m, record, land, disarm, and restore the safe gains.

        The vehicle owns its time: `order.speed` is not looked at, its seed means nothing. `should_stop` is asked once
        everything is ready for arming, and then every 10 ms. Raises VehicleError when nothing was staged, the vehicle
        is not ready, does not hold the staged gains any more or could not be told to take off, which is then
        `not_flown`; what `on_sample` and `should_stop` raise lands the vehicle, and is raised again once it is down.
        """
        try:
            self._require_not_quarantined()
            self._require_staged()
            ground = self._observe_ground(STANDSTILL_S)
            self._parameters.set()
            stop = should_stop()
        except BaseException as error:
            if isinstance(error, VehicleError):
                error.not_flown = True
            self._give_back()
            raise
        if stop is not None:
            self._give_back()
            return self._not_begun(ground, stop.reason)
        flown = self._fly(ground, on_sample, should_stop)
        if flown.error is not None:
            raise flown.error
        return self._record(flown, ground)

    def close(self) -> None:
        """End the conversation; the vehicle is left as it is."""
        self._radio.link.close()
        if self._lookout is not None:
            self._lookout.source.close()

    # ---- as a vehicle whose link stays open

    @property
    def identity(self) -> Identity:
        """As it tells it, with some only after a while; what it has not told is as it was pinned."""
        radio, seen = self._radio, self._radio.seen
        told = Identity(system_id=radio.aim.system, autopilot=radio.profile.name, version=seen.version, uid=seen.uid)
        return told.completed_by(self._pinned)

    @property
    def concern(self) -> str:
        """Why it may only be observed; empty when it may fly."""
        if self._state not in QUARANTINE_STATES:
            return ""
        return " ".join(part for part in (self._why, self._asked) if part)

    @property
    def has_standing_order(self) -> bool:
        """Whether it has not obeyed yet what `land` or `motors_off` asked for."""
        return self._order is not None and not self._order.is_over

    def condition(self) -> Condition:
        """How it is, as last heard: nothing is waited for. Altitude counts as in a record."""
        step = self._state if self._flight is None else self._flight.state
        problem = self._radio.link.log_problem
        troubles = (
            f"The telemetry log {problem}." if problem else "",
            self._lookout.source.trouble if self._lookout is not None else "",
            self._flight.trouble if self._flight is not None else "",
            self._order.trouble if self._order is not None else "",
        )
        return self._gauges.read(
            step=(State.IDLE if step in _ON_THE_GROUND else step).value,
            datum_m=self._datum_m if self._flight is None else self._flight.datum_m,
            held=self._gains.held,
            trouble=" ".join(trouble for trouble in troubles if trouble),
        )

    def attend(self, timeout_s: float) -> None:
        """Listen for so long; the vehicle hears this ground station's heartbeats meanwhile. What `land` or `motors_off`
        asked for is repeated every second until telemetry agrees. Raises LinkError when the link is closed."""
        until_s = self._radio.clock.now_s() + timeout_s
        while (left_s := until_s - self._radio.clock.now_s()) > 0.0:
            heard = self._radio.receive(min(left_s, _LISTEN_S))
            self._judge_heard()
            self._repeat_order(heard)

    def check(self) -> tuple[CheckItem, ...]:
        """Everything that has to be so before a flight; what is not so is an item, not an error. It takes two seconds
        and more. Raises LinkError when the link is closed."""
        return self._check(preflight.WATCHED_S)[1]

    def parameters(self, on_progress: Callable[[int, int], None]) -> dict[str, float]:
        """Every parameter; `on_progress` is told how many came, of how many. Raises VehicleError when they do not come,
        SafeGainsError while the vehicle is only observed."""
        self._require_not_quarantined()
        return parameters.read_all(self._radio, on_progress)

    def restore(self) -> dict[str, float]:
        """Write the safe gains and return what was read back, which is them; a vehicle in doubt stays so. Raises
        SafeGainsError when it is armed, is another one, or does not take them, VehicleError when it does not tell its
        known hardware id."""
        self._identify()
        preflight.require_disarmed(self._radio)
        if preflight.is_another(self._radio, self._pinned):
            raise SafeGainsError(self.concern, hint=_ANOTHER)
        self._require_uid()
        if problem := self._put_back():
            raise SafeGainsError(f"The vehicle does not take what it had: {problem}", hint=_SET_BY_HAND)
        return dict(self._gains.held)

    def change_safe_gains(self, safe_gains: Gains) -> None:
        """Take other safe gains, which a person has named, and write them and read them back; while nobody has decided
        about this vehicle, they are only compared, as at connecting. A vehicle in doubt stays so, and is given them by
        its release. What goes wrong becomes a concern. Raises GainsError for gains that it cannot hold: nothing is
        changed then."""
        changed = GainStore(self._radio, safe_gains)
        changed.held, self._gains = self._gains.held, changed
        if self._decided and self._state in QUARANTINE_STATES:
            return
        if self._took_safe_gains() and self._state in QUARANTINE_STATES:
            self._enter(State.IDLE)
            self._why = ""

    def _put_back(self) -> str:
        """The safe gains, and what a trial set beside them; what is wrong with them, or nothing."""
        return self._gains.restore_or_explain() or self._parameters.restore()

    def land(self, reason: str) -> None:
        """Tell it to land, at once and whatever it says of itself. Raises VehicleError when it cannot be told."""
        self._asked = f"Land was asked for: {reason}."
        self._order = RepeatedCommand(self._radio, Action.LAND)

    def motors_off(self, reason: str) -> None:
        """Stop its motors, at once and at any height."""
        self._asked = f"Motors off was asked for: {reason}."
        self._order = RepeatedCommand(self._radio, Action.KILL)

    def log_to(self, path: Path | None) -> None:
        """Write what passes from now on, in both directions, to this telemetry log; None ends the log. Raises LinkError
        when the file cannot be opened: the log before goes on then."""
        self._radio.link.log_to(path)

    def release(self) -> None:
        """A person has looked at it, also at who it is now: out of observation, once it is disarmed and holds its safe
        gains, read back. One that tells no hardware id any more is accepted as it is. Raises VehicleError when it is
        not heard, is armed, does not hold them, or differs from the pinned one in what that person has not seen; it
        stays as it was then."""
        seen = self._why
        self._await_heartbeat()
        self._identify()
        if (change := preflight.identity_change(self._radio, self._pinned)) not in seen:
            raise SafeGainsError(change, hint=_ANOTHER)
        if (untold := preflight.find_untold_uid(self._radio, self._pinned)) not in seen:
            self._why = f"{seen} {untold}".strip()
            raise SafeGainsError(untold, hint=_ANOTHER)
        if untold or preflight.is_another(self._radio, self._pinned):
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
        self._why = self._asked = ""
        self._order = None

    # ---- connecting

    def _connect(self) -> None:
        preflight.await_vehicle(self._radio, str(self._options["address"]), self._pinned)
        self._plan_problem = preflight.read_vehicle_info(self._radio)
        self._enter(State.PREFLIGHT)
        self._listen(0.0)
        if self._state in QUARANTINE_STATES:
            return
        if self._took_safe_gains():
            self._enter(State.SET_GAINS)
            self._enter(State.IDLE)

    def _took_safe_gains(self) -> bool:
        """Write or compare the safe gains; whether it holds them and nothing else was found meanwhile. It is only
        observed where not."""
        was_observed = self._state in QUARANTINE_STATES
        try:
            self._set_up()
        except VehicleError as error:
            self._observe(str(error) if not self._decided else f"Its safe gains could not be verified: {error}")
            return False
        if self._state in QUARANTINE_STATES and not was_observed:
            return False
        self._decided = True
        self._pinned = self.identity
        return True

    def _set_up(self) -> None:
        """Raises VehicleError when the vehicle is armed, refuses, does not take its safe gains, or holds others that
        nobody decided to write over."""
        preflight.require_disarmed(self._radio)
        preflight.prepare(self._radio, float(self._options["telemetry_hz"]))
        if self._decided:
            self.restore()
        elif (found := self._gains.read()) != self._gains.safe:
            raise SafeGainsError(
                f"It holds {written(found)}, and {written(self._gains.safe)} are named as its safe gains; nothing was "
                "written.",
                hint="If what it holds is safe, name that as its safe gains. Else release it, which writes the others.",
            )
        elif problem := self._parameters.restore():
            raise SafeGainsError(problem, hint=_SET_BY_HAND)

    def _trial_parameters(self) -> TrialParameters:
        """Those of whoever answers by the time when they are first needed."""
        if self._kept_in is None:
            return TrialParameters(self._radio)
        folder, address = self._kept_in, addresses.parse(str(self._options["address"]))
        is_simulated = bool(self._options["simulated"])
        return TrialParameters(
            self._radio, lambda: files_for(folder, address, self.identity, is_simulated=is_simulated)
        )

    def _require_ready(self) -> None:
        """Raises SafeGainsError while it may only be observed, VehicleError when it is not ready to fly."""
        if self._state in QUARANTINE_STATES:
            raise SafeGainsError(self.concern, hint=_SET_BY_HAND)
        preflight.require(self.check())

    def _observe(self, why: str) -> None:
        if self._state not in QUARANTINE_STATES:
            self._enter(State.OBSERVE)
        self._why, self._gains.staged = why, None

    def _await_heartbeat(self) -> None:
        asked_s = self._radio.clock.now_s()
        while self._radio.seen.heartbeat_s < asked_s:
            if self._radio.clock.now_s() - asked_s > _HEARD_WITHIN_S * self._radio.timeout_factor:
                raise VehicleError("The vehicle is not heard.", hint="See that it is on and in reach, then try again.")
            self._listen(_LISTEN_S)

    def _identify(self) -> None:
        """Before anything is written: one that has been away may be another by now."""
        preflight.identify(self._radio, self._pinned)
        self._listen(0.0)
        if self._pinned is not None and self._state not in QUARANTINE_STATES:
            self._pinned = self._pinned.completed_by(self.identity)

    def _require_uid(self) -> None:
        """Raises VehicleError when the pinned vehicle's hardware id is known, and this one has not told its own."""
        if untold := preflight.find_untold_uid(self._radio, self._pinned):
            raise VehicleError(untold, hint="Try again. If it tells none any more, connect it again and release it.")

    def _listen(self, timeout_s: float) -> None:
        """Between flights: a vehicle that somebody else arms, or that tells another version or hardware id than the
        pinned one, is only observed from then on."""
        self._radio.listen(timeout_s)
        self._judge_heard()

    def _judge_heard(self) -> None:
        armed = preflight.ARMED if preflight.is_armed(self._radio) else ""
        change = preflight.identity_change(self._radio, self._pinned)
        if self._state not in QUARANTINE_STATES:
            if why := f"{armed} {change}".strip():
                self._observe(why)
        elif change not in self._why:
            self._why = f"{self._why} {change}"

    def _while_waiting(self, heard: list[PacketReceived]) -> None:
        """What takes time keeps no order waiting, neither one that stands nor one that comes. Giving the safe gains
        back goes to its end all the same."""
        self._repeat_order(heard)
        try:
            self._on_wait()
        except VehicleError:
            if not self._gives_back:
                raise

    def _repeat_order(self, heard: list[PacketReceived]) -> None:
        if self._order is not None:
            self._order.proceed(heard)

    # ---- flying

    def _require_staged(self) -> None:
        if self._gains.staged is None:
            raise VehicleError(
                "No gains were staged for this flight, so it was not started.",
                hint="Stage the gains, compare what is read back, then fly.",
            )

    def _observe_ground(self, watched_s: float) -> Ground:
        """Where it stands. Raises VehicleError when it is not ready to fly, SafeGainsError when it is armed."""
        watched, items = self._check(watched_s)
        self._require_not_quarantined()
        preflight.require(items)
        return watched.ground

    def _check(self, watched_s: float) -> tuple[preflight.GroundObservation, tuple[CheckItem, ...]]:
        self._identify()
        if not preflight.is_armed(self._radio) and self._state not in QUARANTINE_STATES:
            preflight.prepare(self._radio, float(self._options["telemetry_hz"]))
            preflight.make_armable(self._radio)
        watched = preflight.observe(self._radio, self._lookout, watched_s=watched_s)
        self._identify()
        if self._state not in QUARANTINE_STATES:
            preflight.confirm_stop(self._radio, watched)
        minimum_v = float(self._options["min_battery_v"])
        items = preflight.evaluate_items(self._radio, watched, min_battery_v=minimum_v, plan_problem=self._plan_problem)
        if self._pinned is not None and self._pinned.uid:
            items = (*items, preflight.evaluate_uid(self._radio, self._pinned))
        if self._lookout is not None:
            items = (*items, preflight.evaluate_secondary(self._lookout, watched))
        if self._radio.profile.flying_blocks:
            radius_m, plan_radius_m = float(self._options["radius_m"]), float(self._options["plan_radius_m"])
            items = (*items, preflight.evaluate_distance(watched, radius_m=radius_m, plan_radius_m=plan_radius_m))
        return watched, (*items, self._gains.check())

    def _fly(self, ground: Ground, on_sample: Callable[[Sample], None], should_stop: ShouldStop) -> TrialResult:
        last = ground.last
        self._radio.aim = replace(self._radio.aim, east_m=last.east_m, north_m=last.north_m)
        self._enter(State.ARM)
        plan = self._plan(ground)
        self._gains.staged = self._order = None
        watch = watching.begin(
            self._radio.clock.now_s(), last=last, battery_v=self._radio.seen.battery_v, stood_s=STANDSTILL_S
        )
        if self._lookout is not None:
            self._lookout.align(ground.seen_m, ground.altitude_m)
        self._flight = TrialRunner(
            self._radio,
            plan,
            watch,
            restore=self._put_back,
            on_sample=on_sample,
            should_stop=should_stop,
            channels=lambda kept, datum_m: records.channels_of(kept, datum_m, self._scored),
            look=list if self._lookout is None else self._lookout.take_samples,
        )
        try:
            flown = self._flight.fly()
        finally:
            self._datum_m, self._flight = self._flight.datum_m, None
        self._state, self._why = flown.trial.state, flown.trial.why
        if self._state is State.QUARANTINE:
            self._keep_landing(flown.trial)
        return flown

    def _keep_landing(self, trial: Trial) -> None:
        """A vehicle that could not be landed within its trial is told to land all the same, as long as it is armed and
        no person flies it."""
        by_hand = limit_checks.find_taken_over(trial.watch, trial.plan.limits) is not None
        if not by_hand and not self._radio.is_disarmed and self._order is None:
            with suppress(LinkError):
                self._order = RepeatedCommand(self._radio, Action.LAND, by_person=False)
                self._asked = _KEPT_LANDING

    def _plan(self, ground: Ground) -> Plan:
        profile = self._radio.profile
        plan = Plan(
            safe_gains=self._gains.safe_settings,
            ground_m=0.0,
            climbs_from_ground=profile.climbs_from_ground,
            lift_off_s=profile.lift_off_s,
            land_again_s=profile.land_again_s,
            stop_settings=profile.stop_settings,
            limits=limits_of(self._options, self._radio),
        )
        return plan.on_ground_at(ground.altitude_m)

    def _give_back(self) -> None:
        """The safe gains again, for nothing flies on the staged ones; in quarantine where they cannot be verified. One
        that is armed by now keeps what it has, and is observed."""
        if self._state in QUARANTINE_STATES:
            return
        self._gives_back = True
        try:
            self.restore()
        except VehicleError as error:
            if self._state not in QUARANTINE_STATES:
                self._enter(State.QUARANTINE)
                self._why = f"Its safe gains could not be verified: {error}"
        finally:
            self._gives_back = False

    # ---- records

    @property
    def _scored(self) -> Scored:
        return "mocap" if self._options["scored_source"] == "mocap" else "vehicle"

    def _record(self, flown: TrialResult, ground: Ground) -> FlightRecord:
        """Raises VehicleError when the vehicle was never told to take off, for another reason than the operator's."""
        trial, start_s = flown.trial, flown.trial.commanded_boot_s
        reason = records.reason_of(trial)
        if start_s is None and trial.failure is Failure.OPERATOR:
            return self._not_begun(ground, reason)
        if start_s is None:
            refusal = VehicleError(reason, hint="Look at the vehicle, correct this, then fly again.")
            refusal.not_flown = True
            raise refusal
        both = AlignedRecord(trajectory=records.trajectory_of(flown.samples, start_s, trial.plan.datum_m))
        if self._lookout is not None:
            zero_s, name = start_s + flown.offset_s, self._lookout.source.name
            both = add_secondary_altitude(
                both.trajectory, self._lookout.seen, name=name, zero_s=zero_s, scored=self._scored
            )
        return FlightRecord(
            trajectory=both.trajectory,
            ending=records.ending_of(trial),
            reason=" ".join(
                part for part in (reason, _KEPT_LANDING if self._asked == _KEPT_LANDING else "", both.remark) if part
            ),
            settings={**self._options, **both.settings},
        )

    def _not_begun(self, ground: Ground, reason: str) -> FlightRecord:
        """Aborted before anything was commanded: the one instant on the ground."""
        sample = RecordSample(ground.last, ground.altitude_m, self._radio.seen.battery_v)
        trajectory = records.trajectory_of((sample,), ground.last.time_boot_s, self._plan(ground).datum_m)
        return FlightRecord(trajectory=trajectory, ending="aborted", reason=reason, settings=self._options)

    # ---- trust

    def _require_not_quarantined(self) -> None:
        if self._state is State.QUARANTINE:
            raise SafeGainsError(
                f"The vehicle is quarantined: {self._why}",
                hint="Land it if it flies, see that its motors have stopped, verify its gains, then release it.",
            )
        if self._state is State.OBSERVE:
            raise SafeGainsError(
                f"The vehicle is only observed: {self._why}",
                hint="See that it stands with its motors stopped, then release it.",
            )

    def _enter(self, state: State) -> None:
        if state not in TRANSITIONS[self._state]:
            raise AssertionError(f"A vehicle cannot go from {self._state} to {state}.")
        self._state = state
