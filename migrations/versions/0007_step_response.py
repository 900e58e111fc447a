"""Rise time, settling time and steady-state error of each flight, beside its overshoot."""

import sqlalchemy as sa
from alembic import op

revision = "0007"
down_revision = "0006"
branch_labels = None
depends_on = None
release = "0.3.0"

_COLUMNS = ("rise_time_s", "settling_time_s", "steady_state_error_m")


def upgrade() -> None:
    """Flights from before have none; their records are unchanged."""
    for name in _COLUMNS:
        op.add_column("trial", sa.Column(name, sa.Double(), nullable=True))


def downgrade() -> None:
    for name in reversed(_COLUMNS):
        op.drop_column("trial", name)
