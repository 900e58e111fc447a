"""Permitted consequences of each hazard, from docs/real-flight.md."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product
from typing import Final

from bench.hazards.cases import ABORT
from bench.hazards.hostile_links import COMMAND_DELAYS_S, GAPS_S, SHIFTS_M, TWINS_S, UNREAL
from bench.hazards.trial_states import AIR, State


@dataclass(frozen=True, slots=True, kw_only=True)
class Expected:
    """Permitted consequences of a hazard.

    The reason of a trial that is not completed must contain one of the texts in `reasons`. A permanent hazard that
    begins in one of the states `ends_in` must end the trial. `may_abort`: the trial may be aborted, which counts
    against the gains; `may_quarantine`: the vehicle may be quarantined.
    """

    reasons: tuple[str, ...] = ()
    ends_in: tuple[State, ...] = ()
    may_abort: bool = False
    may_quarantine: bool = False


HARMLESS: Final = Expected()
LEADS: Final[Mapping[str, str]] = {ABORT: "the operator's abort", "link-lost": "link was lost"}
"""Faults that bring about a state that is not reached without a fault, and the reason given then."""

_NOT_LANDED: Final = "It has not landed within 40 s"
_NO_POSITION: Final = ("froze", "stood still", "position was lost", "Position: ", "Vehicle clock: ")
_DOUBLED: Final = ("Two vehicles use", "System id: ")
_MOVED: Final = "Standing still: "
_NO_GAINS: Final = (
    "did not confirm",
    "could not be verified",
    "it holds",
    "instead of",
    "failsafe",
    "Motors off: ",
    "Gains: ",
)
_BY_HAND: Final = (
    "took manual control",
    "may have been interrupted",
    "entered mode",
    "did not arm",
    "did not lift off",
)

_BLIND: Final = Expected(reasons=(*_NO_POSITION, _NOT_LANDED), ends_in=AIR, may_quarantine=True)
_UNVERIFIED: Final = Expected(reasons=_NO_GAINS, may_quarantine=True)
_TWINS: Final = Expected(reasons=(*_DOUBLED, *_NO_POSITION, _MOVED), ends_in=AIR, may_quarantine=True)
_LOST: Final = ("link was lost", "Heartbeat: ", "No heartbeat")
_ON_GROUND: Final = Expected(
    reasons=(*_NO_POSITION, _MOVED, _NOT_LANDED, "did not lift off", "before it had climbed"),
    ends_in=AIR,
    may_abort=True,
    may_quarantine=True,
)
_DELAYED: Final = Expected(
    reasons=(*_NO_POSITION, *_LOST, *_NO_GAINS, *_DOUBLED, "could not be set up", "did not arm"),
    ends_in=AIR,
    may_quarantine=True,
)
_COMMANDS_DELAYED: Final = Expected(
    reasons=(*_BY_HAND, *_NO_GAINS, "could not be set up", "not confirmed within"), may_abort=True, may_quarantine=True
)
_UNSEEN: Final = Expected(reasons=("second source of altitude", "Second source of altitude: "), ends_in=AIR)
_ONCE: Final = Expected(reasons=(_MOVED, "Vehicle clock: ", "Position: "))
_SHIFTED: Final = Expected(reasons=(_MOVED, _NOT_LANDED), may_quarantine=True)
_PILOT: Final = Expected(reasons=(*_BY_HAND, "(mode Manual, block "), ends_in=AIR, may_abort=True, may_quarantine=True)

EXPECTED: Final[Mapping[str, Expected]] = {
    **{f"{name} {value}": _BLIND for name, value in product(("x", "y", "z", "vz"), UNREAL)},
    **{f"{name} {value}": HARMLESS for name, value in product(("vx", "vy"), UNREAL)},
    **dict.fromkeys(("parameters nan", "parameters wrong", "no PARAM_VALUE"), _UNVERIFIED),
    **dict.fromkeys(("companion", "companion as autopilot", "copies at once"), HARMLESS),
    **{f"twin {older_s:g} s older": _TWINS for older_s in TWINS_S},
    "flying twin": replace(_TWINS, reasons=(*_TWINS.reasons, "The vehicle is armed")),
    "replaced after 1.3 s": Expected(
        reasons=(*_LOST, *_NO_GAINS, *_NO_POSITION, *_DOUBLED, *_BY_HAND), ends_in=AIR, may_quarantine=True
    ),
    **{f"on the ground after {gap_s:g} s": _ON_GROUND for gap_s in GAPS_S},
    **dict.fromkeys(("later and later, to 1 s", "later and later, to 2 s"), _DELAYED),
    **dict.fromkeys(COMMAND_DELAYS_S, _COMMANDS_DELAYED),
    "late by 0.4 s": Expected(reasons=(*_DOUBLED, *_NO_POSITION)),
    "late by 2 s": Expected(reasons=(*_DOUBLED, *_NO_POSITION), ends_in=AIR, may_quarantine=True),
    "copies after 2 s": Expected(reasons=(*_DOUBLED, *_NO_POSITION), may_quarantine=True),
    **dict.fromkeys(("an hour ahead", "reboot once", "ground once", "ceiling once"), _ONCE),
    "ground every second": Expected(
        reasons=("samples had to be dropped", _MOVED, *_DOUBLED), ends_in=AIR, may_quarantine=True
    ),
    **dict.fromkeys(("disarmed once", "disarmed every second", "by hand once"), HARMLESS),
    "no HEARTBEAT": Expected(
        reasons=(*_LOST, "did not arm", "not confirmed within", "heartbeats do not confirm"),
        ends_in=AIR,
        may_quarantine=True,
    ),
    "no LOCAL_POSITION_NED": _BLIND,
    "no SYS_STATUS": Expected(reasons=("No battery voltage", "no voltage reported"), ends_in=AIR),
    "no COMMAND_ACK": Expected(
        reasons=("could not be set up", "did not arm", "did not lift off", "Motors off: "), may_quarantine=True
    ),
    "no EXTENDED_SYS_STATE": HARMLESS,
    **{f"altitude {by_m:+g} m": _SHIFTED for by_m in SHIFTS_M},
    **dict.fromkeys(("mocap nan", "mocap frozen", "mocap silent"), _UNSEEN),
    "mocap 1 m higher": Expected(
        reasons=("sources of altitude disagree", _NOT_LANDED), ends_in=AIR, may_quarantine=True
    ),
    "pilot": _PILOT,
    "pilot for 1 s": replace(_PILOT, ends_in=()),
    "pilot for 3 s": _PILOT,
    "deaf": Expected(
        reasons=("not confirmed within", "began to land by itself", "did not lift off", "did not arm", *_NO_GAINS),
        may_abort=True,
        may_quarantine=True,
    ),
    "carried away": Expected(reasons=("m from its start", "began to land by itself"), ends_in=AIR, may_abort=True),
}
"""By the name of the hazard; every hazard has an entry."""
