"""What documents and the command line write alike about logs."""

import numpy as np
import pytest

from app.log_library.library_schemas import LogComparison
from app.log_library.parameter_changes import ParameterChange, ParameterGroup
from app.log_library.texts import changed_texts


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "–"),
        (0.0, "0"),
        (float(np.float32(0.075)), "0.075"),
        (float(np.float32(101323.57)), "101323.57"),
        (16_777_217.0, "16777217"),
        (0.1, "0.1"),
        (-1e-5, "-1e-05"),
    ],
)
def test_a_parameter_has_the_digits_that_tell_it_from_others(value: float | None, text: str) -> None:
    """Seen: two pressures that differ looked the same in seven digits."""
    change = ParameterChange(name="A", group=ParameterGroup.OTHER, before=value, after=1.5)
    assert changed_texts(LogComparison.model_construct(parameters=[change])) == [("A", text, "1.5", "other")]
