"""Every figure that is drawn in these tests has only properties and values that Plotly knows."""

from typing import Any

import plotly.graph_objects as go
import pytest

from app.figures.base import Card, Figure


@pytest.fixture(autouse=True)
def known_to_plotly(monkeypatch: pytest.MonkeyPatch) -> None:
    ready = Figure.ready

    def validated(self: Figure, *args: Any, **options: Any) -> Card:
        card = ready(self, *args, **options)
        go.Figure(card.figure)
        return card

    monkeypatch.setattr(Figure, "ready", validated)
