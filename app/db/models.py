"""The tables. The database checks the states too; the transitions between them are in `app.common.states`."""

from datetime import datetime

from sqlalchemy import CheckConstraint, ForeignKey, Index, LargeBinary, String, UniqueConstraint, text
from sqlalchemy.orm import Mapped, mapped_column, relationship

from app.common.states import (
    ACTIVE_ACT_STATES,
    ACTIVE_FLIGHT_STATES,
    AbortCause,
    ActKind,
    ActState,
    CampaignState,
    Ending,
    FlightMode,
    FlightState,
    JobState,
    Outcome,
    TrialKind,
    TrialState,
    VehicleState,
)
from app.core.tuning.strategy import Kind as ProposalKind
from app.db.base import (
    NEVER_REUSE_IDS,
    Base,
    GainsJson,
    JsonObject,
    Numbered,
    OptionsJson,
    Reported,
    Topic,
    is_one_of,
    state_check,
    utc_now,
)
from app.vehicles.flight_end import FlightEnd


class _Dated:
    """A row that knows since when it is there."""

    created_at: Mapped[datetime] = mapped_column(default=utc_now)


class VehicleRow(Base, Reported, _Dated):
    """Something that can fly a trial.

    A simulation's row is created by the first campaign that uses its kind, and shared; its settings are in each
    campaign. A registered vehicle has a row and settings of its own. `held` are the gains that it reported; `concern`
    is why it is quarantined, or was when its link was closed. `operator…`: the operator in control, until when, and the
    digest of the lease token. `version` counts people's edits.
    """

    topic = "vehicle"
    __tablename__ = "vehicle"
    __table_args__ = (state_check(VehicleState), NEVER_REUSE_IDS)

    version: Mapped[int] = mapped_column(default=1, server_default="1")
    kind: Mapped[str] = mapped_column(index=True)
    name: Mapped[str] = mapped_column(unique=True)
    title: Mapped[str]
    is_real: Mapped[bool]
    registered: Mapped[bool] = mapped_column(default=False, server_default=text("0"))
    state: Mapped[VehicleState]
    concern: Mapped[str] = mapped_column(default="")
    options: Mapped[OptionsJson] = mapped_column(default=dict, server_default=text("'{}'"))
    identity: Mapped[JsonObject | None]
    safe_gains: Mapped[GainsJson]
    held: Mapped[GainsJson | None]
    held_at: Mapped[datetime | None]
    checks: Mapped[list[JsonObject] | None]
    checked_at: Mapped[datetime | None]
    battery: Mapped[str] = mapped_column(default="", server_default="")
    wanted_connected: Mapped[bool] = mapped_column(default=False, server_default=text("0"))
    operator: Mapped[str | None]
    operator_token_hash: Mapped[str | None]
    operator_until: Mapped[datetime | None]


class _Requested(Reported):
    """A row that asks something of a vehicle, which a worker claims."""

    worker: Mapped[str | None]
    requested_at: Mapped[datetime] = mapped_column(default=utc_now)
    claimed_at: Mapped[datetime | None]
    finished_at: Mapped[datetime | None]


class VehicleActRow(Base, _Requested):
    """An act: a request to a registered vehicle beside its flights, who made it and why, and the vehicle's answer.

    Written before anything is sent; except for land and motors off, which are sent at once and recorded afterwards.
    """

    __tablename__ = "vehicle_act"
    __table_args__ = (
        state_check(ActState),
        state_check(ActKind, column="kind"),
        Index(
            "uq_vehicle_act_vehicle_under_way",
            "vehicle_id",
            unique=True,
            sqlite_where=text(is_one_of("state", sorted(ACTIVE_ACT_STATES))),
        ),
        NEVER_REUSE_IDS,
    )

    vehicle_id: Mapped[int] = mapped_column(ForeignKey("vehicle.id"), index=True)
    kind: Mapped[ActKind]
    state: Mapped[ActState]
    by: Mapped[str] = mapped_column(default="")
    reason: Mapped[str] = mapped_column(default="")
    asked: Mapped[GainsJson | None]
    read_back: Mapped[GainsJson | None]
    result: Mapped[JsonObject | None]
    problem: Mapped[str] = mapped_column(default="")

    vehicle: Mapped[VehicleRow] = relationship()

    def reported_as(self) -> tuple[Topic, int, int | None]:
        return "vehicle", self.vehicle_id, None


