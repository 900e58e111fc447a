from dataclasses import replace

from app.autopilots.autopilot import ModeParameter
from app.autopilots.commands import Setting
from app.autopilots.measurements import Parameter
from app.vehicles.mavlink.failures import Finding
from app.vehicles.mavlink.monitors.commanded import SettingMonitor
from tests.vehicles.mavlink.monitors.observing import failure_of
from tests.vehicles.mavlink.walking import PLAN, with_autopilot

GAINS = (Setting("gui_v_kp", 1600.0),)
MODE = ModeParameter("aut_mod", 1600.0, {2.0: "home"})
FLOWN = with_autopilot(replace(PLAN, trial_gains=GAINS), mode_parameter=MODE)


def reported(*reports: Parameter) -> tuple[SettingMonitor, Finding | None]:
    settings, finding = SettingMonitor(), None
    for each in reports:
        settings, finding = settings.update(each, FLOWN)
    return settings, finding


def test_one_report_of_another_value_is_a_suspicion_and_two_are_a_finding() -> None:
    other = Parameter("gui_v_kp", 300.0)
    settings, finding = reported(other)
    assert (settings.suspects, finding) == (frozenset({"gui_v_kp"}), None)
    assert (failure_of(settings.find_unconfirmed()), failure_of(reported(other, other)[1])) == ("F10c", "F10c")


def test_the_right_value_ends_a_suspicion_and_other_parameters_begin_none() -> None:
    settings, finding = reported(Parameter("gui_v_kp", 300.0), Parameter("gui_v_kp", 1600.0))
    assert (settings.suspects, finding, settings.find_unconfirmed()) == (frozenset(), None, None)
    assert reported(Parameter("gui_v_kd", 5.0))[0].suspects == frozenset()


def test_another_mode_is_found_by_two_reports() -> None:
    assert failure_of(reported(Parameter("aut_mod", 2.0), Parameter("aut_mod", 2.0))[1]) == "F10b"
    assert reported(Parameter("aut_mod", 7.0))[0].suspects == frozenset(), "a value that names no mode"
