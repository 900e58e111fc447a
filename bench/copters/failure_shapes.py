"""Cases of each failure shape, and healthy ones, of varied vehicles, weather and targets, as the logs that they leave.

What is true of a flight comes from the simulation alone: the damping of its modes, its integral at lift-off, its
weight, gusts, vibration, and the error of its estimate.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from app.autopilots.ardupilot.replica import parameters as ardupilot
from app.core.analysis.loop import LoggedFlight
from app.core.analysis.segment import Segment
from app.core.analysis.shapes import FailureShape
from app.core.records.trajectory import Samples
from bench.copters import px4_simulation, simulation
from bench.copters.failing_flights import (
    ARMED_S,
    DEMANDED,
    INTEGRAL,
    STEP_S,
    THROTTLE,
    TRUE_Z,
    Z_D,
    A,
    Autopilot,
    Flight,
    Flown,
    Jump,
    V,
    Z,
    ardupilot_parameters,
    fly,
    px4_parameters,
    slowest_damped,
)
from tests.logs.written import GUIDED, NOT_LANDED, ardupilot_log
from tests.logs.written import PARAMETERS as ARDUPILOT_PARAMETERS
from tests.logs.written_px4 import FLIGHT, HOLD, PARAMETERS, RAMP_UP, READY, TAKEOFF, px4_log

_LIFTED_M: Final = 0.1
_CRASHED_M: Final = 0.3
_LEAST_AIRBORNE_S: Final = 15.0
_NOISES_M_S2: Final[Mapping[Autopilot, float]] = {"ardupilot": 0.3, "px4": 1.0}
"""Largest of a sound vehicle: PX4 logs its acceleration without ArduCopter's filter."""
_MOST_ASSUMED: Final[Mapping[Autopilot, float]] = {"ardupilot": 0.6875, "px4": 0.8}
_ATTEMPTS: Final = 400


