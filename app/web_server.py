"""The web server of `gainline serve`: Uvicorn with the application."""

import gc
import importlib
import socket
import sys
import threading
from collections.abc import Callable
from typing import Final

import structlog
import uvicorn

from app.main import create_app
from app.network import addresses_elsewhere, web_address
from app.qr import qr_text
from app.settings import Settings

STREAMS_END_WITHIN_S: Final = 3
NUMERICS: Final = ("plotly.graph_objects", "scipy.integrate", "scipy.special", "numba")
NUMERICS_AFTER_S: Final = 5.0
"""How long after it is ready the server loads what charts and judgements need, if nobody has asked for any by then."""

_log = structlog.get_logger(__name__)


class _Server(uvicorn.Server):
    """Uvicorn, which says when it is ready, and ends the open event streams before it waits for them."""

    def __init__(self, config: uvicorn.Config, *, ready: Callable[[], None], closing: Callable[[], None]) -> None:
        super().__init__(config)
        self._ready = ready
        self._closing = closing

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        self._ready()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        self._closing()
        await super().shutdown(sockets)


def run(settings: Settings, listener: socket.socket, announce: Callable[[str], None]) -> None:
    """Serve on a listening socket until SIGINT or SIGTERM; `announce` gets a line when it is ready."""
    application = create_app(settings)
    address = web_address(settings.host, listener.getsockname()[1])

    def ready() -> None:
        _spare_what_stays()
        loading = threading.Timer(NUMERICS_AFTER_S, _load_numerics)
        loading.daemon = True
        loading.start()
        _log.info("ready", address=address)
        announce(f"Gainline is ready at {address}")
        _announce_elsewhere(settings.host, listener.getsockname()[1], announce)

    def closing() -> None:
        application.state.live.close()

    config = uvicorn.Config(
        application,
        log_config=None,
        access_log=False,
        server_header=False,
        timeout_graceful_shutdown=STREAMS_END_WITHIN_S,
    )
    _Server(config, ready=ready, closing=closing).run(sockets=[listener])


def _load_numerics() -> None:
    """So that the first page with charts does not wait for it."""
    for module in NUMERICS:
        importlib.import_module(module)


def _spare_what_stays() -> None:
    """The loaded program is never garbage: the collector need not go through all of it while an answer is made."""
    gc.collect()
    gc.freeze()


def _announce_elsewhere(host: str, port: int, announce: Callable[[str], None]) -> None:
    """Say where a tablet finds the dashboard, to a person with a code to point its camera at."""
    addresses = addresses_elsewhere(host, port)
    for address in addresses:
        announce(f"On a tablet: {address.url}" + (f" ({address.interface})" if address.interface else ""))
    if addresses and sys.stdout.isatty():
        announce(qr_text(addresses[0].url))
