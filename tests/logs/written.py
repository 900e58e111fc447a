"""ArduCopter's logs of simulated flights, as the vehicle would write them with its default LOG_BITMASK."""

from collections.abc import Mapping, Sequence

from app.core.analysis.loop import LoggedFlight
from app.core.analysis.segment import Segment
from app.core.records.trajectory import Samples
from tests.logs.recorded import OnBoardLog

PARM, MODE, EV, PSCD, CTUN, ATT, ERR = 1, 2, 3, 4, 5, 6, 7
GUIDED, LOITER, LAND, STABILIZE, AUTO, RTL = 4, 5, 9, 0, 3, 6
NOT_LANDED, LANDED, ARMED, DISARMED = 28, 18, 10, 11
VIBRATION_FAILSAFE = 29

PARAMETERS: Mapping[str, float] = {
    "PSC_POSZ_P": 1.0,
    "PSC_VELZ_P": 5.0,
    "PSC_VELZ_I": 0.0,
    "PSC_ACCZ_P": 0.5,
    "PSC_ACCZ_I": 1.0,
    "MOT_THST_HOVER": 0.35,
    "SCHED_LOOP_RATE": 400.0,
    "INS_ACCEL_FILTER": 20.0,
}

NEWER_PARAMETERS: Mapping[str, float] = {
    "PSC_D_POS_P": 1.0,
    "PSC_D_VEL_P": 5.0,
    "PSC_D_ACC_P": 0.05,
    "PSC_D_ACC_I": 0.1,
    "PSC_D_ACC_IMAX": 0.8,
    "WP_SPD_UP": 2.5,
    "MOT_THST_HOVER": 0.35,
    "SCHED_LOOP_RATE": 400.0,
    "INS_ACCEL_FILTER": 20.0,
}
"""The same values by the names and in the units of release 4.7."""


def ardupilot_log(
    flight: LoggedFlight,
    *,
    begin_s: float = 10.0,
    modes: Sequence[tuple[float, int]] = ((0.0, GUIDED),),
    events: Sequence[tuple[float, int]] = ((0.0, NOT_LANDED),),
    parameters: Mapping[str, float] = PARAMETERS,
    changes: Sequence[tuple[float, str, float]] = (),
    rows: slice = slice(None),
    has_shaped_altitude: bool = True,
    is_upward: bool = False,
    attitude: Sequence[tuple[float, float, float]] = (),
    errors: Sequence[tuple[float, int, int]] = (),
    without_throttle_s: tuple[float, float] = (0.0, 0.0),
) -> bytes:
    """The first segment of the flight, which begins at `begin_s` after takeoff; times of modes, events, errors, roll
    and pitch (degrees) and parameter changes count from the takeoff, at 5 s of the vehicle's clock. Older releases
    have no shaped altitude beside the target, and 4.1 logs the loop as PSCZ, which `is_upward`."""
    log = OnBoardLog()
    log.define(PARM, "PARM", "QNf", "TimeUS,Name,Value")
    log.define(MODE, "MODE", "QBBB", "TimeUS,Mode,ModeNum,Rsn")
    log.define(EV, "EV", "QB", "TimeUS,Id")
    log.define(ATT, "ATT", "Qff", "TimeUS,Roll,Pitch")
    log.define(ERR, "ERR", "QBB", "TimeUS,Subsys,ECode")
    columns = ("DPD", "TPD", "PD", "DVD", "TVD", "VD", "DAD", "TAD", "AD")[is_upward or not has_shaped_altitude :]
    named = [f"{each[:-1]}Z" for each in columns] if is_upward else columns
    log.define(PSCD, "PSCZ" if is_upward else "PSCD", "Q" + len(columns) * "f", ",".join(("TimeUS", *named)))
    log.define(CTUN, "CTUN", "Qfff", "TimeUS,ThI,ThO,ThH")
    messages: list[tuple[int, int, str, Sequence[float | bytes]]] = []
    messages += [(0, PARM, "<Q16sf", (name.encode(), value)) for name, value in parameters.items()]
    messages += [(_us(at_s), MODE, "<QBBB", (mode, mode, 1)) for at_s, mode in modes]
    messages += [(_us(at_s), EV, "<QB", (event,)) for at_s, event in events]
    messages += [(_us(at_s), PARM, "<Q16sf", (name.encode(), value)) for at_s, name, value in changes]
    messages += [(_us(at_s), ATT, "<Qff", angles) for at_s, *angles in attitude]
    messages += [(_us(at_s), ERR, "<QBB", codes) for at_s, *codes in errors]
    segment = flight.segments[0]
    for row in range(*rows.indices(len(segment.time_s))):
        at_us = _us(begin_s + float(segment.time_s[row] - segment.time_s[0]))
        sign = 1.0 if is_upward else -1.0
        loop = tuple(sign * float(values[row]) for values in _loop(segment))[-len(columns) :]
        messages.append((at_us, PSCD, f"<Q{len(columns)}f", loop))
        throttle = (float(segment.throttle[row]), float(segment.throttle_filtered[row]))
        if _us(without_throttle_s[0]) < at_us < _us(without_throttle_s[1]):
            continue
        messages.append((at_us, CTUN, "<Q3f", (*throttle, parameters.get("MOT_THST_HOVER", 0.35))))
    for at_us, kind, layout, fields in sorted(messages, key=lambda message: message[0]):
        log.add(kind, layout, at_us, *fields)
    return log.content


def _loop(segment: Segment) -> tuple[Samples, ...]:
    """Columns of PSCD, up."""
    return (
        segment.z_d_m,
        segment.z_d_m,
        segment.z_m,
        segment.v_d_m_s,
        segment.v_t_m_s,
        segment.v_m_s,
        segment.a_d_m_s2,
        segment.a_d_m_s2,
        segment.a_m_s2,
    )


def _us(at_s: float) -> int:
    return round(1e6 * (5.0 + at_s))
