"""What a report says, as plain data; `service` gathers it, `rendering` puts it on paper."""

from dataclasses import dataclass
from datetime import datetime

from app.campaigns.schemas import Campaign, CampaignStatistics
from app.core.policy import Gain
from app.figures.base import Card
from app.trials.schemas import Trial


@dataclass(frozen=True, slots=True)
class Fact:
    """One setting with its title."""

    title: str
    value: str


@dataclass(frozen=True, slots=True)
class Anomaly:
    """Something that did not go as it should: of which flight (None: of none), what kind, and what is known of it."""

    flight: int | None
    kind: str
    sentence: str


@dataclass(frozen=True, slots=True)
class Photo:
    """A picture as it was taken."""

    media_type: str
    data: bytes
    added_at: datetime


@dataclass(frozen=True, slots=True, kw_only=True)
class Remark:
    """What people left with a trial: its note, the photos that the report has room for, and how many it has not."""

    trial: Trial
    photos: tuple[Photo, ...]
    left_out: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """A campaign, as the API tells of it, with its settings in words and its figures drawn for a light page.

    `remarks` in the order of the trials, at most `photo_bytes` of photos in all; `what` was tuned and `how`,
    `anomalies` in the order of the flights, `made_at` by program `version`.
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
        """Trials that left the ground, the ones in the table of runs."""
        return tuple(trial for trial in self.trials if trial.state in FLOWN)


FLOWN = frozenset({"captured", "valid", "aborted", "invalid", "lost"})
