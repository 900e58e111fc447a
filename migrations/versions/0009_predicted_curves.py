"""The predicted curve of a trial that has no proposal."""

from alembic import op

revision = "0009"
down_revision = "0008"
branch_labels = None
depends_on = None
release = "0.3.0"


def upgrade() -> None:
    """Trials from before have none. Their table is not rebuilt: SQLite adds a reference that is null with its column,
    which Alembic has no operation for."""
    op.execute(
        "ALTER TABLE trial ADD COLUMN predicted_id INTEGER "
        "CONSTRAINT fk_trial_predicted_id_trajectory REFERENCES trajectory (id)"
    )
    op.create_index("ix_trial_predicted_id", "trial", ["predicted_id"], unique=True)


def downgrade() -> None:
    """The curves go with their column."""
    op.execute("DELETE FROM trajectory WHERE id IN (SELECT predicted_id FROM trial)")
    op.drop_index("ix_trial_predicted_id", table_name="trial")
    op.drop_column("trial", "predicted_id")
