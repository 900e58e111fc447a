"""The hazards of a trial: how each is caused, where it applies, and which consequences docs/real-flight.md permits."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import product
from typing import Final, Protocol

from app.autopilots.dialects import number
from app.simdrone.drone import BOOT_S
from bench.hazards.cases import ABORT, FOR_GOOD_S, SAFE
from bench.hazards.hostile_links import (
    FIELDS,
    POSITION,
    SIGHTING,
    ChangedMessages,
    DelayedPackets,
    DuplicateVehicle,
    FrozenMessages,
    GrowingDelay,
    HazardFactory,
    LostPackets,
    ReplacedVehicle,
    a_number,
    companion,
    false_heartbeat,
    false_position,
    higher,
    on_ground,
    silence,
    stamped,
    twin,
    wrapping_after,
)
from bench.hazards.trial_states import AIR, State

UNREAL: Final = (math.nan, math.inf, -math.inf)
ALL: Final = frozenset(SAFE)
PAPARAZZI: Final = frozenset({"paparazzi"})
COPTERS: Final = ALL - PAPARAZZI
PX4: Final = frozenset({"px4"})
NOT_SEEN: Final = ""
"""Code of a trial without a failure, whose vehicle is quarantined: its landing, its stop or its gains were not seen."""
PREPARING: Final = (State.CONNECT, State.PREFLIGHT, State.SET_GAINS)
WATCHED: Final = (State.PREFLIGHT, State.ARM, *AIR, State.LAND)
"""States in which the vehicle's position is used."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Expected:
    """Permitted consequences of a hazard.

    `codes` are the failures of docs/real-flight.md that it may cause in a flight; `refuses`: the flight may be refused.
    A permanent hazard that begins in one of the states `ends_in` must end the trial. `aborts`: autopilots under which
    the flight may be aborted, which counts against the gains; `quarantines`: the vehicle may be quarantined; `stays`:
    autopilots that do not land on command.
    """

    codes: frozenset[str] = frozenset()
    refuses: bool = False
    ends_in: tuple[State, ...] = ()
    aborts: frozenset[str] = frozenset()
    quarantines: bool = False
    stays: frozenset[str] = frozenset()


class Disturbed(Protocol):
    """What a hazard can do that changes neither the packets nor the vehicle."""

    def kill_process(self) -> None: ...
    def copy_from_other_port(self) -> None: ...
    def move_to_other_port(self) -> None: ...
    def enter_offboard(self) -> None: ...
    def end_geo_init_early(self) -> None: ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Hazard:
    """One hazard, caused by the `link`, by `faults` of the simulated drone, by everything that the ground sends being
    `late_s` late, or by an `act`.

    It lasts `longest_s` at most. Every hazard is caused for good in each state, and unless it `has_one_length` also for
    a short time in the air. `is_always`: it is already there when the drone is switched on.
    """

    expected: Expected
    link: HazardFactory | None = None
    faults: tuple[str, ...] = ()
    late_s: float = 0.0
    act: Callable[[Disturbed], None] | None = None
    longest_s: float = FOR_GOOD_S
    has_one_length: bool = False
    is_always: bool = False
    states: tuple[State, ...] = tuple(State)
    autopilots: frozenset[str] = ALL


HARMLESS: Final = Expected()
LEADS: Final[Mapping[str, str]] = {ABORT: "F8", "link-lost": "F5"}
"""Faults that bring about a state that is not reached without a fault, and the failure that they are."""


def _may(*codes: str, ends_in: tuple[State, ...] = (), aborts: frozenset[str] = frozenset()) -> Expected:
    """Return the consequences of a hazard after which the flight may be refused and the vehicle quarantined."""
    return Expected(codes=frozenset(codes), refuses=True, ends_in=ends_in, aborts=aborts, quarantines=True)


