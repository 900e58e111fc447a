"""Databases like those after years of use: campaigns with many flights and complete records, for benchmarks."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Final

import numpy as np
from sqlalchemy import insert, update

from app.campaigns import history
from app.campaigns import service as campaigns
from app.campaigns.definitions import definition_of, frozen_digest
from app.campaigns.proposals import gate_json
from app.campaigns.schemas import NewCampaign
from app.campaigns.trials.records import keep_response, score
from app.common.settings import Settings
from app.common.states import CampaignState, JobState, TrialState
from app.core.definition import Definition, Interval
from app.core.experiments.takeoff import WINDOW_S, Takeoff
from app.core.records.trajectory import Trajectory
from app.core.tuning.evidence import Evidence
from app.core.tuning.gate import check_policy
from app.core.tuning.strategy import Explanation, band_channels
from app.db import trajectories
from app.db.base import JsonObject
from app.db.migrate import migrate
from app.db.models import CampaignRow, JobRow, ProposalRow, TrialRow
from app.db.session import Database
from app.db.trajectories import pack

SAMPLES: Final = 16_700
SEED: Final = 20261122
SPOILT_EVERY: Final = 25
"""One of so many flights is invalid."""
_GOOD: Final = np.array([1600.0, 900.0, 130.0])
_TRUTH: Final = np.array([0.66, 0.2, 0.05, 0.15, 0.0, 0.1, 0.0, 0.0])
_NOISE_M: Final = 0.008


@cache
def _gate() -> JsonObject:
    """Return the gate's complete result for gains that pass."""
    evidence = Evidence(definition=Definition(), experiment=Takeoff(), flights=())
    return gate_json(check_policy(evidence, evidence.space.mapping(evidence.space.default)))


@dataclass(frozen=True, slots=True)
class Takeoffs:
    """Flights of random gains that improve, on a vehicle that the model can describe."""

    randomness: np.random.Generator
    samples: int

    def gains(self, number: int) -> dict[str, float]:
        """Return integer gains, closer to good ones with every flight."""
        gains = Takeoff.space.gains
        lower, upper = (np.array([getattr(gain, end) for gain in gains]) for end in ("lower", "upper"))
        spread = (upper - lower) * max(0.03, 0.3 * 0.98**number)
        chosen = np.clip(self.randomness.normal(_GOOD, spread), lower + 0.02 * (upper - lower), upper)
        return {gain.name: float(round(value)) for gain, value in zip(gains, chosen, strict=True)}

    def record(self, gains: Mapping[str, float]) -> Trajectory:
        """Return a takeoff with the noise of a tracking system."""
        flown = Takeoff().simulate(np.array(list(gains.values())), _TRUTH)
        time_s = np.linspace(0.0, WINDOW_S, self.samples)
        channels = {name: np.interp(time_s, flown.time_s, values) for name, values in flown.channels.items()}
        wander = np.cumsum(self.randomness.normal(0.0, 1e-3, self.samples)) * np.exp(-time_s / WINDOW_S)
        channels["altitude_m"] += wander + self.randomness.normal(0.0, _NOISE_M, self.samples)
        return Trajectory(time_s, channels, "jsbsim", "simulation")


def seed_database(
    data_dir: Path, *, flights: Mapping[str, int], campaigns_of_five: int = 0, samples: int = SAMPLES
) -> dict[str, int]:
    """Make a database with a campaign of the given number of flights for each name, each with its proposal.

    Adds `campaigns_of_five` small campaigns that are all alike. Returns the ids of the named campaigns.
    """
    file = Settings(data_dir=data_dir).database_file
    migrate(file)
    database = Database(file)
    takeoffs = Takeoffs(np.random.default_rng(SEED), samples)
    try:
        made = {name: _campaign(database, name, count, takeoffs) for name, count in flights.items()}
        if campaigns_of_five:
            small = _campaign(database, "Small 1", 5, takeoffs)
            _copies(database, small, campaigns_of_five - 1)
    finally:
        database.close()
    return made


