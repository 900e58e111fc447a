"""Trials and their records over HTTP."""

from typing import Annotated

from fastapi import APIRouter, Depends, Query, Response, status
from fastapi.responses import FileResponse

from app.autopilots.takeoffs import Takeoff
from app.campaigns.flight_predictions import PredictorCache, TrialPredictor
from app.campaigns.schemas import Campaign, ConsideredGains
from app.campaigns.trials import photos, records, reviews, service
from app.campaigns.trials.record_doubts import Accepted
from app.campaigns.trials.schemas import (
    AbortJudgement,
    Classification,
    Reopening,
    Trajectory,
    Trial,
    TrialEdit,
    TrialPhoto,
    TrialPlan,
)
from app.common.schemas import Gate, Page
from app.web.dependencies import (
    FILE_BODY,
    PLANNED_RECORD_BODY,
    REQUEST_BODY,
    CurrentSettings,
    Id,
    IdempotentPost,
    Reader,
    Record,
    RequestContextDep,
    WantedPart,
    Writer,
    described,
    json_only,
    of_app,
)


async def _trial_predictor(predictors: Annotated[PredictorCache, of_app("predictors")]) -> TrialPredictor:
    return TrialPredictor(predictors)


TrialPredictorDep = Annotated[TrialPredictor, Depends(_trial_predictor)]

router = APIRouter(prefix="/api", tags=["trials"], dependencies=[Depends(json_only)])


@router.get("/campaigns/{campaign_id}/trials")
def list_trials(session: Reader, campaign_id: Id, part: WantedPart) -> Page[Trial]:
    """The trials of a campaign, in the order of their numbers."""
    return service.list_trials(session, campaign_id, part)


@router.post("/campaigns/{campaign_id}/gate")
def evaluate_gate(session: Reader, campaign_id: Id, body: ConsideredGains) -> Gate:
    """The gate's result for any gains. Changes nothing; a trial's gains are checked again."""
    return service.evaluate_gate(session, campaign_id, body.gains)


@router.post("/campaigns/{campaign_id}/reopen")
def reopen_campaign(
    act: IdempotentPost,
    asking: RequestContextDep,
    predictor: TrialPredictorDep,
    campaign_id: Id,
    body: Reopening | None = None,
) -> Campaign:
    """Reopen a finished campaign for more flights."""
    asked = body or Reopening()
    return act(lambda session: service.reopen_campaign(session, campaign_id, asked, asking, predictor=predictor))


@router.get("/trials/{trial_id}")
def get_trial(session: Reader, trial_id: Id) -> Trial:
    return service.get_trial(session, trial_id)


@router.patch("/trials/{trial_id}")
def edit_trial(session: Writer, trial_id: Id, body: TrialEdit) -> Trial:
    """Change the note."""
    return service.edit_trial(session, trial_id, body)


@router.post("/trials/{trial_id}/cancel")
def cancel_trial(act: IdempotentPost, trial_id: Id) -> Trial:
    """Cancel a trial that has not flown."""
    return act(lambda session: service.cancel_trial(session, trial_id))


@router.post("/trials/{trial_id}/classify")
def classify_trial(act: IdempotentPost, asking: RequestContextDep, trial_id: Id, body: Classification) -> Trial:
    """Classify a finished flight as valid, aborted or invalid; whatever was computed from it is recomputed."""
    return act(lambda session: reviews.classify_trial(session, trial_id, body, asking))


@router.post("/trials/{trial_id}/judge-abort")
def judge_abort(act: IdempotentPost, asking: RequestContextDep, trial_id: Id, body: AbortJudgement) -> Trial:
    """Record why the operator aborted a flight. It counts against its gains only if the vehicle behaved badly; whatever
    was computed from it is recomputed."""
    return act(lambda session: reviews.judge_abort(session, trial_id, body, asking))


@router.get("/trials/{trial_id}/trajectory")
def get_trajectory(session: Reader, trial_id: Id, points: Annotated[int, Query(ge=10, le=20_000)] = 1000) -> Trajectory:
    """The record, thinned to at most `points` samples with peaks kept."""
    return records.get_trajectory(session, trial_id, points)


@router.get(
    "/trials/{trial_id}/trajectory.csv",
    response_class=Response,
    responses={
        200: {
            "content": {"text/csv": {"schema": {"type": "string"}}},
            "headers": {
                "X-Checksum-SHA256": {"schema": {"type": "string"}, "description": "checksum of the stored record"}
            },
        }
    },
)
def get_trajectory_csv(session: Reader, trial_id: Id) -> Response:
    """The full record as CSV, every number exactly as stored (single precision, nine digits)."""
    name, csv, checksum = records.export_trajectory(session, trial_id)
    headers = {"Content-Disposition": f'attachment; filename="{name}"', "X-Checksum-SHA256": checksum}
    return Response(csv, media_type="text/csv", headers=headers)


