"""What is data in ArduPilot and PX4: modes, parameters, rates, words."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from app.vehicles.mavlink.dialects import Dialect
from app.vehicles.simdrone.autopilots.copter.parameters import Coding, Parameter


class Behaviour(Enum):
    """What a flight mode makes the vehicle do."""

    STAY = "where it is"
    TAKE_OFF = "to the height of takeoff, once armed"
    LAND = "down"


class Reaction(Enum):
    """What a failsafe does."""

    NONE = "nothing"
    WARN = "say so"
    HOLD = "stay where it is"
    LAND = "come down"


@dataclass(frozen=True, slots=True)
class FlightMode:
    """A mode: its number in HEARTBEAT.custom_mode, the bits that go with it, and what it does."""

    name: str
    custom_mode: int
    base_mode: int
    behaviour: Behaviour = Behaviour.STAY
    may_arm: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class FirmwareProfile:
    """What is data in an autopilot. `modes` holds every mode, the first being that after the start, and those that the
    services need by name; `refused` is the result of a refusal, `texts` what is said with one."""

    dialect: Dialect
    autopilot: int
    version: int
    parameters: tuple[Parameter, ...]
    coding: Coding
    periods_s: Mapping[str, float]
    """Of the messages that it sends unasked."""
    streams: tuple[str, ...]
    """Those that REQUEST_DATA_STREAM asks for; none where it is not heeded."""
    modes: tuple[FlightMode, ...]
    land: str
    hold: str
    by_hand: str
    """A pilot's."""
    automatic: str
    """The one that a pilot switches back to."""
    refused: int
    unready: str
    """Says, every now and then, why it would not arm; the reason follows."""
    no_estimate: str
    not_armable: str
    not_landed: str
    link_lost: str
    fence_breached: str
    ground_m: float
    """Height of the place of takeoff in the local frame."""
