"""Live telemetry of a flight and requests to abort it, all in memory so that nothing blocks."""

from collections.abc import Callable
from typing import Final

import numpy as np

from app.core.clock import REAL_TIME, Clock
from app.core.experiments.base import Experiment
from app.live.messages import FlightPhase, Phase, PublishedMessage, Telemetry
from app.vehicles.base import Sample

MESSAGES_PER_S: Final = 25

Publish = Callable[[PublishedMessage], None]


class AbortFlag:
    """Request to end one flight. Set once, from any thread; the listener is notified at once."""

    def __init__(self) -> None:
        self.reason: str | None = None
        self._tell: Callable[[str], None] = lambda _reason: None

    def set(self, reason: str) -> None:
        """Set the flag; only the first reason counts."""
        if self.reason is None:
            self.reason = reason or "aborted"
            self._tell(self.reason)

    def add_listener(self, tell: Callable[[str], None]) -> None:
        """Set the listener; it is called at once if the flag is set already."""
        self._tell = tell
        if self.reason is not None:
            tell(self.reason)


class AbortRegistry:
    """Abort flags of the flights of this process, by trial. Lock-free: safe from any thread and from signal
    handlers."""

    def __init__(self) -> None:
        self._flags: dict[int, AbortFlag] = {}
        self._closed: str | None = None

    def register(self, trial_id: int) -> AbortFlag:
        """Return the trial's flag; in a closed registry it is set already."""
        flag = self._flags.setdefault(trial_id, AbortFlag())
        if self._closed is not None:
            flag.set(self._closed)
        return flag

    def unregister(self, trial_id: int) -> None:
        self._flags.pop(trial_id, None)

    def abort(self, trial_id: int, reason: str) -> bool:
        """Abort the trial's flight. Returns whether that trial is being flown here."""
        if (flag := self._flags.get(trial_id)) is None:
            return False
        flag.set(reason)
        return True

    def abort_all(self, reason: str) -> None:
        """End every flight, and every flight registered later."""
        self._closed = reason
        for flag in tuple(self._flags.values()):
            flag.set(reason)

    def trial_ids(self) -> list[int]:
        return sorted(self._flags)


class FlightMonitor:
    """Collects one flight's samples and publishes them in at most 25 messages a second, with the error so far.

    The error so far is the trapezoidal mean of |set point − output| from the command to the newest sample (its integral
    where the experiment's error is one), within the time that the experiment scores. The flight's own error is computed
    from its full-rate record.
    """

    def __init__(
        self, campaign_id: int, trial_id: int, experiment: Experiment, publish: Publish, clock: Clock = REAL_TIME
    ) -> None:
        self._campaign_id = campaign_id
        self._trial_id = trial_id
        self._experiment = experiment
        self._columns: list[str] = []
        self._scored_until_s = float(experiment.grid_s[-1])
        self._publish = publish
        self._clock = clock
        self._rows: list[list[float]] = []
        self._due_s = 0.0
        self._last: tuple[float, float] | None = None
        self._integral = 0.0

    def phase(self, phase: Phase, note: str = "") -> None:
        self._publish(FlightPhase(campaign_id=self._campaign_id, trial_id=self._trial_id, phase=phase, note=note))

    def sample(self, sample: Sample) -> None:
        output = self._experiment.output
        set_point = float(self._experiment.set_point(np.array([sample.time_s]))[0])
        self._score(sample.time_s, abs(set_point - sample[output]))
        others = [name for name in sample.channels if name != output]
        self._columns = ["time_s", output, *others]
        self._rows.append([sample.time_s, sample[output], *(sample[name] for name in others)])
        now_s = self._clock.now_s()
        if now_s >= self._due_s:
            self._due_s = max(self._due_s + 1.0 / MESSAGES_PER_S, now_s)
            self.flush()

    def flush(self) -> None:
        """Publish the collected samples."""
        if self._rows:
            rows, self._rows = self._rows, []
            self._publish(
                Telemetry(
                    campaign_id=self._campaign_id,
                    trial_id=self._trial_id,
                    time_s=rows[-1][0],
                    columns=self._columns,
                    samples=rows,
                    error_so_far=self.error_so_far,
                )
            )

    @property
    def error_so_far(self) -> float | None:
        if self._last is None or self._last[0] <= 0.0:
            return None
        return self._integral if self._experiment.integrates else self._integral / self._last[0]

    def _score(self, time_s: float, deviation: float) -> None:
        if 0.0 <= time_s <= self._scored_until_s:
            before_s, before = self._last if self._last is not None else (0.0, deviation)
            self._integral += (time_s - before_s) * (before + deviation) / 2.0
            self._last = (time_s, deviation)
