"""ArduCopter's entry in the registry: its on-board log, and traces with a row per step."""

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Final

from app.autopilots.ardupilot.log import read_ardupilot
from app.autopilots.ardupilot.replica.replay import LoopTrace, replayed, replica_of
from app.autopilots.ardupilot.replica.vertical import OUTPUTS
from app.autopilots.ardupilot.replica_check import ardupilot_loop_log
from app.autopilots.ardupilot.trace import is_ardupilot_trace, read_ardupilot_trace
from app.autopilots.loop_check import (
    LoopCheck,
    Result,
    Signal,
    TraceReplay,
    Upload,
    grouped,
    replay_of_log,
    result_of_trace,
)
from app.logs.formats import Format

_PRECISION: Final = "firmware and recording have single precision"


_SIGNALS: Final[Mapping[str, Signal]] = MappingProxyType(
    {
        "z_d_m": Signal("Desired altitude", "m", 3, 1e-4, _PRECISION),
        "v_d_m_s": Signal("Desired climb rate", "m/s", 3, 1e-4, _PRECISION),
        "a_d_m_s2": Signal("Desired acceleration", "m/s²", 3, 3e-4, _PRECISION),
        "v_t_m_s": Signal("Climb rate target", "m/s", 3, 1e-4, _PRECISION),
        "a_t_m_s2": Signal("Acceleration target", "m/s²", 3, 5e-4, _PRECISION),
        "i_term_permille": Signal("Integrator of the acceleration controller", "‰ of throttle", 1, 0.14, _PRECISION),
        "throttle": Signal("Demanded throttle", "of full", 4, 5e-4, _PRECISION),
        "throttle_filtered": Signal("Filtered throttle", "of full", 4, 5e-4, _PRECISION),
    }
)
_UP: Final = "Altitude, climb rate and acceleration are positive up."


def _examine_log(upload: Upload) -> Result:
    log = ardupilot_loop_log(read_ardupilot(upload.stream), name=upload.name)
    compared = replay_of_log(log, replica_of(log), log.time_s, gains=log.parameters.gains, notes=_notes)
    return result_of_trace(_SIGNALS, compared, kind="log")


def _examine_trace(upload: Upload) -> Result:
    return result_of_trace(_SIGNALS, _replayed(read_ardupilot_trace(upload.stream, name=upload.name)))


def _replayed(trace: LoopTrace) -> TraceReplay:
    followed = int(trace.followed.sum())
    limited = f"{grouped(followed)} rows at a throttle limit are each computed from the recorded row before."
    return TraceReplay(
        time_s=trace.time_s,
        recorded=dict(zip(OUTPUTS, trace.outputs.T, strict=True)),
        replica=dict(zip(OUTPUTS, replayed(trace).T, strict=True)),
        gains=trace.parameters.gains,
        notes=(limited, _UP) if followed else (_UP,),
    )


def _notes(rows: Mapping[str, int]) -> Iterable[str]:
    yield "Climb rate target and demanded throttle were computed from the same row of the log."
    if rows["z_d_m"]:
        yield f"The desired motion was shaped again from the row before, in {grouped(rows['z_d_m'])} rows."
    else:
        yield "The desired motion was not shaped again: the log has no position targets (GUIP), or not only those."
    if not rows["throttle"]:
        yield "The demanded throttle was not computed: the log has no PIDA and CTUN beside PSCD."
    yield _UP


CHECK: Final = LoopCheck(
    recordings="ArduCopter's .bin log of a flight in GUIDED, or a trace of its vertical loop with one row per step, "
    ".csv or .csv.gz",
    signals=_SIGNALS,
    figures=MappingProxyType(
        {"reference": ("Shaped target", OUTPUTS[:3]), "commands": ("Controllers and throttle", OUTPUTS[3:])}
    ),
    note=_UP,
    log=Format.DATAFLASH,
    is_trace=is_ardupilot_trace,
    examine_log=_examine_log,
    examine_trace=_examine_trace,
)
