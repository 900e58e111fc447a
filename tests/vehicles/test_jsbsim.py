import math
import subprocess
import sys
from collections.abc import Mapping

import numpy as np
import pytest

from app.core.control.vertical_guidance import ALT
from app.core.errors import InputError
from app.core.records.trajectory import Trajectory
from app.vehicles.base import OptionValue
from app.vehicles.jsbsim import JsbsimFlight, new_aircraft
from app.vehicles.registry import check_options
from tests.vehicles.flying import SAFE, TAKEOFF, TUNED, flown

WEIGHT_N = 0.4 * 9.8124
"""JSBSim's gravity at 52° north and sea level, the centrifugal part taken off: 9.8124 m/s² (WGS 84)."""
FULL_THRUST_N = 4 * 0.35 * 4.4482216


def hover_share(flight: Trajectory) -> float:
    return float(flight["thrust"][-1024:].mean())


def lift_off_s(flight: Trajectory) -> float:
    return float(flight.time_s[np.argmax(flight["altitude_m"] > 0.05)])


def offset_m(flight: JsbsimFlight) -> tuple[float, float]:
    """How far north and east of its place of takeoff the vehicle is."""
    north_ft, east_ft = (float(flight._fdm[f"position/from-start-neu-{axis}-ft"]) for axis in "ne")
    return north_ft * 0.3048, east_ft * 0.3048


def furthest_from_start_m(options: Mapping[str, OptionValue]) -> tuple[float, float]:
    """Largest horizontal offset in a takeoff of 33 s, and the altitude at its end."""
    complete = {name: float(value) for name, value in check_options("jsbsim", options).items()}
    flight = JsbsimFlight(complete, seed=5)
    command = np.array([ALT, 3 << 8, *TUNED.values()], dtype=np.int64)
    offsets, altitude_m = [0.0], 0.0
    for _ in range(33 * 4):
        altitude_m = float(flight.advance(128, command)[-1, 0])
        offsets.append(math.hypot(*offset_m(flight)))
    return max(offsets), altitude_m


@pytest.mark.complete
def test_it_hovers_on_its_weight_in_thrust() -> None:
    assert hover_share(flown("jsbsim", {})) == pytest.approx(WEIGHT_N / FULL_THRUST_N, abs=0.0005)


@pytest.mark.complete
def test_it_stands_still_until_the_motors_lift_it() -> None:
    flight = flown("jsbsim", {"start_latency_s": 1.0})
    resting = flight.time_s < 1.0
    assert np.abs(flight["altitude_m"][resting]).max() < 0.001
    assert np.abs(flight["climb_rate_m_s"][resting]).max() < 0.001
    assert flight["thrust"][resting].max() == 0.0


@pytest.mark.complete
def test_the_start_latency_shifts_the_whole_takeoff() -> None:
    late = lift_off_s(flown("jsbsim", {"start_latency_s": 0.5})) - lift_off_s(flown("jsbsim", {}))
    assert late == pytest.approx(0.5, abs=0.01)


@pytest.mark.complete
def test_more_thrust_means_less_command_to_hover() -> None:
    assert hover_share(flown("jsbsim", {"thrust_scale": 1.2})) == pytest.approx(
        WEIGHT_N / FULL_THRUST_N / 1.2, abs=0.001
    )


@pytest.mark.complete
@pytest.mark.parametrize("mass_kg", [0.35, 0.48])
def test_command_to_hover_goes_with_mass(mass_kg: float) -> None:
    expected = mass_kg / 0.4 * WEIGHT_N / FULL_THRUST_N
    assert hover_share(flown("jsbsim", {"mass_kg": mass_kg})) == pytest.approx(expected, abs=0.001)


@pytest.mark.complete
def test_a_motor_lag_delays_the_lift_off() -> None:
    assert lift_off_s(flown("jsbsim", {"motor_lag_s": 0.1})) > lift_off_s(flown("jsbsim", {})) + 0.05


@pytest.mark.complete
def test_a_sagging_battery_loses_voltage_with_the_load_and_costs_thrust() -> None:
    flight = flown("jsbsim", {"battery_sag": 0.05})
    share = hover_share(flight)
    assert share * (1.0 - 0.05 * share) ** 2 == pytest.approx(WEIGHT_N / FULL_THRUST_N, abs=0.001)
    assert flight["battery_v"][-1] == pytest.approx(11.1 * (1.0 - 0.05 * share), abs=0.01)


@pytest.mark.complete
def test_altitude_noise_has_the_asked_for_spread() -> None:
    """The motion of a resting vehicle is nil, so what is recorded before the start is noise alone."""
    flight = flown("jsbsim", {"altitude_noise_m": 0.02, "start_latency_s": 2.0})
    resting = flight["altitude_m"][flight.time_s < 2.0]
    assert resting.std() == pytest.approx(0.02, rel=0.1)
    assert resting.mean() == pytest.approx(0.0, abs=0.003)


