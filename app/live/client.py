"""The web process's end of the live link: it stays connected as long as there is a worker, and carries aborts to it."""

import asyncio
import itertools
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Final

import structlog

from app.core.errors import GainlineError, InputError
from app.live.messages import MAX_LINE_BYTES, Abort, AbortAnswer, FromWorker, Message, WorkerHello, decode, encode

FIRST_PAUSE_S: Final = 0.05
LONGEST_PAUSE_S: Final = 0.5
ANSWER_TIMEOUT_S: Final = 2.0

_log = structlog.get_logger(__name__)


class LinkDownError(GainlineError):
    """The worker cannot be reached, so nothing said to it would arrive."""


class LiveClient:
    """Keeps one connection to the worker at `path`, trying again for ever. One event loop only.

    `on_message` gets whatever the worker says; `on_link` is told when the connection comes and goes.
    """

    def __init__(
        self, path: Path, *, on_message: Callable[[FromWorker], None], on_link: Callable[[bool], None]
    ) -> None:
        self._path = path
        self._on_message = on_message
        self._on_link = on_link
        self._writer: asyncio.StreamWriter | None = None
        self._waiting: dict[int, asyncio.Future[AbortAnswer]] = {}
        self._numbers = itertools.count(1)

    @property
    def connected(self) -> bool:
        return self._writer is not None

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
        """Tell the worker to end a flight and wait for its answer. Raises LinkDownError when it cannot be told."""
        if self._writer is None:
            raise _link_down("no worker is running")
        request = next(self._numbers)
        answer = self._waiting[request] = asyncio.get_running_loop().create_future()
        self._writer.write(encode(Abort(request=request, trial_id=trial_id, reason=reason)))
        try:
            return await asyncio.wait_for(answer, ANSWER_TIMEOUT_S)
        except TimeoutError as error:
            raise _link_down(f"the worker did not answer within {ANSWER_TIMEOUT_S:g} s") from error
        finally:
            del self._waiting[request]

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
                self._writer = writer
                self._on_message(message)
                self._on_link(True)
            case AbortAnswer(request=request):
                if (answer := self._waiting.get(request)) is not None and not answer.done():
                    answer.set_result(message)
            case Abort():
                raise InputError("The worker sent an abort.", hint="Restart the worker.")
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


def _link_down(why: str) -> LinkDownError:
    return LinkDownError(
        f"The worker could not be told: {why}.",
        hint="If a vehicle is in the air, use its own remote control now. A supervised worker is restarted within "
        "seconds; a separate one is started with `gainline worker`.",
    )