_BLIND: Final = _may("F9d", NOT_SEEN, ends_in=AIR)
_UNVERIFIED: Final = _may(NOT_SEEN)
_TWINS: Final = _may("F12", "F9d", ends_in=AIR)
_ON_GROUND: Final = _may("F9a", "F9d", "F4a", "F6", "F10b", NOT_SEEN, ends_in=AIR, aborts=ALL)
_DELAYED: Final = _may("F9a", "F9d", "F5", "F12", NOT_SEEN, ends_in=AIR)
_COMMANDS_DELAYED: Final = _may("F10b", "F10c", "F4a", NOT_SEEN, aborts=ALL)
_REFUSED: Final = Expected(refuses=True)
_UNSEEN: Final = Expected(codes=frozenset({"F9a", "F9c"}), refuses=True, ends_in=AIR)
_PILOT: Final = _may("F10a", "F10b", "F10c", "F4a", ends_in=AIR, aborts=ALL)
_DRIFTING: Final = _may("F9a", "F9d", "F6", "F10b", NOT_SEEN, ends_in=AIR, aborts=PAPARAZZI)
_STUCK: Final = _may("F9a", "F9d", NOT_SEEN, ends_in=(State.TAKEOFF,))
_AHEAD: Final = _may("F9a", "F9d")
_BEHIND: Final = _may("F9a", "F9d", "F10b")

_NUMBERS: Final[Mapping[str, Hazard]] = {
    **{
        f"{name} {value}": Hazard(link=a_number(name, value), expected=HARMLESS if name in ("vx", "vy") else _BLIND)
        for name, value in product(FIELDS, UNREAL)
    },
    **{
        f"{name} {value} for 0.3 s": Hazard(
            link=a_number(name, value), expected=HARMLESS, longest_s=0.3, has_one_length=True, states=(*AIR, State.LAND)
        )
        for name, value in (("x", math.inf), ("z", math.nan))
    },
    "parameters nan": Hazard(
        link=lambda forger: ChangedMessages(forger, "PARAM_VALUE", lambda _: {"param_value": math.nan}),
        expected=_UNVERIFIED,
    ),
    "parameters wrong": Hazard(
        link=lambda forger: ChangedMessages(
            forger, "PARAM_VALUE", lambda message: {"param_value": number(message, "param_value") + 1.0}
        ),
        expected=_may("F10c", NOT_SEEN),
    ),
    **{
        f"altitude {by_m:+g} m": Hazard(link=higher(POSITION, by_m), expected=_UNVERIFIED)
        for by_m in (0.1, 0.2, -0.1, -0.2)
    },
}

_SENDERS: Final[Mapping[str, Hazard]] = {
    "companion": Hazard(link=companion(poses=False), expected=HARMLESS),
    "companion as autopilot": Hazard(link=companion(poses=True), expected=HARMLESS),
    **{f"twin {older_s:g} s older": Hazard(link=twin(older_s), expected=_TWINS) for older_s in (0.0, 0.4, 5.0, 3600.0)},
    "flying twin": Hazard(link=lambda forger: DuplicateVehicle(forger, 5.0, flies=True), expected=_TWINS),
    "replaced after 1.3 s": Hazard(
        link=lambda forger: ReplacedVehicle(forger, 1.3),
        expected=_may("F5", "F9d", "F12", "F10a", "F10b", "F10c", NOT_SEEN, ends_in=AIR),
    ),
    **{
        f"on the ground after {gap_s:g} s": Hazard(link=on_ground(gap_s), expected=_ON_GROUND)
        for gap_s in (0.0, 0.3, 0.6, 1.0)
    },
    "reboot once": Hazard(link=false_position(height_m=0.1, every_s=math.inf, boot_s=0.2), expected=_REFUSED),
    "ground once": Hazard(link=false_position(height_m=0.1, every_s=math.inf, ahead_s=0.005), expected=_REFUSED),
    "ground every second": Hazard(
        link=false_position(height_m=0.1, every_s=1.0, ahead_s=0.005), expected=_may("F9b", "F12", ends_in=AIR)
    ),
    "ceiling once": Hazard(link=false_position(height_m=9.0, every_s=math.inf, ahead_s=0.005), expected=_REFUSED),
    "disarmed once": Hazard(link=false_heartbeat(every_s=math.inf), expected=HARMLESS),
    "disarmed every second": Hazard(link=false_heartbeat(every_s=1.0), expected=HARMLESS),
    "by hand once": Hazard(link=false_heartbeat(every_s=math.inf, armed=True, by_hand=True), expected=HARMLESS),
    "copy from another port": Hazard(
        act=lambda rig: rig.copy_from_other_port(), expected=HARMLESS, has_one_length=True
    ),
    "moves to another port": Hazard(
        act=lambda rig: rig.move_to_other_port(),
        expected=_REFUSED,
        has_one_length=True,
    ),
}

