"""The replicas of the autopilots' vertical loops, and the comparison of a recording with one of them."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from app.autopilots.ardupilot import replica_check as ardupilot
from app.autopilots.ardupilot.profile import ARDUPILOT
from app.autopilots.autopilot import Autopilot
from app.autopilots.paparazzi import replica_check as paparazzi
from app.autopilots.paparazzi.profile import PAPARAZZI
from app.autopilots.px4 import replica_check as px4
from app.autopilots.px4.profile import PX4
from app.autopilots.replica_check import LoopReplica

REPLICAS: Final[Mapping[Autopilot, LoopReplica]] = MappingProxyType(
    {ARDUPILOT: ardupilot.REPLICA, PX4: px4.REPLICA, PAPARAZZI: paparazzi.REPLICA}
)
"""By the autopilot; the first that recognises a trace checks it."""


def traced(head: bytes) -> Autopilot | None:
    """The autopilot of which a file with these first bytes is a trace of the loop; None if it is of none."""
    return next((autopilot for autopilot, replica in REPLICAS.items() if replica.is_trace(head)), None)
