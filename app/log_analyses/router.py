"""Log analyses over HTTP."""

from fastapi import APIRouter

from app.log_analyses import service
from app.log_analyses.schemas import LogAnalysis
from app.web.dependencies import REQUEST_BODY, Record

router = APIRouter(prefix="/api/log-analyses", tags=["log analyses"])


@router.post("", openapi_extra=REQUEST_BODY)
def analyze_log(record: Record) -> LogAnalysis:
    """Analyse a log: how the altitude was controlled, the fitted vehicle, and better gains.

    ArduCopter's .bin log of a flight with altitude changes, or Paparazzi's .data log (with its .log as the form field
    `companion`) or .tlog of takeoffs to 3 m. Takes some seconds; nothing is stored.
    """
    return service.analyze_upload(record.content(), record.read_companion(), name=record.name)