class CampaignRow(Base, Reported, _Dated):
    """One vehicle, one experiment, one strategy.

    `version` counts people's edits. `safe_gains` are the vehicle's at the first flight, after which they are part of
    the frozen definition. `open_until_flight` is the number of flights up to which the stop rule does not end it, after
    a reopening.
    """

    __tablename__ = "campaign"
    __table_args__ = (
        state_check(CampaignState),
        state_check(Outcome, column="outcome"),
        Index("ix_campaign_updated_at_id", "updated_at", "id"),
        NEVER_REUSE_IDS,
    )

    version: Mapped[int] = mapped_column(default=1)
    name: Mapped[str]
    state: Mapped[CampaignState] = mapped_column(index=True)
    outcome: Mapped[Outcome | None]
    stop_reason: Mapped[str] = mapped_column(default="")
    experiment: Mapped[str]
    strategy: Mapped[str]
    definition: Mapped[JsonObject]
    definition_digest: Mapped[str | None]
    safe_gains: Mapped[GainsJson | None]
    open_until_flight: Mapped[int] = mapped_column(default=0, server_default="0")
    vehicle_id: Mapped[int] = mapped_column(ForeignKey("vehicle.id"), index=True)
    vehicle_options: Mapped[OptionsJson]
    parent_id: Mapped[int | None] = mapped_column(ForeignKey("campaign.id", ondelete="SET NULL"), index=True)
    updated_at: Mapped[datetime] = mapped_column(default=utc_now, onupdate=utc_now)

    vehicle: Mapped[VehicleRow] = relationship(lazy="joined", innerjoin=True)

    def reported_as(self) -> tuple[Topic, int, int | None]:
        return "campaign", self.id, self.id


class RehearsalRow(Base):
    """A campaign on a simulation that rehearses one on a real vehicle."""

    __tablename__ = "rehearsal"

    rehearsal_id: Mapped[int] = mapped_column(ForeignKey("campaign.id", ondelete="CASCADE"), primary_key=True)
    campaign_id: Mapped[int] = mapped_column(ForeignKey("campaign.id", ondelete="CASCADE"), index=True)


class TrajectoryRow(Base, Numbered, _Dated):
    """One recorded or predicted flight, packed by `app.db.trajectories`. Written once; the database refuses changes."""

    __tablename__ = "trajectory"

    codec: Mapped[int]
    columns: Mapped[list[str]]
    samples: Mapped[int]
    duration_s: Mapped[float]
    source: Mapped[str]
    clock: Mapped[str]
    checksum: Mapped[str]
    data: Mapped[bytes] = mapped_column(LargeBinary, deferred=True)


class TrialRow(Base, Reported, _Dated):
    """One flight of one policy.

    `predicted_error` and `predicted_interval` are those with which it was planned; of a trial without a proposal,
    `predicted` is the curve, else it is the proposal's. `repaired_error` is what the flight would score without its
    `glitches`. `curve` is the scored output in a few [time_s, value] pairs, for small plots. `ending` says how the
    record ends, whatever the trial's class; `abort_cause` why the flight was aborted. `end` is how its last flight
    ended; `reason` are the words of a person or an import, which are shown instead.
    """

    topic = "trial"
    __tablename__ = "trial"
    __table_args__ = (
        state_check(TrialState),
        CheckConstraint("state != 'valid' OR error IS NOT NULL", name="valid_is_scored"),
        UniqueConstraint("campaign_id", "number"),
        Index("ix_trial_campaign_id_state_error", "campaign_id", "state", "error"),
        NEVER_REUSE_IDS,
    )

    version: Mapped[int] = mapped_column(default=1)
    campaign_id: Mapped[int] = mapped_column(ForeignKey("campaign.id", ondelete="CASCADE"))
    number: Mapped[int]
    state: Mapped[TrialState]
    kind: Mapped[TrialKind] = mapped_column(String)
    gains: Mapped[GainsJson]
    read_back: Mapped[GainsJson | None]
    proposal_id: Mapped[int | None] = mapped_column(ForeignKey("proposal.id", ondelete="SET NULL"), index=True)
    predicted_error: Mapped[float | None]
    predicted_id: Mapped[int | None] = mapped_column(ForeignKey("trajectory.id"), index=True, unique=True)
    gate: Mapped[JsonObject]
    trajectory_id: Mapped[int | None] = mapped_column(ForeignKey("trajectory.id"), unique=True)
    error: Mapped[float | None]
    overshoot_m: Mapped[float | None]
    rise_time_s: Mapped[float | None]
    settling_time_s: Mapped[float | None]
    steady_state_error_m: Mapped[float | None]
    curve: Mapped[list[list[float]] | None]
    ending: Mapped[Ending | None] = mapped_column(String)
    end: Mapped[FlightEnd | None]
    abort_cause: Mapped[AbortCause | None] = mapped_column(String)
    settings: Mapped[OptionsJson] = mapped_column(default=dict)
    reason: Mapped[str] = mapped_column(default="")
    note: Mapped[str] = mapped_column(default="")
    predicted_interval: Mapped[JsonObject | None]
    overrule_reason: Mapped[str] = mapped_column(default="", server_default="")
    glitches: Mapped[list[JsonObject] | None]
    repaired_error: Mapped[float | None]
    landing_battery_v: Mapped[float | None]
    seed: Mapped[int]
    flown_at: Mapped[datetime | None]

    campaign: Mapped[CampaignRow] = relationship()
    proposal: Mapped["ProposalRow | None"] = relationship()
    trajectory: Mapped[TrajectoryRow | None] = relationship(foreign_keys=[trajectory_id])
    predicted: Mapped[TrajectoryRow | None] = relationship(foreign_keys=[predicted_id])


