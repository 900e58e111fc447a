"""The life of a job."""

from collections.abc import Mapping
from enum import StrEnum
from typing import Final


class JobState(StrEnum):
    """Numeric work. It is pure, so a job whose worker died simply waits again.

    queued ──→ running ──→ done
      ↑  │        ├──────→ failed ───→ queued (retried)
      │  │        ├──────→ cancelled ─→ queued (retried)
      │  └─→ cancelled
      └───────────┘ the worker went away
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
"""What a person may do with a job, and in which states."""