_TIMES: Final[Mapping[str, Hazard]] = {
    "later and later, to 1 s": Hazard(link=lambda _: GrowingDelay(0.8, 1.0), expected=_DELAYED),
    "later and later, to 2 s": Hazard(link=lambda _: GrowingDelay(1.5, 2.0), expected=_DELAYED),
    "late by 0.4 s": Hazard(
        link=lambda _: DelayedPackets(0.4, every=3, copies=False),
        expected=Expected(codes=frozenset({"F9d", "F12"}), refuses=True),
    ),
    "late by 2 s": Hazard(
        link=lambda _: DelayedPackets(2.0, every=7, copies=False), expected=_may("F12", "F9a", "F9d")
    ),
    "copies after 2 s": Hazard(link=lambda _: DelayedPackets(2.0, every=2, copies=True), expected=_REFUSED),
    "copies of all after 3 s": Hazard(
        link=lambda _: DelayedPackets(3.0, every=1, copies=True),
        expected=_REFUSED,
        states=tuple(state for state in State if state is not State.CONNECT),
    ),
    "copies of unheard packets": Hazard(  # for 3 s they are those of a second vehicle
        link=lambda _: DelayedPackets(3.0, every=1, copies=True), expected=_TWINS, states=(State.CONNECT,)
    ),
    "copies at once": Hazard(link=lambda _: DelayedPackets(0.0, every=1, copies=True), expected=HARMLESS),
    "an hour ahead": Hazard(link=false_position(height_m=0.1, every_s=1.0, ahead_s=3600.0), expected=_REFUSED),
    **{
        f"one stamp {sign * by_s:+g} s": Hazard(
            link=stamped(sign * by_s, count=1), expected=HARMLESS, has_one_length=True, states=WATCHED
        )
        for by_s, sign in product((0.1, 0.3, 0.5, 1.0, 2.0, 3.0), (1, -1))
    },
    **{
        f"all stamps {sign * by_s:+g} s": Hazard(
            link=stamped(sign * by_s), expected=_AHEAD if sign > 0 else _BEHIND, has_one_length=True, states=WATCHED
        )
        for by_s, sign in product((0.1, 0.3, 0.5, 1.0, 2.0, 3.0), (1, -1))
    },
    **{
        f"clock wraps after {elapsed_s:g} s": Hazard(
            link=wrapping_after(elapsed_s),
            expected=HARMLESS,
            has_one_length=True,
            is_always=True,
            states=(State.CONNECT,),
        )
        for elapsed_s in (16.0, 19.0, 20.3, 30.0, 56.0)
    },
    **{f"commands {late_s:g} s late": Hazard(late_s=late_s, expected=_COMMANDS_DELAYED) for late_s in (0.6, 1.2, 2.0)},
}

_SILENCES: Final[Mapping[str, Hazard]] = {
    "no HEARTBEAT": Hazard(link=silence("HEARTBEAT"), expected=_may("F5", NOT_SEEN, ends_in=AIR)),
    "no LOCAL_POSITION_NED": Hazard(link=silence(POSITION), expected=_may("F9a", "F9d", NOT_SEEN, ends_in=AIR)),
    "no SYS_STATUS": Hazard(
        link=silence("SYS_STATUS"), expected=Expected(codes=frozenset({"F7"}), refuses=True, ends_in=AIR)
    ),
    "no COMMAND_ACK": Hazard(link=silence("COMMAND_ACK"), expected=_may("F4a", "F4b", NOT_SEEN)),
    "no PARAM_VALUE": Hazard(link=silence("PARAM_VALUE"), expected=_UNVERIFIED),
    "no EXTENDED_SYS_STATE": Hazard(link=silence("EXTENDED_SYS_STATE"), expected=_UNVERIFIED, autopilots=COPTERS),
    "no SCRIPT_CURRENT": Hazard(link=silence("SCRIPT_CURRENT"), expected=_UNVERIFIED, autopilots=PAPARAZZI),
    "30 % are lost": Hazard(
        link=lambda forger: LostPackets(0.3, forger.chance),
        expected=_may("F5", "F9b", "F9d", NOT_SEEN, ends_in=(State.CONNECT, State.PREFLIGHT)),
        states=(State.CONNECT, State.PREFLIGHT, State.RECORD, State.LAND),
    ),
}

