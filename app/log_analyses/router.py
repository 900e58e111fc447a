"""Log analyses over HTTP."""

from fastapi import APIRouter, status

from app.campaigns.schemas import Campaign
from app.log_analyses import service
from app.log_analyses.schemas import LogAnalysis
from app.web.dependencies import REQUEST_BODY, Record, RequestContextDep

router = APIRouter(prefix="/api/log-analyses", tags=["log analyses"])


@router.post("", openapi_extra=REQUEST_BODY)
def analyze_log(record: Record) -> LogAnalysis:
    """Analyse a log: how the altitude was controlled, the fitted vehicle, and better gains.

    ArduCopter's .bin or PX4's .ulg log of a flight with altitude changes, a .tlog of altitude steps under either, or
    Paparazzi's .data log (with its .log as the form field `companion`) or .tlog of takeoffs to 3 m. Takes some seconds;
    nothing is stored.
    """
    return service.analyze_upload(record.content(), record.read_companion(), name=record.name)


@router.post("/campaign", status_code=status.HTTP_201_CREATED, openapi_extra=REQUEST_BODY)
def start_campaign(record: Record, asking: RequestContextDep) -> Campaign:
    """Create a campaign of a vehicle that is flown elsewhere, with the takeoffs of a Paparazzi log as its first
    flights."""
    from app.log_analyses import campaigns  # noqa: PLC0415 - imports the models of an analysis

    found = service.read_upload(record.content(), record.read_companion(), name=record.name)
    return record.once(Campaign, lambda session: campaigns.start_campaign(session, found, asking, name=record.name))
