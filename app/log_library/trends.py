"""What the logs of a vehicle tell together, and over its life."""

from collections.abc import Sequence
from statistics import fmean

from sqlalchemy.orm import Session

from app.core.analysis.combined_fit import LogFit, combine
from app.core.formatting import count
from app.db.models import AnalysedLogRow
from app.figures.base import Card, card_of
from app.figures.panels import Line, Panel, PanelsFigure, Plot
from app.figures.theme import ThemeName
from app.log_library import repository
from app.log_library.library_schemas import CombinedVehicle, LoggedVehicleDetails, LogNumbers
from app.log_library.schemas import EstimatedValue
from app.log_library.stored_logs import log_view, vehicle_view
from app.log_library.texts import QUANTITIES


def get_vehicle(session: Session, vehicle_id: int) -> LoggedVehicleDetails:
    """A vehicle with what its logs tell together. Raises NotFoundError."""
    vehicle, logs = repository.get_vehicle(session, vehicle_id), repository.logs_of(session, vehicle_id)
    return LoggedVehicleDetails(**dict(vehicle_view(vehicle, len(logs), logs[-1])), combined=_combined(logs))


def _combined(logs: Sequence[AnalysedLogRow]) -> CombinedVehicle | None:
    """What those under the newest log's autopilot tell together; None if fewer than two tell the vehicle."""
    alike = (row for row in logs if row.autopilot == logs[-1].autopilot)
    fits = {row.file_digest: LogFit(**row.fit) for row in alike if row.fit is not None}  # a file is evidence once
    if len(fits) < 2:
        return None
    found = combine([*fits.values()])
    hover = EstimatedValue(mean=fmean(found.hover_throttles), deviation=found.hover_spread)
    fitted = {name: EstimatedValue(mean=found.mean[name], deviation=found.deviation[name]) for name in found.mean}
    return CombinedVehicle(logs=len(fits), hover_throttle=hover, **fitted, is_one_vehicle=found.is_one_vehicle)


def trend_figure(session: Session, vehicle_id: int, theme: ThemeName) -> Card:
    """Hover throttle, deviation, activity and margin by the number of the log, oldest first. Raises NotFoundError."""
    vehicle = repository.get_vehicle(session, vehicle_id)
    logs = [log_view(row).numbers for row in repository.logs_of(session, vehicle_id)]
    return card_of(PanelsFigure(trend_plot(vehicle.name, logs), theme_name=theme))


def trend_plot(name: str, logs: Sequence[LogNumbers]) -> Plot:
    """A panel for each quantity that a log tells."""
    panels = []
    for title, digits, value_of in QUANTITIES:
        known = {float(place): value for place, log in enumerate(logs, 1) if (value := value_of(log)) is not None}
        line = Line(name=title, style="measured", x=tuple(known), y=tuple(known.values()), marks=True)
        panels += [Panel(y_title=title, digits=digits, lines=(line,))] * bool(known)
    return Plot(
        title=f"Trend of {name}",
        summary=f"Hover throttle, mean deviation, throttle activity and margin in {count(len(logs), 'log')}.",
        x_title="Log",
        x_range=(0.5, len(logs) + 0.5),
        x_digits=0,
        x_step=1 + len(logs) // 12,
        panels=tuple(panels),
    )
