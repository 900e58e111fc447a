"""Log analyses, the log library and the atlas of failure shapes over HTTP."""

from collections.abc import Sequence
from typing import Annotated
from urllib.parse import quote

from fastapi import APIRouter, Query, Response, status

from app.campaigns.schemas import Campaign
from app.common.schemas import Page, uploaded_name
from app.documents.html import chart_library
from app.figures.base import Card
from app.log_library import comparisons, documents, service, shapes, stored_logs, trends
from app.log_library.library_schemas import (
    AnalysedLog,
    AtlasShape,
    LogAnalysis,
    LogComparison,
    LogExport,
    LoggedVehicle,
    LoggedVehicleBrief,
    LoggedVehicleDetails,
    LogPlace,
    VehicleName,
)
from app.web.dependencies import (
    REQUEST_BODY,
    CurrentDatabase,
    CurrentSettings,
    Id,
    IdempotentPost,
    Reader,
    Record,
    RequestContextDep,
    Theme,
    WantedPart,
    Writer,
    described,
    document_response,
)

FlownGains = Annotated[str, Query(max_length=40, description="KP,KI,KD flown, if the log does not contain them")]
SystemId = Annotated[int | None, Query(ge=0, le=255, description="system id, if a log has several vehicles")]
RegisteredVehicle = Annotated[int | None, Query(ge=1, le=2**63 - 1)]
router = APIRouter(prefix="/api/log-analyses", tags=["log analyses"])
vehicles = APIRouter(prefix="/api/logged-vehicles", tags=["log analyses"])
failure_shapes = APIRouter(prefix="/api/failure-shapes", tags=["log analyses"])


@failure_shapes.get("")
def list_failure_shapes() -> Sequence[AtlasShape]:
    """List the shapes of failure that a log is searched for: how each is recognised, what to do, and what it looks like
    in a simulated flight."""
    return shapes.atlas()


@router.post("", openapi_extra=REQUEST_BODY)
def analyze_log(
    record: Record, database: CurrentDatabase, gains: FlownGains = "", vehicle: SystemId = None
) -> LogAnalysis:
    """Analyse a log: how the altitude was controlled, the fitted vehicle, and better gains; and how well the replica of
    the autopilot's vertical loop explains it. Where only one of both is possible, the other says why not.

    ArduCopter's .bin or PX4's .ulg log of a flight with altitude changes, a .tlog of altitude steps under either, or
    Paparazzi's .data log (with its .log as the form field `companion`) or .tlog of takeoffs to 3 m; or a trace of the
    vertical loop with a row for every step, .csv or .csv.gz. Takes some seconds. The answer is stored for seven days,
    or until it is deleted if the log is kept; the file is not. The same log again has the same answer.
    """
    return service.analyze_upload(
        database,
        record.content(),
        record.read_companion(),
        name=uploaded_name(record.name, unnamed=service.UNNAMED),
        gains=gains,
        vehicle=vehicle,
    )


@router.post("/example")
def analyze_example(database: CurrentDatabase) -> LogAnalysis:
    """Analyse the log that comes with Gainline: altitude steps of a simulated ArduCopter."""
    return service.analyze_example(database)


@router.post("/campaign", status_code=status.HTTP_201_CREATED, openapi_extra=REQUEST_BODY)
def start_campaign(
    record: Record,
    asking: RequestContextDep,
    vehicle: RegisteredVehicle = None,
    logged_vehicle: SystemId = None,
) -> Campaign:
    """Create the campaign of a log.

    From a Paparazzi log: of a vehicle that is flown elsewhere, with the takeoffs as its first flights. From a log of an
    ArduCopter or PX4: a draft of altitude steps with a registered `vehicle`, by default the only one that flies them,
    with the gains proposed from the log for the first flight. The fitted vehicle replaces the data sheet
    until then.
    """
    name = uploaded_name(record.name, unnamed=service.UNNAMED)
    found = service.read_upload(record.content(), record.read_companion(), name=name, vehicle=logged_vehicle)
    return record.once(lambda session: service.start_campaign(session, found, asking, name=name, vehicle_id=vehicle))


@router.get("")
def list_logs(
    session: Reader,
    part: WantedPart,
    vehicle: Annotated[int | None, Query(ge=1, le=2**63 - 1, description="a vehicle with kept logs")] = None,
    kept: Annotated[bool, Query(description="false: those that are kept for seven days only")] = True,
) -> Page[AnalysedLog]:
    """Analysed logs, the newest flight first."""
    return stored_logs.list_logs(session, part, vehicle_id=vehicle, kept=kept)


