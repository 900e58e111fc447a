"""Flights as releases of ArduCopter of all times could have logged them: those that the real binary of 4.7 flew, and
steps under the altitude loop of releases 3.3 to 4.0, written down here from its description and not from the replica.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import cache
from typing import Final, Self

import numpy as np

from app.core.models.copter import accelerometer_filter
from app.core.records.trajectory import Samples
from app.logs.base import numbers
from app.logs.boots import CLOCK
from app.logs.dataflash import read_tables
from bench.copters.simulation import SimulatedCopter, move, packed, weather_of
from tests.logs.recorded import recorded

STEP_S: Final = 1 / 400
_ROW_EVERY: Final = 40
G_M_S2: Final = 9.80665
GUIDED, ALT_HOLD = 4, 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """What a log holds of a flight, up, at its rows, shape (n,) each; and the modes and events in it, s. `gains` are
    those of the loop by the names of releases 4.0 to 4.6."""

    time_s: Samples
    z_m: Samples
    v_m_s: Samples
    a_m_s2: Samples
    z_d_m: Samples
    v_d_m_s: Samples
    v_t_m_s: Samples
    a_d_m_s2: Samples
    a_t_m_s2: Samples
    throttle: Samples
    throttle_filtered: Samples
    hover: Samples
    modes: tuple[tuple[float, int], ...]
    events: tuple[tuple[float, int], ...]
    gains: Mapping[str, float]

    def between(self, begin_s: float, end_s: float) -> Self:
        """A part of it, with all its modes and events."""
        rows = (self.time_s >= begin_s) & (self.time_s < end_s)
        signals = (each.name for each in fields(self) if isinstance(getattr(self, each.name), np.ndarray))
        return replace(self, **{name: getattr(self, name)[rows] for name in signals})

    @property
    def error_m(self) -> float:
        """Mean deviation."""
        return float(np.abs(self.z_d_m - self.z_m).mean())


DEFAULTS: Final[Mapping[str, float]] = {
    "PSC_POSZ_P": 1.0,
    "PSC_VELZ_P": 5.0,
    "PSC_ACCZ_P": 0.5,
    "PSC_ACCZ_I": 1.0,
    "PSC_ACCZ_FLTE": 20.0,
}


@cache
def flown(name: str) -> Motion:
    """A flight of the real binary of 4.7."""
    tables = read_tables(recorded(f"{name}.bin"), {"PSCD", "CTUN", "MODE", "EV"}).tables
    loop, tuning = tables["PSCD"], tables["CTUN"]
    time_s, tuned_s = (numbers(each[CLOCK]) / 1e6 for each in (loop, tuning))
    down = {
        "z_m": "PD", "v_m_s": "VD", "a_m_s2": "AD", "z_d_m": "DPD", "v_d_m_s": "DVD", "v_t_m_s": "TVD",
        "a_d_m_s2": "DAD", "a_t_m_s2": "TAD",
    }  # fmt: skip
    throttles = {"throttle": "ThI", "throttle_filtered": "ThO", "hover": "ThH"}

    def timed(message: str, column: str) -> tuple[tuple[float, int], ...]:
        table = tables[message]
        return tuple(zip((numbers(table[CLOCK]) / 1e6).tolist(), table[column].tolist(), strict=True))

    return Motion(
        time_s=time_s,
        **{each: -numbers(loop[column]) for each, column in down.items()},
        **{each: np.interp(time_s, tuned_s, numbers(tuning[column])) for each, column in throttles.items()},
        modes=timed("MODE", "ModeNum"),
        events=timed("EV", "Id"),
        gains=DEFAULTS,
    )


COPTER: Final = SimulatedCopter(
    hover_throttle=0.42, assumed_hover_throttle=0.4, quadratic=0.373, motor_lag_s=0.06, dead_time_s=0.0, drag_1_s=0.3,
    drag_1_m=0.0, sag=0.0, gust_m_s2=0.2, noise_m_s2=0.03, wander_m_s=0.0, wander_m=0.0,
)  # fmt: skip
"""The simulated vehicle; its acceleration is logged behind the firmware's two-pole filter of 20 Hz."""
TRUTH: Final = {
    name: getattr(COPTER.linear, name) for name in ("hover_throttle", "thrust_slope", "motor_lag_s", "drag_1_s")
}
OLDER: Final[Mapping[str, float]] = {
    **DEFAULTS,
    "PSC_POSZ_P": 1.5,
    "PSC_VELZ_P": 4.0,
    "PSC_ACCZ_P": 0.4,
    "PSC_ACCZ_I": 0.8,
}
_BEGINS_S: Final = (8.0, 15.0)


