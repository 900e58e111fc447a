"""Content of a report as plain data; `service` collects it, `rendering` formats it."""

from dataclasses import dataclass
from datetime import datetime

from app.campaigns.schemas import Campaign, CampaignStatistics
from app.campaigns.trials.schemas import Trial
from app.core.policy import Gain
from app.figures.base import Card


@dataclass(frozen=True, slots=True)
class Fact:
    """One setting: title and value."""

    title: str
    value: str


@dataclass(frozen=True, slots=True)
class Anomaly:
    """An anomaly: its flight (None if it belongs to none), its kind, and a description."""

    flight: int | None
    kind: str
    sentence: str


@dataclass(frozen=True, slots=True)
class Photo:
    """An unmodified photo."""

    media_type: str
    data: bytes
    added_at: datetime


@dataclass(frozen=True, slots=True, kw_only=True)
class Remark:
    """Remarks on a trial: its note, the photos that fit into the report, and the number of those left out."""

    trial: Trial
    photos: tuple[Photo, ...]
    left_out: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """A campaign as the API returns it, with its settings in words and its figures drawn for a light page.

    `remarks` are in the order of the trials, with at most `photo_bytes` of photos in all; `what` was tuned and `how`;
    `anomalies` are in the order of the flights; `made_at` is the time of creation, by program `version`.
    """

    campaign: Campaign
    statistics: CampaignStatistics
    trials: tuple[Trial, ...]
    gains: tuple[Gain, ...]
    what: tuple[Fact, ...]
    how: tuple[Fact, ...]
    cards: tuple[Card, ...]
    remarks: tuple[Remark, ...]
    photo_bytes: int
    anomalies: tuple[Anomaly, ...]
    version: str
    made_at: datetime

    @property
    def flown(self) -> tuple[Trial, ...]:
        """Trials that left the ground: those in the table of runs."""
        return tuple(trial for trial in self.trials if trial.state in FLOWN)


FLOWN = frozenset({"captured", "valid", "aborted", "invalid", "lost"})
