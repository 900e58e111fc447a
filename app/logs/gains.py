"""Names of the altitude control gains of each autopilot in its logs."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Final

from app.core.control.loop_log import GAINS

PAPARAZZI: Final[Mapping[str, str]] = MappingProxyType({"gui_v_kp": "kp", "gui_v_ki": "ki", "gui_v_kd": "kd"})
"""Its MAVLink parameters, and the names of these gains in the takeoff experiment."""

PAPARAZZI_SETS: Final = (GAINS,)

ARDUPILOT_SETS: Final = (
    ("PSC_POSZ_P", "PSC_VELZ_P", "PSC_ACCZ_P", "PSC_ACCZ_I", "PSC_ACCZ_D"),
    ("PSC_D_POS_P", "PSC_D_VEL_P", "PSC_D_ACC_P", "PSC_D_ACC_I", "PSC_D_ACC_D"),
)
"""Until 4.6, and from 4.7 on."""

PX4_SETS: Final = (("MPC_Z_P", "MPC_Z_VEL_P_ACC", "MPC_Z_VEL_I_ACC", "MPC_Z_VEL_D_ACC"),)


def names_in(sets: Sequence[Sequence[str]]) -> frozenset[str]:
    """All names in these sets."""
    return frozenset(name for names in sets for name in names)
