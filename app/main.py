"""Assembly of the web application."""

import gc

# Modules loaded until `gc.freeze()` stay for good: looking for garbage among them takes a tenth of the start.
gc.disable()

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from fastapi import FastAPI
from starlette.middleware.gzip import GZipMiddleware

from app import __version__
from app.accounts.keys_and_links import Keyring
from app.bundles.router import router as bundles
from app.campaigns import catalogue
from app.campaigns import router as campaigns
from app.campaigns.flight_predictions import PredictorCache
from app.campaigns.trials import router as trials
from app.common.errors import NotFoundError
from app.common.settings import Settings
from app.compare.router import router as compare
from app.db.migrate import require_current
from app.db.session import Database
from app.fleet.router import router as fleet
from app.flights.router import router as flights
from app.jobs.router import router as jobs
from app.live.hub import live_link
from app.log_library import router as log_library
from app.reports.router import router as reports
from app.reproductions.router import router as reproductions
from app.web import errors, events, system
from app.web.headers import Assets, BodyLimitMiddleware, HeadersMiddleware
from app.web.origin import AccessMiddleware

gc.freeze()
gc.enable()


def create_app(settings: Settings | None = None) -> FastAPI:
    """Create the application for the settings' database, which must be at the program's revision when it starts.

    Raises SchemaError at start-up when it is not.
    """
    settings = settings or Settings()
    database = Database(settings.database_file)

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        require_current(settings.database_file)
        app.state.keyring = Keyring(settings.data_dir)
        async with live_link(settings.data_dir, database) as live:
            app.state.live = live
            yield
        database.close()

    app = FastAPI(
        title="Gainline",
        version=__version__,
        lifespan=lifespan,
        openapi_url="/api/openapi.json",
        docs_url=None,
        redoc_url=None,
        responses=errors.RESPONSES,
        generate_unique_id_function=lambda route: route.name,  # so that generated clients have readable calls
    )
    app.state.settings = settings
    app.state.database = database
    app.state.predictors = PredictorCache()
    for router in (
        catalogue.router,
        system.router,
        campaigns.router,
        trials.router,
        flights,
        trials.uploads,
        fleet,
        jobs,
        reproductions,
        log_library.router,
        log_library.vehicles,
        log_library.failure_shapes,
        compare,
        reports,
        bundles,
        campaigns.vehicles_router,
        campaigns.figures_router,
        events.router,
    ):
        app.include_router(router)
    errors.install(app)
    app.add_middleware(BodyLimitMiddleware, upload_bytes=settings.max_upload_bytes)
    app.add_middleware(AccessMiddleware)
    app.add_middleware(GZipMiddleware, minimum_size=1000, compresslevel=5)  # of nine: for each response anew
    app.add_middleware(HeadersMiddleware)
    if (settings.ui_dir / "index.html").is_file():
        app.mount("/assets", Assets(directory=settings.ui_dir / "assets", check_dir=False))
        app.frontend("/", directory=settings.ui_dir, fallback="index.html")
    else:
        app.add_api_route("/", _no_dashboard, include_in_schema=False)
    return app


def _no_dashboard() -> None:
    raise NotFoundError(
        "built dashboard in",
        "this installation",
        hint="In a checkout, `./dev up` builds and serves it. The API under /api works without it.",
    )
