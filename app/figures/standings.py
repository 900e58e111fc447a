"""The standing of a flight among those of its campaign, which decides how its curve is drawn."""

from typing import Final

from app.figures import theme
from app.figures.data import FlightData, History
from app.figures.theme import Palette

SHARED_LEGEND: Final = {"earlier": "Earlier", "invalid": "Not counted"}
"""Standings whose flights look alike and share a legend entry."""
_ORDER: Final = ("invalid", "earlier", "baseline", "latest", "unjudged", "best")


def standing_of(history: History, flight: FlightData) -> str:
    """`best`, `latest`, `baseline`, `earlier`, `invalid` or `unjudged`."""
    if flight.outcome == "not yet reviewed":
        return "unjudged"
    if flight.outcome != "valid":
        return "invalid"
    if flight is history.best:
        return "best"
    if flight is history.latest and flight.gains == history.flights[0].gains:
        return "latest" if len(history.flights) == 1 else "baseline"
    return "latest" if flight is history.latest else "earlier"


def drawing_order(history: History, flight: FlightData) -> tuple[int, int]:
    """The most important flights last, on top."""
    return _ORDER.index(standing_of(history, flight)), flight.number


def style_of(palette: Palette, standing: str) -> dict[str, object]:
    """The line of a flight with this standing, or of the `prediction`."""
    return {
        "best": theme.line(palette.best, 3),
        "latest": theme.line(palette.ink, 2),
        "baseline": theme.line(palette.earlier, 1.75, "longdash"),
        "prediction": theme.line(palette.prediction, 2.25, "dash"),
        "earlier": theme.line(palette.earlier, 1.25),
        "invalid": theme.line(palette.bad, 1.25, "dot"),
        "unjudged": theme.line(palette.ink, 2, "longdash"),
    }[standing]
