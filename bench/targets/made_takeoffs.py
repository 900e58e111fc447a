"""Logs of takeoffs that random twins fly with the default gains under Paparazzi, as its ground station writes them."""

from typing import Final

import numpy as np

from app.autopilots.paparazzi.replica.loop_log import FIELDS
from app.core.control import vertical_guidance as loop
from app.core.experiments.takeoff import TARGET_M, Takeoff
from app.vehicles.kernels import (
    ALTITUDE,
    CLIMB_RATE,
    COMMAND_SIZE,
    ENTERED,
    KD,
    KI,
    KP,
    LAST_THRUST,
    MODE,
    TARGET,
    THRUST,
    Rows,
)
from app.vehicles.twin import TwinFlight
from bench.copters.made_logs import MadeLog
from bench.targets.vehicles import population
from tests.logs.paparazzi_flights import COMPANION

_SEED: Final = 20261201
_EVERY: Final = 26
"""Steps from one message to the next: about 20 a second."""
_BEFORE, _FLOWN = 60, 700
"""Messages on the ground before the command, and after it."""
_BEGIN_S: Final = 12.0
_AIRCRAFT: Final = 31
_STATE: Final = {
    "z_ref": loop.Z_REF,
    "zd_ref": loop.ZD_REF,
    "zdd_ref": loop.ZDD_REF,
    "z_sum_err": loop.Z_SUM_ERR,
    "ff_cmd": loop.FF_CMD,
    "fb_cmd": loop.FB_CMD,
    "thrust": LAST_THRUST,
}
"""Where the loop's memory has what is logged."""


def ground_log(number: int) -> MadeLog:
    """Paparazzi's .data and .log of a takeoff of the twin with this number, from 0, of those with further physics.

    Its options are the truth, but for the start latency: the log shows when the loop began, not the command, so what is
    true is the time from the last message before that.
    """
    vehicle = [each for each in population("further-physics", 2 * number + 2, _SEED) if each.kind == "twin"][number]
    options = {name: float(value) for name, value in vehicle.options.items()}
    flight, late = (TwinFlight(each, number) for each in (options, {**options, "start_latency_s": 1.0}))
    command = np.zeros(COMMAND_SIZE, dtype=np.int64)
    command[[MODE, TARGET]] = loop.ALT, loop.fix(TARGET_M, loop.POSITION_BITS)
    command[[KP, KI, KD]] = [int(each) for each in Takeoff.space.default]
    on_ground, entered_after = late.advance(1, command)[0], 0
    lines = [_message(place, on_ground, late) for place in range(_BEFORE)]
    for place in range(_BEFORE, _BEFORE + _FLOWN):
        rows = flight.advance(_EVERY, command)
        if flight.autopilot[ENTERED] and not entered_after:
            entered_after = int(np.argmax(rows[:, THRUST] > 0.0)) + 1
        lines.append(_message(place, rows[-1], flight))
    truth = {each.name: options[each.name] for each in Takeoff.model_parameters}
    truth["start_latency_s"] = entered_after * loop.STEP_S
    return MadeLog("\n".join((*lines, "")).encode(), truth, COMPANION.encode())


def _message(place: int, row: Rows, flight: TwinFlight) -> str:
    """VERT_LOOP with the measurements of a step and what the loop made of them; before it was entered, its reference is
    the vehicle itself."""
    z, zd = loop.measured(-row[ALTITUDE], loop.POSITION_BITS), loop.measured(-row[CLIMB_RATE], loop.SPEED_BITS)
    values = {"z": z, "zd": zd, "z_ref": z, "zd_ref": zd}
    if flight.autopilot[ENTERED]:
        values |= {name: int(flight.autopilot[index]) for name, index in _STATE.items()}
        values["z_sp"] = -loop.fix(TARGET_M, loop.POSITION_BITS)
    counts = " ".join(str(values.get(name, 0)) for name in FIELDS)
    return f"{_BEGIN_S + place * _EVERY * loop.STEP_S:.3f} {_AIRCRAFT} VERT_LOOP {counts}"
