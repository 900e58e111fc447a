"""The web server of `gainline serve`: Uvicorn with the application."""

import asyncio
import gc
import importlib
import resource
import socket
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Final

import scipy  # noqa: F401, TID253
import structlog
import uvicorn

from app.accounts.keys_and_links import Keyring
from app.common.settings import Settings, is_loopback
from app.core.clock import REAL_TIME
from app.db.backup import discard_partial_copies
from app.db.outbox import latest_event_id
from app.main import create_app
from app.runtime.http_connections import Connections, LimitedProtocol, room_for_connections
from app.web.addresses import addresses_elsewhere, qr_text, unlock_link, web_address

TICKS_A_SECOND: Final = 10
WITHOUT_DESCRIPTORS_S: Final = 0.05
NUMERICS: Final = ("scipy.integrate", "scipy.special", "numba")
"""What statistics need. Their package is loaded above, before threads do: Python 3.11 fails to import a module of a
package of which another thread is just ending the import (KeyError)."""
NUMERICS_AFTER_S: Final = 5.0
"""How long after it is ready the server imports them, if no request has done so by then."""

_log = structlog.get_logger(__name__)


class _Server(uvicorn.Server):
    """Uvicorn with a limit of connections, a callback when it is ready, and event streams that end before it waits for
    them."""

    def __init__(
        self,
        config: uvicorn.Config,
        listener: socket.socket,
        connections: Connections,
        *,
        ready: Callable[[], None],
        closing: Callable[[], None],
    ) -> None:
        super().__init__(config)
        self._listener = listener
        self._connections = connections
        self._ready = ready
        self._closing = closing
        self._arriving: set[asyncio.Task[None]] = set()

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        assert not sockets, "the listener is its own"
        await super().startup([])
        self._listener.setblocking(False)
        self._listen()
        self._ready()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        assert not sockets
        asyncio.get_running_loop().remove_reader(self._listener)
        self._closing()
        await super().shutdown([self._listener])

    async def on_tick(self, counter: int) -> bool:
        if counter % TICKS_A_SECOND == 0:
            self._connections.drop_overdue()
        return await super().on_tick(counter)

    def _listen(self) -> None:
        asyncio.get_running_loop().add_reader(self._listener, self._accept)

    def _accept(self) -> None:
        """Accept waiting connections while there is room.

        The event loop's own server would accept all of them before it closed the first, and run out of descriptors.
        """
        loop = asyncio.get_running_loop()
        while self._connections.has_room(len(self._arriving)):
            try:
                arrived, _ = self._listener.accept()
            except (BlockingIOError, ConnectionAbortedError):
                return
            except OSError as error:
                _log.error("connections cannot be accepted", why=str(error))
                loop.remove_reader(self._listener)
                loop.call_later(WITHOUT_DESCRIPTORS_S, self._listen)
                return
            arrived.setblocking(False)
            task = loop.create_task(self._serve_one(arrived))
            self._arriving.add(task)
            task.add_done_callback(self._arriving.discard)

    async def _serve_one(self, arrived: socket.socket) -> None:
        protocol = partial(LimitedProtocol, self._connections, self.config, self.server_state, self.lifespan.state)
        with suppress(OSError):  # the client has closed it already
            await asyncio.get_running_loop().connect_accepted_socket(protocol, arrived)


def run(settings: Settings, listener: socket.socket, announce: Callable[[str], None]) -> None:
    """Serve on a listening socket until SIGINT or SIGTERM; `announce` gets a line when it is ready.

    Raises StorageError when the database or the secret of the data folder cannot be read.
    """
    discard_partial_copies(settings.data_dir)
    application = create_app(settings)
    with application.state.database.read() as session:
        latest_event_id(session)  # a start-up error is raised here, and not in the event loop
    Keyring(settings.data_dir)
    address = web_address(settings.host, listener.getsockname()[1])

    def ready() -> None:
        # Exclude the loaded program from garbage collection, which would otherwise delay responses.
        gc.collect()
        gc.freeze()
        loading = threading.Timer(NUMERICS_AFTER_S, _load_numerics)
        loading.daemon = True
        loading.start()
        _log.info("ready", address=address)
        announce(f"Gainline is ready at {address}")
        _announce_links(settings, listener.getsockname()[1], application.state.keyring, announce)

    def closing() -> None:
        application.state.live.hub.close()

    connections = Connections(room_for_connections(resource.getrlimit(resource.RLIMIT_NOFILE)[0]), REAL_TIME)
    config = uvicorn.Config(
        application,
        http="httptools",
        ws="none",
        proxy_headers=False,
        log_config=None,
        access_log=False,
        server_header=False,
        timeout_graceful_shutdown=3,
    )
    _Server(config, listener, connections, ready=ready, closing=closing).run()


def _load_numerics() -> None:
    """Import the numerics, so that the first page with statistics does not wait for them."""
    for module in NUMERICS:
        importlib.import_module(module)


def _announce_links(settings: Settings, port: int, keyring: Keyring, announce: Callable[[str], None]) -> None:
    """Print the links that unlock browsers.

    On loopback, the link that lets a browser command real vehicles. On a server that other devices reach, its addresses
    and the link that lets a tablet fly simulations; on a terminal also as a QR code.
    """
    addresses = addresses_elsewhere(settings.host, port)
    for address in addresses:
        announce(f"On a tablet: {address.url}" + (f" ({address.interface})" if address.interface else ""))
    if is_loopback(settings.host):
        link = unlock_link(web_address(settings.host, port), keyring.new_link())
        announce(f"Open {link} to command real vehicles from that browser.")
    elif addresses:
        link = unlock_link(addresses[0].url, keyring.new_link())
        announce(f"Open {link} on a tablet to create and fly simulated campaigns.")
        if sys.stdout.isatty():
            announce(qr_text(link))
    announce("The link works once, within 15 minutes; `gainline unlock` prints another.")
