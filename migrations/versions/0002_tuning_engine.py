"""What the tuning engine tells: intervals, glitches, overruled refusals, advice; jobs with an order and a result."""

from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None
release = "0.1.0"


def upgrade() -> None:
    for table, columns in _new_columns().items():
        for column in columns:
            op.add_column(table, column)
    compute_proposals_again()


def compute_proposals_again() -> None:
    """Every stored proposal is outdated: what it depends on has grown."""
    op.execute("""
        INSERT INTO job (kind, state, campaign_id, attempts, created_at)
        SELECT 'proposal', 'queued', id, 0, strftime('%Y-%m-%d %H:%M:%f000', 'now') FROM campaign
        WHERE state IN ('draft', 'ready', 'deciding')
        AND id NOT IN (SELECT campaign_id FROM job WHERE campaign_id IS NOT NULL AND state = 'queued')
    """)


def downgrade() -> None:
    for table, columns in _new_columns().items():
        for column in columns:
            op.drop_column(table, column.name)


def _new_columns() -> dict[str, tuple[sa.Column[Any], ...]]:
    return {
        "trial": (
            _json("predicted_interval"),
            _text("overrule_reason"),
            _json("glitches"),
            sa.Column("repaired_error", sa.Double(), nullable=True),
            sa.Column("landing_battery_v", sa.Double(), nullable=True),
        ),
        "proposal": (_json("interval"), _json("advice"), _json("spread")),
        "job": (_json("order"), sa.Column("done_share", sa.Double(), nullable=True), _text("doing"), _json("result")),
    }


def _json(name: str) -> sa.Column[Any]:
    return sa.Column(name, sa.JSON(none_as_null=True), nullable=True)


def _text(name: str) -> sa.Column[Any]:
    return sa.Column(name, sa.String(), nullable=False, server_default="")
