"""What is to befall one trial, drawn from a seed: consecutive seeds go through every mishap in every state."""

import random
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import Final

from bench.hazards.stages import Stage

ABORT: Final = "abort"
"""The operator's."""
MOTORS_OFF: Final = "motors-off"
"""The operator's separate act: at once, at any height."""
OTHER_LANDING: Final = "other-landing"
"""Another ground station tells the vehicle to land."""
OTHER_MODE: Final = "other-mode"
"""Another ground station switches the vehicle to a mode that nobody here asked for."""
WILD_GAINS: Final = "wild-gains"
"""The gains of this trial are bad: the vehicle does not stay inside its limits."""
MOCAP: Final = ("mocap-lost", "mocap-frozen", "mocap-drift")
"""Of a second source of altitude, which only trials with one of these have."""
MISHAPS: Final = (
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
    *MOCAP,
    ABORT,
    MOTORS_OFF,
    OTHER_LANDING,
    OTHER_MODE,
    WILD_GAINS,
)
"""The simulated drone's faults, and what only we can do."""
_ACTS: Final = frozenset({ABORT, MOTORS_OFF, OTHER_LANDING, OTHER_MODE, WILD_GAINS})
"""They have no end."""
CELLS: Final = tuple(product(MISHAPS, Stage))

FOR_GOOD_S: Final = float("inf")

SAFE: Final[Mapping[str, Mapping[str, float]]] = {
    "paparazzi": {"kp": 300, "ki": 15, "kd": 90},
    "ardupilot": {"PSC_POSZ_P": 1.1, "PSC_VELZ_P": 5.5, "PSC_ACCZ_P": 0.45, "PSC_ACCZ_D": 0.001, "PSC_ACCZ_I": 0.9},
    "px4": {"MPC_Z_P": 1.1, "MPC_Z_VEL_P_ACC": 4.4, "MPC_Z_VEL_D_ACC": 0.01, "MPC_Z_VEL_I_ACC": 1.8},
}
"""Not one of them is what the autopilot holds after its start."""
TUNED: Final[Mapping[str, Mapping[str, float]]] = {
    "paparazzi": {"kp": 1600, "ki": 1023, "kd": 127},
    "ardupilot": {"PSC_POSZ_P": 1.5, "PSC_VELZ_P": 5.0, "PSC_ACCZ_P": 0.37, "PSC_ACCZ_D": 0.002, "PSC_ACCZ_I": 1.1},
    "px4": {"MPC_Z_P": 1.2, "MPC_Z_VEL_P_ACC": 6.1, "MPC_Z_VEL_D_ACC": 0.02, "MPC_Z_VEL_I_ACC": 1.7},
}
_WILD: Final = ({"kp": 250, "ki": 2000, "kd": 0}, {"kp": 100, "ki": 300, "kd": 10}, {"kp": 4000, "ki": 2000, "kd": 20})
_SPREAD: Final = 0.05

_DELAYS_S: Final[Mapping[Stage, float]] = {
    Stage.CONNECT: 0.2,
    Stage.PREFLIGHT: 0.04,
    Stage.SET_GAINS: 6.0,
    Stage.ARM: 1.6,
    Stage.TAKEOFF: 0.6,
    Stage.RECORD: 28.0,
    Stage.LAND: 8.0,
    Stage.ABORT_LAND: 6.0,
    Stage.LINK_LOST: 5.0,
    Stage.DISARM: 0.25,
    Stage.RESTORE: 0.15,
}
"""The latest onset after the beginning of each state."""
_EARLY_S: Final = 6.0


@dataclass(frozen=True, slots=True)
class Mishap:
    """Sets in `delay_s` after the trial has first reached `stage`, and is over `duration_s` later."""

    kind: str
    stage: Stage
    delay_s: float
    duration_s: float = FOR_GOOD_S


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One trial and its mishaps, the one that it is about first. `warm_s`: how long the drone is on before it is
    connected to; `waits_s`: how long its gains are staged before it flies; `pinned`: whether its system is named."""

    seed: int
    autopilot: str
    mishaps: tuple[Mishap, ...]
    gains: Mapping[str, float]
    warm_s: float
    waits_s: float
    pinned: bool

    @property
    def has_second_source(self) -> bool:
        return any(each.kind.startswith("mocap") for each in self.mishaps)

    @property
    def safe(self) -> Mapping[str, float]:
        return SAFE[self.autopilot]


def draw(seed: int) -> Case:
    """The case of a seed."""
    chance = random.Random(seed)
    kind, stage = CELLS[seed % len(CELLS)]
    autopilot = "paparazzi" if kind == WILD_GAINS else chance.choices(list(SAFE), (7, 2, 2))[0]
    first = Mishap(kind, stage, _delay_s(chance, stage), _duration_s(chance, kind))
    if kind == WILD_GAINS:
        first = Mishap(kind, Stage.CONNECT, 0.0)
    mishaps = (first, *_companions(chance, first.stage))
    return Case(
        seed=seed,
        autopilot=autopilot,
        mishaps=mishaps,
        gains=_gains(chance, autopilot, wild=any(each.kind == WILD_GAINS for each in mishaps)),
        warm_s=chance.uniform(4.0, 6.0),
        waits_s=chance.choice((0.0, chance.uniform(0.0, 8.0))),
        pinned=chance.random() < 0.5,
    )


def _companions(chance: random.Random, stage: Stage) -> tuple[Mishap, ...]:
    """What leads the trial into a state that it does not reach by itself, and sometimes one more mishap."""
    match stage:
        case Stage.LINK_LOST:
            kind = chance.choice(("link-lost", "wrong-system"))
            return (Mishap(kind, Stage.RECORD, chance.uniform(0.3, _EARLY_S), chance.uniform(5.0, 30.0)),)
        case Stage.ABORT_LAND:
            return (_ender(chance),)
        case Stage.DISARM | Stage.RESTORE if chance.random() < 0.6:
            return (_ender(chance),)
        case _ if chance.random() < 0.3:
            other = chance.choice([each for each in MISHAPS if each != WILD_GAINS])
            where = chance.choice(list(Stage))
            return (Mishap(other, where, _delay_s(chance, where), _duration_s(chance, other)),)
        case _:
            return ()


def _ender(chance: random.Random) -> Mishap:
    return Mishap(chance.choice((ABORT, "low-battery")), Stage.RECORD, chance.uniform(0.3, _EARLY_S))


def _delay_s(chance: random.Random, stage: Stage) -> float:
    most_s = _DELAYS_S[stage]
    return chance.uniform(0.0, min(most_s, _EARLY_S) if chance.random() < 0.5 else most_s)


def _duration_s(chance: random.Random, kind: str) -> float:
    if kind in _ACTS:
        return FOR_GOOD_S
    how = chance.random()
    if how < 0.3:
        return FOR_GOOD_S
    return chance.uniform(0.1, 1.5) if how < 0.6 else chance.uniform(1.5, 15.0)


def _gains(chance: random.Random, autopilot: str, *, wild: bool) -> dict[str, float]:
    return dict(chance.choice(_WILD)) if wild else tuned_gains(chance, autopilot)


def tuned_gains(chance: random.Random, autopilot: str) -> dict[str, float]:
    """Gains that fly well, scattered so that none is another's."""
    scattered = {name: value * chance.uniform(1 - _SPREAD, 1 + _SPREAD) for name, value in TUNED[autopilot].items()}
    return {name: round(value) if autopilot == "paparazzi" else round(value, 5) for name, value in scattered.items()}
