"""Flight plan of the simulated Paparazzi with its blocks and waypoints, and the settings of the AR.Drone 2 airframe in
order, with their values after the start.

Setting names are the C variables' truncated to 16 characters; a name of 16 characters is never found by a request.
"""

import math
from dataclasses import dataclass, replace
from enum import Enum
from typing import Final

from app.autopilots.simulated.copter_parameters import Kind, Parameter, Parameters
from app.core.control.vertical_guidance import INT32_MAX, INT32_MIN

DESCENT_M_S: Final = 0.8
LANDED_AFTER_S: Final = 3.0
"""Value in this program's flight plan. Plans without such a guard stop the thrust of a vehicle that is commanded to
land in the first second, before it counts as flying."""
DEFAULT_ALTITUDE_M: Final = 2.0
MAX_DISTANCE_M: Final = 50.0
"""max_dist_from_home: greatest distance from HOME, the origin, at which blocks are flown."""
HOME_HEIGHT_M: Final = 1.0
"""Height of the waypoint HOME, to which it flies back and where it stays."""

CLIMB: Final = 2
WAYPOINTS: Final = ("dummy", "HOME", "CLIMB", "STDBY", "p1", "p2", "p3", "p4", "CAM", "TD")
"""Waypoints by index. Their names are not transmitted."""


class Vertical(Enum):
    """Vertical mode of a block."""

    THROTTLE = "no thrust"
    WAYPOINT = "the altitude of its waypoint"
    DESCEND = "down at DESCENT_M_S until it no longer flies"


@dataclass(frozen=True, slots=True)
class Block:
    """One block. Entering it starts or stops the `motors`, or leaves them as they are (None). `after` is the block that
    follows after `lasts_s`, if any, and not before there is a position if it `waits`; `landed` the one that follows
    when the vehicle no longer flies. `max_time_s`, `max_height_m` (local z, up) and `max_distance_m` (along an axis
    from HOME) are exceptions that lead to "land here"."""

    name: str
    vertical: Vertical = Vertical.WAYPOINT
    waypoint: str = "STDBY"
    motors: bool | None = None
    after: str | None = None
    lasts_s: float = 0.0
    waits: bool = False
    landed: str | None = None
    max_time_s: float = float("inf")
    max_height_m: float = float("inf")
    max_distance_m: float = float("inf")


BLOCKS: Final = (
    Block("Wait GPS", Vertical.THROTTLE, motors=False, after="Geo init", waits=True),
    Block("Geo init", Vertical.THROTTLE, motors=False, after="Holding point", lasts_s=10.0),
    Block("Holding point", Vertical.THROTTLE, motors=False),
    Block("Start Engine", Vertical.THROTTLE, motors=True),
    Block("Takeoff", waypoint="CLIMB", max_time_s=45.0, max_height_m=4.5, max_distance_m=8.0),
    Block("Standby"),
    Block("stay_p1", waypoint="p1"),
    Block("go_p2", waypoint="p2"),
    Block("line_p1_p2", waypoint="p1"),
    Block("route", waypoint="p1"),
    Block("Oval", waypoint="p1"),
    Block("test yaw", waypoint="p1"),
    Block("circle CAM", waypoint="CAM"),
    Block("land here", waypoint="TD", after="land"),
    Block("land", waypoint="TD", after="flare"),
    Block("flare", Vertical.DESCEND, landed="landed"),
    Block("landed", Vertical.THROTTLE),
    Block("HOME", waypoint="HOME"),
)
"""The plan's blocks in order; of blocks with horizontal figures only the height is flown."""

BY_NAME: Final = {block.name: seq for seq, block in enumerate(BLOCKS)}
GEO_INIT: Final = BY_NAME["Geo init"]
LAND_HERE: Final = BY_NAME["land here"]
TAKEOFF: Final = BY_NAME["Takeoff"]


class FlightPlan:
    """Current block of the plan."""

    def __init__(self, *, landed_after_s: float) -> None:
        """Begin in the first block; `landed_after_s` is the minimum time of descent before a landing is detected."""
        self._landed_after_s = landed_after_s
        self.seq = 0
        self.time_s = 0.0
        """Time since the block was entered, s."""
        self.altitudes_m = dict.fromkeys(WAYPOINTS, DEFAULT_ALTITUDE_M)
        """Of the waypoints, in the local frame."""

    @property
    def block(self) -> Block:
        return BLOCKS[self.seq]

    def enter(self, seq: int, height_m: float) -> None:
        """Enter a block at this height (local frame, up); a number past the end means the last one."""
        self.seq = min(seq, len(BLOCKS) - 1)
        self.time_s = 0.0
        if self.seq == LAND_HERE:
            self.altitudes_m["TD"] = height_m

    def next(
        self, elapsed_s: float, height_m: float, distance_m: float, *, flies: bool, has_position: bool
    ) -> int | None:
        """Advance time in the block; return the next block if the plan leaves this one. `distance_m` is from HOME."""
        self.time_s += elapsed_s
        block = self.block
        if block.after is not None and self.time_s >= block.lasts_s and (has_position or not block.waits):
            return BY_NAME[block.after]
        if block.landed is not None and not flies and self.time_s > self._landed_after_s:
            return BY_NAME[block.landed]
        is_over = self.time_s > block.max_time_s or height_m > block.max_height_m or distance_m > block.max_distance_m
        return LAND_HERE if is_over else None


