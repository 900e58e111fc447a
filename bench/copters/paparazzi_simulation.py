"""Flights of altitude steps under Paparazzi's vertical loop, recorded as over a link, on vehicles that differ from the
model of the campaign.

Their thrust is a polynomial of the command and falls with the battery, their motors have two lags and a dead time,
their drag has a quadratic part, gusts shake them, and the estimated altitude and climb rate have noise, which the loop
answers. The record has 51 rows a second and no thrust command; every set point takes effect a little later than
commanded, at a time that is known to a row.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from app.core.control.vertical_guidance import (
    ALT,
    FULL_THRUST,
    LEVEL,
    POSITION_BITS,
    RATE_HZ,
    SPEED_BITS,
    STATE_SIZE,
    STEP_S,
    detect_flight,
    measured,
    start,
    step,
)
from app.core.experiments.altitude_steps import AltitudeSteps
from app.core.kernels import kernel
from app.core.models.set_points import SetPoints
from app.core.models.vertical_batch import reference_altitude
from app.core.policy import Gains
from app.core.records.trajectory import Samples, Trajectory
from app.vehicles.simulated import gusts, streams

_BEYOND_S: Final = 0.4
_LATEST_S: Final = 0.2
_ROW_STEPS: Final = 10
_GRAVITY_M_S2: Final = 9.81
_SLOW_S: Final = 1.0 / (2.0 * np.pi * 2.0)
_EXTRA_DELAY_S: Final = 0.03
_FORGOTTEN_1_S: Final = 100.0
"""Modes that decay faster, as those of the steps of a dead time do, do not ring."""
_ALTITUDE_NOISE_S, _CLIMB_NOISE_S = 0.05, 0.03

# Indices of a packed vehicle.
_HOVER, _QUADRATIC, _LAG_GAIN, _SECOND_LAG_GAIN, _DRAG, _DRAG_QUADRATIC, _SAG, _DELAY = range(8)


@dataclass(frozen=True, slots=True, kw_only=True)
class SteppedVehicle:
    """A vehicle and its surroundings: `quadratic` is the share of u² in its thrust, `sag` the thrust lost in 33 s;
    `gust_m_s2`, `noise_m` and `noise_m_s` are standard deviations."""

    hover_throttle: float
    quadratic: float
    motor_lag_s: float
    second_lag_s: float
    dead_time_s: float
    latency_s: float
    drag_1_s: float
    drag_1_m: float
    sag: float
    gust_m_s2: float
    noise_m: float
    noise_m_s: float

    @property
    def packed(self) -> Samples:
        """Constants of a step."""
        lags = (STEP_S / max(lag_s, STEP_S) for lag_s in (self.motor_lag_s, self.second_lag_s))
        delay = round(self.dead_time_s / STEP_S)
        return np.array([self.hover_throttle, self.quadratic, *lags, self.drag_1_s, self.drag_1_m, self.sag, delay])


def sample(random: np.random.Generator) -> SteppedVehicle:
    """Draw a vehicle."""
    draw = random.uniform
    return SteppedVehicle(
        hover_throttle=float(draw(0.5, 0.75)),
        quadratic=float(draw(0.0, 1.0)),
        motor_lag_s=float(draw(0.0, 0.1)),
        second_lag_s=float(draw(0.0, 0.02)),
        dead_time_s=float(draw(0.0, 0.04)),
        latency_s=float(draw(0.0, 0.4)),
        drag_1_s=float(draw(0.0, 0.4)),
        drag_1_m=float(draw(0.0, 0.1)),
        sag=float(draw(0.0, 0.03)),
        gust_m_s2=float(np.exp(draw(np.log(0.03), np.log(0.4)))),
        noise_m=float(draw(0.0, 0.01)),
        noise_m_s=float(draw(0.0, 0.06)),
    )


def fly(steps: AltitudeSteps, vehicle: SteppedVehicle, gains: Gains, seed: int) -> tuple[Trajectory, float]:
    """The stored record of a flight, and its throttle activity over the scored time."""
    weather, altitude, climb, times = streams(seed, 4)
    count = round((steps.window_s + _BEYOND_S) * RATE_HZ)
    time_s: Samples = np.arange(count, dtype=np.float64) * STEP_S
    late_s = times.uniform(0.0, _LATEST_S, len(steps.set_points.times_s) - 1)
    known_s = np.maximum(late_s + times.uniform(-1.0, 1.0, len(late_s)) * _ROW_STEPS * STEP_S, 0.0)
    disturbances = np.column_stack(
        (
            gusts(weather, count, sd=vehicle.gust_m_s2, correlation_s=0.5),
            gusts(altitude, count, sd=vehicle.noise_m, correlation_s=_ALTITUDE_NOISE_S),
            gusts(climb, count, sd=vehicle.noise_m_s, correlation_s=_CLIMB_NOISE_S),
        )
    )
    targets = np.rint(_late(steps.set_points, late_s).at(time_s) * (1 << POSITION_BITS))
    flown = np.zeros((count, 3))
    values = np.array([gains["kp"], gains["ki"], gains["kd"]], dtype=np.int64)
    _fly(
        values,
        vehicle.packed,
        targets.astype(np.int64),
        disturbances,
        round(vehicle.latency_s / STEP_S),
        np.zeros(64),
        flown,
    )
    rows, known = slice(None, None, _ROW_STEPS), _late(steps.set_points, known_s)
    channels = {
        "altitude_m": flown[rows, 0],
        "climb_rate_m_s": flown[rows, 1],
        "set_point_m": known.at(time_s[rows]),
        "reference_m": reference_altitude(known, count)[rows],
    }
    scored = time_s >= steps.scored_from_s
    slow = flown[:, 2] - _fast(flown[:, 2])
    record = Trajectory(time_s[rows], channels, "mavlink", "vehicle").as_stored()
    return record, float(np.std((flown[:, 2] - slow)[scored & (time_s <= steps.window_s)]))


def least_damping(vehicle: SteppedVehicle, gains: Gains, *, factor: float = 1.0, late_s: float = 0.0) -> float:
    """Least damping ratio of the vehicle's linear model in hover, all gains times `factor`, the command `late_s` later:
    written apart from that of the program, in discrete time and with every step of the dead time in the state."""
    hover, share = vehicle.hover_throttle, vehicle.quadratic
    force = (1.0 - share) * hover + share * hover**2
    lift = _GRAVITY_M_S2 * ((1.0 - share) + 2.0 * share * hover) / force
    first, second = vehicle.packed[[_LAG_GAIN, _SECOND_LAG_GAIN]].tolist()
    taps = round((vehicle.dead_time_s + late_s) / STEP_S)
    kp, ki, kd = (factor * gains[name] for name in ("kp", "ki", "kd"))
    matrix = np.zeros((5 + taps, 5 + taps))  # sum of errors, two lags, altitude, climb rate, commands on their way
    command = np.zeros(5 + taps)
    command[[0, 3, 4]] = np.array([ki / 256.0, -2.0 * kp - ki / 256.0, -8.0 * kd]) / FULL_THRUST
    arriving = command if taps == 0 else np.eye(5 + taps)[-1]
    matrix[0, [0, 3]] = 1.0, -1.0
    matrix[1] = first * arriving
    matrix[1, 1] += 1.0 - first
    matrix[2] = second * matrix[1]
    matrix[2, 2] += 1.0 - second
    matrix[3, [3, 4]] = 1.0, STEP_S
    matrix[4] = STEP_S * lift * matrix[2]
    matrix[4, 4] += 1.0 - STEP_S * vehicle.drag_1_s
    if taps:
        matrix[5] = command
        matrix[6:, 5:-1] = np.eye(taps - 1)
    modes = np.linalg.eigvals(matrix)
    poles = np.log(modes[np.abs(modes) > 1e-3]) / STEP_S
    oscillations = poles[(np.abs(poles.imag) > 0.5) & (poles.real > -_FORGOTTEN_1_S)]
    return float(min(-oscillations.real / np.abs(oscillations), default=1.0))


def within_margin(vehicle: SteppedVehicle, gains: Gains) -> float:
    """The same with 30 ms more delay, and 0.7 to twice the gains."""
    return min(least_damping(vehicle, gains, factor=factor, late_s=_EXTRA_DELAY_S) for factor in (0.7, 1.0, 1.4, 2.0))


def _fast(throttle: Samples) -> Samples:
    """The throttle about its own 2 Hz low-pass."""
    fast, slow = np.empty_like(throttle), throttle[0]
    gain = STEP_S / (STEP_S + _SLOW_S)
    for place, value in enumerate(throttle.tolist()):
        slow += gain * (value - slow)
        fast[place] = value - slow
    return fast


def _late(set_points: SetPoints, late_s: Samples) -> SetPoints:
    times_s = np.round((np.array(set_points.times_s[1:]) + late_s) * RATE_HZ) / RATE_HZ
    return replace(set_points, times_s=(0.0, *times_s.tolist()))


@kernel
def _fly(
    gains: np.ndarray,
    vehicle: Samples,
    targets: np.ndarray,
    disturbances: Samples,
    resting: int,
    commands: Samples,
    flown: Samples,
) -> None:
    """Fill `flown`, shape (n, 3): estimated altitude and climb rate, and the commanded throttle."""
    state = np.zeros(STATE_SIZE, dtype=np.int64)
    hover, share = vehicle[_HOVER], vehicle[_QUADRATIC]
    force = (1.0 - share) * hover + share * hover * hover
    altitude, climb, first, second, command = 0.0, 0.0, 0.0, 0.0, 0
    delay, size = int(vehicle[_DELAY]), len(commands)
    for i in range(len(flown)):
        seen, seen_climb = altitude + disturbances[i, 1], climb + disturbances[i, 2]
        flown[i, 0], flown[i, 1] = seen, seen_climb
        z, zd = measured(-seen, POSITION_BITS), measured(-seen_climb, SPEED_BITS)
        if i == resting:
            start(state, z, zd)
        if i >= resting:
            in_flight = detect_flight(state, command)
            command = step(state, ALT, targets[i], gains[0], gains[1], gains[2], z, zd, LEVEL, in_flight)
        flown[i, 2] = command / FULL_THRUST
        commands[i % size] = flown[i, 2]
        arriving = commands[(i - delay) % size] if i >= delay else 0.0
        first += vehicle[_LAG_GAIN] * (arriving - first)
        second += vehicle[_SECOND_LAG_GAIN] * (first - second)
        lift = ((1.0 - share) * second + share * second * second) / force * (1.0 - vehicle[_SAG] * i * STEP_S / 33.0)
        drag = vehicle[_DRAG] * climb + vehicle[_DRAG_QUADRATIC] * climb * abs(climb)
        gust = disturbances[i, 0] if altitude > 0.0 else 0.0
        altitude += climb * STEP_S
        climb += (_GRAVITY_M_S2 * (lift - 1.0) - drag + gust) * STEP_S
        if altitude <= 0.0:
            altitude, climb = 0.0, max(climb, 0.0)
