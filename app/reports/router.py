"""HTTP API of reports, each with its own content security policy that allows only the file's own content."""

from fastapi import APIRouter, Response

from app.campaigns.service import get_row
from app.common.settings import Settings
from app.db.session import Database
from app.documents.html import Document, chart_library
from app.reports.html import file_name, render
from app.reports.pdf import print_pdf
from app.reports.service import report_of
from app.web.dependencies import CurrentDatabase, CurrentSettings, Id, described, document_response

router = APIRouter(prefix="/api/campaigns", tags=["reports"])


@router.get("/{campaign_id}/report.html", response_class=Response, responses=described("text/html", binary=False))
def get_report(database: CurrentDatabase, settings: CurrentSettings, campaign_id: Id) -> Response:
    """The whole campaign as one page that can be saved and sent: it needs neither Gainline nor a network."""
    document = _document(database, settings, campaign_id)
    return document_response(document, file_name(campaign_id, "html"))


@router.get("/{campaign_id}/report.pdf", response_class=Response, responses=described("application/pdf"))
def get_report_as_pdf(database: CurrentDatabase, settings: CurrentSettings, campaign_id: Id) -> Response:
    """The same as PDF, printed by Chromium on the server; 503 if it is not installed or already busy printing."""
    with database.read() as session:
        get_row(session, campaign_id)  # an unknown campaign is reported even if there is no printer
    return Response(
        print_pdf(lambda: _document(database, settings, campaign_id).html),
        media_type="application/pdf",
        headers={"Content-Disposition": f'inline; filename="{file_name(campaign_id, "pdf")}"'},
    )


def _document(database: Database, settings: Settings, campaign_id: int) -> Document:
    """Read in a transaction that ends before rendering. Raises NotFoundError."""
    with database.read() as session:
        report = report_of(session, campaign_id)
    return render(report, chart_library(settings.ui_dir))
