"""Log analyses over HTTP."""

from typing import Annotated

from fastapi import APIRouter, Query, status

from app.campaigns.schemas import Campaign
from app.common.schemas import uploaded_name
from app.log_library import service
from app.log_library.schemas import LogAnalysis
from app.web.dependencies import REQUEST_BODY, Record, RequestContextDep

FlownGains = Annotated[str, Query(max_length=40, description="KP,KI,KD flown, if the log does not contain them")]
LoggedVehicle = Annotated[int | None, Query(ge=0, le=255, description="system id, if a log has several vehicles")]
router = APIRouter(prefix="/api/log-analyses", tags=["log analyses"])


@router.post("", openapi_extra=REQUEST_BODY)
def analyze_log(record: Record, gains: FlownGains = "", vehicle: LoggedVehicle = None) -> LogAnalysis:
    """Analyse a log: how the altitude was controlled, the fitted vehicle, and better gains; and how well the replica of
    the autopilot's vertical loop explains it. Where only one of both is possible, the other says why not.

    ArduCopter's .bin or PX4's .ulg log of a flight with altitude changes, a .tlog of altitude steps under either, or
    Paparazzi's .data log (with its .log as the form field `companion`) or .tlog of takeoffs to 3 m; or a trace of the
    vertical loop with a row for every step, .csv or .csv.gz. Takes some seconds; nothing is stored.
    """
    return service.analyze_upload(
        record.content(), record.read_companion(), name=record.name, gains=gains, vehicle=vehicle
    )


@router.get("/example")
def get_example_analysis() -> LogAnalysis:
    """Analyse the example: a takeoff that comes with Gainline, recorded from the autopilot's own code."""
    return service.analyze_example()


@router.post("/campaign", status_code=status.HTTP_201_CREATED, openapi_extra=REQUEST_BODY)
def start_campaign(
    record: Record,
    asking: RequestContextDep,
    vehicle: Annotated[int | None, Query(ge=1, le=2**63 - 1)] = None,
    logged_vehicle: LoggedVehicle = None,
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
