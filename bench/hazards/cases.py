"""Random cases: the faults to inject into one trial. Consecutive seeds cover every fault in every state of a trial."""

import random
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import Final

from app.core.experiments.takeoff import WINDOW_S
from bench.hazards.trial_states import State

ABORT: Final = "abort"
"""An abort by the operator."""
MOTORS_OFF: Final = "motors-off"
"""Motors off by the operator: at once, at any height."""
OTHER_LANDING: Final = "other-landing"
"""Another ground station commands the vehicle to land."""
OTHER_MODE: Final = "other-mode"
"""Another ground station changes the mode of the vehicle."""
OTHER_TARGET: Final = "other-target"
"""Another ground station commands another set point."""
OTHER_GAIN: Final = "other-gain"
"""Another ground station writes a gain."""
STALL: Final = "stall"
"""Gainline's process stands still."""
TAKEN_OVER: Final = "taken-over"
"""A pilot switches to a manual mode, and back at the end."""
WILD_GAINS: Final = "wild-gains"
"""The trial's gains are so bad that the vehicle exceeds its limits."""
MOCAP: Final = ("mocap-lost", "mocap-frozen", "mocap-drift")
"""Faults of the second source of altitude, which only trials with one of these faults have."""
FOREIGN_KILL: Final = "foreign-kill"
"""Another ground station stops the motors."""
FLIES_HOME: Final = "flies-home"
"""The vehicle flies home by itself."""
FALSE_ALTITUDES: Final = ("stuck-altitude", "drifting-altitude", "creeping-altitude")
"""Faults in which the vehicle's altitude and climb rate are wrong, and agree with each other."""
LEAN_OSCILLATION: Final = "lean-oscillation"
"""The vehicle's attitude oscillates."""
FAULT_KINDS: Final = (
    "no-heartbeat",
    "param-unconfirmed",
    "arm-refused",
    "no-lift-off",
    "link-lost",
    "frozen-position",
    "jumping-position",
    "low-battery",
    "reboot",
    "duplicated-packets",
    "reordered-packets",
    "wrong-system",
    "silent-witness",
    FOREIGN_KILL,
    FLIES_HOME,
    *FALSE_ALTITUDES,
    LEAN_OSCILLATION,
    *MOCAP,
    ABORT,
    MOTORS_OFF,
    OTHER_LANDING,
    OTHER_MODE,
    OTHER_TARGET,
    OTHER_GAIN,
    STALL,
    TAKEN_OVER,
    WILD_GAINS,
)
"""Faults of the simulated drone, and those that only the bench can cause."""
_ACTS: Final = frozenset(
    {ABORT, MOTORS_OFF, OTHER_LANDING, OTHER_MODE, OTHER_TARGET, OTHER_GAIN, WILD_GAINS, FOREIGN_KILL}
)
"""Faults without a duration."""
CELLS: Final = tuple(product(FAULT_KINDS, State))

FOR_GOOD_S: Final = float("inf")

SAFE: Final[Mapping[str, Mapping[str, float]]] = {
    "paparazzi": {"kp": 300, "ki": 15, "kd": 90},
    "ardupilot": {"PSC_POSZ_P": 1.1, "PSC_VELZ_P": 5.5, "PSC_ACCZ_P": 0.45, "PSC_ACCZ_D": 0.001, "PSC_ACCZ_I": 0.9},
    "px4": {"MPC_Z_P": 1.1, "MPC_Z_VEL_P_ACC": 4.4, "MPC_Z_VEL_D_ACC": 0.01, "MPC_Z_VEL_I_ACC": 1.8},
}
"""Safe gains; each differs from the autopilot's default."""
TUNED: Final[Mapping[str, Mapping[str, float]]] = {
    "paparazzi": {"kp": 1600, "ki": 1023, "kd": 127},
    "ardupilot": {"PSC_POSZ_P": 1.5, "PSC_VELZ_P": 5.0, "PSC_ACCZ_P": 0.37, "PSC_ACCZ_D": 0.002, "PSC_ACCZ_I": 1.1},
    "px4": {"MPC_Z_P": 1.2, "MPC_Z_VEL_P_ACC": 6.1, "MPC_Z_VEL_D_ACC": 0.02, "MPC_Z_VEL_I_ACC": 1.7},
}
_WILD: Final = ({"kp": 250, "ki": 2000, "kd": 0}, {"kp": 100, "ki": 300, "kd": 10}, {"kp": 4000, "ki": 2000, "kd": 20})
_SPREAD: Final = 0.05
_STEPS_EVERY: Final = 12

_DELAYS_S: Final[Mapping[State, float]] = {
    State.CONNECT: 0.2,
    State.PREFLIGHT: 0.04,
    State.SET_GAINS: 6.0,
    State.ARM: 1.6,
    State.TAKEOFF: 0.6,
    State.RECORD: 28.0,
    State.LAND: 8.0,
    State.ABORT_LAND: 6.0,
    State.LINK_LOST: 5.0,
    State.DISARM: 0.25,
    State.RESTORE: 0.15,
}
"""Largest delay of a fault after the beginning of each state."""
_EARLY_S: Final = 6.0
_LONGEST_STALL_S: Final = 3.0


