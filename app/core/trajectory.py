"""Trajectories: the samples of a flight or a model run."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

Samples = NDArray[np.float64]

CHANNEL_UNITS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "altitude_m": "m",
        "altitude_2_m": "m",
        "altitude_m_lower": "m",
        "altitude_m_upper": "m",
        "climb_rate_m_s": "m/s",
        "set_point_m": "m",
        "reference_m": "m",
        "thrust": "1",
        "feed_forward": "1",
        "feedback": "1",
        "battery_v": "V",
        "pitch_error_rad": "rad",
        "pitch_error_rad_lower": "rad",
        "pitch_error_rad_upper": "rad",
        "pitch_reference_rad": "rad",
        "pitch_rad": "rad",
        "pitch_rate_rad_s": "rad/s",
        "angle_of_attack_rad": "rad",
        "altitude_change_m": "m",
        "speed_change_m_s": "m/s",
        "thrust_change_n": "N",
        "elevator_rad": "rad",
    }
)
"""Known channels and their units.

Thrust and its two parts are shares of full command (the autopilot's 9600 counts). Those of an aircraft in flight (angle
of attack, altitude and speed change, pitch, thrust change, elevator) are deviations from trimmed flight.
"""


@dataclass(frozen=True, slots=True)
class Trajectory:
    """Samples of one flight, altitude up, time in seconds since the command (earlier samples are negative).

    `time_s` has shape (n,) and increases strictly; every channel has shape (n,). `source` names what measured it
    (`jsbsim`, `twin`, `csv`, …), `clock` the origin of the time stamps (`simulation`, `vehicle`, `ground`).
    """

    time_s: Samples
    channels: Mapping[str, Samples]
    source: str
    clock: str

    def __getitem__(self, channel: str) -> Samples:
        return self.channels[channel]

    def __len__(self) -> int:
        return len(self.time_s)

    def as_stored(self) -> "Trajectory":
        """The trajectory as the database returns it: every number rounded to single precision."""
        return Trajectory(
            _single(self.time_s),
            {name: _single(values) for name, values in self.channels.items()},
            self.source,
            self.clock,
        )


def _single(values: Samples) -> Samples:
    return values.astype(np.float32).astype(np.float64)
