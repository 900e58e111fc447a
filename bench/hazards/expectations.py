"""What each hazard may do to a trial, as docs/real-flight.md has it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product
from typing import Final

from bench.hazards.cases import ABORT
from bench.hazards.hostility import GAPS_S, SHIFTS_M, TWINS_S, UNREAL, UPLINKS_S
from bench.hazards.stages import AIR, Stage


@dataclass(frozen=True, slots=True, kw_only=True)
class Expected:
    """`told`: the reason of a trial that is not completed has one of these words. `ends`: the states from which on, for
    good, it is not borne; `aborts`: it may be taken for the gains' fault; `quarantines`: it may leave doubt about the
    vehicle."""

    told: tuple[str, ...] = ()
    ends: tuple[Stage, ...] = ()
    aborts: bool = False
    quarantines: bool = False


HARMLESS: Final = Expected()
LEADS: Final[Mapping[str, str]] = {ABORT: "the operator's abort", "link-lost": "link was lost"}
"""What leads a trial into a state that it does not reach by itself, and how it is told then."""

_NOT_LANDED: Final = "It has not landed within 40 s"
_NO_POSITION: Final = ("froze", "stood still", "position was lost", "Position: ", "Vehicle clock: ")
_DOUBLED: Final = ("Two vehicles use", "System id: ")
_MOVED: Final = "Standing still: "
_NO_GAINS: Final = ("did not confirm", "could not be verified", "it holds", "failsafe", "Motors off: ", "Gains: ")
_BY_HAND: Final = (
    "took over manual control",
    "may have flown",
    "entered mode",
    "did not arm",
    "did not lift off",
)

_BLIND: Final = Expected(told=(*_NO_POSITION, _NOT_LANDED), ends=AIR, quarantines=True)
_UNVERIFIED: Final = Expected(told=_NO_GAINS, quarantines=True)
_TWINS: Final = Expected(told=(*_DOUBLED, *_NO_POSITION, _MOVED), ends=AIR, quarantines=True)
_LOST: Final = ("link was lost", "Heartbeat: ", "No heartbeat")
_MISPLACED: Final = Expected(
    told=(*_NO_POSITION, _MOVED, _NOT_LANDED, "did not lift off", "before it had climbed"),
    ends=AIR,
    aborts=True,
    quarantines=True,
)
_SLOWER: Final = Expected(
    told=(*_NO_POSITION, *_LOST, *_NO_GAINS, *_DOUBLED, "could not be set up", "did not arm"),
    ends=AIR,
    quarantines=True,
)
_UPLINK: Final = Expected(
    told=(*_BY_HAND, *_NO_GAINS, "could not be set up", "not confirmed within"), aborts=True, quarantines=True
)
_UNSEEN: Final = Expected(told=("second source of altitude", "Second source of altitude: "), ends=AIR)
_ONCE: Final = Expected(told=(_MOVED, "Vehicle clock: "))
_SHIFTED: Final = Expected(told=(_MOVED, _NOT_LANDED), quarantines=True)
_PILOT: Final = Expected(told=_BY_HAND, ends=AIR, aborts=True, quarantines=True)

EXPECTED: Final[Mapping[str, Expected]] = {
    **{f"{name} {value}": _BLIND for name, value in product(("x", "y", "z", "vz"), UNREAL)},
    **{f"{name} {value}": HARMLESS for name, value in product(("vx", "vy"), UNREAL)},
    **dict.fromkeys(("parameters nan", "parameters wrong", "no PARAM_VALUE"), _UNVERIFIED),
    **dict.fromkeys(("companion", "companion as autopilot", "copies at once"), HARMLESS),
    **{f"twin {older_s:g} s older": _TWINS for older_s in TWINS_S},
    "flying twin": replace(_TWINS, told=(*_TWINS.told, "The vehicle is armed")),
    "replaced after 1.3 s": Expected(
        told=(*_LOST, *_NO_GAINS, *_NO_POSITION, *_DOUBLED, *_BY_HAND), ends=AIR, quarantines=True
    ),
    **{f"on the ground after {gap_s:g} s": _MISPLACED for gap_s in GAPS_S},
    **dict.fromkeys(("later and later, to 1 s", "later and later, to 2 s"), _SLOWER),
    **dict.fromkeys(UPLINKS_S, _UPLINK),
    "late by 0.4 s": Expected(told=(*_DOUBLED, *_NO_POSITION)),
    "late by 2 s": Expected(told=(*_DOUBLED, *_NO_POSITION), ends=AIR, quarantines=True),
    "copies after 2 s": Expected(told=(*_DOUBLED, *_NO_POSITION), quarantines=True),
    **dict.fromkeys(("an hour ahead", "reboot once", "ground once", "ceiling once"), _ONCE),
    "ground every second": Expected(told=("samples had to be dropped", _MOVED), ends=AIR),
    **dict.fromkeys(("disarmed once", "disarmed every second", "by hand once"), HARMLESS),
    "no HEARTBEAT": Expected(
        told=("link was lost", "Heartbeat: ", "No heartbeat", "did not arm", "not confirmed within"),
        ends=AIR,
        quarantines=True,
    ),
    "no LOCAL_POSITION_NED": _BLIND,
    "no SYS_STATUS": Expected(told=("No battery voltage", "no voltage reported"), ends=AIR),
    "no COMMAND_ACK": Expected(told=("could not be set up", "did not arm", "did not lift off", "Motors off: ")),
    "no EXTENDED_SYS_STATE": HARMLESS,
    **{f"altitude {by_m:+g} m": _SHIFTED for by_m in SHIFTS_M},
    **dict.fromkeys(("mocap nan", "mocap frozen", "mocap silent"), _UNSEEN),
    "mocap 1 m higher": Expected(told=("sources of altitude disagree", _NOT_LANDED), ends=AIR, quarantines=True),
    "pilot": _PILOT,
    "pilot for 1 s": replace(_PILOT, ends=()),
    "pilot for 3 s": _PILOT,
    "deaf": Expected(
        told=("not confirmed within", "began to land by itself", "did not lift off", "did not arm", *_NO_GAINS),
        aborts=True,
        quarantines=True,
    ),
    "carried away": Expected(told=("away from its start", "began to land by itself"), ends=AIR, aborts=True),
}
"""By the hazard's name: there is one for each."""
