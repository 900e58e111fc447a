"""Whether a record from elsewhere shows a flight of its experiment, and as what else it may be read.

A record that shows none may still be one: in another unit, above another datum, with altitude positive down. The
readings that explain it are found by trying them, the fewest at a time.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import product
from typing import Final

import numpy as np

from app.core.errors import TrajectoryError
from app.core.records.metrics import SetPoint, require_scorable
from app.core.records.trajectory import CHANNEL_UNITS, Samples, Trajectory

ALTITUDE: Final = "altitude_m"
AT_REST_S: Final = 1.0
"""Time before the command in which the vehicle must be at rest."""
NEAR_GROUND_M: Final = 0.3
"""Paparazzi's own datum is 0.1 m below where the vehicle stands, and a barometer drifts by as much again."""
LOWEST_SHARE: Final = 0.5
HIGHEST_SHARE: Final = 1.5
"""Heights of a flight, as shares of the commanded one: even a badly tuned loop comes that close."""
_EXPLAINED_SHARE: Final = 0.4
"""A reading explains a record if half of the flight is then within this share of the commanded height."""
_HIGH: Final = 0.9
"""Quantile of the samples that is the height of a flight: a short glitch is higher."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExpectedFlight:
    """What records of an experiment show: the altitude at the set points from `begin_s` to `end_s` (s since the
    command), before that, if it is scored from the command on, the vehicle at rest on the ground."""

    set_point: SetPoint
    begin_s: float
    end_s: float


class Implausible(StrEnum):
    """What a record shows that none of its experiment's flights does."""

    CONSTANT = "constant"
    OFF_GROUND = "off ground"
    MOVING = "moving"
    TOO_LOW = "too low"
    TOO_HIGH = "too high"


_SENTENCES: Final[Mapping[Implausible, str]] = {
    Implausible.CONSTANT: "it has no more altitudes than the flight has set points, the highest {:z.2f} m",
    Implausible.OFF_GROUND: "it begins at {:z.2f} m, not within {:g} m of the ground",
    Implausible.MOVING: "it moves by {:z.2f} m in the second before the command, by more than {:g} m",
    Implausible.TOO_LOW: "it rises by {:z.2f} m, less than {:g} m",
    Implausible.TOO_HIGH: "it is at {:z.2f} m for half of the time, above {:g} m",
}


@dataclass(frozen=True, slots=True)
class Finding:
    """What is implausible, its value and its limit, m."""

    code: Implausible
    value_m: float
    limit_m: float

    @property
    def sentence(self) -> str:
        """The finding as a sentence about the record, its begin in lower case."""
        return _SENTENCES[self.code].format(self.value_m, self.limit_m).replace("-", "−")


class Reading(StrEnum):
    """How a record may be read that does not have seconds, metres, altitude positive up, and its zero at the ground."""

    MILLISECONDS = "milliseconds"
    MICROSECONDS = "microseconds"
    CENTIMETRES = "centimetres"
    MILLIMETRES = "millimetres"
    FEET = "feet"
    DOWN_POSITIVE = "down-positive"
    OTHER_DATUM = "other-datum"

    @property
    def words(self) -> str:
        """What the record then has, for people."""
        return _WORDS.get(self, f"{'time' if self in _TIME_UNITS_S else 'altitude'} in {self}")


_WORDS: Final[Mapping[Reading, str]] = {
    Reading.DOWN_POSITIVE: "altitude positive down",
    Reading.OTHER_DATUM: "altitude above another level than the ground, such as the sea",
}
_TIME_UNITS_S: Final[Mapping[Reading, float]] = {Reading.MILLISECONDS: 1e-3, Reading.MICROSECONDS: 1e-6}
_UNITS_M: Final[Mapping[Reading, float]] = {Reading.CENTIMETRES: 1e-2, Reading.MILLIMETRES: 1e-3, Reading.FEET: 0.3048}
_LENGTHS_M: Final[Mapping[Reading, float]] = {**_UNITS_M, Reading.DOWN_POSITIVE: -1.0}
_EITHER: Final = (*_TIME_UNITS_S, None), (*_UNITS_M, None), (Reading.DOWN_POSITIVE, None), (Reading.OTHER_DATUM, None)
_COMBINATIONS: Final = sorted((frozenset(filter(None, chosen)) for chosen in product(*_EITHER)), key=len)