@router.get("/trials/{trial_id}/tlog", response_class=FileResponse, responses=described("application/octet-stream"))
def get_telemetry_log(session: Reader, settings: CurrentSettings, trial_id: Id) -> FileResponse:
    """The .tlog of the trial's last flight: all messages over the link in both directions, in the format of ground
    stations."""
    file, name = records.find_telemetry_log(session, trial_id, settings.data_dir)
    return FileResponse(file, media_type="application/octet-stream", filename=name)


@router.get("/trials/{trial_id}/photos")
def list_photos(session: Reader, trial_id: Id) -> list[TrialPhoto]:
    """The photos of a flight, in the order in which they were added."""
    return photos.list_photos(session, trial_id)


@router.get("/trials/{trial_id}/photos/{photo_id}", response_class=Response, responses=described(*photos.ENDINGS))
def get_photo(session: Reader, trial_id: Id, photo_id: Id) -> Response:
    """A picture as uploaded. Its headers keep it from running or loading anything when it is opened by itself."""
    picture, name = photos.get_picture(session, trial_id, photo_id)
    return Response(
        picture.data,
        media_type=picture.media_type,
        headers={
            "Cache-Control": "private, max-age=31536000, immutable",
            "Content-Disposition": f'inline; filename="{name}"',
            "Content-Security-Policy": "default-src 'none'; sandbox; frame-ancestors 'none'",
        },
    )


@router.delete("/trials/{trial_id}/photos/{photo_id}", status_code=status.HTTP_204_NO_CONTENT)
def delete_photo(session: Writer, trial_id: Id, photo_id: Id) -> None:
    photos.delete_photo(session, trial_id, photo_id)


uploads = APIRouter(prefix="/api", tags=["trials"])
"""A router of its own, because the request bodies are not JSON."""


AcceptedQuery = Annotated[Accepted, Query()]


def _takeoff_in(record: Record, accepted: Accepted) -> Takeoff:
    content, companion = record.content(), record.read_companion()
    return records.read_upload(content, name=record.name, takeoff=accepted.takeoff, companion=companion)


@uploads.post(
    "/campaigns/{campaign_id}/records", status_code=status.HTTP_201_CREATED, openapi_extra=PLANNED_RECORD_BODY
)
def import_flight(
    record: Record,
    asking: RequestContextDep,
    predictor: TrialPredictorDep,
    accepted: AcceptedQuery,
    campaign_id: Id,
) -> Trial:
    """Plan the trial in the form field `trial` and upload its record, as one operation: nothing is planned when the
    record is refused."""
    plan = record.read_field("trial", TrialPlan)
    flown = _takeoff_in(record, accepted)
    return record.once(
        lambda session: records.plan_and_import(
            session, campaign_id, plan, flown, asking, accepted=accepted, predictor=predictor
        ),
        ahead=lambda session: service.prepare_trial(session, campaign_id, plan, predictor),
    )


@uploads.post("/trials/{trial_id}/trajectory", status_code=status.HTTP_201_CREATED, openapi_extra=REQUEST_BODY)
def upload_trajectory(
    record: Record,
    asking: RequestContextDep,
    accepted: AcceptedQuery,
    trial_id: Id,
) -> Trial:
    """Upload the record of a flight flown elsewhere, or the recovered record of a lost flight.

    A log (MAVLink .tlog, ArduPilot .bin, PX4 .ulg, Paparazzi .data, with its .log as the form field `companion`), in
    which takeoff and gains are found; or CSV with the columns time_s (seconds since the command) and altitude_m (up),
    and optionally the other channels, at most 200 000 rows. It is scored and classified at once.
    """
    flown = _takeoff_in(record, accepted)
    return record.once(lambda session: records.import_record(session, trial_id, flown, asking, accepted=accepted))


@uploads.post("/trials/{trial_id}/photos", status_code=status.HTTP_201_CREATED, openapi_extra=FILE_BODY)
def add_photo(upload: Record, trial_id: Id) -> TrialPhoto:
    """Add a photo (JPEG, PNG or WebP, detected by its content; at most 10 MiB) to a flight, as the form field
    `file`."""
    return upload.once(lambda session: photos.add_photo(session, trial_id, upload.content()))
