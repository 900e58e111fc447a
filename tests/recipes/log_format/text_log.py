"""A text with a row for each sample: an example of a log format."""

from typing import BinaryIO, Final

import numpy as np

from app.logs.base import Table, refused

FIRST: Final = b"#TEXTLOG\n"


def is_text_log(head: bytes) -> bool:
    """Whether a file begins like this log."""
    return head.startswith(FIRST)


def read_text_log(stream: BinaryIO) -> dict[str, Table]:
    """Its only table, in µs and cm. Raises TrajectoryError for rows that are no numbers."""
    stream.seek(len(FIRST))
    try:
        rows = np.loadtxt(stream, dtype=np.float64, ndmin=2)
    except ValueError as error:
        raise refused("contains a row that is not four numbers", "Choose a log that is complete.") from error
    if rows.shape[1] != 4:
        raise refused("contains a row that is not four numbers", "Choose a log that is complete.")
    return {"ROW": dict(zip(("time_us", "altitude_cm", "flies", "kp"), rows.T, strict=True))}
