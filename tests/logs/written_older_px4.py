"""PX4's logs as its releases from 1.5 to 1.16 wrote them: what each called its topics and columns, and how often.

The motion is that of the recorded flights of release 1.17 where the loop was the same (from 1.11 on), else a simulated
one: the law of the releases until 1.10, written down here, around a vehicle of `bench.copters`. Down is positive, as in
the firmware.
"""

import io
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from types import MappingProxyType
from typing import Final

import numpy as np
from pyulog import ULog

from app.core.models.copter import GRAVITY_M_S2
from app.core.records.trajectory import Samples
from bench.copters.simulation import SimulatedCopter, move, packed, weather_of
from tests.logs.recorded import ULogFile, recorded

HOLD, MISSION, TAKEOFF, LAND, OFFBOARD = 4, 3, 17, 18, 14
OLDER_GAINS: Final[Mapping[str, float]] = MappingProxyType(
    {"MPC_Z_P": 1.0, "MPC_Z_VEL_P": 0.25, "MPC_Z_VEL_I": 0.1, "MPC_Z_VEL_D": 0.01}
)
GAINS: Final[Mapping[str, float]] = MappingProxyType(
    {"MPC_Z_P": 1.0, "MPC_Z_VEL_P_ACC": 4.0, "MPC_Z_VEL_I_ACC": 2.0, "MPC_Z_VEL_D_ACC": 0.0}
)
"""Those of the recorded flights."""
COPTER: Final = SimulatedCopter(
    hover_throttle=0.42, assumed_hover_throttle=0.5, quadratic=0.3, motor_lag_s=0.05, dead_time_s=0.0, drag_1_s=0.3,
    drag_1_m=0.02, sag=0.01, gust_m_s2=0.1, noise_m_s2=0.1, wander_m_s=0.02, wander_m=0.01,
)  # fmt: skip
THR_MAX: Final = 0.9
MOVE_S: Final = 0.004
_CONTROL_EVERY: Final = 5
_HEIGHT_M = 5.0
_LIFT_S, _LAND_S = 2.0, 16.0
_CHANGES_S: Final = (6.02, 13.06, 20.04, 27.08, 34.0)
"""At other times between two rows each: a jump of the thrust just before a row looks earlier than it was."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Vehicle:
    """A vehicle under the law of the releases until 1.10, with gains and least thrust as its hover thrust asks for, in
    the weather of `seed`, and when it changes its altitude."""

    copter: SimulatedCopter = COPTER
    seed: int = 1
    changes_s: tuple[float, ...] = _CHANGES_S

    @property
    def gains(self) -> dict[str, float]:
        share = self.copter.hover_throttle / COPTER.hover_throttle
        return {name: value if name == "MPC_Z_P" else share * value for name, value in OLDER_GAINS.items()}

    @property
    def least_thrust(self) -> float:
        return min(0.12, 0.4 * self.copter.hover_throttle)


_VEHICLE: Final = Vehicle()

Signals = Mapping[str, Samples]
Motion = Mapping[str, Signals]
"""Signals of each subject, with their `time_s`."""


@dataclass(frozen=True, slots=True)
class Layout:
    """What a release logged: topics, each with its subject, columns and interval; "float z=down;" is the signal "down"
    of the subject, without "=" a column is 0. Its gains are `older` ones, of thrust, or not."""

    topics: Mapping[str, tuple[str, str, float]]
    release: int | None
    older: bool


_POSITION = ("position", "float x;float y;float z=z;float vx;float vy;float vz=vz;uint8_t z_reset_counter;", 0.1)
_STATUS = "uint8_t nav_state=mode;uint8_t arming_state=armed;"
_LANDED = ("landed", "bool landed=landed;bool ground_contact=landed;bool maybe_landed=landed;", 0.0)
_ATTITUDE = ("attitude", "float roll_body=roll;float pitch_body=pitch;float yaw_body;", 0.1)
_SINCE_1_11 = (
    "float x;float y;float z=z;float vx;float vy;float vz=vz;float[3] acceleration=,,az;float[3] jerk;"
    "float[3] thrust=tx,ty,tz;"
)
_CONTROLS = ("thrust", "float[8] control=,,,up,,,,;", 0.1)

_1_5: Mapping[str, tuple[str, str, float]] = {
    "vehicle_local_position": _POSITION,
    "vehicle_local_position_setpoint": (
        "target", "float x;float y;float z=z;float yaw;float vx;float vy;float vz=vz;float acc_x;float acc_z;", 0.1,
    ),
    "vehicle_attitude_setpoint": (*_ATTITUDE[:1], f"{_ATTITUDE[1]}float thrust=up;", 0.1),
    "actuator_controls_0": _CONTROLS,
    "vehicle_status": ("status", f"{_STATUS}bool is_rotary_wing=rotors;", 0.0),
    "vehicle_land_detected": ("landed", "bool landed=landed;bool freefall;", 0.0),
}  # fmt: skip
_OLD_TARGET = (
    "float x;float y;float z=z;float yaw;float yawspeed;float vx;float vy;float vz=vz;float acc_x;float acc_y;"
    "float acc_z;{}float[3] thrust=tx,ty,tz;"
)
_1_8 = {
    **_1_5,
    "vehicle_local_position_setpoint": ("target", _OLD_TARGET.format(""), 0.1),
    "vehicle_land_detected": _LANDED,
}
_1_9 = {
    **_1_8,
    "vehicle_local_position_setpoint": ("target", _OLD_TARGET.format("float jerk_x;float jerk_y;float jerk_z;"), 0.125),
    "trajectory_setpoint": ("set_point", "float x;float y;float z=z;float vx;float vy;float vz=vz;float acc_z;", 0.385),
    "vehicle_attitude_setpoint": (*_ATTITUDE[:1], f"{_ATTITUDE[1]}float[3] thrust_body=,,down;", 0.1),
}
_1_11 = {
    "vehicle_local_position": _POSITION,
    "vehicle_local_position_setpoint": ("target", _SINCE_1_11, 0.1),
    "trajectory_setpoint": (
        "set_point", "float x;float y;float z=z;float vx;float vy;float vz=vz;float[3] acceleration=,,az;", 0.2,
    ),
    "vehicle_attitude_setpoint": _1_9["vehicle_attitude_setpoint"],
    "actuator_controls_0": ("thrust", _CONTROLS[1], 0.02),
    "vehicle_status": ("status", f"{_STATUS}uint8_t vehicle_type=rotors;", 0.0),
    "vehicle_land_detected": _LANDED,
}  # fmt: skip
_1_12 = {**_1_11, "takeoff_status": ("takeoff", "uint8_t takeoff_state=state;", 0.0)}
_1_14 = {
    **{topic: _1_12[topic] for topic in _1_12 if topic != "actuator_controls_0"},
    "vehicle_local_position_setpoint": ("target", _SINCE_1_11.replace("float[3] jerk;", ""), 0.1),
    "trajectory_setpoint": (
        "set_point", "float[3] position=,,z;float[3] velocity=,,vz;float[3] acceleration=,,az;float[3] jerk;", 0.2,
    ),
    "vehicle_thrust_setpoint": ("thrust", "float[3] xyz=,,down;", 0.02),
}  # fmt: skip
_1_16 = {**_1_14, "vehicle_attitude_setpoint": ("attitude", "float[4] q_d;float[3] thrust_body=,,down;", 0.1)}

LAYOUTS: Final[Mapping[str, Layout]] = MappingProxyType(
    {
        "1.5": Layout(_1_5, None, older=True),
        "1.7": Layout({**_1_5, "vehicle_land_detected": _LANDED}, 0x010702FF, older=True),
        "1.8": Layout(_1_8, 0x01080080, older=True),
        "1.9": Layout(_1_9, 0x010902FF, older=True),
        "1.10": Layout(_1_9, 0x010A01FF, older=True),
        "1.11": Layout(_1_11, 0x010B02FF, older=False),
        "1.12": Layout(_1_12, 0x010C03FF, older=False),
        "1.13": Layout(_1_12, 0x010D0000, older=False),
        "1.14": Layout(_1_14, 0x010E00FF, older=False),
        "1.16": Layout(_1_16, 0x011000FF, older=False),
    }
)
RELEASES: Final = ("", "1.7.2", "1.8.0-beta", "1.9.2", "1.10.1", "1.11.2", "1.12.3", "1.13.0-dev", "1.14.0", "1.16.0")
MANOEUVRES: Final = ("steps", "takeoff", "plain")


@dataclass(frozen=True, slots=True, kw_only=True)
class Written:
    """A log of this release: `parameters` instead of its own, `without` topics, `replaced` values of some columns by
    subject and signal, `renamed` parts of the columns."""

    layout: str
    manoeuvre: str = "steps"
    parameters: Mapping[str, float] | None = None
    without: tuple[str, ...] = ()
    replaced: Mapping[tuple[str, str], float | tuple[float, ...]] = field(default_factory=dict)
    renamed: tuple[str, str] = ("", "")
    release: int | None = None
    vehicle: Vehicle = _VEHICLE

    @property
    def content(self) -> bytes:
        layout, motion = LAYOUTS[self.layout], motion_of(self.layout, self.manoeuvre, self.vehicle)
        log = ULogFile()
        release = layout.release if self.release is None else self.release
        if release is not None:
            log.information("uint32_t ver_sw_release", release.to_bytes(4, "little"))
        parameters = parameters_of(self.layout, self.vehicle) if self.parameters is None else self.parameters
        for name, value in parameters.items():
            log.parameter(name, value)
        for topic, (subject, columns, every_s) in layout.topics.items():
            if topic not in self.without:
                signals = dict(motion[subject])
                signals |= {
                    name: np.full(len(signals["time_s"]), value)
                    for (of, name), value in self.replaced.items()
                    if of == subject
                }
                _write(log, topic, columns.replace(*self.renamed) if self.renamed[0] else columns, signals, every_s)
        return log.content


def parameters_of(layout: str, vehicle: Vehicle = _VEHICLE) -> dict[str, float]:
    """The gains and limits that its flights flew with."""
    if LAYOUTS[layout].older:
        hover = vehicle.copter.assumed_hover_throttle
        limits = {"MPC_THR_HOVER": hover, "MPC_THR_MIN": vehicle.least_thrust, "MPC_THR_MAX": THR_MAX}
        return {**vehicle.gains, **limits, "MPC_Z_VEL_MAX_UP": 3.0, "MPC_Z_VEL_MAX_DN": 1.5, "MAV_TYPE": 2}
    return {**GAINS, "MPC_THR_HOVER": 0.5, "MPC_Z_VEL_MAX_UP": 3.0, "MPC_Z_VEL_MAX_DN": 1.5, "MAV_TYPE": 2}


def motion_of(layout: str, manoeuvre: str, vehicle: Vehicle) -> Motion:
    """Recorded where the loop was that of the recorded flights, but for the plain flight, which none of them is."""
    if LAYOUTS[layout].older:
        return simulated(manoeuvre, vehicle)
    return recorded_motion(f"px4_{manoeuvre}.ulg") if manoeuvre != "plain" else simulated("plain", vehicle)


def _write(log: ULogFile, topic: str, columns: str, signals: Signals, every_s: float) -> None:
    letters = {"float": "f", "uint8_t": "B", "bool": "?"}
    fields = [each.partition("=") for each in columns.split(";") if each]
    described, layout, names = "", "", list[str]()
    for column, _, sources in fields:
        kind, _, size = column.split(" ")[0].partition("[")
        count = int(size.removesuffix("]")) if size else 1
        described += f"{column};"
        layout += count * letters[kind]
        names += sources.split(",") if sources else count * [""]
    log.define(topic, described, layout)
    time_s, last = signals["time_s"], -1
    for row, at_s in enumerate(time_s.tolist()):
        if not every_s or int(at_s / every_s + 1e-6) > last:
            last = int(at_s / every_s + 1e-6) if every_s else last
            values = [float(signals[name][row]) if name else 0.0 for name in names]
            log.add(topic, at_s, *(v if k == "f" else int(v) for v, k in zip(values, layout, strict=True)))


@cache
def recorded_motion(name: str) -> Motion:
    """That of a recorded flight of release 1.17."""
    topics = {each.name: each.data for each in ULog(io.BytesIO(recorded(name))).data_list}

    def signals(topic: str, **columns: str) -> Signals:
        data = topics[topic]
        values = {key: np.asarray(data[column], dtype=np.float64) for key, column in columns.items()}
        return {"time_s": data["timestamp"] / 1e6, **values}

    target = signals(
        "vehicle_local_position_setpoint",
        z="z", vz="vz", az="acceleration[2]", tx="thrust[0]", ty="thrust[1]", tz="thrust[2]",
    )  # fmt: skip
    thrust = signals("vehicle_thrust_setpoint", down="xyz[2]")
    status = signals("vehicle_status", mode="nav_state", armed="arming_state", rotors="vehicle_type")
    still = np.zeros(len(target["time_s"]))
    return {
        "position": signals("vehicle_local_position", z="z", vz="vz"),
        "target": target,
        "set_point": signals("trajectory_setpoint", z="position[2]", vz="velocity[2]", az="acceleration[2]"),
        "attitude": {"time_s": target["time_s"], "roll": still, "pitch": still, "down": target["tz"]},
        "thrust": {**thrust, "up": -thrust["down"]},
        "status": status,
        "landed": signals("vehicle_land_detected", landed="landed"),
        "takeoff": signals("takeoff_status", state="takeoff_state"),
    }


@cache
def simulated(manoeuvre: str, vehicle: Vehicle) -> Motion:
    """A flight with the law of the releases until 1.10, from 20 s of the vehicle's clock on: "smooth" has altitude
    changes of a mission that feeds climb rates forward, "steps" those of offboard control, which does not."""
    time_s = np.arange(0.0, {"steps": 40.0, "smooth": 40.0, "takeoff": 30.0, "plain": 25.0}[manoeuvre], MOVE_S)
    reference, rates = _references(manoeuvre, time_s, vehicle.changes_s)
    flown = _flown(vehicle, time_s, reference, rates, on_ground=manoeuvre == "takeoff")
    rows = slice(None, None, _CONTROL_EVERY)
    z, v, v_t, thrust = flown[rows].T
    hover = vehicle.copter.hover_throttle
    at_s = 20.0 + time_s[rows]
    still, lean = np.zeros(len(at_s)), np.full(len(at_s), 0.1)
    body = thrust / np.cos(lean)
    down = {"z": -reference[rows], "vz": -rates[rows] if manoeuvre == "smooth" else np.full(len(at_s), np.nan)}
    flies = manoeuvre != "takeoff"
    events_s = 20.0 + np.array([0.0, 1.0, _LIFT_S, 8.0, _LAND_S, 26.0])
    modes = np.array([HOLD, HOLD, TAKEOFF, HOLD, LAND, LAND], dtype=np.float64)
    cruise = {"steps": OFFBOARD, "smooth": MISSION, "plain": HOLD}.get(manoeuvre, HOLD)
    touched_s = float(at_s[np.flatnonzero(z > 0.02)[-1]]) + 1.0 if not flies else 0.0
    return {
        "position": {"time_s": at_s, "z": -z, "vz": -v},
        "target": {
            "time_s": at_s, "z": down["z"], "vz": -v_t, "az": -GRAVITY_M_S2 * (thrust / hover - 1.0),
            "tx": body * np.sin(lean), "ty": still, "tz": -thrust,
        },
        "set_point": {"time_s": at_s, **down, "az": np.full(len(at_s), np.nan)},
        "attitude": {"time_s": at_s, "roll": still, "pitch": -lean, "up": body, "down": -body},
        "thrust": {"time_s": at_s, "up": body, "down": -body},
        "status": {
            "time_s": events_s[:1] if flies else events_s,
            "mode": np.array([float(cruise)]) if flies else modes,
            "armed": np.array([2.0]) if flies else np.array([1.0, 2.0, 2.0, 2.0, 2.0, 1.0]),
            "rotors": np.ones(1 if flies else len(events_s)),
        },
        "landed": {
            "time_s": events_s[:1] if flies else np.array([20.0, events_s[2] + 0.5, touched_s]),
            "landed": np.zeros(1) if flies else np.array([1.0, 0.0, 1.0]),
        },
        "takeoff": {"time_s": np.array([20.0]), "state": np.array([5.0])},
    }  # fmt: skip


def _references(manoeuvre: str, time_s: Samples, changes_s: tuple[float, ...]) -> tuple[Samples, Samples]:
    """Altitude and climb rate that are given, up."""
    if manoeuvre == "takeoff":
        rates = np.where(time_s < _LIFT_S + 1.0, 0.0, np.where(time_s < _LIFT_S + 3.0, 1.5, 0.0))
        rates = np.where(time_s > _LAND_S, -0.7, rates)
        return np.cumsum(rates) * MOVE_S, rates
    changes = np.zeros(len(time_s))
    for number, begin_s in enumerate(changes_s if manoeuvre != "plain" else ()):
        since = (time_s - begin_s) / (2.0 if manoeuvre == "smooth" else 1e-9)
        since = np.clip(since, 0.0, 1.0)
        changes += (-1.0) ** number * (10.0 * since**3 - 15.0 * since**4 + 6.0 * since**5)
    altitude = _HEIGHT_M + (1.5 if manoeuvre == "smooth" else 1.0) * changes
    return altitude, np.gradient(altitude, MOVE_S) if manoeuvre == "smooth" else np.zeros(len(time_s))


def _flown(vehicle: Vehicle, time_s: Samples, reference: Samples, rates: Samples, *, on_ground: bool) -> Samples:
    """Altitude, climb rate, its target and thrust, up, shape (n, 4): position control 50 times a second."""
    weather = weather_of(vehicle.copter, vehicle.seed, len(time_s), MOVE_S, climb_rate_wander_s=0.6)
    copter, late = packed(vehicle.copter, MOVE_S), round(vehicle.copter.dead_time_s / MOVE_S)
    hover, assumed = vehicle.copter.hover_throttle, vehicle.copter.assumed_hover_throttle
    moving = np.array([0.0 if on_ground else hover, reference[0], 0.0])
    integral, thrust, v_t, before = (0.0 if on_ground else hover - assumed), moving[0], 0.0, 0.0
    flown, control_s = np.empty((len(time_s), 4)), _CONTROL_EVERY * MOVE_S
    gains = vehicle.gains
    for row, at_s in enumerate(time_s.tolist()):
        z, v = moving[1] + weather[row, 3], moving[2] + weather[row, 2]
        if row % _CONTROL_EVERY == 0:
            v_t = float(np.clip(gains["MPC_Z_P"] * (reference[row] - z) + rates[row], -1.5, 3.0))
            rate, before = (v - before) / control_s, v
            wanted = gains["MPC_Z_VEL_P"] * (v_t - v) + integral - gains["MPC_Z_VEL_D"] * rate + assumed
            thrust = float(np.clip(wanted, vehicle.least_thrust, THR_MAX))
            if thrust == wanted:
                integral += gains["MPC_Z_VEL_I"] * (v_t - v) * control_s
            if on_ground and (at_s < _LIFT_S or (at_s > _LAND_S and z < 0.05)):
                thrust, integral = 0.0, 0.0
        flown[row] = z, v, v_t, thrust
        sent = flown[max(row - late, 0), 3]
        move(moving, copter, sent, at_s, weather[row, 0] if moving[1] > 0.0 else 0.0, MOVE_S)
        if moving[1] < 0.0:
            moving[1], moving[2] = 0.0, max(moving[2], 0.0)
    return flown