class TrialPhotoRow(Base, Reported):
    """A picture of a flight, as uploaded."""

    __tablename__ = "trial_photo"

    trial_id: Mapped[int] = mapped_column(ForeignKey("trial.id", ondelete="CASCADE"), index=True)
    media_type: Mapped[str]
    data: Mapped[bytes] = mapped_column(LargeBinary, deferred=True)
    added_at: Mapped[datetime] = mapped_column(default=utc_now)

    trial: Mapped[TrialRow] = relationship()

    def reported_as(self) -> tuple[Topic, int, int | None]:
        return "trial", self.trial_id, self.trial.campaign_id


class FlightRow(Base, _Requested):
    """One request to a vehicle, written before it is sent, and what the vehicle answered.

    A flight of mode `stage` waits with its gains on the vehicle until an operator sets `take_off_at`, or `stand_down`
    is who asked that it must not fly (a `Requester`). `safe_gains` are those to be restored after it, `restored` those
    read back then; `battery` is the label of the installed battery; `end` how it ended.

    A line of the vehicle's ledger: while it exists, neither its trial nor its campaign can be deleted.
    """

    topic = "flight"
    __tablename__ = "flight"
    __table_args__ = (
        state_check(FlightState),
        Index(
            "uq_flight_vehicle_under_way",
            "vehicle_id",
            unique=True,
            sqlite_where=text(is_one_of("state", sorted(ACTIVE_FLIGHT_STATES))),
        ),
        NEVER_REUSE_IDS,
    )

    campaign_id: Mapped[int] = mapped_column(ForeignKey("campaign.id", ondelete="RESTRICT"), index=True)
    trial_id: Mapped[int] = mapped_column(ForeignKey("trial.id", ondelete="RESTRICT"), index=True)
    vehicle_id: Mapped[int] = mapped_column(ForeignKey("vehicle.id"), index=True)
    state: Mapped[FlightState]
    mode: Mapped[FlightMode] = mapped_column(String, default="fly", server_default="fly")
    gains: Mapped[GainsJson]
    read_back: Mapped[GainsJson | None]
    take_off_at: Mapped[datetime | None]
    stand_down: Mapped[str] = mapped_column(default="", server_default="")
    safe_gains: Mapped[GainsJson | None]
    restored: Mapped[GainsJson | None]
    restored_at: Mapped[datetime | None]
    battery: Mapped[str] = mapped_column(default="", server_default="")
    battery_v_before: Mapped[float | None]
    battery_v_after: Mapped[float | None]
    speed: Mapped[float | None]
    end: Mapped[FlightEnd | None]

    campaign: Mapped[CampaignRow] = relationship()
    trial: Mapped[TrialRow] = relationship()
    vehicle: Mapped[VehicleRow] = relationship()


class ProposalRow(Base, Reported):
    """A strategy's proposal from one history; stale as soon as the campaign's history has another digest."""

    topic = "proposal"
    __tablename__ = "proposal"

    campaign_id: Mapped[int] = mapped_column(ForeignKey("campaign.id", ondelete="CASCADE"), index=True)
    history_digest: Mapped[str]
    kind: Mapped[ProposalKind] = mapped_column(String)
    gains: Mapped[GainsJson]
    predicted_error: Mapped[float | None]
    predicted_id: Mapped[int | None] = mapped_column(ForeignKey("trajectory.id"), unique=True)
    explanation: Mapped[JsonObject]
    gate: Mapped[JsonObject]
    stop_verdict: Mapped[JsonObject]
    interval: Mapped[JsonObject | None]
    advice: Mapped[JsonObject | None]
    spread: Mapped[JsonObject | None]
    computed_at: Mapped[datetime] = mapped_column(default=utc_now)

    predicted: Mapped[TrajectoryRow | None] = relationship()


