"""Export of a campaign as one file, and import with new ids and every number unchanged."""

from pathlib import Path
from typing import IO

from sqlalchemy.orm import Session

from app.bundles.contents import MAX_CAMPAIGNS
from app.bundles.packing import Packer
from app.bundles.reading import Bundle
from app.bundles.storing import keep_telemetry, store
from app.campaigns import history
from app.campaigns import service as campaigns
from app.campaigns.schemas import Campaign
from app.common.errors import BusyError, ConflictError
from app.db.models import CampaignRow


def write_bundle(session: Session, campaign_id: int, data_dir: Path, out: IO[bytes]) -> str:
    """Write the campaign, after those that it starts from; returns the file name.

    Raises NotFoundError, BusyError while one of them has a flight under way, and ConflictError for more than a bundle
    holds.
    """
    row = campaigns.get_row(session, campaign_id)
    chain = _chain(session, row)
    for each in chain:
        if history.flight_under_way(session, each.id) is not None:
            raise BusyError(
                f"Campaign {each.id} has a flight under way.", hint="Wait until it is over, then take the bundle."
            )
    Packer(session, data_dir, out).pack(chain)
    return f"campaign-{row.id}.gainline.zip"


def _chain(session: Session, row: CampaignRow) -> list[CampaignRow]:
    """The campaign and those that it starts from, the first of them first.

    None can be left out, because the campaign's first gains could not be computed again without it.
    """
    chain = [row]
    while (donor := (chain[0].definition.get("start") or {}).get("donor")) is not None:
        found = campaigns.get_row(session, donor["campaign_id"])
        if any(found is known for known in chain):
            break
        chain.insert(0, found)
    if len(chain) > MAX_CAMPAIGNS:
        raise ConflictError(
            f"Campaign {row.id} goes back over {len(chain) - 1} warm starts, and a bundle holds {MAX_CAMPAIGNS} "
            "campaigns: without the first of them its gains could not be computed again.",
            hint=f"Take the bundle of an earlier one of them (campaign {chain[MAX_CAMPAIGNS - 1].id} is the last that "
            "fits), or the report and the records of this one.",
        )
    return chain


def store_bundle(session: Session, bundle: Bundle, data_dir: Path) -> Campaign:
    """Import a checked bundle: a new campaign, and those that it starts from.

    Raises InputError for what this version cannot hold, and ConflictError while any flight is active, because a large
    bundle holds the write lock for longer than a flight may wait.
    """
    if (flight := history.any_flight_under_way(session)) is not None:
        raise ConflictError(
            f"Campaign {flight.campaign_id} has a flight asked for, staged or under way, and storing a bundle would "
            "keep its commands and its record waiting.",
            hint="Bring the bundle in once it has landed, or unstage it.",
        )
    arrived = store(session, bundle)
    keep_telemetry(bundle, arrived, data_dir)
    return campaigns.get_campaign(session, arrived.rows[-1].id)