NAME_LIMIT: Final = 16
KILL_SETTING: Final = "kil_thr"
NEWER_KILL_SETTING: Final = "aut_kil_thr"
"""Name in a source tree of 2017 (version 5.10), in which the variables are in one structure."""


def setting(name: str, default: int | float) -> Parameter:
    """A setting; an integer default marks an integer in the autopilot, to which values are truncated."""
    return Parameter(name, Kind.INT32 if isinstance(default, int) else Kind.REAL32, float(default))


def held(kind: Kind, value: float) -> float:
    """Return a value as held in the autopilot's variable."""
    if kind is Kind.REAL32:
        return value
    return float(min(max(math.trunc(value), INT32_MIN), INT32_MAX)) if math.isfinite(value) else float(INT32_MIN)


def settings(kill_setting: str) -> Parameters:
    """Return the settings with their values after the start; `kill_setting` is this release's name of the one that
    stops the throttle, empty if there is none."""
    named = (replace(each, name=kill_setting) if each.name == KILL_SETTING else each for each in SETTINGS)
    return Parameters([each for each in named if each.name], longest_name=NAME_LIMIT - 1)


SETTINGS: Final = (
    setting("tel_mod_Mav", 0),
    setting("tel_mod_Mai", 0),
    setting("aut_mod_aut", 13),
    setting(KILL_SETTING, 1),
    setting("aut_pow_swi", 0),
    setting("aut_mod", 13),
    setting("gui_v_kp", 283),
    setting("gui_v_kd", 82),
    setting("gui_v_ki", 13),
    setting("gui_v_nom_thr", 0.655),
    setting("gui_v_ada_thr_en", 0),
    setting("gui_v_z_sp", -23),
    setting("gui_h_use_ref", 1),
    setting("gh_ref_max_spe", 5.0),
    setting("gui_h_app_for_by", 0.0),
    setting("gh_ref_tau", 0.5),
    setting("gh_ref_ome", 1.169371),
    setting("gh_ref_zet", 0.85),
    setting("gui_h_gai_p", 79),
    setting("gui_h_gai_d", 100),
    setting("gui_h_gai_i", 30),
    setting("gui_h_gai_v", 0),
    setting("gui_h_gai_a", 0),
    setting("gui_h_sp_pos_x", 0),
    setting("gui_h_sp_pos_y", 0),
    setting("fli_alt", 149.0),
    setting("nav_hea", 31),
    setting("nav_rad", 5.0),
    setting("nav_cli_vsp", 0.5),
    setting("nav_des_vsp", -0.8),
    setting("sta_gai_p_x", 850),
    setting("sta_gai_d_x", 425),
    setting("sta_gai_i_x", 0),
    setting("sta_gai_dd_x", 0),
    setting("sta_gai_p_y", 850),
    setting("sta_gai_d_y", 425),
    setting("sta_gai_i_y", 0),
    setting("sta_gai_dd_y", 0),
    setting("sta_gai_p_z", 1000),
    setting("sta_gai_d_z", 700),
    setting("sta_gai_i_z", 0),
    setting("sta_gai_dd_z", 100),
    setting("att_ref_qua_i_mo", 7.853981),
    setting("att_ref_qua_i_mo", 0.9),
    setting("att_ref_qua_i_mo", 7.853981),
    setting("att_ref_qua_i_mo", 0.9),
    setting("att_ref_qua_i_mo", 3.490659),
    setting("att_ref_qua_i_mo", 0.9),
    setting("nps_byp_ahr", 0),
    setting("nps_byp_ins", 0),
    setting("gps_has_fix", 1),
    setting("dat_ena", 1),
    setting("nps_ele_sup_vol", 12.4),
    setting("nps_atm_win_spe", 0.0),
    setting("nps_atm_win_dir", 0.0),
    setting("nps_atm_tur_sev", 0.0),
    setting("imu_bod_to_imu_e", 0.0),
    setting("imu_bod_to_imu_e", 0.0),
    setting("imu_bod_to_imu_e", 0.0),
    setting("imu_b2i_set_cur", 0),
    setting("mul_gps_mod", 0),
    setting("ahr_icq_gra_heu_", 30),
    setting("ahr_icq_acc_ome", 0.063),
    setting("ahr_icq_acc_zet", 0.9),
    setting("ahr_icq_mag_ome", 0.04),
    setting("ahr_icq_mag_zet", 0.9),
    setting("air_dat_qnh", 1013.315),
    setting("air_dat_tas_fac", 1.0),
    setting("air_dat_cal_qnh_", 0),
    setting("air_dat_cal_air", 1),
    setting("air_dat_cal_tas_", 1),
    setting("air_dat_cal_ams_", 0),
    setting("geo_mag_cal_onc", 0),
    setting("gps_nps_gps_nps_", 1),
    setting("dat_mav_per_sta", 1),
    setting("dat_mav_per_tel_", 1),
)