_SECOND_SOURCE: Final[Mapping[str, Hazard]] = {
    "mocap nan": Hazard(
        link=lambda forger: ChangedMessages(forger, SIGHTING, lambda _: {"z": math.nan}), expected=_UNSEEN
    ),
    "mocap 1 m higher": Hazard(link=higher(SIGHTING, 1.0), expected=_may("F9c", NOT_SEEN, ends_in=AIR)),
    "mocap frozen": Hazard(link=lambda forger: FrozenMessages(forger, SIGHTING), expected=_UNSEEN),
    "mocap silent": Hazard(link=silence(SIGHTING), expected=_UNSEEN),
}

_VEHICLE: Final[Mapping[str, Hazard]] = {
    "pilot": Hazard(faults=("taken-over",), expected=_PILOT),
    "pilot for 1 s": Hazard(faults=("taken-over",), longest_s=1.0, expected=replace(_PILOT, ends_in=())),
    "pilot for 3 s": Hazard(faults=("taken-over",), longest_s=3.0, expected=_PILOT),
    "deaf": Hazard(faults=("deaf",), expected=_may("F11", "F4a", NOT_SEEN, aborts=ALL)),
    "carried away": Hazard(
        faults=("carried-away",), expected=Expected(codes=frozenset({"F6", "F11"}), ends_in=AIR, aborts=ALL)
    ),
    "reboot": Hazard(
        faults=("reboot",), longest_s=BOOT_S, has_one_length=True, expected=_may("F5", "F10b", ends_in=AIR)
    ),
    "foreign kill": Hazard(faults=("foreign-kill",), has_one_length=True, expected=_may("F10b", "F13", ends_in=AIR)),
    "flies home": Hazard(
        faults=("flies-home",), expected=replace(_may("F10b", "F10c", "F11", ends_in=AIR), stays=PAPARAZZI)
    ),
    "drifts by 0.5 m/s": Hazard(faults=("drifting-altitude",), expected=_DRIFTING),
    "drifts by 0.1 m/s": Hazard(faults=("creeping-altitude",), expected=_DRIFTING),
    "drifts by 0.5 m/s unwitnessed": Hazard(
        faults=("drifting-altitude", "silent-witness"), expected=replace(_DRIFTING, aborts=ALL)
    ),
    "stuck altitude": Hazard(faults=("stuck-altitude",), expected=_STUCK),
    "stuck altitude unwitnessed": Hazard(
        faults=("stuck-altitude", "silent-witness"), expected=replace(_STUCK, codes=_STUCK.codes | {"F10b"})
    ),
    "lean oscillation": Hazard(
        faults=("lean-oscillation",),
        expected=Expected(codes=frozenset({"F6"}), refuses=True, ends_in=AIR, aborts=ALL),
    ),
    "drifts on the ground": Hazard(
        faults=("ground-drift",),
        has_one_length=True,
        states=(*PREPARING, State.ARM),
        expected=Expected(codes=frozenset({"F9d"}), refuses=True),
    ),
    "geo init ended early": Hazard(
        act=lambda rig: rig.end_geo_init_early(),
        expected=_REFUSED,
        has_one_length=True,
        states=PREPARING,
        autopilots=PAPARAZZI,
    ),
    "left in OFFBOARD": Hazard(
        act=lambda rig: rig.enter_offboard(),
        expected=HARMLESS,
        has_one_length=True,
        states=(State.CONNECT, State.SET_GAINS),
        autopilots=PX4,
    ),
}

PROCESS_KILLED: Final = "process killed"
HAZARDS: Final[Mapping[str, Hazard]] = {
    **_NUMBERS,
    **_SENDERS,
    **_TIMES,
    **_SILENCES,
    **_SECOND_SOURCE,
    **_VEHICLE,
    PROCESS_KILLED: Hazard(act=lambda rig: rig.kill_process(), expected=_UNVERIFIED, has_one_length=True),
}
"""By name."""
PILOTS: Final = frozenset(name for name, hazard in HAZARDS.items() if "taken-over" in hazard.faults)