def read_as(record: Trajectory, readings: Collection[Reading]) -> Trajectory:
    """The record in seconds and metres, up from the ground, if it is to be read so; its source says how it was read.

    Every length and speed is converted. Above another datum, each altitude counts from its own level at rest.
    """
    if not readings:
        return record
    time_s = record.time_s * np.prod([_TIME_UNITS_S.get(reading, 1.0) for reading in readings])
    scale = np.prod([_LENGTHS_M.get(reading, 1.0) for reading in readings])
    channels = dict[str, Samples]()
    for name, values in record.channels.items():
        unit = CHANNEL_UNITS.get(name)
        read = values * scale if unit in {"m", "m/s"} else values
        has_datum = unit == "m" and Reading.OTHER_DATUM in readings
        channels[name] = read - np.median(_at_rest(time_s, read)) if has_datum else read
    words = ", ".join(reading.words for reading in Reading if reading in readings)
    return Trajectory(time_s, channels, f"{record.source}; read with {words}", record.clock)


def find_implausible(expected: ExpectedFlight, record: Trajectory) -> tuple[Finding, ...]:
    """What keeps the record from being a flight of the experiment. None if it has no samples where it is scored:
    scoring reports that."""
    scored, targets = _scored(expected, record)
    if not scored.size:
        return ()
    rest = _at_rest(record.time_s, record[ALTITUDE]) if expected.begin_s == 0.0 else np.zeros(1)
    half = len(rest) // 2
    moved_m = abs(float(np.median(rest[half:]) - np.median(rest[: half + 1])))
    begins_m, level_m = float(np.median(rest)), float(np.median(scored))
    rise_m, target_m = _height(scored) - begins_m, _height(targets)
    lowest_m, highest_m = LOWEST_SHARE * target_m, HIGHEST_SHARE * target_m
    is_constant = len(np.unique(scored)) <= len(np.unique(targets)) + 1
    checks = (
        (is_constant, Finding(Implausible.CONSTANT, float(scored.max()), target_m)),
        (abs(begins_m) > NEAR_GROUND_M, Finding(Implausible.OFF_GROUND, begins_m, NEAR_GROUND_M)),
        (moved_m > NEAR_GROUND_M, Finding(Implausible.MOVING, moved_m, NEAR_GROUND_M)),
        (rise_m < lowest_m, Finding(Implausible.TOO_LOW, rise_m, lowest_m)),
        (level_m > highest_m, Finding(Implausible.TOO_HIGH, level_m, highest_m)),
    )
    return tuple(finding for is_found, finding in checks if is_found)


def find_readings(expected: ExpectedFlight, record: Trajectory) -> tuple[Reading, ...]:
    """The fewest readings with which the record shows a flight of the experiment, without gaps, and nearer to the
    commanded height than without them. Empty if there are none."""
    altitude = replace(record, channels={ALTITUDE: record[ALTITUDE]})
    allowed = min(_miss(expected, record), _EXPLAINED_SHARE)
    for chosen in _COMBINATIONS[1:]:
        tried = read_as(altitude, chosen)
        if _miss(expected, tried) < allowed and not find_implausible(expected, tried):
            try:
                require_scorable(tried, ALTITUDE, expected.begin_s, expected.end_s)
            except TrajectoryError:
                continue
            return tuple(reading for reading in Reading if reading in chosen)
    return ()


def _scored(expected: ExpectedFlight, record: Trajectory) -> tuple[Samples, Samples]:
    """Altitude and set point where the flight is scored, shape (k,) each."""
    inside = (record.time_s >= expected.begin_s) & (record.time_s <= expected.end_s)
    return record[ALTITUDE][inside], expected.set_point(record.time_s[inside])


def _at_rest(time_s: Samples, altitude: Samples) -> Samples:
    """The altitude in the second before the command, or the first one recorded."""
    before = altitude[(time_s >= -AT_REST_S) & (time_s < 0.0)]
    return before if before.size else altitude[:1]


def _height(altitude: Samples) -> float:
    return float(np.quantile(altitude, _HIGH))


def _miss(expected: ExpectedFlight, record: Trajectory) -> float:
    """Median distance from the set points, as a share of the commanded height; infinite without samples."""
    scored, targets = _scored(expected, record)
    return float(np.median(np.abs(scored - targets))) / _height(targets) if scored.size else np.inf
