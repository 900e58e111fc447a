"""Paparazzi logs as its ground station writes them, of takeoffs that the exact replica flies on a point mass."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from app.core.control import vertical_guidance as loop

HOVER_THROTTLE = 0.63
GROUND_M = 0.1
GRAVITY_M_S2 = 9.81

COMPANION = """<?xml version="1.0"?>
<configuration time_of_day="1795222159.0" data_file="flight.data">
 <conf><aircraft ac_id="31" name="ardrone2">
  <airframe name="ardrone2"><section name="GUIDANCE_V" prefix="GUIDANCE_V_">
   <define name="HOVER_KP" value="283"/><define name="HOVER_KD" value="82"/><define name="HOVER_KI" value="13"/>
  </section></airframe>
  <generated_settings><dl_settings><dl_settings NAME="control">
   <dl_setting var="autopilot_mode_auto2" min="0" step="1" max="19"/>
   <dl_setting var="guidance_v_kp" min="0" step="1" max="600"/>
   <dl_setting var="guidance_v_kd" min="0" step="1" max="600"/>
   <dl_setting var="guidance_v_ki" min="0" step="1" max="300"/>
  </dl_settings></dl_settings></generated_settings>
 </aircraft></conf>
</configuration>
"""


@dataclass(frozen=True)
class Flight:
    """A takeoff: on the ground for `wait_s`, then `fly_s` towards 3 m. `stale`: position and speed are sampled one step
    later than the commands that were computed from them."""

    gains: Mapping[str, int]
    wait_s: float = 3.0
    fly_s: float = 34.0
    every: int = 26
    stale: bool = False
    loop_log: bool = True
    tilt: int = loop.LEVEL
    setting: bool = False


def data_of(flight: Flight, *, start_s: float = 12.0) -> str:
    """The lines of the .data file."""
    kp, ki, kd = (flight.gains[name] for name in ("kp", "ki", "kd"))
    up_m, climb_m_s, thrust = GROUND_M, 0.0, 0
    lines = [f"{start_s:.3f} 31 ALIVE 153,27,52"]
    reports = [f"31 DL_VALUE {n} {v}.000000" for n, v in ((1, kp), (2, kd), (3, ki))] if flight.setting else []
    state = loop.new_state(*_state(up_m, climb_m_s))
    for step in range(round((flight.wait_s + flight.fly_s) * loop.RATE_HZ)):
        z, zd = _state(up_m, climb_m_s)
        flying = step >= flight.wait_s * loop.RATE_HZ
        in_flight = loop.detect_flight(state, thrust)
        if flying:
            thrust = loop.step(state, loop.ALT, 768, kp, ki, kd, z, zd, flight.tilt, in_flight)
        else:
            thrust = loop.step(state, loop.THROTTLE, 0, kp, ki, kd, z, zd, flight.tilt, False)
        acceleration = GRAVITY_M_S2 * (thrust / loop.FULL_THRUST / HOVER_THROTTLE - 1.0)
        climb_m_s += acceleration / loop.RATE_HZ
        up_m += climb_m_s / loop.RATE_HZ
        if up_m <= GROUND_M and climb_m_s < 0.0:
            up_m, climb_m_s, acceleration = GROUND_M, 0.0, 0.0
        if step % flight.every == 0:
            now_s = start_s + step / loop.RATE_HZ
            seen = _state(up_m, climb_m_s) if flight.stale else (z, zd)
            lines += [f"{now_s:.3f} {report}" for report in reports]
            lines += _messages(flight, state, now_s, flying, *seen, round(-acceleration * 2**10), thrust)
    return "\n".join(lines) + "\n"


def write(folder: Path, flight: Flight, *, companion: bool = True) -> Path:
    path = folder / "flight.data"
    path.write_text(data_of(flight))
    if companion:
        path.with_suffix(".log").write_text(COMPANION)
    return path


def _state(up_m: float, climb_m_s: float) -> tuple[int, int]:
    return round(-up_m * 2**8), round(-climb_m_s * 2**19)


def _messages(
    flight: Flight, state: loop.State, now_s: float, flying: bool, z: int, zd: int, zdd: int, thrust: int
) -> list[str]:
    lines = [f"{now_s:.3f} 31 ROTORCRAFT_FP 0 1280 {-z} 0 0 {-zd} 0 0 0 0 1280 768 0 {thrust} 7"]
    if flight.loop_log:
        loop_fields = (
            -768 if flying else 0, 0, z, zd, zdd, *state[[loop.Z_REF, loop.ZD_REF, loop.ZDD_REF]],
            0, 0, 0, *state[[loop.Z_SUM_ERR, loop.FF_CMD, loop.FB_CMD]], thrust,
        )  # fmt: skip
        lines.append(f"{now_s:.3f} 31 VERT_LOOP {' '.join(map(str, loop_fields))}")
    return lines