@dataclass(frozen=True, slots=True)
class PlannedFault:
    """A fault to inject `delay_s` after the trial first reaches `state`; it ends `duration_s` later."""

    kind: str
    state: State
    delay_s: float
    duration_s: float = FOR_GOOD_S


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One trial and its faults; the first is the one under test.

    `powered_s` is how long the drone has been on before the connection, `staged_s` how long its gains are staged before
    the takeoff, `pinned` whether the connection names the drone's system id, `window_s` the scored time of the flight.
    """

    seed: int
    autopilot: str
    faults: tuple[PlannedFault, ...]
    gains: Mapping[str, float]
    powered_s: float
    staged_s: float
    pinned: bool
    window_s: float = WINDOW_S

    @property
    def has_second_source(self) -> bool:
        return any(each.kind.startswith("mocap") for each in self.faults)

    @property
    def flies_steps(self) -> bool:
        """Whether it flies altitude steps after its takeoff, as every second block of seeds does."""
        is_wild = any(each.kind == WILD_GAINS for each in self.faults)
        return not is_wild and self.seed // _STEPS_EVERY % 2 == 0

    @property
    def safe(self) -> Mapping[str, float]:
        return SAFE[self.autopilot]


def draw(seed: int) -> Case:
    """Return the case of a seed."""
    chance = random.Random(seed)
    kind, state = CELLS[seed % len(CELLS)]
    autopilot = "paparazzi" if kind == WILD_GAINS else chance.choices(list(SAFE), (7, 2, 2))[0]
    first = PlannedFault(kind, state, _delay_s(chance, state), _duration_s(chance, kind))
    if kind == WILD_GAINS:
        first = PlannedFault(kind, State.CONNECT, 0.0)
    further = _further_faults(chance, first.state)  # the end of a drift also ends another one
    faults = (first, *(each for each in further if each.kind not in MOCAP or each.kind != kind))
    return Case(
        seed=seed,
        autopilot=autopilot,
        faults=faults,
        gains=_gains(chance, autopilot, wild=any(each.kind == WILD_GAINS for each in faults)),
        powered_s=chance.uniform(14.0, 16.0),
        staged_s=chance.choice((0.0, chance.uniform(0.0, 8.0))),
        pinned=chance.random() < 0.5,
    )


def _further_faults(chance: random.Random, state: State) -> tuple[PlannedFault, ...]:
    """Return the faults that bring about a state that is not reached without a fault; sometimes one more fault."""
    match state:
        case State.LINK_LOST:
            kind = chance.choice(("link-lost", "wrong-system"))
            return (PlannedFault(kind, State.RECORD, chance.uniform(0.3, _EARLY_S), chance.uniform(5.0, 30.0)),)
        case State.ABORT_LAND:
            return (_early_end(chance),)
        case State.DISARM | State.RESTORE if chance.random() < 0.6:
            return (_early_end(chance),)
        case _ if chance.random() < 0.3:
            other = chance.choice([each for each in FAULT_KINDS if each != WILD_GAINS])
            where = chance.choice(list(State))
            return (PlannedFault(other, where, _delay_s(chance, where), _duration_s(chance, other)),)
        case _:
            return ()


def _early_end(chance: random.Random) -> PlannedFault:
    return PlannedFault(chance.choice((ABORT, "low-battery")), State.RECORD, chance.uniform(0.3, _EARLY_S))


def _delay_s(chance: random.Random, state: State) -> float:
    most_s = _DELAYS_S[state]
    return chance.uniform(0.0, min(most_s, _EARLY_S) if chance.random() < 0.5 else most_s)


def _duration_s(chance: random.Random, kind: str) -> float:
    if kind in _ACTS:
        return FOR_GOOD_S
    if kind == STALL:
        return chance.uniform(0.1, _LONGEST_STALL_S)
    how = chance.random()
    if how < 0.3:
        return FOR_GOOD_S
    return chance.uniform(0.1, 1.5) if how < 0.6 else chance.uniform(1.5, 15.0)


def _gains(chance: random.Random, autopilot: str, *, wild: bool) -> dict[str, float]:
    return dict(chance.choice(_WILD)) if wild else tuned_gains(chance, autopilot)


def tuned_gains(chance: random.Random, autopilot: str) -> dict[str, float]:
    """Return gains that fly well, with random variation so that no two cases have the same."""
    scattered = {name: value * chance.uniform(1 - _SPREAD, 1 + _SPREAD) for name, value in TUNED[autopilot].items()}
    return {name: round(value) if autopilot == "paparazzi" else round(value, 5) for name, value in scattered.items()}
