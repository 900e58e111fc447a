"""Which column of the text log means what: an example of a decoder."""

from typing import BinaryIO, Final

from app.logs.text_log import read_text_log  # type: ignore[import-not-found]

from app.autopilots.paparazzi.profile import PAPARAZZI
from app.autopilots.recording import Recording, Setting, Source, columns_of, spans_of

SOURCES: Final = {"altitude_m": Source("ROW", "altitude_cm", 0.01)}


def read_text(stream: BinaryIO) -> Recording:
    """The recording in a text log."""
    tables = read_text_log(stream)
    rows = tables["ROW"]
    time_s = (rows["time_us"] / 1e6).tolist()
    flies = zip(time_s, (rows["flies"] > 0.0).tolist(), strict=True)
    return Recording(
        title="text log",
        autopilot=PAPARAZZI,
        columns=columns_of(tables, SOURCES, clock="time_us"),
        settings=[Setting(-float("inf"), gain, float(rows["kp"][0])) for gain in ("kp", "ki", "kd")],
        in_air=spans_of(flies),
    )


TEXT: Final = {
    "title": "Text log",
    "read": lambda stream, _companion: read_text(stream),
    "flight": lambda _recording, _name: None,
    "altitude": "no altitude",
    "hint": "Choose a log that is complete.",
}
"""The arguments of its `Reader`."""
