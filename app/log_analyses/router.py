"""Log analyses over HTTP."""

from fastapi import APIRouter

from app.log_analyses import service
from app.log_analyses.service import LogAnalysis
from app.web.dependencies import REQUEST_BODY, Record

router = APIRouter(prefix="/api/log-analyses", tags=["log analyses"])


@router.post("", openapi_extra=REQUEST_BODY)
def analyze_log(record: Record) -> LogAnalysis:
    """Analyse ArduCopter's .bin log of a flight with altitude changes: how its altitude loop behaves, the vehicle
    behind it, and better gains. Takes some seconds; nothing is stored."""
    return service.analyze_upload(record.content(), name=record.name)
