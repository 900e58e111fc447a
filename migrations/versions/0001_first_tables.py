"""First tables."""

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None
release = "0.1.0"


def upgrade() -> None:
    create_event()
    create_idempotency_key()
    create_trajectory()
    create_vehicle()
    create_campaign()
    create_job()
    create_proposal()
    create_trial()
    create_flight()


def create_event() -> None:
    op.create_table(
        "event",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("topic", sa.String(), nullable=False),
        sa.Column("entity_id", sa.Integer(), nullable=False),
        sa.Column("campaign_id", sa.Integer(), nullable=True),
        sa.Column("at", sa.DateTime(), nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_event"),
        sqlite_autoincrement=True,
    )


def create_idempotency_key() -> None:
    op.create_table(
        "idempotency_key",
        sa.Column("key", sa.String(), nullable=False),
        sa.Column("fingerprint", sa.String(), nullable=False),
        sa.Column("answer", sa.String(), nullable=False),
        sa.Column("created_at", sa.DateTime(), nullable=False),
        sa.PrimaryKeyConstraint("key", name="pk_idempotency_key"),
    )
    op.create_index("ix_idempotency_key_created_at", "idempotency_key", ["created_at"], unique=False)


def create_trajectory() -> None:
    op.create_table(
        "trajectory",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("codec", sa.Integer(), nullable=False),
        sa.Column("columns", sa.JSON(none_as_null=True), nullable=False),
        sa.Column("samples", sa.Integer(), nullable=False),
        sa.Column("duration_s", sa.Double(), nullable=False),
        sa.Column("source", sa.String(), nullable=False),
        sa.Column("clock", sa.String(), nullable=False),
        sa.Column("checksum", sa.String(), nullable=False),
        sa.Column("data", sa.LargeBinary(), nullable=False),
        sa.Column("created_at", sa.DateTime(), nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_trajectory"),
        sqlite_autoincrement=True,
    )
    op.execute("""
        CREATE TRIGGER trajectory_is_immutable BEFORE UPDATE ON trajectory
        BEGIN SELECT RAISE(ABORT, 'a stored trajectory is never changed'); END
    """)


def create_vehicle() -> None:
    op.create_table(
        "vehicle",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("kind", sa.String(), nullable=False),
        sa.Column("title", sa.String(), nullable=False),
        sa.Column("is_real", sa.Boolean(), nullable=False),
        sa.Column("state", sa.String(20), nullable=False),
        sa.Column("safe_gains", sa.JSON(none_as_null=True), nullable=False),
        sa.Column("concern", sa.String(), nullable=False),
        sa.Column("created_at", sa.DateTime(), nullable=False),
        sa.CheckConstraint(
            "state IN ('disconnected', 'ready', 'staged', 'flying', 'quarantined')", name="ck_vehicle_state"
        ),
        sa.PrimaryKeyConstraint("id", name="pk_vehicle"),
        sa.UniqueConstraint("kind", name="uq_vehicle_kind"),
        sqlite_autoincrement=True,
    )


def create_campaign() -> None:
    op.create_table(
        "campaign",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("version", sa.Integer(), nullable=False),
        sa.Column("name", sa.String(), nullable=False),
        sa.Column("state", sa.String(20), nullable=False),
        sa.Column("outcome", sa.String(20), nullable=True),
        sa.Column("stop_reason", sa.String(), nullable=False),
        sa.Column("experiment", sa.String(), nullable=False),
        sa.Column("strategy", sa.String(), nullable=False),
        sa.Column("definition", sa.JSON(none_as_null=True), nullable=False),
        sa.Column("definition_digest", sa.String(), nullable=True),
        sa.Column("vehicle_id", sa.Integer(), nullable=False),
        sa.Column("vehicle_options", sa.JSON(none_as_null=True), nullable=False),
        sa.Column("parent_id", sa.Integer(), nullable=True),
        sa.Column("created_at", sa.DateTime(), nullable=False),
        sa.Column("updated_at", sa.DateTime(), nullable=False),
        sa.CheckConstraint("outcome IN ('converged', 'budget', 'stopped')", name="ck_campaign_outcome"),
        sa.CheckConstraint(
            "state IN ('draft', 'ready', 'flying', 'deciding', 'finished', 'archived')", name="ck_campaign_state"
        ),
        sa.ForeignKeyConstraint(
            ["parent_id"], ["campaign.id"], name="fk_campaign_parent_id_campaign", ondelete="SET NULL"
        ),
        sa.ForeignKeyConstraint(["vehicle_id"], ["vehicle.id"], name="fk_campaign_vehicle_id_vehicle"),
        sa.PrimaryKeyConstraint("id", name="pk_campaign"),
        sqlite_autoincrement=True,
    )
    op.create_index("ix_campaign_parent_id", "campaign", ["parent_id"], unique=False)
    op.create_index("ix_campaign_state", "campaign", ["state"], unique=False)
    op.create_index("ix_campaign_updated_at_id", "campaign", ["updated_at", "id"], unique=False)
    op.create_index("ix_campaign_vehicle_id", "campaign", ["vehicle_id"], unique=False)


def create_job() -> None:
    op.create_table(
        "job",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("kind", sa.String(), nullable=False),
        sa.Column("state", sa.String(20), nullable=False),
        sa.Column("campaign_id", sa.Integer(), nullable=True),
        sa.Column("problem", sa.JSON(none_as_null=True), nullable=True),
        sa.Column("attempts", sa.Integer(), nullable=False),
        sa.Column("worker", sa.String(), nullable=True),
        sa.Column("lease_until", sa.DateTime(), nullable=True),
        sa.Column("created_at", sa.DateTime(), nullable=False),
        sa.Column("started_at", sa.DateTime(), nullable=True),
        sa.Column("finished_at", sa.DateTime(), nullable=True),
        sa.CheckConstraint("state IN ('queued', 'running', 'done', 'failed', 'cancelled')", name="ck_job_state"),
        sa.ForeignKeyConstraint(
            ["campaign_id"], ["campaign.id"], name="fk_job_campaign_id_campaign", ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("id", name="pk_job"),
        sqlite_autoincrement=True,
    )
    op.create_index("ix_job_campaign_id", "job", ["campaign_id"], unique=False)
    op.create_index("ix_job_state_id", "job", ["state", "id"], unique=False)


def create_proposal() -> None:
    op.create_table(
        "proposal",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("campaign_id", sa.Integer(), nullable=False),
        sa.Column("history_digest", sa.String(), nullable=False),
        sa.Column("kind", sa.String(), nullable=False),
        sa.Column("gains", sa.JSON(none_as_null=True), nullable=False),
        sa.Column("predicted_error", sa.Double(), nullable=True),
        sa.Column("predicted_id", sa.Integer(), nullable=True),
        sa.Column("explanation", sa.JSON(none_as_null=True), nullable=False),
        sa.Column("gate", sa.JSON(none_as_null=True), nullable=False),
        sa.Column("stop_verdict", sa.JSON(none_as_null=True), nullable=False),
        sa.Column("computed_at", sa.DateTime(), nullable=False),
        sa.ForeignKeyConstraint(
            ["campaign_id"], ["campaign.id"], name="fk_proposal_campaign_id_campaign", ondelete="CASCADE"
        ),
        sa.ForeignKeyConstraint(["predicted_id"], ["trajectory.id"], name="fk_proposal_predicted_id_trajectory"),
        sa.PrimaryKeyConstraint("id", name="pk_proposal"),
        sa.UniqueConstraint("predicted_id", name="uq_proposal_predicted_id"),
        sqlite_autoincrement=True,
    )
    op.create_index("ix_proposal_campaign_id", "proposal", ["campaign_id"], unique=False)


def create_trial() -> None:
    op.create_table(
        "trial",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("version", sa.Integer(), nullable=False),
        sa.Column("campaign_id", sa.Integer(), nullable=False),
        sa.Column("number", sa.Integer(), nullable=False),
        sa.Column("state", sa.String(20), nullable=False),
        sa.Column("kind", sa.String(), nullable=False),
        sa.Column("gains", sa.JSON(none_as_null=True), nullable=False),
        sa.Column("read_back", sa.JSON(none_as_null=True), nullable=True),
        sa.Column("proposal_id", sa.Integer(), nullable=True),
        sa.Column("predicted_error", sa.Double(), nullable=True),
        sa.Column("gate", sa.JSON(none_as_null=True), nullable=False),
        sa.Column("trajectory_id", sa.Integer(), nullable=True),
        sa.Column("error", sa.Double(), nullable=True),
        sa.Column("overshoot_m", sa.Double(), nullable=True),
        sa.Column("curve", sa.JSON(none_as_null=True), nullable=True),
        sa.Column("ending", sa.String(), nullable=True),
        sa.Column("settings", sa.JSON(none_as_null=True), nullable=False),
        sa.Column("reason", sa.String(), nullable=False),
        sa.Column("note", sa.String(), nullable=False),
        sa.Column("seed", sa.Integer(), nullable=False),
        sa.Column("created_at", sa.DateTime(), nullable=False),
        sa.Column("flown_at", sa.DateTime(), nullable=True),
        sa.CheckConstraint("state != 'valid' OR error IS NOT NULL", name="ck_trial_valid_is_scored"),
        sa.CheckConstraint(
            "state IN ('planned', 'staged', 'flying', 'captured', 'valid', 'aborted', 'invalid', 'cancelled', 'lost')",
            name="ck_trial_state",
        ),
        sa.ForeignKeyConstraint(
            ["campaign_id"], ["campaign.id"], name="fk_trial_campaign_id_campaign", ondelete="CASCADE"
        ),
        sa.ForeignKeyConstraint(
            ["proposal_id"], ["proposal.id"], name="fk_trial_proposal_id_proposal", ondelete="SET NULL"
        ),
        sa.ForeignKeyConstraint(["trajectory_id"], ["trajectory.id"], name="fk_trial_trajectory_id_trajectory"),
        sa.PrimaryKeyConstraint("id", name="pk_trial"),
        sa.UniqueConstraint("campaign_id", "number", name="uq_trial_campaign_id_number"),
        sa.UniqueConstraint("trajectory_id", name="uq_trial_trajectory_id"),
        sqlite_autoincrement=True,
    )
    op.create_index("ix_trial_campaign_id_state_error", "trial", ["campaign_id", "state", "error"], unique=False)
    op.create_index("ix_trial_proposal_id", "trial", ["proposal_id"], unique=False)


def create_flight() -> None:
    op.create_table(
        "flight",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("campaign_id", sa.Integer(), nullable=False),
        sa.Column("trial_id", sa.Integer(), nullable=False),
        sa.Column("vehicle_id", sa.Integer(), nullable=False),
        sa.Column("state", sa.String(20), nullable=False),
        sa.Column("gains", sa.JSON(none_as_null=True), nullable=False),
        sa.Column("read_back", sa.JSON(none_as_null=True), nullable=True),
        sa.Column("speed", sa.Double(), nullable=True),
        sa.Column("worker", sa.String(), nullable=True),
        sa.Column("problem", sa.String(), nullable=False),
        sa.Column("requested_at", sa.DateTime(), nullable=False),
        sa.Column("claimed_at", sa.DateTime(), nullable=True),
        sa.Column("finished_at", sa.DateTime(), nullable=True),
        sa.CheckConstraint(
            "state IN ('requested', 'running', 'landed', 'aborted', 'failed', 'lost', 'cancelled')",
            name="ck_flight_state",
        ),
        sa.ForeignKeyConstraint(
            ["campaign_id"], ["campaign.id"], name="fk_flight_campaign_id_campaign", ondelete="RESTRICT"
        ),
        sa.ForeignKeyConstraint(["trial_id"], ["trial.id"], name="fk_flight_trial_id_trial", ondelete="RESTRICT"),
        sa.ForeignKeyConstraint(["vehicle_id"], ["vehicle.id"], name="fk_flight_vehicle_id_vehicle"),
        sa.PrimaryKeyConstraint("id", name="pk_flight"),
        sqlite_autoincrement=True,
    )
    op.create_index("ix_flight_campaign_id", "flight", ["campaign_id"], unique=False)
    op.create_index("ix_flight_trial_id", "flight", ["trial_id"], unique=False)
    op.create_index("ix_flight_vehicle_id", "flight", ["vehicle_id"], unique=False)
    op.create_index(
        "uq_flight_vehicle_under_way",
        "flight",
        ["vehicle_id"],
        unique=True,
        sqlite_where=sa.text("state IN ('requested', 'running')"),
        postgresql_where=sa.text("state IN ('requested', 'running')"),
    )


def downgrade() -> None:
    op.drop_table("flight")
    op.drop_table("trial")
    op.drop_table("proposal")
    op.drop_table("job")
    op.drop_table("campaign")
    op.drop_table("vehicle")
    op.drop_table("trajectory")
    op.drop_table("idempotency_key")
    op.drop_table("event")
