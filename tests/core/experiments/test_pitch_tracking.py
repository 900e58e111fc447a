import numpy as np
import pytest

from app.autopilots.registry import get_experiment
from app.core.errors import TrajectoryError
from app.core.experiments.base import Envelope, prior_distribution
from app.core.experiments.pitch_tracking import PitchTracking
from app.core.models.f16 import A, B, perturbed, transitions
from app.core.records.trajectory import CHANNEL_UNITS, Trajectory
from app.core.tuning.corrected_model import model_optimum
from tests.core.tuning.flying import compiled_only

TRUTH = PitchTracking({"perturbation": 0.0})
HAND = TRUTH.space.default
BEST = np.array([-20.0, -50.0, -57.3, -14.796, -4.210, -0.008])
"""The local optimum of the truth, to the digits in which the definition of the experiment gives it."""


def error(gains: np.ndarray[tuple[int], np.dtype[np.float64]]) -> float:
    return float(TRUTH.errors(TRUTH.outputs(gains[np.newaxis], TRUTH.nominal_model))[0])


def test_the_truths_modes_are_those_of_the_source() -> None:
    """Short period −0.76215 ± 1.20509j, phugoid −0.003901 ± 0.084374j, and the altitude."""
    expected = [-0.76215 - 1.20509j, -0.76215 + 1.20509j, -0.003901 - 0.084374j, -0.003901 + 0.084374j, 0.0]
    assert np.sort_complex(np.linalg.eigvals(A)) == pytest.approx(np.array(expected), abs=1e-5)


@pytest.mark.parametrize(("gains", "expected"), [(np.zeros(6), 6.66664), (HAND, 3.38180), (BEST, 0.204716)])
def test_the_truth_scores_known_gains_as_the_definition_says(
    gains: np.ndarray[tuple[int], np.dtype[np.float64]], expected: float
) -> None:
    assert error(gains) == pytest.approx(expected, abs=1e-4)


@compiled_only
@pytest.mark.complete
def test_twenty_starts_anywhere_in_the_bounds_end_in_the_same_optimum_of_the_truth() -> None:
    random = np.random.default_rng(5)
    found = []
    for _ in range(20):
        end = model_optimum(TRUTH, TRUTH.space, random.uniform(TRUTH.space.lower, TRUTH.space.upper))
        while (again := model_optimum(TRUTH, TRUTH.space, end.gains)).error < (1.0 - 1e-4) * end.error:
            end = again
        found.append(error(end.gains))
    assert found == pytest.approx([0.204716] * 20, abs=2e-4)


def test_a_step_is_exact_to_the_fourth_order() -> None:
    step_s, halved = 0.02, np.hstack((A, B))
    moved = transitions(halved)
    augmented = np.vstack((0.02 * halved, np.zeros((2, 7))))
    exact, power = np.eye(7), np.eye(7)
    for k in range(1, 12):
        power = power @ augmented / k
        exact += power
    assert moved == pytest.approx(exact[:5], abs=2.0 * step_s**5 * 500.0)


@pytest.mark.parametrize(("options", "off"), [({}, 0.45), ({"perturbation": 0.2}, 0.2), ({"perturbation": 0.8}, 0.8)])
def test_the_inaccurate_models_are_drawn_as_the_definition_says(options: dict[str, float], off: float) -> None:
    random = np.random.default_rng(50)
    a = A * (1.0 + random.uniform(-off, off, (5, 5)))
    b = B * (1.0 + random.uniform(-off, off, (5, 2)))
    experiment = get_experiment("pitch-tracking", {"model_seed": 50, **options})
    assert isinstance(experiment, PitchTracking)
    assert (experiment.systems(experiment.nominal_model) == np.hstack((a, b))).all()


