"""A vehicle that is received, identified, and landed or stopped by a person: all that is possible in quarantine."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Final

from app.autopilots.commands import Action
from app.core.clock import Clock
from app.core.policy import Gains
from app.vehicles.base import Identity, VehicleError
from app.vehicles.flight_end import requested
from app.vehicles.kinds import Options
from app.vehicles.mavlink import parameters
from app.vehicles.mavlink.altitude_sources import AltitudeSource
from app.vehicles.mavlink.events import PacketReceived
from app.vehicles.mavlink.identity import VehicleIdentity
from app.vehicles.mavlink.monitors.clock import RESTARTED_S
from app.vehicles.mavlink.preparation import ARMED
from app.vehicles.mavlink.quarantine import Quarantine
from app.vehicles.mavlink.radio import LISTEN_S, open_radio
from app.vehicles.mavlink.sent_commands import STOPPING_S, RepeatedCommand, set_up
from app.vehicles.mavlink.status_reader import StatusReader
from app.vehicles.mavlink.transports import LinkError, Transport
from app.vehicles.mavlink.trial_state import State

_POSITIONS_CEASED_S: Final = 2.0


class ObservedVehicle(ABC):
    """One vehicle on one link. A vehicle that is not as expected is only observed from then on."""

    def __init__(
        self,
        options: Options,
        safe_gains: Gains,
        *,
        is_real: bool,
        clock: Clock,
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

        `clock` is the vehicle's time; `source` is a second source of altitude, which is closed with the vehicle;
        `transport` replaces the address and the thread that reads it. The folder `trial_parameters` keeps the
        parameters that a trial changes in addition to the gains, so that the next connection can restore them if this
        process dies. `on_wait` is called while waiting for the vehicle on the ground; an exception from it ends the
        operation.

        With `observes`, a vehicle that is armed or does not hold its safe gains stays connected and is only observed
        (see `concern`). Otherwise it raises SafeGainsError, and a vehicle that is not ready to fly VehicleError. Raises
        VehicleError if no vehicle or another one answers, GainsError for safe gains that it cannot hold.
        """
        self.is_real: Final = is_real
        self._options = dict(options)
        self._decided, self._plan_problem, self._parameters_folder = decided, "", trial_parameters
        self._quarantine = Quarantine()
        self._repeated: RepeatedCommand | None = None
        self._is_restoring = False
        self.has_stopped: bool | None = False
        self._was_flying = was_flying
        self._secondary = source
        self._on_wait = on_wait
        self._radio = open_radio(
            options,
            clock,
            on_message=None if source is None else source.on_message,
            on_wait=self._while_waiting,
            is_silent=self._is_silent,
            transport=transport,
        )
        self._identity = VehicleIdentity(self._radio, identity)
        self._status_reader = StatusReader(self._radio)
        self._telemetry_requested_s = self._radio.clock.now_s()
        try:
            self._gains = parameters.GainStore(self._radio, safe_gains)
            self._open(observes=observes)
        except BaseException:
            self._radio.link.close()
            raise

    @abstractmethod
    def _open(self, *, observes: bool) -> None:
        """Connect; with `observes`, also to a vehicle that may only be observed."""

    @property
    def safe_gains(self) -> Gains:
        return self._gains.safe

    def read_gains(self) -> dict[str, float]:
        """Return the gains that the vehicle holds now."""
        return self._gains.read()

    @property
    def identity(self) -> Identity:
        """Identity as reported, which may take some time; parts not reported are those of the pinned identity."""
        return self._identity.reported

    @property
    def concern(self) -> str:
        """Reason why the vehicle may only be observed; empty if it may fly."""
        return self._quarantine.concern

    @property
    def has_standing_order(self) -> bool:
        """Whether a command of `land` or `motors_off` is still being repeated to a vehicle that may be armed, and was
        not repeated for a minute without a packet from it."""
        repeated = self._repeated
        if repeated is None or repeated.is_withheld:
            return False
        return not (repeated.is_over or repeated.is_unheard or self._radio.is_disarmed)

    @property
    def _is_flying(self) -> bool:
        """Whether a trial is in progress."""
        return False

    def log_to(self, path: Path | None) -> None:
        """Record all packets from now on, in both directions, in this telemetry log; None ends the log. Raises
        LinkError if the file cannot be opened; the previous log then continues."""
        self._radio.link.log_to(path)

    def close(self) -> None:
        """Close the link; the vehicle is left unchanged."""
        self._radio.link.close()
        if self._secondary is not None:
            self._secondary.close()

    def parameters(self) -> dict[str, float]:
        """Read every parameter. Raises VehicleError if they do not arrive, SafeGainsError while the vehicle is only
        observed."""
        self._quarantine.require_none()
        return parameters.read_all(self._radio)

    # ---- receiving

    def attend(self, timeout_s: float) -> None:
        """Receive for `timeout_s` while sending the ground station's heartbeats. A command of `land` or `motors_off` is
        repeated every second until telemetry confirms it. If only heartbeats arrive, telemetry is requested again,
        which takes longer. Raises LinkError if the link is closed."""
        until_s = self._radio.clock.now_s() + timeout_s
        while (left_s := until_s - self._radio.clock.now_s()) > 0.0:
            packets = self._radio.receive(min(left_s, LISTEN_S))
            self._check_identity()
            self._repeat_command(packets)
            self._was_flying = self._was_flying and not self._radio.is_disarmed
        self._renew_telemetry()

    def _listen(self, timeout_s: float) -> None:
        """Receive between flights. A vehicle that somebody else arms, or that reports another version or hardware id
        than the pinned one, is only observed from then on."""
        self._radio.listen(timeout_s)
        self._check_identity()

    def _check_identity(self) -> None:
        if self._gains.have_restarted:
            self._gains.forget()
        change = self._identity.change
        if self._quarantine.is_active:
            self._quarantine.add(change)
        elif why := f"{ARMED if self._radio.is_armed else ''} {change}".strip():
            self._observe(why)

    def _identify(self) -> None:
        """Identify the vehicle before anything is written: after an absence it may be another one."""
        self._identity.request()
        self._listen(0.0)
        if self._identity.pinned is not None and not self._quarantine.is_active:
            self._identity.pinned = self._identity.pinned.completed_by(self.identity)

    def _request_telemetry(self) -> None:
        set_up(self._radio, self._radio.profile.prepare(self._radio.target, float(self._options["telemetry_hz"])))

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
                self._request_telemetry()
                until_s = self._radio.clock.now_s() + 2.0 * RESTARTED_S
                while self._radio.clock.now_s() < until_s:
                    self._listen(LISTEN_S)

    @property
    def _is_at_rest(self) -> bool:
        """Whether it is disarmed, may be commanded, and is not being landed or stopped."""
        return not self._quarantine.is_active and self._radio.is_disarmed and self._repeated is None

    def _while_waiting(self, packets: list[PacketReceived]) -> None:
        """Repeat a pending Land or motors off and accept new commands during operations that wait. Restoring the safe
        gains is never interrupted."""
        self._repeat_command(packets)
        try:
            self._on_wait()
        except VehicleError:
            if not self._is_restoring:
                raise

    # ---- commands of a person

    def land(self, words: str) -> None:
        """Command the vehicle to land at once, in any state. Raises VehicleError if it cannot be commanded."""
        self._quarantine.requested, self.has_stopped = requested("Land", words), bool(self.has_stopped)
        self._repeated = RepeatedCommand(self._radio, Action.LAND)

    def motors_off(self, words: str) -> None:
        """Stop the motors at once, at any height. A vehicle that may have been in the air, or that does not confirm it,
        is only observed from then on."""
        self._quarantine.requested, self.has_stopped = requested("Motors off", words), None
        self._repeated = RepeatedCommand(self._radio, Action.KILL)
        if not self._is_flying and not self._radio.is_disarmed:
            self._doubt_stop("The vehicle was not known to be on the ground: inspect it before it flies again.")

    def _doubt_stop(self, why: str) -> None:
        self._quarantine.requested = f"{self._quarantine.requested} {why}"
        self._observe(self._quarantine.why if self._quarantine.is_active else "")

    def _repeat_command(self, packets: list[PacketReceived]) -> None:
        if (repeated := self._repeated) is None:
            return
        try:
            repeated.proceed(packets)
        except LinkError:
            raise
        except VehicleError as error:  # its flight plan is not known
            self._quarantine.requested, self._repeated = str(error), None
        if self.has_stopped is None and not self._is_flying and repeated.action is Action.KILL and repeated.is_over:
            self.has_stopped = repeated.has_stopped
            if not repeated.has_stopped:
                self._doubt_stop(f"The vehicle has not confirmed within {STOPPING_S:g} s that its motors stopped.")

    def _observe(self, why: str) -> None:
        self._quarantine.begin(State.OBSERVE, why)
        self._gains.staged = None

    def _is_silent(self) -> bool:
        """Whether a vehicle that was left in the air gets no heartbeats of a ground station, so that the failsafe that
        its preflight checks have read back lands it: until Land is repeated, it is down, or somebody decides."""
        repeated = self._repeated
        return self._was_flying and (repeated is None or (repeated.is_withheld and not repeated.is_over))