@dataclass(frozen=True)
class Case:
    """A flight, and how it was flown."""

    flight: Flight
    flown: Flown

    @property
    def steps(self) -> Samples:
        return self.flown.steps

    @property
    def step_s(self) -> float:
        return STEP_S[self.flight.autopilot]

    @cached_property
    def lift_off_s(self) -> float | None:
        """When it leaves the ground, if it begins there."""
        lifted = np.flatnonzero(self.steps[:, TRUE_Z] > _LIFTED_M)
        return None if self.flight.held_down_s is None else self.step_s * float(lifted[0] if lifted.size else np.inf)

    @property
    def crashed(self) -> bool:
        """Whether it touched the ground, or hardly left it."""
        lift_off_s = self.lift_off_s or 0.0
        airborne = self.steps[round((min(lift_off_s, 1e3) + 3.0) / self.step_s) :, TRUE_Z]
        return airborne.size * self.step_s < _LEAST_AIRBORNE_S or bool(np.min(airborne) < _CRASHED_M)

    @cached_property
    def rows(self) -> Samples:
        """The steps that are logged, some time later than they should be, shape (m, 9), and before them their time."""
        every = round(self.flight.row_s / self.step_s)
        places = np.arange(0, len(self.steps) - every, every)
        places = places + np.random.default_rng(self.flight.seed).integers(0, max(every // 8, 1), len(places))
        return np.column_stack([self.step_s * places, self.steps[places]])

    @cached_property
    def truth(self) -> dict[str, float]:
        """What is true of the flight, by names that end in units."""
        steps, since = self.steps, 0 if self.lift_off_s is None else round(self.lift_off_s / self.step_s)
        flown = steps[since:]
        mode = slowest_damped(self.flight)
        period = max(round(1.0 / max(mode[1], 0.1) / self.step_s), 1)
        swing_m = flown[:, TRUE_Z] - np.convolve(flown[:, TRUE_Z], np.full(period, 1.0 / period), "same")
        above_m = flown[:, TRUE_Z] - flown[:, Z_D]
        early = slice(0, round(10.0 / self.step_s))
        rising = np.gradient(flown[:, Z_D], self.step_s) > 0.05
        held = _longest(rising & (flown[:, THROTTLE] > 0.999)) * self.step_s
        jump = self.flight.jump
        return {
            "damping": mode[0],
            "swing_m": float(np.sqrt(2.0) * swing_m[period:-period].std()),
            "integral_m_s2": 0.0 if self.lift_off_s is None else float(flown[0, INTEGRAL]),
            "overshoot_m": 0.0 if self.lift_off_s is None else float(above_m[early].max()),
            "hover_error": abs(self.flight.copter.assumed_hover_throttle / self.flight.copter.hover_throttle - 1.0),
            "at_limit_s": held,
            "short_m": self._short_m if held > LEVELS[FailureShape.SATURATED_CLIMB]["at_limit_s"][1] else 0.0,
            "jump_m": 0.0 if jump is None else abs(jump.by_m),
            "vibration_m_s2": float(self.flown.noise_m_s2.std()),
            "gust_m_s2": float(self.flown.gust_m_s2.std()),
        }

    @property
    def _short_m(self) -> float:
        """How much higher it would be at most with motors of twice the thrust."""
        hover = 0.5 * self.flight.copter.hover_throttle
        copter = replace(self.flight.copter, hover_throttle=hover, assumed_hover_throttle=hover)
        return float(np.max(fly(replace(self.flight, copter=copter)).steps[:, TRUE_Z] - self.steps[:, TRUE_Z]))

    def shows(self, shape: FailureShape) -> bool | None:
        """Whether it has a shape; None if it has some of it."""
        values = [(self.truth[name], *levels) for name, levels in LEVELS[shape].items()]
        if all((value - present) * (present - absent) >= 0.0 for value, present, absent in values):
            return True
        return False if any((value - absent) * (present - absent) <= 0.0 for value, present, absent in values) else None

    @property
    def content(self) -> bytes:
        """The flight as the vehicle's own log."""
        return _FILES[self.flight.autopilot](self)


LEVELS: Final[Mapping[FailureShape, Mapping[str, tuple[float, float]]]] = {
    FailureShape.RINGING: {"damping": (0.04, 0.1), "swing_m": (0.06, 0.02)},
    FailureShape.WINDUP: {"integral_m_s2": (0.8, 0.4), "overshoot_m": (0.3, 0.15)},
    FailureShape.HOVER_THROTTLE: {"hover_error": (0.15, 0.07)},
    FailureShape.SATURATED_CLIMB: {"at_limit_s": (1.0, 0.5), "short_m": (0.5, 0.2)},
    FailureShape.ESTIMATOR_JUMP: {"jump_m": (0.5, 0.0)},
    FailureShape.VIBRATION: {"vibration_m_s2": (2.0, 1.1)},
    FailureShape.WIND: {"gust_m_s2": (0.8, 0.4)},
}
"""A flight has a shape where all of these are beyond the first level, and has not where one is on the other side of the
second; between both it is not counted."""


def case_of(shape: FailureShape | None, number: int, seed: int) -> Case:
    """A flight with a shape, or with none of them: the first of those drawn of which this is true. It may have others
    beside, which its truth tells."""
    place = 0 if shape is None else 1 + list(FailureShape).index(shape)
    random = np.random.default_rng((seed, place, number))
    for _ in range(_ATTEMPTS):
        flight = _healthy(random)
        flight = flight if shape is None else _CAUSES[shape](flight, random)
        case = Case(flight, fly(flight))
        if not case.crashed and (not any(map(case.shows, FailureShape)) if shape is None else case.shows(shape)):
            return case
    raise AssertionError(f"no flight shows {shape}")


def _healthy(random: np.random.Generator) -> Flight:
    autopilot: Autopilot = ("ardupilot", "px4")[random.integers(2)]
    sample = simulation.sample if autopilot == "ardupilot" else px4_simulation.sample_px4
    copter = sample(random)
    copter = replace(
        copter,
        assumed_hover_throttle=copter.hover_throttle * float(random.uniform(0.94, 1.06)),
        sag=float(random.uniform(0.0, 0.02)),
        gust_m_s2=float(random.uniform(0.03, 0.3)),
        noise_m_s2=float(random.uniform(0.02, _NOISES_M_S2[autopilot])),
    )
    takes_off = bool(random.integers(2))
    targets, at_s = [], 0.0
    altitude_m = float(random.uniform(4.0, 9.0))
    for _ in range(random.integers(4, 8)):
        targets.append((at_s, altitude_m))
        at_s += float(random.uniform(5.0, 11.0)) + 6.0 * (takes_off and not targets[1:])
        change_m = float(random.uniform(0.5, 3.0))
        altitude_m += change_m if altitude_m - change_m < 3.0 or random.integers(2) else -change_m
    return Flight(
        autopilot=autopilot,
        copter=copter,
        seed=int(random.integers(2**31)),
        targets=tuple(targets),
        lasts_s=at_s,
        climb_m_s=float(random.uniform(1.0, 3.0)),
        gains={name: float(random.uniform(0.75, 1.2)) for name in _GAINS[autopilot]},
        held_down_s=0.0 if takes_off else None,
        row_s=(0.1, 0.1, 0.04)[random.integers(3)],
    )


_GAINS: Final[Mapping[Autopilot, tuple[str, ...]]] = {
    "ardupilot": ("PSC_POSZ_P", "PSC_VELZ_P", "PSC_ACCZ_P", "PSC_ACCZ_I"),
    "px4": ("MPC_Z_P", "MPC_Z_VEL_P_ACC", "MPC_Z_VEL_I_ACC"),
}


def _rings(flight: Flight, random: np.random.Generator) -> Flight:
    """Gains too high for the lag, or an integral too large beside them."""
    gains = {name: float(np.exp(random.uniform(np.log(0.5), np.log(5.0)))) for name in flight.gains}
    return replace(flight, gains=gains, copter=replace(flight.copter, motor_lag_s=float(random.uniform(0.05, 0.2))))


def _winds_up(flight: Flight, random: np.random.Generator) -> Flight:
    """The ground holds the vehicle, and its integral takes long to fall."""
    (_, first_m), *others = flight.targets
    late_s = 8.0 if flight.held_down_s is None else 0.0
    targets = ((0.0, first_m), *((at_s + late_s, altitude_m) for at_s, altitude_m in others))
    integral = list(flight.gains)[-1]
    return replace(
        flight,
        targets=targets,
        lasts_s=flight.lasts_s + late_s,
        held_down_s=float(random.uniform(0.5, 2.5)),
        gains={**flight.gains, integral: float(random.uniform(0.2, 1.0))},
    )


def _hovers_otherwise(flight: Flight, random: np.random.Generator) -> Flight:
    error = float(random.uniform(0.16, 0.5)) * (1 if random.integers(2) else -1)
    assumed = float(np.clip(flight.copter.hover_throttle * (1.0 + error), 0.125, _MOST_ASSUMED[flight.autopilot]))
    return replace(flight, copter=replace(flight.copter, assumed_hover_throttle=assumed))


def _lacks_thrust(flight: Flight, random: np.random.Generator) -> Flight:
    """A heavy vehicle, an empty battery, drag, and a climb rate that it does not reach."""
    hover = float(random.uniform(0.6, 0.92))
    copter = replace(
        flight.copter,
        hover_throttle=hover,
        assumed_hover_throttle=min(hover * float(random.uniform(0.95, 1.02)), _MOST_ASSUMED[flight.autopilot]),
        quadratic=float(random.uniform(-0.3, 0.3)),
        drag_1_s=float(random.uniform(0.2, 1.0)),
        drag_1_m=float(random.uniform(0.0, 0.3)),
    )
    (_, altitude_m), *others = flight.targets
    place, climb_m = int(random.integers(len(others))), float(random.uniform(6.0, 15.0))
    climbs = [(at_s, target_m + climb_m * (number >= place)) for number, (at_s, target_m) in enumerate(others)]
    targets = ((0.0, altitude_m), *climbs)
    return replace(flight, copter=copter, targets=targets, climb_m_s=float(random.uniform(2.5, 6.0)))


def _jumps(flight: Flight, random: np.random.Generator) -> Flight:
    sign, size_m = (1 if random.integers(2) else -1), float(np.exp(random.uniform(np.log(0.55), np.log(5.0))))
    jump = Jump(
        at_s=float(random.uniform(0.45, 0.9)) * flight.lasts_s,
        by_m=sign * size_m,
        by_m_s=float(random.uniform(-1.0, 1.0)),
        moves_reference=not random.integers(4),
    )
    raised = tuple((at_s, altitude_m + 6.0) for at_s, altitude_m in flight.targets)
    return replace(flight, jump=jump, targets=raised)


def _vibrates(flight: Flight, random: np.random.Generator) -> Flight:
    amplitude_m_s2 = float(random.uniform(25.0, 140.0))
    return replace(flight, vibration_m_s2=amplitude_m_s2, vibration_hz=float(random.uniform(45.0, 250.0)))


def _flies_in_wind(flight: Flight, random: np.random.Generator) -> Flight:
    gust_s = float(np.exp(random.uniform(np.log(0.5), np.log(4.0))))
    return replace(flight, copter=replace(flight.copter, gust_m_s2=float(random.uniform(0.8, 2.2)), gust_s=gust_s))


_CAUSES: Final[Mapping[FailureShape, Callable[[Flight, np.random.Generator], Flight]]] = {
    FailureShape.RINGING: _rings,
    FailureShape.WINDUP: _winds_up,
    FailureShape.HOVER_THROTTLE: _hovers_otherwise,
    FailureShape.SATURATED_CLIMB: _lacks_thrust,
    FailureShape.ESTIMATOR_JUMP: _jumps,
    FailureShape.VIBRATION: _vibrates,
    FailureShape.WIND: _flies_in_wind,
}


def _longest(rows: NDArray[np.bool_]) -> int:
    """Length of the longest run of these rows."""
    edges = np.flatnonzero(np.diff(rows.astype(np.int8), prepend=0, append=0))
    return int(np.max(edges[1::2] - edges[::2], initial=0))


def _log_of_ardupilot(case: Case) -> bytes:
    lifted_s = 0.0 if case.lift_off_s is None else case.lift_off_s
    return ardupilot_log(
        _logged(case),
        begin_s=0.0,
        events=((lifted_s, NOT_LANDED),),
        modes=((0.0, GUIDED),),
        parameters={**ARDUPILOT_PARAMETERS, **ardupilot_parameters(case.flight).named},
    )


def _log_of_px4(case: Case) -> bytes:
    named = {**PARAMETERS, **px4_parameters(case.flight).named}
    if (lifted_s := case.lift_off_s) is None:
        return px4_log(_logged(case), parameters=named)
    states = ((0.0, READY), (ARMED_S, RAMP_UP), (lifted_s + 1.0, FLIGHT))
    return px4_log(
        _logged(case),
        parameters=named,
        modes=((0.0, TAKEOFF), (lifted_s + 4.0, HOLD)),
        takeoff=states,
        landed=((0.0, True), (lifted_s, False)),
    )


def _logged(case: Case) -> LoggedFlight:
    """Its rows, as far as the writers of logs take them."""
    time_s, rows = case.rows[:, 0], case.rows[:, 1:]
    rates = np.gradient(rows[:, Z_D], time_s)
    segment = Segment(
        time_s=time_s,
        z_m=rows[:, Z],
        v_m_s=rows[:, V],
        a_m_s2=rows[:, A],
        z_d_m=rows[:, Z_D],
        v_d_m_s=rates,
        a_d_m_s2=np.gradient(rates, time_s),
        v_t_m_s=rates,
        throttle=rows[:, DEMANDED],
        throttle_filtered=rows[:, THROTTLE],
        assumed_hover=np.full(len(rows), case.flight.copter.assumed_hover_throttle),
    )
    return LoggedFlight(loop=simulation.loop_of(ardupilot.Parameters()), segments=[segment])


_FILES: Final[Mapping[Autopilot, Callable[[Case], bytes]]] = {"ardupilot": _log_of_ardupilot, "px4": _log_of_px4}
