"""A vehicle that speaks MAVLink, between opening and closing."""

import datetime as dt
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from app.core.policy import Gains
from app.core.trajectory import Trajectory
from app.vehicles.base import Ending, FlightOrder, FlightRecord, Sample, ShouldStop
from app.vehicles.errors import SafeGainsError, VehicleError
from app.vehicles.kinds import Options
from app.vehicles.mavlink import addresses, limits, parameters, preflight
from app.vehicles.mavlink.clock import Clock, ScaledClock
from app.vehicles.mavlink.failures import RESPONSES, Failure
from app.vehicles.mavlink.limits import Limits
from app.vehicles.mavlink.link import Link
from app.vehicles.mavlink.machine import Plan, Trial
from app.vehicles.mavlink.preflight import Ground
from app.vehicles.mavlink.profiles import PROFILES
from app.vehicles.mavlink.profiles.base import Aim
from app.vehicles.mavlink.radio import PATIENCE_S, Radio
from app.vehicles.mavlink.signals import Keep
from app.vehicles.mavlink.states import MOVES, State
from app.vehicles.mavlink.trial import Flight, Flown, channels_of

TAKEOFF_ALTITUDE_M: Final = 3.0
STAND_S: Final = 1.0
"""Watched once more before arming, for between staging and flying a person may have taken his time."""

HASTE: Final = 4.0
"""Up to this speed of its clock a simulated vehicle is waited for as a real one is. Beyond, waiting for packets takes
longer by its time, because a busy computer's pauses are on the wall."""


class MavlinkVehicle:
    """One vehicle at the other end of one link.

    Whatever ends a flight ends it with the safe gains read back, or in quarantine: then everything further that would
    reach the vehicle raises SafeGainsError.
    """

    kind: Final = "mavlink"

    def __init__(self, options: Options, safe_gains: Gains, *, is_real: bool, clock: Clock | None = None) -> None:
        """Connect, wait for the vehicle, check it on the ground, and write the safe gains. `clock` is the vehicle's
        time, by default that of its options. Raises VehicleError when it is not there or not ready, SafeGainsError when
        it is armed, GainsError for safe gains that it cannot hold."""
        self.is_real: Final = is_real
        self._options = dict(options)
        self._state = State.CONNECT
        self._why = ""
        self._staged = False
        profile = PROFILES[str(options["autopilot"])]
        clock = clock or ScaledClock(float(options["clock_speed"]))
        self._link = Link(
            addresses.parse(str(options["address"])),
            profile.dialect,
            clock=clock,
            target_system=int(options["system_id"]) or None,
            tlog=_log_path(str(options["log_folder"])),
        )
        aim = Aim(
            system=0,
            aircraft=int(options["aircraft_id"]),
            waypoint=int(options["climb_waypoint"]),
            altitude_m=TAKEOFF_ALTITUDE_M,
        )
        self._patience = max(1.0, float(options["clock_speed"]) / HASTE)
        self._radio = Radio(self._link, profile, clock, aim, patience_s=PATIENCE_S * self._patience)
        try:
            self._meet(safe_gains)
        except BaseException:
            self._link.close()
            raise

    def _meet(self, safe_gains: Gains) -> None:
        preflight.meet(self._radio, str(self._options["address"]))
        self._enter(State.PREFLIGHT)
        preflight.prepare(self._radio, float(self._options["telemetry_hz"]))
        self._gain_set = parameters.find_gain_set(self._radio)
        self.safe_gains: Gains = parameters.check_gains(safe_gains, self._gain_set)
        preflight.stand(self._radio, min_battery_v=float(self._options["min_battery_v"]))
        self._enter(State.SET_GAINS)
        if problem := self._restore():
            raise SafeGainsError(
                f"The vehicle does not take its safe gains: {problem}", hint="Set them by hand and read them back."
            )

    def stage(self, gains: Gains) -> dict[str, float]:
        """Write every gain and return what was read back. Raises GainsError for gains that may not be written (nothing
        is changed then), VehicleError when the vehicle does not confirm, SafeGainsError in quarantine."""
        self._require_trust()
        wanted = parameters.check_gains(gains, self._gain_set)
        if self._state is State.IDLE:
            self._enter(State.SET_GAINS)
        self._staged = False
        self._radio.listen(0.0)
        preflight.require_disarmed(self._radio)
        try:
            held = parameters.write_gains(self._radio, self._gain_set, wanted)
        except VehicleError:
            self._unstage()
            raise
        self._staged = held == wanted
        return held

    def read_gains(self) -> dict[str, float]:
        """What the vehicle holds now."""
        return parameters.read_gains(self._radio, self._gain_set)

    def fly(
        self,
        order: FlightOrder,  # noqa: ARG002 - the vehicle owns its time, and chance is its own
        *,
        on_sample: Callable[[Sample], None],
        should_stop: ShouldStop,
    ) -> FlightRecord:
        """Arm, take off to 3 m, record, land, disarm, and restore the safe gains.

        The vehicle owns its time: `order.speed` is not looked at, its seed means nothing. `should_stop` is asked every
        10 ms. Raises VehicleError when nothing was staged or the vehicle did not lift off; what `on_sample` and
        `should_stop` raise lands the vehicle, and is raised again once it is down.
        """
        self._require_trust()
        if not self._staged:
            raise VehicleError(
                "No gains were staged for this flight, so it was not started.",
                hint="Stage the gains, compare what is read back, then fly.",
            )
        try:
            ground = preflight.stand(
                self._radio, min_battery_v=float(self._options["min_battery_v"]), watched_s=STAND_S
            )
            stop = should_stop()
        except SafeGainsError as error:
            self._state, self._why = State.QUARANTINE, str(error)
            raise
        except BaseException:
            self._unstage()
            raise
        if stop is not None:
            self._unstage()
            return self._not_begun(ground, stop.reason)
        flown = self._fly(ground, on_sample, should_stop)
        if flown.error is not None:
            raise flown.error
        return self._record(flown, ground)

    def close(self) -> None:
        """End the conversation; the vehicle is left as it is."""
        self._link.close()

    def _fly(self, ground: Ground, on_sample: Callable[[Sample], None], should_stop: ShouldStop) -> Flown:
        last = ground.last
        self._radio.aim = replace(self._radio.aim, east_m=last.east_m, north_m=last.north_m)
        self._enter(State.ARM)
        self._staged = False
        watch = limits.begin(self._radio.clock.now_s(), last=last, battery_v=self._radio.seen.battery_v)
        flight = Flight(
            self._radio,
            self._plan(ground),
            watch,
            restore=self._restore,
            on_sample=on_sample,
            should_stop=should_stop,
        )
        flown = flight.fly()
        self._state, self._why = flown.trial.state, flown.trial.why
        return flown

    def _plan(self, ground: Ground) -> Plan:
        profile = self._radio.profile
        datum_m = ground.altitude_m if profile.climbs_from_ground else 0.0
        return Plan(
            safe_gains=parameters.settings(self._gain_set, self.safe_gains),
            ground_m=ground.altitude_m,
            datum_m=datum_m,
            lift_off_s=profile.lift_off_s,
            limits=Limits(
                set_point_m=datum_m + TAKEOFF_ALTITUDE_M,
                heartbeat_s=profile.heartbeat_s,
                min_battery_v=float(self._options["min_battery_v"]),
                radius_m=float(self._options["radius_m"]),
                flying_modes=profile.flying_modes,
                landing_modes=profile.landing_modes,
            ).stretched(self._patience),
        )

    def _unstage(self) -> None:
        """Back to the safe gains, for what was staged will not fly; in quarantine where they cannot be verified."""
        self._staged = False
        try:
            problem = self._restore()
        except VehicleError as error:
            problem = str(error)
        if problem:
            self._enter(State.QUARANTINE)
            self._why = f"Its safe gains could not be verified: {problem}"

    def _restore(self) -> str:
        """Write the safe gains; what is wrong with those read back, or nothing. Raises VehicleError for silence."""
        wanted = dict(self.safe_gains)
        held = parameters.write_gains(self._radio, self._gain_set, wanted)
        return "" if held == wanted else f"it holds {held} instead of {wanted}."

    def _record(self, flown: Flown, ground: Ground) -> FlightRecord:
        """Raises VehicleError when the vehicle was never told to take off, for another reason than the operator's."""
        trial, start_s = flown.trial, flown.trial.commanded_boot_s
        reason = _reason(trial)
        if start_s is None and trial.failure is Failure.OPERATOR:
            return self._not_begun(ground, reason)
        if start_s is None:
            raise VehicleError(reason, hint="Look at the vehicle, correct this, then fly again.")
        trajectory = _trajectory(flown.samples, start_s, trial.plan.datum_m)
        return FlightRecord(trajectory=trajectory, ending=_ending(trial), reason=reason, settings=self._options)

    def _not_begun(self, ground: Ground, reason: str) -> FlightRecord:
        """Aborted before anything was commanded: the one instant on the ground."""
        start_s = ground.last.time_boot_s
        sample = Keep(ground.last, ground.altitude_m, self._radio.seen.battery_v)
        trajectory = _trajectory((sample,), start_s, self._plan(ground).datum_m)
        return FlightRecord(trajectory=trajectory, ending="aborted", reason=reason, settings=self._options)

    def _require_trust(self) -> None:
        if self._state is State.QUARANTINE:
            raise SafeGainsError(
                f"The vehicle is quarantined: {self._why}",
                hint="Land it if it flies, see that its motors have stopped, verify its gains, then release it.",
            )

    def _enter(self, state: State) -> None:
        if state not in MOVES[self._state]:
            raise AssertionError(f"A vehicle cannot go from {self._state} to {state}.")
        self._state = state


