"""States of a job."""

from collections.abc import Mapping
from enum import StrEnum
from typing import Final


class JobState(StrEnum):
    """States of numeric work. It is pure, so a job whose worker died is queued again.

    queued ──→ running ──→ done
      ↑  │        ├──────→ failed ───→ queued (retried)
      │  │        ├──────→ cancelled ─→ queued (retried)
      │  └─→ cancelled
      └───────────┘ the worker died or shut down
    """

    QUEUED = "queued"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"


TRANSITIONS: Final[Mapping[JobState, frozenset[JobState]]] = {
    JobState.QUEUED: frozenset({JobState.RUNNING, JobState.CANCELLED}),
    JobState.RUNNING: frozenset({JobState.DONE, JobState.FAILED, JobState.CANCELLED, JobState.QUEUED}),
    JobState.DONE: frozenset(),
    JobState.FAILED: frozenset({JobState.QUEUED}),
    JobState.CANCELLED: frozenset({JobState.QUEUED}),
}

ACTIONS: Final[Mapping[str, frozenset[JobState]]] = {
    "cancel": frozenset({JobState.QUEUED, JobState.RUNNING}),
    "retry": frozenset({JobState.FAILED, JobState.CANCELLED}),
}
"""Actions that a person may take on a job, and in which states."""
