"""experiments/bubble/nuisance.py: fitted registration, noise of a measured sheet."""

import functools
from dataclasses import replace

import bubblefit as bf
import numpy as np
import pytest
import scipy
from bubblefit.experiments.bubble.objective import MISALIGNMENTS
from bubblefit.experiments.bubble.sheet import fit_disk_polynomial
from bubblefit.inference.linear import LinearisedFit
from bubblefit.inference.noise import Noise
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel, default_increments
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.sampling import SmoothReading
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...builders.projects import fit_setup
from ...support.refusals import complaint

TRUE = {"E1": 600.0, "E2": 300.0, "G12": 14.0}
PRESSURES = (0.03, 0.09, 0.15, 0.2)
LAW = bf.Law("constant", bounds={"E1": [100, 2000], "E2": [50, 1500], "G12": [1, 100]})
YARNS_TURN, TILT, ASIDE, NOISE = 8.0, 2.0, (1.5, -0.8), 0.01


def fields_of_tilted_camera():
    """Return points and displacements of a disk whose yarns are turned, as a camera askew sees."""
    mesh = disk_mesh(100.0, 300)
    model = BubbleModel(mesh, 0.81, PRESSURES).with_parameters({"turn": np.radians(YARNS_TURN)})
    moved = MembraneSolver().run(model, HypoelasticLaw.linear(*TRUE.values())).displacement
    c, s = np.cos(np.radians(TILT)), np.sin(np.radians(TILT))
    seen = moved @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]]).T
    seen = seen + NOISE * np.random.default_rng(4).standard_normal(seen.shape)
    inside = np.hypot(*mesh.points[:, :2].T) < 96
    return mesh.points[inside] + (*ASIDE, 0.0), seen[:, inside]


def fit_of_camera_fields(**nuisance):
    points, seen = fields_of_tilted_camera()
    bubble = bf.Bubble(
        points, seen, PRESSURES, radius=100.0, elements=300, objective="mm", noise=NOISE,
        nuisance=nuisance,
    )  # fmt: skip
    trusted = ["off-centre", "turned", "tilted", "radius", "camera-frame"]
    fabric = bf.Fabric("turned", 0.81)
    return bf.fit([bubble], LAW, fabric=fabric, starts=3, jobs=1, trust=trusted, mesh_error="told")


def test_turn_tilt_and_shift_are_fitted_with_sigma():
    found = fit_of_camera_fields(registration="fitted")
    table = found.coefficients().set_index("unknown")
    known = {"turn": YARNS_TURN, "tilt_x": TILT, "tilt_y": 0.0}
    known |= {"shift_x": -ASIDE[0], "shift_y": -ASIDE[1]}
    for name, value in known.items():
        assert table.value[name] == pytest.approx(value, abs=0.1), name
        assert abs(table.value[name] - value) < 4 * table.sigma[name] + 0.01, name
    for name, value in TRUE.items():
        assert found.law.modulus(name, 0.0) == pytest.approx(
            value, rel=0.1 if name == "G12" else 0.01
        )


def test_fitted_registration_begins_at_symmetry_of_the_fields():
    points, seen = fields_of_tilted_camera()
    bubble = bf.Bubble(points, seen, PRESSURES, radius=100.0, elements=300, noise=NOISE,
                       nuisance={"registration": "fitted"})  # fmt: skip
    setup = fit_setup(bf.Project.of([bubble], LAW, fabric=bf.Fabric("turned", 0.81)))
    unknowns = setup.problem().unknowns
    begin = dict(zip(unknowns.nuisance.names, unknowns.nuisance.begin, strict=True))
    assert begin["turn"] == pytest.approx(YARNS_TURN, abs=1.5)
    assert begin["tilt_x"] == pytest.approx(TILT, abs=0.3) and abs(begin["tilt_y"]) < 0.3
    assert begin["shift_x"] == pytest.approx(-ASIDE[0], abs=0.5)
    assert begin["shift_y"] == pytest.approx(-ASIDE[1], abs=0.5)
    assert not unknowns.nuisance.start.any()


def test_fitted_turn_of_a_quarter_is_refused():
    points, seen = fields_of_tilted_camera()
    bubble = bf.Bubble(
        points, seen, PRESSURES, radius=100.0, symmetry="quarter", nuisance={"turn": 5.0}
    )
    assert "nuisance.turn" in complaint(bf.fit, [bubble], LAW, fabric=bf.Fabric("turned", 0.81))


SHEET_PRESSURES = (0.03, 0.09, 0.15)
FABRIC = bf.Fabric("computed", 0.81)
SHEET_NOISE = 0.02
QUADS, POINTS = 48, 300


@functools.cache
def computed():
    mesh = disk_mesh(100.0, QUADS)
    law = HypoelasticLaw.linear(*TRUE.values())
    model = BubbleModel(mesh, 0.81, SHEET_PRESSURES, default_increments(SHEET_PRESSURES))
    return mesh, MembraneSolver().run(model, law).displacement