def _profile(times_s: Samples, begins_s: tuple[float, float]) -> Samples:
    """Climb rates of a target that goes up 2 m from one time on, and down again from another, with 1 m/s²."""
    rate = np.zeros_like(times_s)
    for begin_s, sign in zip(begins_s, (1.0, -1.0), strict=True):
        since = times_s - begin_s
        rate += sign * np.clip(np.minimum(since, 3.0 - since), 0.0, 1.0)
    return rate


@cache
def older_steps(
    *,
    feeds_rate: bool = True,
    bias_m_s: float = 0.0,
    gains: tuple[tuple[str, float], ...] = (),
    copter: SimulatedCopter = COPTER,
    begins_s: tuple[float, float] = _BEGINS_S,
    seed: int = 7,
) -> Motion:
    """Steps of 2 m under the loop of releases 3.3 to 4.0 with these gains instead of `OLDER`, flying at 5 m from the
    beginning: the acceleration is demanded from the change of the climb rate target. Position targets of GUIDED move
    without a desired climb rate, the pilot's in ALT_HOLD with one, which `feeds_rate`. The estimated climb rate may
    have a bias."""
    g = {**OLDER, **dict(gains)}
    p_z, p_v, p_a, i_a, filter_hz = g.values()
    times_s = np.arange(0.0, 24.0, STEP_S)
    rates = _profile(times_s, begins_s)
    weather = weather_of(copter, seed, len(times_s), STEP_S)
    (b0, b1, b2), (_, a1, a2) = (each.tolist() for each in accelerometer_filter(20.0, STEP_S))
    k_v, k_a, k_u = (STEP_S / (STEP_S + 1.0 / (2.0 * np.pi * hz)) for hz in (4.0, filter_hz, 2.0))
    h, assumed, constants = copter.hover_throttle, copter.assumed_hover_throttle, packed(copter, STEP_S)
    late = [h] * round(copter.dead_time_s / STEP_S)
    moving = np.array([h, 5.0, 0.0])
    z_d, error_v, error_a, v_t = 5.0, 0.0, 0.0, bias_m_s
    demanded = sent = h
    total = 1000.0 * (h - assumed)
    sensed = memory_1 = memory_2 = 0.0
    rows = []
    for step, at_s in enumerate(times_s.tolist()):
        gust, noise, error_of_v, error_of_z = weather[step].tolist()
        z_d += rates[step] * STEP_S
        v_d = rates[step] if feeds_rate else 0.0
        z, estimated, measured = moving[1] + error_of_z, moving[2] + error_of_v + bias_m_s, sensed + noise
        error = z_d - z
        linear = 1.0 / p_z**2
        before = v_t
        v_t = p_z * error if abs(error) <= linear else np.sign(error) * np.sqrt(2.0 * (abs(error) - linear / 2.0))
        v_t += v_d
        change = (v_t - before) / STEP_S if step else 0.0
        error_v += k_v * (v_t - estimated - error_v)
        a_t = change + p_v * error_v
        error_a += k_a * (100.0 * (a_t - measured) - error_a)
        total += i_a * error_a * STEP_S
        sent += k_u * (demanded - sent)
        if step % _ROW_EVERY == 0:
            rows.append((at_s, z, estimated, measured, z_d, v_d, v_t, a_t, demanded, sent))
        demanded = assumed + (p_a * error_a + total) / 1000.0
        late.append(sent)
        a = move(moving, constants, late.pop(0), at_s, gust, STEP_S)
        sensed = b0 * a + memory_1
        memory_1, memory_2 = b1 * a - a1 * sensed + memory_2, b2 * a - a2 * sensed
    at, z_, v_, a_, z_d_, v_d_, v_t_, a_t_, throttle, filtered = np.array(rows).T
    return Motion(
        time_s=at + 20.0,
        z_m=z_,
        v_m_s=v_,
        a_m_s2=a_,
        z_d_m=z_d_,
        v_d_m_s=v_d_,
        a_d_m_s2=np.gradient(v_d_, at),
        v_t_m_s=v_t_,
        a_t_m_s2=a_t_,
        throttle=throttle,
        throttle_filtered=filtered,
        hover=np.full(len(at), assumed),
        modes=((10.0, ALT_HOLD if feeds_rate else GUIDED),),
        events=((10.0, 10), (12.0, 28), (50.0, 18)),
        gains=g,
    ).between(24.0, 44.0)