def _campaign(database: Database, name: str, flights: int, takeoffs: Takeoffs) -> int:
    new = NewCampaign.model_validate(
        {"name": name, "vehicle": {"kind": "jsbsim"}, "definition": {"strategy": "gradient", "stop": {"kind": "paper"}}}
    )
    with database.write() as session:
        campaign_id = campaigns.create_campaign(session, new).id
    for first in range(1, flights + 1, 50):
        with database.write() as session:
            for number in range(first, min(first + 50, flights + 1)):
                gains = takeoffs.gains(number)
                record = takeoffs.record(gains)
                row = _trial(campaign_id, number, gains)
                row.trajectory = trajectories.pack(record)
                judged = score(Takeoff(), record)
                keep_response(row, judged.response)
                row.curve = judged.curve
                if number % SPOILT_EVERY == 0:
                    row.state, row.reason = TrialState.INVALID, "wind gust"
                else:
                    assert judged.error is not None
                    row.error, row.predicted_error = judged.error, 0.97 * judged.error
                    row.predicted_interval = asdict(Interval(lower=0.9 * judged.error, upper=1.06 * judged.error))
                session.add(row)
    _propose(database, campaign_id, takeoffs, flights + 1)
    return campaign_id


def _trial(campaign_id: int, number: int, gains: Mapping[str, float]) -> TrialRow:
    return TrialRow(
        campaign_id=campaign_id,
        number=number,
        state=TrialState.VALID,
        kind="start" if number == 1 else "step",
        gains=dict(gains),
        read_back=dict(gains),
        gate=_gate(),
        ending="completed",
        glitches=[],
        seed=number,
    )


def _propose(database: Database, campaign_id: int, takeoffs: Takeoffs, number: int) -> None:
    """Store a proposal with its predicted curve and band, as a strategy would."""
    with database.write() as session:
        campaign = campaigns.get_row(session, campaign_id)
        campaign.state, campaign.definition_digest = CampaignState.DECIDING, frozen_digest(campaign)
        campaign.safe_gains = campaign.vehicle.safe_gains
        session.execute(update(JobRow).where(JobRow.campaign_id == campaign_id).values(state=JobState.DONE))
        gains = takeoffs.gains(number)
        modelled = Takeoff().simulate(np.array(list(gains.values())), _TRUTH)
        lower, upper = band_channels(Takeoff.output)
        altitude_m = modelled["altitude_m"]
        band = {Takeoff.output: altitude_m, lower: altitude_m - 0.15, upper: altitude_m + 0.15}
        predicted = trajectories.pack(Trajectory(modelled.time_s, band, "model", "simulation"))
        row = ProposalRow(
            campaign_id=campaign_id,
            history_digest=history.history_digest(
                session, campaign, definition_of(campaign), history.trials_of(session, campaign_id)
            ),
            kind="step",
            gains=gains,
            predicted_error=0.21,
            predicted=predicted,
            explanation=asdict(Explanation(summary="A step of the gradient.")),
            gate=_gate(),
            stop_verdict={
                "stop": False,
                "reason": None,
                "why": "The flights still get better.",
                "failures": 0,
                "threshold": None,
            },
            interval=asdict(Interval(lower=0.19, upper=0.24)),
            advice={"kind": "step", "gains": gains, "why": "It is expected to be better."},
            spread=None,
        )
        session.add(row)


def _copies(database: Database, campaign_id: int, count: int) -> None:
    """Add copies of a campaign, with their records thinned to a few samples."""
    with database.write() as session:
        campaign = _columns(session.get_one(CampaignRow, campaign_id))
        trials = history.trials_of(session, campaign_id)
        thin = [_thinned(history.record_of(session, row)) for row in trials]
        columns = [_columns(row) for row in trials]
        for number in range(2, count + 2):
            copy = CampaignRow(**campaign | {"name": f"Small {number}"})
            session.add(copy)
            records = [pack(record) for record in thin]
            session.add_all(records)
            session.flush()
            session.execute(
                insert(TrialRow),
                [
                    trial | {"campaign_id": copy.id, "trajectory_id": record.id}
                    for trial, record in zip(columns, records, strict=True)
                ],
            )


def _thinned(record: Trajectory) -> Trajectory:
    every = slice(None, None, len(record) // 60)
    channels = {name: values[every] for name, values in record.channels.items()}
    return Trajectory(record.time_s[every], channels, record.source, record.clock)


def _columns(row: CampaignRow | TrialRow) -> dict[str, object]:
    """Return the values of a row, without its id."""
    return {column.key: getattr(row, column.key) for column in row.__table__.columns if column.key != "id"}
