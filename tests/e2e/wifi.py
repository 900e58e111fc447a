"""A connection between browser and server that can be lost without notice."""

import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from threading import Event, Thread
from types import TracebackType
from typing import Self
from urllib.parse import urlsplit

CHUNK_BYTES = 65_536


class InterruptibleProxy:
    """Forwards connections on `url` to the server; while lost, what is sent waits, as under TCP's repetitions."""

    def __init__(self, server_url: str) -> None:
        there = urlsplit(server_url)
        assert there.hostname is not None
        assert there.port is not None
        self._there = there.hostname, there.port
        self._listening = socket.create_server(("127.0.0.1", 0))
        self._passes = Event()
        self._passes.set()
        self._sockets: list[socket.socket] = []
        self.url = f"http://127.0.0.1:{self._listening.getsockname()[1]}"

    def __enter__(self) -> Self:
        Thread(target=self._accept, daemon=True).start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for one in (self._listening, *self._sockets):
            with suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)
            one.close()

    @contextmanager
    def lost(self) -> Iterator[None]:
        self._passes.clear()
        try:
            yield
        finally:
            self._passes.set()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                here, _ = self._listening.accept()
                there = socket.create_connection(self._there)
                self._sockets += here, there
                Thread(target=self._pump, args=(here, there), daemon=True).start()
                Thread(target=self._pump, args=(there, here), daemon=True).start()

    def _pump(self, source: socket.socket, sink: socket.socket) -> None:
        with suppress(OSError):
            while data := source.recv(CHUNK_BYTES):
                self._passes.wait()
                sink.sendall(data)
            sink.shutdown(socket.SHUT_WR)
