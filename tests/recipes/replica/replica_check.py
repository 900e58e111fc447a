"""The toy's loop beside its replica, for traces with a row per step: an example."""

from typing import BinaryIO, Final

import numpy as np
from app.autopilots.toy.replica.vertical import throttle_of  # type: ignore[import-not-found]

from app.autopilots.recording import Recording
from app.autopilots.replica_check import LoopReplica, Replay, ReplicaCheck, Signal, check_replay
from app.core.errors import InputError

FIRST: Final = b"t_s,target_m,altitude_m,toy_throttle\n"
GAIN: Final = 0.2
SIGNALS: Final = {"throttle": Signal("Throttle", "of full", 4, 1e-6)}


def _check_log(_recording: Recording, name: str, _gains: str) -> ReplicaCheck:
    raise InputError(f"{name} has no rows of the loop.", hint="Use a trace.")


def _check_trace(stream: BinaryIO, _name: str) -> ReplicaCheck:
    stream.seek(len(FIRST))
    time_s, target_m, altitude_m, throttle = np.loadtxt(stream, delimiter=",", ndmin=2).T
    replica = {"throttle": throttle_of(GAIN, target_m, altitude_m)}
    replay = Replay(time_s=time_s, recorded={"throttle": throttle}, replica=replica, gains={"kp": GAIN})
    return check_replay(SIGNALS, replay, kind="trace")


REPLICA: Final = LoopReplica(
    signals=SIGNALS,
    figures=(("Throttle", ("throttle",)),),
    note="",
    check_log=_check_log,
    is_trace=lambda head: head.startswith(FIRST),
    check_trace=_check_trace,
)
