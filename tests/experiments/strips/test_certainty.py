"""What strips, and a bubble, determine of the moduli."""

import numpy as np
import pytest
from bubblefit.experiments.strips.data import Strip
from bubblefit.experiments.strips.prepared import PLACES, SPECIMENS, independent_loads, loads_alike
from bubblefit.inference.assessment import certainty, uncertainty_from
from bubblefit.inference.descent import descend
from bubblefit.inference.noise import Noise
from bubblefit.materials.forms.base import COMPONENTS
from bubblefit.project.project import read_project
from bubblefit.readers.curves import LoadCurve, fit_load_polynomial, specimen_scatter

from ...inference.scatter import follows, scatter_of
from ...projects import constant_strips
from .problems import CONSTANT, CONSTANTS, CUBIC, LAW, STRIPS, joint, near, strips


def test_certainty_predicts_the_scatter_of_noisy_strip_fits():
    """Sigma is the scatter of linear estimates from drawn noise; a real fit goes where they do."""
    noise, moduli = 5.0, np.array([20.0, 200.0, 500.0])
    fit, truth = strips(CONSTANTS, CONSTANT, noise=noise, seed=1), near(CONSTANTS, CONSTANT, 1.0)
    point = fit.evaluate(truth, True)
    predicted = certainty(fit, point, CONSTANT, np.array([0.1, 0.1, 0.1]))
    # Ten loads a strip say their noise to 22 %; the scatter is that of the noise as it is said.
    assert set(predicted.noise) == set(STRIPS)
    assert np.mean(list(predicted.noise.values())) == pytest.approx(noise, rel=0.25)
    scatter = scatter_of(fit, point, predicted.noise)
    sigma = [predicted.sigma[name][0] for name in ("G12", "E2", "E1")]
    assert sigma == pytest.approx(CONSTANTS.to_coefficients @ scatter / moduli, rel=0.03)
    best, _ = descend(fit, point, 1e-7, 10**6, norms=True)
    off = best.unknowns - truth - follows(fit, point, -point.residual)
    assert np.abs(off / scatter).max() < 0.05


def test_what_each_data_set_pins_down():
    fit = joint(noise=10.0, bubble_noise=0.1)
    point = fit.evaluate(CUBIC.at(LAW.beta), True)
    reached, noise = np.array([0.1, 0.1, 0.3]), Noise.of(fit, point.residual).rows
    bubble, uniaxial, both = (
        uncertainty_from(fit, point, LAW, reached, tests, noise)
        for tests in ([0], [1, 2, 3], [0, 1, 2, 3])
    )
    for name in COMPONENTS:
        assert (both[name] <= bubble[name] * (1 + 1e-6)).all()
        assert (both[name] <= uniaxial[name] * (1 + 1e-6)).all()
    worst = {name: sigma.max() for name, sigma in bubble.items()}
    assert worst["G12"] > 2 * max(worst["E1"], worst["E2"])
    assert uniaxial["G12"].max() < 0.2 * bubble["G12"].max()
    # A pull along the warp says nothing of the fill or of shear.
    warp = uncertainty_from(fit, point, LAW, reached, [1], noise)
    assert warp["E1"].max() < 0.5
    assert min(warp["E2"].min(), warp["G12"].min()) > 1.0


ELONGATION = np.linspace(0.1, 3.0, 30)
WHOLE = 100.0 * ELONGATION


def strip(loads: np.ndarray) -> Strip:
    """Of curves (specimens, n) N."""
    curves = [
        LoadCurve("warp", str(k), ELONGATION, load, None) for k, load in enumerate(loads)
    ]  # fmt: skip
    together = np.tile(ELONGATION, len(loads))
    polynomial = fit_load_polynomial(together, loads.ravel(), 2, True)
    scatter = specimen_scatter(curves, polynomial).deviation
    return Strip("warp", 20.0, 23.0, polynomial, tuple(curves), scatter)


def test_specimens_that_differ_by_a_factor_count_as_specimens():
    factors = np.array([0.9, 0.97, 1.0, 1.02, 1.11])
    assert independent_loads(strip(factors[:, None] * WHOLE)) == pytest.approx(4.0, rel=1e-6)


def test_loads_that_err_by_themselves_count_by_themselves():
    random = np.random.default_rng(4)
    noise = 5.0 * random.standard_normal((6, len(WHOLE)))
    assert independent_loads(strip(WHOLE + noise)) > 0.6 * 5 * len(WHOLE)


def test_sigma_is_the_scatter_of_what_specimens_say():
    """Of 300 sets of five specimens, each stiffer by its own factor and a little uneven."""
    random = np.random.default_rng(6)
    shape = WHOLE / np.sqrt(WHOLE @ WHOLE)
    said, found = [], []
    for _ in range(300):
        factor = 1.0 + 0.05 * random.standard_normal((5, 1))
        loads = factor * WHOLE + 1.0 * random.standard_normal((5, len(WHOLE)))
        own = strip(loads)
        # The best factor of all loads, and one sigma of it as a fit reckons it.
        found.append(float(np.mean(loads @ shape)))
        n = loads.size
        assert own.scatter is not None
        said.append(own.scatter * np.sqrt(loads_alike(own, n, None) / 5))
    assert np.sqrt(np.mean(np.square(said))) == pytest.approx(np.std(found), rel=0.15)


def test_what_nobody_knows():
    """One curve, or a polynomial: a few places of it; as many times as specimens are said."""
    one = strip(WHOLE[None] + 1.0)
    assert independent_loads(one) == PLACES and independent_loads(one, 4) == 3 * PLACES
    polynomial = Strip("warp", 20.0, 23.0, one.polynomial)
    assert independent_loads(polynomial) == (SPECIMENS - 1) * PLACES
    assert independent_loads(polynomial, 1) == independent_loads(polynomial, 2) == PLACES
    # Noise that is given is that of single loads; where specimens are told, they count.
    assert loads_alike(one, 30, 2.0) == 1.0
    assert loads_alike(one, 30, None) == 30 / PLACES
    assert loads_alike(one, 30, 2.0, specimens=3) == 30 / (2 * PLACES)
    assert loads_alike(one, 1, None) == 1.0
    # Specimens that agree to the last digit.
    assert independent_loads(strip(np.tile(WHOLE, (3, 1)))) >= 2.0


def test_a_fit_reckons_with_specimens(tmp_path):
    """Two specimens of constant moduli: all of their loads count as one."""
    project = read_project(constant_strips(tmp_path))
    one = project.tests["one"]
    from bubblefit.runs.setup import prepare_fit

    problem = prepare_fit(project, [one]).problem()  # type: ignore[list-item]
    y = problem.unknowns.at(np.array([10.0, 190.0, 330.0]))
    point = problem.evaluate(y, False)
    assert point is not None
    alike = Noise.of(problem, point.residual).alike
    assert alike["one: warp"] == pytest.approx(22.0, rel=1e-6)
    # A polynomial of the same points says no more, though it has as many values as increments.
    text = (tmp_path / "project.toml").read_text()
    (tmp_path / "project.toml").write_text(text.replace('"points"', '"polynomial"'))
    (warp, fill) = (
        prepare_fit(p, [p.tests["one"]]).problem().comparisons  # type: ignore[list-item]
        for p in [read_project(tmp_path / "project.toml")]
    ).__next__()
    assert warp.objective.alike == pytest.approx(8.0) == fill.objective.alike