class JobRow(Base, Reported, _Dated):
    """Numeric work: queued, running or done.

    `order` describes the work, `done_share` (0 … 1) and `doing` the progress. `result` is loaded only on
    access. `lease_until` passes when the worker stops renewing it.
    """

    topic = "job"
    __tablename__ = "job"
    __table_args__ = (state_check(JobState), Index("ix_job_state_id", "state", "id"), NEVER_REUSE_IDS)

    kind: Mapped[str]
    state: Mapped[JobState]
    campaign_id: Mapped[int | None] = mapped_column(ForeignKey("campaign.id", ondelete="CASCADE"), index=True)
    problem: Mapped[JsonObject | None]
    order: Mapped[JsonObject | None]
    done_share: Mapped[float | None]
    doing: Mapped[str] = mapped_column(default="", server_default="")
    result: Mapped[JsonObject | None] = mapped_column(deferred=True)
    attempts: Mapped[int] = mapped_column(default=0)
    worker: Mapped[str | None]
    lease_until: Mapped[datetime | None]
    started_at: Mapped[datetime | None]
    finished_at: Mapped[datetime | None]

    campaign: Mapped[CampaignRow | None] = relationship()


class LoggedVehicleRow(Base, Numbered, _Dated):
    """A vehicle whose logs are kept, known by its hardware id, or where its logs have none, by name."""

    __tablename__ = "logged_vehicle"

    name: Mapped[str] = mapped_column(unique=True)
    hardware_id: Mapped[str | None] = mapped_column(unique=True)


class AnalysedLogRow(Base, Numbered):
    """The answer to a log, by the `program` of this version; kept for a vehicle, or for a few days.

    `digest` is that of the file and of what it was analysed with, `file_digest` of the file alone. `ordered_at` is when
    it was flown, or if nobody knows when it was analysed. `numbers` are those for lists and trends, `fit` what the log
    tells of the vehicle; `answer` is the rest, and `flight` what of it was analysed, packed.
    """

    __tablename__ = "analysed_log"
    __table_args__ = (Index("ix_analysed_log_vehicle_id_ordered_at", "vehicle_id", "ordered_at"), NEVER_REUSE_IDS)

    vehicle_id: Mapped[int | None] = mapped_column(ForeignKey("logged_vehicle.id"))
    digest: Mapped[str] = mapped_column(unique=True)
    file_digest: Mapped[str]
    file_name: Mapped[str]
    autopilot: Mapped[str]
    grade: Mapped[str]
    hardware_id: Mapped[str]
    vehicle_name: Mapped[str]
    program: Mapped[str]
    flown_at: Mapped[datetime | None]
    analysed_at: Mapped[datetime]
    ordered_at: Mapped[datetime]
    numbers: Mapped[JsonObject]
    fit: Mapped[JsonObject | None]
    answer: Mapped[bytes] = mapped_column(LargeBinary, deferred=True)
    flight: Mapped[bytes | None] = mapped_column(LargeBinary, deferred=True)
    file_bytes: Mapped[int] = mapped_column(default=0)

    vehicle: Mapped[LoggedVehicleRow | None] = relationship()


class LogFileRow(Base):
    """The file of a kept log and its companion, where that was asked for."""

    __tablename__ = "log_file"

    log_id: Mapped[int] = mapped_column(ForeignKey("analysed_log.id", ondelete="CASCADE"), primary_key=True)
    content: Mapped[bytes] = mapped_column(LargeBinary)
    companion: Mapped[bytes | None] = mapped_column(LargeBinary)


class EventRow(Base, Numbered):
    """The outbox: what changed, in order."""

    __tablename__ = "event"

    topic: Mapped[str]
    entity_id: Mapped[int]
    campaign_id: Mapped[int | None]
    at: Mapped[datetime]


class IdempotencyRow(Base):
    """The answer to the first request with this key, returned when the same request is sent again."""

    __tablename__ = "idempotency_key"

    key: Mapped[str] = mapped_column(primary_key=True)
    fingerprint: Mapped[str]
    answer: Mapped[str]
    created_at: Mapped[datetime] = mapped_column(default=utc_now, index=True)