def _trajectory(samples: Sequence[Keep], start_s: float, datum_m: float) -> Trajectory:
    """By the vehicle's own clock, from the command on; channels that some samples lack are left out."""
    rows = [channels_of(sample, datum_m) for sample in samples]
    names = [name for name in rows[-1] if all(name in row for row in rows)] if rows else []
    time_s = np.array([round(sample.position.time_boot_s - start_s, 6) for sample in samples])
    channels = {name: np.array([row[name] for row in rows], dtype=np.float64) for name in names}
    return Trajectory(time_s, channels, MavlinkVehicle.kind, "vehicle")


def _ending(trial: Trial) -> Ending:
    """What the record is worth, whatever became of the vehicle."""
    outcome = None if trial.failure is None else RESPONSES[trial.failure].outcome
    if outcome is None:
        return "completed"
    return "aborted" if outcome == "aborted" else "invalid"


def _reason(trial: Trial) -> str:
    """Why the flight ended early or does not count, and what else is to be known of its record."""
    if trial.failure is None or trial.failure is Failure.OPERATOR:
        said = trial.why
    else:
        said = f"{RESPONSES[trial.failure].text} {trial.why}"
    dropped = trial.watch.glitches if trial.failure is not Failure.GLITCHES else 0
    flag = f"{dropped} of its samples jumped and were dropped." if dropped else ""
    return " ".join(part for part in (said, flag) if part)


def _log_path(folder: str) -> Path | None:
    """A file of its own for every opening, in UTC; no folder, no log."""
    if not folder:
        return None
    return Path(folder) / f"{dt.datetime.now(dt.UTC):%Y%m%dT%H%M%S.%f}.tlog"
