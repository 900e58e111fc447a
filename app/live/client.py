"""The web process's end of the live link: stays connected while there is a worker, and sends it what cannot wait for
the database."""

import asyncio
import itertools
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Final, TypeVar

import structlog

from app.core.errors import GainlineError, InputError
from app.live.messages import (
    MAX_LINE_BYTES,
    Abort,
    AbortAnswer,
    Answer,
    FromWorker,
    Message,
    Ping,
    Pong,
    ToWorker,
    VehicleCommandKind,
    VehicleOrder,
    VehicleOrderAnswer,
    WorkerHello,
    decode,
    encode,
)

FIRST_PAUSE_S: Final = 0.05
LONGEST_PAUSE_S: Final = 0.5
ANSWER_TIMEOUT_S: Final = 2.0
ORDER_TIMEOUT_S: Final = 1.5
"""A later request is not carried out; less than ANSWER_TIMEOUT_S, so that the worker has time to answer that."""
PING_EVERY_S: Final = 1.0

_log = structlog.get_logger(__name__)
A = TypeVar("A", AbortAnswer, VehicleOrderAnswer, Pong)


class LinkDownError(GainlineError):
    """The worker cannot be reached, so a message would not arrive."""


class LiveClient:
    """Keeps one connection to the worker at `path` and reconnects indefinitely. For one event loop only.

    `on_message` receives the worker's messages. `on_link` is called when the connection is established or lost, and
    when the worker stops or resumes answering.
    """

    def __init__(
        self, path: Path, *, on_message: Callable[[FromWorker], None], on_link: Callable[[bool], None]
    ) -> None:
        self._path = path
        self._on_message = on_message
        self._on_link = on_link
        self._writer: asyncio.StreamWriter | None = None
        self._waiting: dict[int, asyncio.Future[Answer]] = {}
        self._answers = True
        self._numbers = itertools.count(1)

    @property
    def connected(self) -> bool:
        return self._writer is not None

    @property
    def answers(self) -> bool:
        """Whether there is a worker that answered the last ping."""
        return self.connected and self._answers

    async def watch(self) -> None:
        """Ping the worker periodically until cancelled."""
        while True:
            await asyncio.sleep(PING_EVERY_S)
            if self.connected:
                try:
                    await self._ask(Ping(request=next(self._numbers)), Pong)
                except LinkDownError:
                    self._note(answers=False)
                else:
                    self._note(answers=True)

    def _note(self, *, answers: bool) -> None:
        before, self._answers = self.answers, answers
        if self.answers != before:
            _log.warning("worker answers again" if answers else "worker does not answer")
            self._on_link(self.answers)

    async def run(self) -> None:
        """Connect and listen until cancelled."""
        pause_s = FIRST_PAUSE_S
        while True:
            try:
                reader, writer = await asyncio.open_unix_connection(str(self._path), limit=MAX_LINE_BYTES)
            except OSError:
                await asyncio.sleep(pause_s)
                pause_s = min(2 * pause_s, LONGEST_PAUSE_S)
                continue
            pause_s = FIRST_PAUSE_S
            await self._listen(reader, writer)

    async def abort(self, trial_id: int, reason: str) -> AbortAnswer:
        """Request that the worker aborts a flight, and wait for its answer. Raises LinkDownError when it cannot be
        reached."""
        question = Abort(request=next(self._numbers), trial_id=trial_id, reason=reason, by_s=_deadline_s())
        return await self._ask(question, AbortAnswer)

    async def order(self, vehicle_id: int, order: VehicleCommandKind, reason: str) -> VehicleOrderAnswer:
        """Request that the worker lands a vehicle or stops its motors. Raises LinkDownError as `abort` does."""
        question = VehicleOrder(
            request=next(self._numbers), vehicle_id=vehicle_id, order=order, reason=reason, by_s=_deadline_s()
        )
        return await self._ask(question, VehicleOrderAnswer)

    async def _ask(self, question: ToWorker, kind: type[A]) -> A:
        if self._writer is None:
            raise _link_down("no worker is running")
        answered = self._waiting[question.request] = asyncio.get_running_loop().create_future()
        self._writer.write(encode(question))
        try:
            async with asyncio.timeout(ANSWER_TIMEOUT_S):  # wait_for can swallow a cancellation in Python 3.11
                answer = await answered
        except TimeoutError as error:
            raise _link_down(f"the worker did not answer within {ANSWER_TIMEOUT_S:g} s") from error
        finally:
            del self._waiting[question.request]
        if not isinstance(answer, kind):
            raise _link_down(f"the worker gave another answer: {answer.type}")
        return answer

    async def _listen(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            while line := await reader.readline():
                self._take(decode(line), writer)
        except (OSError, InputError, ValueError) as error:
            _log.warning("live link broken", why=str(error))
        finally:
            self._drop(writer)

    def _take(self, message: Message, writer: asyncio.StreamWriter) -> None:
        match message:
            case WorkerHello():
                self._writer, self._answers = writer, True
                self._on_message(message)
                self._on_link(True)
            case AbortAnswer(request=request) | VehicleOrderAnswer(request=request) | Pong(request=request):
                if (answer := self._waiting.get(request)) is not None and not answer.done():
                    answer.set_result(message)
            case Abort() | VehicleOrder() | Ping():
                raise InputError(f"The worker sent an {message.type}.", hint="Restart the worker.")
            case _:
                self._on_message(message)

    def _drop(self, writer: asyncio.StreamWriter) -> None:
        was_up, self._writer = self.connected, None
        for answer in self._waiting.values():
            if not answer.done():
                answer.set_exception(_link_down("the worker went away"))
        with suppress(OSError):
            writer.close()
        if was_up:
            self._on_link(False)


def _deadline_s() -> float:
    return time.monotonic() + ORDER_TIMEOUT_S


def _link_down(why: str) -> LinkDownError:
    return LinkDownError(
        f"The worker could not be told: {why}.",
        hint="If a vehicle is in the air, use its own remote control now. A supervised worker is restarted within "
        "seconds; a separate one is started with `gainline worker`.",
    )
