"""Common parts of the simulated vehicles: gain limits, flight sequence and record, pacing of simulated time, seeded
disturbances, aborts.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Final, Protocol

import numpy as np

from app.autopilots.autopilot import require_accepted
from app.core.clock import REAL_TIME, Clock
from app.core.control.vertical_guidance import (
    ALT,
    CLIMB,
    INT32_MAX,
    INT32_MIN,
    POSITION_BITS,
    RATE_HZ,
    SPEED_BITS,
    STEP_S,
    THROTTLE,
    fix,
)
from app.core.errors import Problem
from app.core.experiments.takeoff import SET_POINTS, WINDOW_S
from app.core.formatting import percent
from app.core.models.set_points import SetPoints
from app.core.policy import Gains, shortened
from app.core.records.trajectory import Trajectory
from app.vehicles.base import (
    RECORDED_BEYOND_S,
    FlightOptions,
    FlightRecord,
    OptionValue,
    Sample,
    ShouldStop,
    VehicleError,
)
from app.vehicles.flight_end import Failure, FlightEnd, StopRequest, withdrawn_by
from app.vehicles.kernels import (
    ALTITUDE,
    CHANNELS,
    COMMAND_SIZE,
    KD,
    KI,
    KP,
    MODE,
    SET_POINT,
    TARGET,
    Integers,
    Rows,
    correlate,
)
from app.vehicles.kinds import Options

CANNOT_HOLD: Final = "The vehicle cannot hold these gains."


LISTEN_EVERY_S: Final = 0.02
"""Longest interval between two calls of `should_stop` in a paced flight."""


class Pacer:
    """Limit vehicle time to `speed` times the clock's time, a positive number; None does not limit it.

    Time is counted from the start, so that a computation that fell behind catches up.
    """

    def __init__(self, speed: float | None, clock: Clock = REAL_TIME) -> None:
        self._speed = speed
        self._clock = clock
        self._start_s = clock.now_s()

    def wait_until(self, vehicle_time_s: float, should_stop: ShouldStop) -> StopRequest | None:
        """Wait until `vehicle_time_s` seconds of the flight may have passed; return a stop request as soon as it comes.

        `should_stop` is called at least once, every 20 ms of the clock, and a last time at the end of the wait.
        """
        while True:
            early_s = 0.0
            if self._speed is not None:
                early_s = self._start_s + vehicle_time_s / self._speed - self._clock.now_s()
            if early_s > 0.0:
                self._clock.wait_s(min(early_s, LISTEN_EVERY_S))
            if (stop := should_stop()) is not None:
                return stop
            if early_s <= LISTEN_EVERY_S:
                return None


GAIN_NAMES: Final = ("kp", "ki", "kd")
FLIGHT_S: Final = WINDOW_S + RECORDED_BEYOND_S
"""Time recorded after the command for the default window, 33 s."""
TELEMETRY_HZ: Final = 50
HIGHEST_HOVER: Final = 0.95
"""Share of full thrust up to which a vehicle that hovers with it can be controlled."""
_WATCHED: Final = ("altitude_m", "climb_rate_m_s", "set_point_m", "reference_m", "thrust", "battery_v")

_LANDING_RATE_M_S: Final = 0.5
_LANDING_S: Final = 30.0
_LANDED_M: Final = 0.02
_LANDING_SLICE: Final = RATE_HZ // 4

STEPS: Final = round(FLIGHT_S * RATE_HZ) + 1
MAX_STEPS: Final = STEPS + round(_LANDING_S * RATE_HZ)
"""Steps of the longest flight with the default window: aborted at the last instant, then landed."""


class Simulation(Protocol):
    """One flight of a simulated vehicle, resting on the ground and commanded to take off at step 0."""

    def advance(self, steps: int, command: Integers) -> Rows:
        """Fly `steps` steps of 1/512 s under the autopilot's `command`; return one row of `CHANNELS` for each, shape
        (steps, 8), with the measurements at the beginning of the step and the resulting thrust."""


Launch = Callable[[dict[str, float], int], Simulation]
"""Begins a flight of a vehicle with its options and a seed."""


class StagedVehicle(ABC):
    """A simulated vehicle that starts every flight anew, with its gains between the flights; `accept` completes and
    checks them, `settings` describe the vehicle in its records."""

    is_real: Final = False

    def __init__(
        self,
        kind: str,
        safe_gains: Gains,
        settings: Mapping[str, OptionValue],
        accept: Callable[[Gains], dict[str, float]],
    ) -> None:
        self.kind: Final = kind
        self._settings = dict(settings)
        self.safe_gains: Final[Gains] = accept(safe_gains)
        self._accept = accept
        self._held: dict[str, float] = dict(self.safe_gains)
        self._staged = False

    def stage(self, gains: Gains) -> dict[str, float]:
        """Write every gain and return the gains now held. Raises GainsError, and changes nothing, for a value that the
        controller cannot hold."""
        self._held = self._accept(gains)
        self._staged = True
        return self.read_gains()

    def read_gains(self) -> dict[str, float]:
        """Return the gains that the vehicle holds now."""
        return dict(self._held)

    def close(self) -> None:  # noqa: B027
        """Do nothing: no resource is open between flights."""

    def fly(
        self, order: FlightOptions, *, on_sample: Callable[[Sample], None], should_stop: ShouldStop
    ) -> FlightRecord:
        """Fly with the staged gains, with simulated time limited to the order's speed.

        `should_stop` is called every 20 ms, of vehicle time or of wall time, whichever comes first; only a stop ends
        the flight early. Afterwards the vehicle holds its safe gains. Raises VehicleError if no gains were staged or
        the simulation diverged.
        """
        if not self._staged:
            raise VehicleError(
                "No gains were staged for this flight, so it was not started.",
                hint="Stage the gains, check the read-back, then fly.",
            )
        try:
            trajectory, stop, has_flown = self._flown(order, on_sample, should_stop)
        finally:
            self._restore()
        end = FlightEnd() if stop is None else FlightEnd(failure=Failure.OPERATOR, request=stop)
        return FlightRecord(
            trajectory=trajectory,
            ending="completed" if stop is None else "aborted",
            end=end if stop is None or has_flown else withdrawn_by(stop),
            settings=self._settings,
        )

    @abstractmethod
    def _flown(
        self, order: FlightOptions, on_sample: Callable[[Sample], None], should_stop: ShouldStop
    ) -> tuple[Trajectory, StopRequest | None, bool]:
        """Fly; return the record, the stop request that ended the flight if any, and whether anything was flown."""

    def _restore(self) -> None:
        self._held = dict(self.safe_gains)
        self._staged = False


class SimulatedVehicle(StagedVehicle):
    """Simulated vehicle that holds the loop's three integer gains and starts every flight from rest on the ground.

    A stop ends the flight there: the safe gains are set and the vehicle descends at 0.5 m/s. The record includes the
    descent, whose set point is the ground; one that never rose above `_LANDED_M` has not flown.
    """

    def __init__(self, kind: str, safe_gains: Gains, settings: Options, launch: Launch) -> None:
        super().__init__(kind, safe_gains, settings, _counts)
        self._launch = launch

    def _flown(
        self, order: FlightOptions, on_sample: Callable[[Sample], None], should_stop: ShouldStop
    ) -> tuple[Trajectory, StopRequest | None, bool]:
        numbers = {name: float(value) for name, value in self._settings.items()}
        simulation = self._launch(numbers, order.seed)
        rows: list[Rows] = []
        stop = self._take_off(simulation, rows, order, on_sample, should_stop)
        self._restore()
        if stop is not None and rows:
            rows.extend(self._land(simulation, rows[-1]))
        elif stop is not None:  # before the first step: a single instant on the ground
            rows.append(_flown(simulation, 1, _command(THROTTLE, 0, self._held), 0.0))
        flown = np.concatenate(rows)
        return trajectory_of(flown, self.kind), stop, bool(flown[:, ALTITUDE].max() > _LANDED_M)

    def _take_off(
        self,
        simulation: Simulation,
        rows: list[Rows],
        order: FlightOptions,
        on_sample: Callable[[Sample], None],
        should_stop: ShouldStop,
    ) -> StopRequest | None:
        """Fill `rows` until the manoeuvre is over; return the stop request that ended it early, if any."""
        pacer, targets = Pacer(order.speed, order.clock), order.set_points.targets
        for first, last in _slices(order.record_s, order.set_points):
            if (stop := pacer.wait_until(first * STEP_S, should_stop)) is not None:
                return stop
            command = _command(ALT, int(targets[min(first, len(targets) - 1)]), self._held)
            set_point_m = float(order.set_points.at(np.array([first * STEP_S]))[0])
            rows.append(_flown(simulation, last - first, command, set_point_m))
            on_sample(_sample(first, rows[-1][0]))
        return None

    def _land(self, simulation: Simulation, last: Rows) -> Iterator[Rows]:
        """Descend until the vehicle stands on the ground, for at most 30 s, without pacing."""
        command = _command(CLIMB, fix(-_LANDING_RATE_M_S, SPEED_BITS), self._held)
        for _ in range(round(_LANDING_S * RATE_HZ) // _LANDING_SLICE):
            if last[-1, ALTITUDE] <= _LANDED_M:
                return
            last = _flown(simulation, _LANDING_SLICE, command, 0.0)
            yield last


def opener(kind: str, launch: Launch) -> Callable[[Options, Gains, Path | None], SimulatedVehicle]:
    """The function that opens a vehicle of this kind."""
    return lambda options, safe_gains, _trial_parameters: SimulatedVehicle(kind, safe_gains, options, launch)


def refuse_hover(option: str, share: float, reason: str) -> tuple[Problem, ...]:
    """Refuse an option with which hovering needs more than `HIGHEST_HOVER`; `reason` has a place for the `share` that
    it needs."""
    if share <= HIGHEST_HOVER:
        return ()
    limit = f"and control is possible up to {percent(HIGHEST_HOVER)}"
    return (Problem(option, f"{reason.format(percent(share))}, {limit}"),)


def simulate_flight(
    simulation: Simulation, gains: Gains, set_points: SetPoints = SET_POINTS, steps: int = STEPS
) -> Rows:
    """Simulate one flight, by default a takeoff, in one call per set point, with the same result as through the vehicle
    interface; shape (`steps`, 8).

    For the twin a takeoff takes 1.5 ms instead of 30. Gains are 32-bit integers and are not checked. A flight that
    diverges numerically has non-finite altitudes.
    """
    rows = []
    edges = [*set_points.steps, steps]
    for first, last, altitude_m in zip(edges, edges[1:], set_points.altitudes_m, strict=False):
        rows.append(simulation.advance(last - first, _command(ALT, fix(altitude_m, POSITION_BITS), gains)))
        rows[-1][:, SET_POINT] = altitude_m
    return np.concatenate(rows)


def trajectory_of(rows: Rows, kind: str) -> Trajectory:
    """The record of a simulated flight: one row of `CHANNELS` every 1/512 s."""
    time_s = np.arange(len(rows), dtype=np.float64) * STEP_S
    channels = {name: np.ascontiguousarray(rows[:, i]) for i, name in enumerate(CHANNELS)}
    return Trajectory(time_s, channels, kind, "simulation")


def _command(mode: int, target: int, gains: Gains) -> Integers:
    command = np.empty(COMMAND_SIZE, dtype=np.int64)
    command[[MODE, TARGET, KP, KI, KD]] = (mode, target, *(int(gains[name]) for name in GAIN_NAMES))
    return command


def _slices(record_s: float, set_points: SetPoints) -> Iterator[tuple[int, int]]:
    """First and past-last step of each 20 ms, and of what lies before and after a set point within them; the last slice
    ends with the instant at which the record does."""
    every_20_ms = {round(i * RATE_HZ / TELEMETRY_HZ) for i in range(int(record_s * TELEMETRY_HZ) + 1)}
    edges = sorted(every_20_ms | set(set_points.steps))
    return zip(edges, [*edges[1:], round(record_s * RATE_HZ) + 1], strict=True)


def _flown(simulation: Simulation, steps: int, command: Integers, set_point_m: float) -> Rows:
    rows = simulation.advance(steps, command)
    rows[:, SET_POINT] = set_point_m
    if not np.isfinite(rows).all():
        raise VehicleError(
            "The simulation diverged: the vehicle's state is no longer finite.",
            hint="The vehicle is unstable with these gains or options. Choose less aggressive ones.",
        )
    return rows


def _sample(step: int, row: Rows) -> Sample:
    values = dict(zip(CHANNELS, row.tolist(), strict=True))
    return Sample(step * STEP_S, {name: values[name] for name in _WATCHED})


def _counts(gains: Gains) -> dict[str, float]:
    require_accepted(gains, dict.fromkeys(GAIN_NAMES, _refusal), CANNOT_HOLD, " as whole numbers of counts")
    return {name: int(gains[name]) for name in GAIN_NAMES}


def _refusal(value: float) -> str | None:
    if not INT32_MIN <= value <= INT32_MAX:
        return f"must fit in 32 bits, got {shortened(value)}"
    return None if value == int(value) else f"must be a whole number of counts, got {value:g}"


def streams(seed: int, count: int) -> list[np.random.Generator]:
    """Return `count` independent random generators for one flight."""
    return [np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(count)]


def gusts(generator: np.random.Generator, steps: int, *, sd: float, correlation_s: float) -> Rows:
    """Return Gauss-Markov gusts at 512 Hz, shape (steps,), in the unit of the standard deviation."""
    if sd == 0.0:
        return np.zeros(steps)
    series = generator.standard_normal(steps)
    correlate(series, correlation_s)
    series *= sd
    return series