def test_parameters_are_logarithms_of_what_an_element_is_multiplied_by() -> None:
    experiment = PitchTracking({"model_seed": 3})
    model = np.zeros(19)
    names = [parameter.name for parameter in experiment.model_parameters]
    model[names.index("ln_b52")] = np.log(2.0)
    systems = experiment.systems(np.stack((model, np.zeros(19))))
    assert systems[0, 4, 6] == pytest.approx(2.0 * perturbed(0.45, 3)[4, 6])
    assert systems[0] != pytest.approx(systems[1])
    assert systems[1] == pytest.approx(perturbed(0.45, 3))
    assert len(experiment.informed(model, np.full(19, 0.1)).model_parameters) == 19
    assert experiment.informed(model, np.full(19, 0.1)).nominal_model == pytest.approx(model)


def test_runs_in_a_batch_are_the_same_as_one_by_one() -> None:
    experiment = PitchTracking({"model_seed": 3})
    gains = np.stack((HAND, BEST))
    models = np.stack((np.zeros(19), np.full(19, 0.01)))
    both = experiment.outputs(gains, models)
    for run in range(2):
        alone = experiment.simulate(gains[run], models[run])
        assert (both[run] == alone["pitch_error_rad"]).all()
        assert set(alone.channels) <= set(CHANNEL_UNITS)


def test_an_error_of_ten_radians_counts_as_that_from_there_on() -> None:
    """Elevator the wrong way round: the nose runs away within seconds and stays at 10 rad on the books."""
    runaway = np.array([-50.0, 0.0, 0.0, -57.3, -57.3, 0.5])
    run = TRUTH.simulate(runaway, TRUTH.nominal_model)
    first = int(np.argmax(np.abs(run["pitch_error_rad"]) >= 10.0))
    assert 0 < first < 3000
    expected = float(np.trapezoid(np.abs(run["pitch_error_rad"][:first]), dx=0.02)) + 0.02 * 10.0 * (3001 - first - 0.5)
    assert TRUTH.error(run) == pytest.approx(expected, rel=0.01)
    assert TRUTH.errors(run["pitch_error_rad"][np.newaxis])[0] == pytest.approx(TRUTH.error(run), rel=1e-9)


def test_a_stored_flight_is_scored_on_its_own_time_stamps() -> None:
    run = TRUTH.simulate(HAND, TRUTH.nominal_model)
    assert TRUTH.error(run.as_stored()) == pytest.approx(3.38180, abs=1e-4)
    assert (TRUTH.set_point(run.time_s) == 0.0).all()
    short = Trajectory(run.time_s[:2000], {"pitch_error_rad": run["pitch_error_rad"][:2000]}, "model", "simulation")
    with pytest.raises(TrajectoryError, match="0 … 60 s after the command are needed"):
        TRUTH.error(short)


def test_a_model_with_what_a_flight_did_beyond_it_flies_that_flight_again() -> None:
    experiment = PitchTracking({"model_seed": 50})
    flight = TRUTH.simulate(BEST, TRUTH.nominal_model).as_stored()
    beyond = experiment.disturbances(flight, BEST, experiment.nominal_model)
    assert beyond is not None
    flown = experiment.disturbed_outputs(BEST[np.newaxis], experiment.nominal_model, beyond)[0]
    assert flown == pytest.approx(flight["pitch_error_rad"], abs=1e-6)
    plain = experiment.outputs(BEST[np.newaxis], experiment.nominal_model)[0]
    assert np.abs(plain - flight["pitch_error_rad"]).max() > 1e-3


def test_without_the_commands_a_record_tells_nothing_about_single_steps() -> None:
    flight = TRUTH.simulate(BEST, TRUTH.nominal_model)
    bare = Trajectory(flight.time_s, {"pitch_error_rad": flight["pitch_error_rad"]}, "csv", "vehicle")
    assert TRUTH.disturbances(bare, BEST, TRUTH.nominal_model) is None


def test_no_hazard_is_known_beside_the_bounds() -> None:
    assert TRUTH.hazards(HAND, prior_distribution(TRUTH), Envelope(ceiling_m=4.5, safe_gains={})) == ()


def test_its_model_depends_on_no_parameters_of_an_autopilot() -> None:
    experiment, parameters = PitchTracking(), {"MOT_THST_HOVER": 0.3}
    assert experiment.loop_parameters(parameters) == {}
    assert experiment.under(parameters) is experiment