def measured_bubble(seed=0, noise_of_data=SHEET_NOISE, **section):
    """Return a computed, flat bubble as a camera sees it: with noise, and not up to the rim."""
    random = np.random.default_rng(0)
    mesh, moved = computed()
    angle, share = 2 * np.pi * random.random(POINTS), np.sqrt(random.random(POINTS))
    places = 95.0 * (share * [np.cos(angle), np.sin(angle)]).T
    sample, inside = SmoothReading.of(mesh).matrix(places)
    at_places = np.stack([sample @ frame for frame in moved])
    random = np.random.default_rng(seed)
    at_places += noise_of_data * random.standard_normal(at_places.shape)
    heights = noise_of_data * random.standard_normal(len(places))
    points = np.column_stack([places, heights])[inside]
    keys = {"radius": 100.0, "elements": QUADS, "objective": "mm", "noise": SHEET_NOISE} | section
    return bf.Bubble(points, at_places, SHEET_PRESSURES, **keys)


def problem_of(**section):
    return fit_setup(bf.Project.of([measured_bubble(**section)], LAW, fabric=FABRIC)).problem()


def problem_at_truth(**section):
    problem = problem_of(**section)
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
    deviation = np.linalg.norm(surface.rms * surface.errors_at(at_rim), axis=1)
    assert deviation == pytest.approx(np.std(values, axis=0), rel=0.2)


def test_flat_sheet_has_no_shared_errors():
    comparison, *_ = problem_at_truth()
    assert comparison.shared_errors is None


#: Noise, mm, and section. A large noise, beside which it does not matter what a polynomial leaves
#: out of a field of few quads.
MEASURED = {
    "surface": (SHEET_NOISE, {"sheet": {"surface": "measured", "degree": 4}}),
    "rim": (0.2, {"sheet": {"rim": "measured", "degree": 4}}),
    "from_pressure": (SHEET_NOISE, {"sheet": {"from_pressure": 0.03, "modes": 1}}),
}


@pytest.mark.parametrize(("level", "section"), MEASURED.values(), ids=MEASURED)
def test_estimates_scatter_as_much_as_their_covariance_says(level, section):
    problem = problem_of(noise_of_data=level, noise=level, **section)
    truth = problem.unknowns.at([TRUE["G12"], TRUE["E2"], TRUE["E1"]])
    without_noise = problem_of(noise_of_data=0.0, **section).evaluate(truth, False).residual
    best = problem.evaluate(truth, True)
    by_noise = best.residual - without_noise
    noise = Noise.from_residual(problem, by_noise).with_shared_errors(problem, best, by_noise)
    assert noise.level["bubble"] == pytest.approx(level, rel=0.05)
    fitted = LinearisedFit.of(problem, best, noise)
    estimates = []
    seeds = range(1, 41)
    for seed in seeds:
        noisy = problem_of(seed=seed, noise_of_data=level, **section)
        change = noisy.evaluate(truth, False).residual - without_noise
        weighted = fitted.weights * change
        estimates.append(fitted.inverse @ (fitted.jacobian.T @ weighted))
    moduli = np.array(estimates)[:, :3]
    covariance = (fitted.noise_response @ fitted.noise_response.T)[:3, :3]
    chi_square = np.sum(moduli.T * np.linalg.solve(covariance, moduli.T), axis=0)
    # Within the 95 % interval of the sum of that many squares.
    low, high = scipy.stats.chi2.ppf([0.025, 0.975], 3 * len(seeds))
    assert low < chi_square.sum() < high


def test_errors_of_a_registration_are_tilts_shifts_and_a_turn(registered):
    comparison, law, nuisance, history, registration = registered
    columns = comparison.shared_errors(comparison, law, nuisance, history).changes.toarray()
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


def test_registration_without_a_rim_has_no_errors_of_shifts(registered):
    comparison, law, nuisance, history, registration = registered
    errors = replace(comparison.shared_errors, registration=replace(registration, rim=None))
    whole = comparison.shared_errors(comparison, law, nuisance, history).changes.toarray()
    without_rim = errors(comparison, law, nuisance, history).changes.toarray()
    assert without_rim == pytest.approx(whole[:, [0, 1, 4]])


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
    columns = comparison.shared_errors(comparison, law, nuisance, history).changes
    objective = comparison.objective
    differences = np.concatenate(objective.differences(history.displacement, nuisance))
    level = np.sqrt(0.5 * np.mean(differences**2))
    variance = columns.power(2).sum(axis=1).mean()
    assert np.sqrt(variance) * objective.scale[0] == pytest.approx(level, rel=0.01)
    size = objective.sizes[0]
    first, second = columns[:size], columns[3 * size : 4 * size]
    assert first.nnz == size and not (first != second).nnz
