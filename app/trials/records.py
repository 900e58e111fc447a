"""Gains in an imported log, compared with those of its trial."""

import math
from collections.abc import Mapping
from typing import Final

from sqlalchemy.orm import Session

from app.common.errors import Problem, UnconfirmedError
from app.core.policy import Gains
from app.db.models import CampaignRow, TrialRow
from app.logs.takeoffs import Takeoff
from app.trials.judging import check_flown_gains

_SINGLE_PRECISION: Final = 1e-6
"""Logs store gains as single-precision numbers."""


def settle_gains(session: Session, campaign: CampaignRow, row: TrialRow, flown: Takeoff, *, confirmed: bool) -> None:
    """Set the trial's gains to what the log says.

    A log without gains leaves them as planned. Where the sets differ and that is `confirmed`, the trial takes the gains
    that were flown and loses the prediction for the planned ones; gains under other names are stored as read back only.
    Raises UnconfirmedError that names both sets, GainsError when the flown gains are outside the campaign's bounds.
    """
    if not flown.gains:
        return
    if _same(row.gains, flown.gains):
        row.read_back = row.read_back or dict(row.gains)
        return
    if not confirmed:
        raise UnconfirmedError(
            f"The log was flown with {_format_gains(flown.gains)}; trial {row.number} was planned with "
            f"{_format_gains(row.gains)}.",
            hint=f"Choose the log of this trial, or confirm that {_consequence(row.gains, flown.gains)}.",
            problems=(Problem("confirm", f"the gains in the log, {_format_gains(flown.gains)}, are not the trial's"),),
        )
    row.read_back = dict(flown.gains)
    if _alike(row.gains, flown.gains):
        judged = check_flown_gains(session, campaign, flown.gains)
        row.gains, row.gate, row.kind = judged.gains, judged.gate, "manual"
        row.predicted_error = row.predicted_interval = None


def _alike(planned: Gains, flown: Gains) -> bool:
    """Whether both sets have the same gain names."""
    return planned.keys() == flown.keys()


def _same(planned: Gains, flown: Gains) -> bool:
    return _alike(planned, flown) and all(
        math.isclose(value, flown[name], rel_tol=_SINGLE_PRECISION, abs_tol=_SINGLE_PRECISION)
        for name, value in planned.items()
    )


def _consequence(planned: Gains, flown: Gains) -> str:
    if _alike(planned, flown):
        return "the trial shall stand for the gains in the log"
    return "the flight shall count for the planned gains, which this log does not name"


def _format_gains(gains: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {value:g}" for name, value in gains.items())
