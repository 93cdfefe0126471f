"""experiments/bubble/shared_errors.py: noise of a measured sheet, rim and registration in bands."""

from dataclasses import replace

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.experiments.bubble.objective import MISALIGNMENTS
from bubblefit.experiments.bubble.sheet import fit_disk_polynomial
from bubblefit.inference.linear import posteriors_of
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel, default_increments
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.sampling import SmoothReading
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...builders.projects import fit_setup

TRUE = {"E1": 600.0, "E2": 300.0, "G12": 14.0}
PRESSURES = (0.03, 0.09, 0.15)
LAW = bf.Law("constant", bounds={"E1": [100, 2000], "E2": [50, 1500], "G12": [1, 100]})
FABRIC = bf.Fabric("computed", 0.81)
NOISE = 0.02
QUADS = 48


def measured_bubble(seed=0, **section):
    """Return a computed, flat bubble as a camera sees it: with noise, and not up to the rim."""
    random = np.random.default_rng(seed)
    mesh = disk_mesh(100.0, QUADS)
    law = HypoelasticLaw.linear(*TRUE.values())
    model = BubbleModel(mesh, 0.81, PRESSURES, default_increments(PRESSURES))
    moved = MembraneSolver().run(model, law).displacement
    angle, share = 2 * np.pi * random.random(1500), np.sqrt(random.random(1500))
    places = 95.0 * (share * [np.cos(angle), np.sin(angle)]).T
    sample, inside = SmoothReading.of(mesh).matrix(places)
    at_places = np.stack([sample @ frame for frame in moved])
    at_places += NOISE * random.standard_normal(at_places.shape)
    heights = NOISE * random.standard_normal(len(places))
    points = np.column_stack([places, heights])[inside]
    keys = {"radius": 100.0, "elements": QUADS, "objective": "mm", "noise": NOISE, **section}
    return bf.Bubble(points, at_places, PRESSURES, **keys)


def problem_at_truth(**section):
    setup = fit_setup(bf.Project.of([measured_bubble(**section)], LAW, fabric=FABRIC))
    problem = setup.problem()
    law = HypoelasticLaw.linear(*TRUE.values())
    (comparison,) = problem.comparisons
    nuisance = dict.fromkeys(problem.unknowns.nuisance.names, 0.0)
    history = comparison.run(law, (), nuisance, warm=False)
    return comparison, law, nuisance, history


def test_polynomial_scatters_as_its_spread_says():
    random = np.random.default_rng(1)
    places = random.uniform(-70, 70, (400, 2))
    at_rim = 100.0 * np.array([[1.0, 0.0], [0.0, -1.0]])
    values = []
    for _ in range(300):
        heights = 0.5 * random.standard_normal((400, 1))
        values.append(fit_disk_polynomial(places, heights, 100.0, 4).values_at(at_rim)[:, 0])
    surface = fit_disk_polynomial(places, 0.5 * random.standard_normal((400, 1)), 100.0, 4)
    drawn = [surface.disturbed(random).values_at(at_rim)[:, 0] for _ in range(300)]
    assert np.std(drawn, axis=0) == pytest.approx(np.std(values, axis=0), rel=0.2)


def test_flat_sheet_has_no_shared_errors():
    comparison, *_ = problem_at_truth()
    assert comparison.shared_errors is None


def test_draws_of_a_measured_surface_move_residuals_as_other_pictures_do():
    section = {"sheet": {"surface": "measured", "degree": 4}}
    comparison, law, nuisance, history = problem_at_truth(**section)
    columns = comparison.shared_errors(comparison, law, nuisance, history)
    expected = np.sqrt((columns**2).sum(axis=1).mean())
    changes = []
    for seed in range(1, 7):
        other, _, _, other_history = problem_at_truth(seed=seed, **section)
        del other
        changes.append(other_history.displacement)
    scatter = np.std(changes, axis=0, ddof=1)
    # The mean square over nodes and points is that of a residual in mm times the root of n.
    unit = comparison.objective.scale[0]
    assert expected * unit == pytest.approx(np.sqrt(np.mean(scatter**2)), rel=0.5)


def test_bands_contain_the_noise_of_a_measured_surface():
    bubble = measured_bubble(sheet={"surface": "measured"})
    fit = bf.fit(bubble, LAW, fabric=FABRIC, starts=1, jobs=1, mesh_error="told")
    noise = fit.best.certainty.noise
    alone = replace(noise, shared=np.zeros((len(noise.residual_sigma), 0)))
    best = fit.best.with_derivatives
    covariances = [posteriors_of(fit.problem, best, n)[0].covariance for n in (noise, alone)]
    reported, by_residuals = (np.sqrt(np.diag(covariance)) for covariance in covariances)
    assert noise.shared.any()
    assert (reported > 1.05 * by_residuals).any() and (reported >= by_residuals).all()
    assert fit.best.certainty.posterior.covariance == pytest.approx(covariances[0], rel=1e-6)


def test_errors_of_a_registration_are_tilts_shifts_and_a_turn(registered):
    comparison, law, nuisance, history, registration = registered
    columns = comparison.shared_errors(comparison, law, nuisance, history)
    assert columns.shape[1] == 5
    expected = comparison.objective.nuisance_columns(MISALIGNMENTS, nuisance, history)
    assert columns[:, 2] == pytest.approx(registration.rim.error * expected[:, 2])
    tilt = np.degrees(registration.flatness / 100.0 * np.sqrt(0.2))
    assert columns[:, 0] == pytest.approx(tilt * expected[:, 0])
    turned = comparison.model.with_parameters({"turn": np.radians(registration.warp.error)})
    run = MembraneSolver().run(turned, law)
    change = comparison.objective.residual(run, nuisance) - comparison.objective.residual(
        history, nuisance
    )
    assert columns[:, 4] == pytest.approx(change, abs=1e-3 * np.abs(change).max())


@pytest.fixture(scope="module")
def registered():
    section = {"data": {"points": {"registration": {}}}}
    setup = fit_setup(bf.Project.of([measured_bubble(**section)], LAW, fabric=FABRIC))
    problem = setup.problem()
    law = HypoelasticLaw.linear(*TRUE.values())
    (comparison,) = problem.comparisons
    history = comparison.run(law, (), {}, warm=False)
    return comparison, law, {}, history, setup.tests[0].registration


def test_noise_of_the_frame_counted_from_is_shared_by_all_frames():
    section = {"sheet": {"from_pressure": 0.03, "modes": 1}}
    comparison, law, nuisance, history = problem_at_truth(**section)
    columns = comparison.shared_errors(comparison, law, nuisance, history)
    objective = comparison.objective
    differences = np.concatenate(objective.differences(history.displacement, nuisance))
    level = np.sqrt(0.5 * np.mean(differences**2))
    variance = (columns**2).sum(axis=1).mean()
    assert np.sqrt(variance) * objective.scale[0] == pytest.approx(level, rel=0.3)
    rows = np.split(columns, np.cumsum(objective.sizes)[:-1])
    first, second = rows[0], rows[3]
    assert first / np.abs(first).max() == pytest.approx(second / np.abs(second).max())