@router.get("/{log_id}")
def get_log_analysis(session: Reader, log_id: Id) -> LogAnalysis:
    """A stored answer, as it was given."""
    return stored_logs.get_analysis(session, log_id)


@router.put("/{log_id}/vehicle")
def keep_log(session: Writer, log_id: Id, body: VehicleName) -> LogPlace:
    """Keep a log as a flight of the vehicle with this name, which is created if there is none. A vehicle is recognised
    by the hardware id in its logs; 409 if the name is that of another."""
    return stored_logs.keep(session, log_id, body.name)


@router.delete("/{log_id}", status_code=status.HTTP_204_NO_CONTENT)
def delete_log(session: Writer, log_id: Id) -> None:
    """Delete a log; of a vehicle without logs nothing is left."""
    stored_logs.delete_log(session, log_id)


@router.put("/{log_id}/file", openapi_extra=REQUEST_BODY)
def store_log_file(record: Record, settings: CurrentSettings, session: Writer, log_id: Id) -> LogPlace:
    """Store the file of a kept log too. All files together take at most GAINLINE_LOG_FILE_BYTES."""
    return stored_logs.store_file(
        session, log_id, record.content(), record.read_companion(), quota_bytes=settings.log_file_bytes
    )


@router.get("/{log_id}/file", response_class=Response, responses=described("application/octet-stream"))
def get_log_file(
    session: Reader, log_id: Id, companion: Annotated[bool, Query(description="Paparazzi's .log instead")] = False
) -> Response:
    """A stored file; 404 if it is not stored."""
    name, content = stored_logs.file_content(session, log_id, companion=companion)
    headers = {"Content-Disposition": f"attachment; filename*=UTF-8''{quote(name)}"}
    return Response(content, media_type="application/octet-stream", headers=headers)


@router.get("/{log_id}/comparison")
def compare_logs(
    session: Reader,
    log_id: Id,
    before: Annotated[int | None, Query(ge=1, le=2**63 - 1, description="by default the log before it")] = None,
) -> LogComparison:
    """Compare a log with another of the same vehicle: which parameters changed, and whether its gains are better."""
    return comparisons.compare(session, log_id, before)


@router.get("/{log_id}/export.json")
def export_log(session: Reader, log_id: Id) -> LogExport:
    """The answer and all parameters, for other programs."""
    return stored_logs.export(session, log_id)


@router.get("/{log_id}/export.html", response_class=Response, responses=described("text/html", binary=False))
def export_log_as_html(session: Reader, settings: CurrentSettings, log_id: Id) -> Response:
    """The answer, its figures and what changed since the log before it, as one page that can be saved and sent: it
    needs neither Gainline nor a network."""
    document = documents.document_of(session, log_id, chart_library(settings.ui_dir))
    return document_response(document, documents.file_name(log_id))


@router.post("/{log_id}/campaign", status_code=status.HTTP_201_CREATED)
def start_stored_campaign(
    act: IdempotentPost,
    database: CurrentDatabase,
    asking: RequestContextDep,
    log_id: Id,
    vehicle: RegisteredVehicle = None,
) -> Campaign:
    """Create the campaign of a stored log, as from its file; 404 for one of takeoffs whose file is not stored."""
    found, name = service.start_of(database, log_id)
    return act(lambda session: service.start_campaign(session, found, asking, name=name, vehicle_id=vehicle))


@vehicles.get("")
def list_logged_vehicles(session: Reader) -> list[LoggedVehicle]:
    """The vehicles with kept logs, the one that flew last first."""
    return stored_logs.list_vehicles(session)


@vehicles.get("/{vehicle_id}")
def get_logged_vehicle(session: Reader, vehicle_id: Id) -> LoggedVehicleDetails:
    """A vehicle, and what its logs tell together."""
    return trends.get_vehicle(session, vehicle_id)


@vehicles.get("/{vehicle_id}/trend")
def get_trend(session: Reader, vehicle_id: Id, theme: Theme = "light") -> Card:
    """Hover throttle, deviation, throttle activity and margin over the vehicle's logs."""
    return trends.trend_figure(session, vehicle_id, theme)


@vehicles.put("/{vehicle_id}/name")
def rename_logged_vehicle(session: Writer, vehicle_id: Id, body: VehicleName) -> LoggedVehicleBrief:
    return stored_logs.rename_vehicle(session, vehicle_id, body.name)
