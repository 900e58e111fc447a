"""Photos of flights, checks of recorded controllers, and rehearsals of campaigns on a simulation."""

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"
branch_labels = None
depends_on = None
release = "0.2.0"


def upgrade() -> None:
    op.create_table(
        "trial_photo",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("trial_id", sa.Integer(), nullable=False),
        sa.Column("media_type", sa.String(), nullable=False),
        sa.Column("data", sa.LargeBinary(), nullable=False),
        sa.Column("added_at", sa.DateTime(), nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_trial_photo"),
        sa.ForeignKeyConstraint(["trial_id"], ["trial.id"], name="fk_trial_photo_trial_id_trial", ondelete="CASCADE"),
        sqlite_autoincrement=True,
    )
    op.create_index("ix_trial_photo_trial_id", "trial_photo", ["trial_id"], unique=False)
    op.create_table(
        "controller_check",
        sa.Column("id", sa.Integer(), nullable=False),
        sa.Column("file_name", sa.String(), nullable=False),
        sa.Column("kind", sa.String(), nullable=False),
        sa.Column("passed", sa.Boolean(), nullable=False),
        sa.Column("result", sa.JSON(none_as_null=True), nullable=False),
        sa.Column("checked_at", sa.DateTime(), nullable=False),
        sa.PrimaryKeyConstraint("id", name="pk_controller_check"),
        sqlite_autoincrement=True,
    )
    op.create_table(
        "rehearsal",
        sa.Column("rehearsal_id", sa.Integer(), nullable=False),
        sa.Column("campaign_id", sa.Integer(), nullable=False),
        sa.PrimaryKeyConstraint("rehearsal_id", name="pk_rehearsal"),
        *(
            sa.ForeignKeyConstraint(
                [column], ["campaign.id"], name=f"fk_rehearsal_{column}_campaign", ondelete="CASCADE"
            )
            for column in ("rehearsal_id", "campaign_id")
        ),
    )
    op.create_index("ix_rehearsal_campaign_id", "rehearsal", ["campaign_id"], unique=False)


def downgrade() -> None:
    op.drop_index("ix_rehearsal_campaign_id", table_name="rehearsal")
    op.drop_table("rehearsal")
    op.drop_table("controller_check")
    op.drop_index("ix_trial_photo_trial_id", table_name="trial_photo")
    op.drop_table("trial_photo")