@pytest.mark.parametrize(
    "wind_from_deg", [225.0, *(pytest.param(each, marks=pytest.mark.complete) for each in (0.0, 90.0))]
)
def test_it_holds_its_place_in_wind_of_5_m_s_with_gusts(wind_from_deg: float) -> None:
    wind = {"wind_m_s": 5.0, "gust_m_s": 1.5, "wind_from_deg": wind_from_deg}
    offset_m, altitude_m = furthest_from_start_m(wind)
    assert 0.1 < offset_m < 2.0
    assert altitude_m == pytest.approx(3.0, abs=0.2)


@pytest.mark.complete
def test_the_strongest_wind_it_may_be_given_does_not_upset_it() -> None:
    offset_m, altitude_m = furthest_from_start_m({"wind_m_s": 10.0, "gust_m_s": 3.0, "motor_lag_s": 0.15})
    assert offset_m < 6.0
    assert altitude_m == pytest.approx(3.0, abs=1.0)


def test_still_air_leaves_it_where_it_started() -> None:
    offset_m, _ = furthest_from_start_m({})
    assert offset_m < 0.001


@pytest.mark.complete
def test_a_takeoff_in_wind_can_be_scored() -> None:
    calm, windy = (TAKEOFF.error(flown("jsbsim", {"wind_m_s": wind, "gust_m_s": wind / 5})) for wind in (0.0, 5.0))
    assert calm < windy < 0.2


def test_wind_from_the_north_drives_it_south() -> None:
    complete = {name: float(value) for name, value in check_options("jsbsim", {"wind_m_s": 5.0}).items()}
    flight = JsbsimFlight(complete, seed=1)
    flight.advance(5 * 512, np.array([ALT, 3 << 8, *TUNED.values()], dtype=np.int64))
    north_m, east_m = offset_m(flight)
    assert north_m < -0.1
    assert abs(east_m) < 0.05


@pytest.mark.parametrize(
    ("tilt", "angle"), [("ic/phi-deg", "attitude/phi-deg"), ("ic/theta-deg", "attitude/theta-deg")]
)
def test_it_rights_itself_from_a_tilt_of_30_degrees(tilt: str, angle: str) -> None:
    aircraft = new_aircraft()
    aircraft["ic/h-agl-ft"] = 100.0
    aircraft[tilt] = 30.0
    assert aircraft.run_ic()
    aircraft["motors/thrust-norm"] = 0.63
    for _ in range(5 * 512):
        aircraft.run()
    assert aircraft[angle] == pytest.approx(0.0, abs=0.5)


def test_it_turns_back_to_its_heading() -> None:
    aircraft = new_aircraft()
    aircraft["ic/h-agl-ft"] = 100.0
    aircraft["ic/psi-true-deg"] = 40.0
    assert aircraft.run_ic()
    aircraft["motors/thrust-norm"] = 0.63
    for _ in range(5 * 512):
        aircraft.run()
    assert aircraft["attitude/psi-deg"] == pytest.approx(0.0, abs=0.5)


def test_a_vehicle_too_heavy_for_its_motors_is_refused_by_name() -> None:
    with pytest.raises(InputError) as refusal:
        check_options("jsbsim", {"mass_kg": 0.6, "thrust_scale": 0.8})
    assert [problem.field for problem in refusal.value.problems] == ["vehicle.options.mass_kg"]


@pytest.mark.complete
def test_gains_that_throw_it_about_still_leave_a_finite_record() -> None:
    flight = flown("jsbsim", {}, {"kp": 4000, "ki": 2000, "kd": 0})
    assert np.isfinite(flight["altitude_m"]).all()


THREADS = """
import threading
from app.vehicles.jsbsim import new_aircraft

def step() -> None:
    aircraft = new_aircraft()
    for _ in range(200):
        aircraft.run()

def keep_busy() -> None:
    while not over.is_set():
        [object() for _ in range(1000)]

over = threading.Event()
busy = threading.Thread(target=keep_busy)
busy.start()
for _ in range(30):
    threads = [threading.Thread(target=step) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
over.set()
busy.join()
"""


@pytest.mark.complete
def test_jsbsim_in_threads_that_end_neither_kills_the_process_nor_writes_to_the_terminal() -> None:
    """A separate process: JSBSim 1.3.3 ends it when a thread with a Python logger goes, and prints by default."""
    done = subprocess.run([sys.executable, "-c", THREADS], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


@pytest.mark.complete
def test_jsbsim_writes_nothing_to_the_terminal(capfd: pytest.CaptureFixture[str]) -> None:
    flown("jsbsim", {"wind_m_s": 1.0}, SAFE)
    captured = capfd.readouterr()
    assert captured.out == ""
    assert captured.err == ""
