"""Reports over HTTP, each under a policy of its own: nothing but what the file holds."""

from fastapi import APIRouter, Response

from app.api.deps import CurrentDatabase, CurrentSettings, Id
from app.db.session import Database
from app.reports.content import Report
from app.reports.printing import print_pdf
from app.reports.rendering import chart_library, file_name, render
from app.reports.service import report_of

router = APIRouter(prefix="/api/campaigns", tags=["reports"])


@router.get(
    "/{campaign_id}/report.html",
    response_class=Response,
    responses={200: {"content": {"text/html": {"schema": {"type": "string"}}}}},
)
def get_report(database: CurrentDatabase, settings: CurrentSettings, campaign_id: Id) -> Response:
    """The whole campaign as one page that can be saved and sent: it needs neither this program nor a network."""
    report = _report(database, campaign_id)
    document = render(report, chart_library(settings.ui_dir))
    return Response(
        document.html,
        media_type="text/html",
        headers={
            "Content-Security-Policy": document.policy,
            "Content-Disposition": f'inline; filename="{file_name(report.campaign, "html")}"',
        },
    )


@router.get(
    "/{campaign_id}/report.pdf",
    response_class=Response,
    responses={200: {"content": {"application/pdf": {"schema": {"type": "string", "format": "binary"}}}}},
)
def get_report_as_pdf(database: CurrentDatabase, settings: CurrentSettings, campaign_id: Id) -> Response:
    """The same, printed by a Chromium on the server; 503 where there is none, or it is printing already."""
    report = _report(database, campaign_id)
    document = render(report, chart_library(settings.ui_dir))
    return Response(
        print_pdf(document.html),
        media_type="application/pdf",
        headers={"Content-Disposition": f'inline; filename="{file_name(report.campaign, "pdf")}"'},
    )


def _report(database: Database, campaign_id: int) -> Report:
    """Read in a transaction of its own, which is over before anything is drawn or printed."""
    with database.read() as session:
        return report_of(session, campaign_id)
