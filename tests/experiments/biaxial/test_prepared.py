"""experiments/biaxial/prepared.py: residuals, noise and errors of biaxial paths."""

import numpy as np
import pytest
from bubblefit.experiments.base import Weighting
from bubblefit.meshes.strip_models import elongations

from ...builders.biaxial_tests import (
    BENT_LAW,
    FIVE_RATIOS,
    biaxial_project,
    biaxial_rows,
    write_biaxial_rows,
)
from ...builders.projects import fit_setup


def test_biaxial_residuals_and_derivatives(five_ratios_folder):
    setup = fit_setup(five_ratios_folder / "project.toml")
    (prepared,) = setup.tests
    comparisons = prepared.comparisons(setup.make_solver, Weighting())
    assert [c.name for c in comparisons] == [f"biaxial: {ratio}" for ratio in FIVE_RATIOS]
    law = BENT_LAW.with_beta(1.1 * BENT_LAW.beta)
    free = tuple(range(12))
    for comparison in comparisons:
        objective = comparison.objective
        history, jacobian = comparison.differentiate(law, free, {}, warm=False)
        residual = objective.residual(history, {})
        own = elongations(history.displacement)
        off = (own - own[0] - objective.strain)[1:]
        np.testing.assert_allclose(residual * objective.scale, 100 * off.T.ravel(), atol=1e-12)
        rms, largest = np.sqrt(np.mean(off[:, 0] ** 2)), np.abs(objective.strain).max()
        assert np.linalg.norm(residual[: objective.sizes[0]]) == pytest.approx(rms / largest)
        for place in (7, 11):
            step = 1e-4 * np.eye(12)[place]
            laws = [law.with_beta(law.beta + s) for s in (step, -step)]
            up, down = (objective.residual(comparison.run(x, free, {}, False), {}) for x in laws)
            slope = (up - down) / 2e-4
            least = 1e-6 * np.abs(jacobian[:, [7, 11]]).max()
            np.testing.assert_allclose(jacobian[:, place], slope, rtol=1e-5, atol=least)
        larger = np.linspace(2, 30, 30)[1:, None]
        assert [len(at) for at in objective.positions] == list(objective.sizes)
        np.testing.assert_allclose(objective.positions[1], larger)
        # Weights of one test among others add up to that of the test.
    weighted, own = prepared.comparisons(setup.make_solver, Weighting(True, 3.0)), comparisons[0]
    history, other = (own.run(one, free, {}, False) for one in (law, BENT_LAW))
    residual = own.objective.residual(history, {})
    ratio = weighted[0].objective.residual(history, {}) / residual
    np.testing.assert_allclose(ratio, 3.0 / 10)
    shifted = own.objective.shifted(history, other)
    np.testing.assert_allclose(shifted.residual(other, {}), residual, atol=1e-12)


@pytest.mark.parametrize(
    ("line", "noise", "how"), [("noise = 0.03", 0.03, "given"), ("", 0.01, "assumed")]
)
def test_noise_of_a_biaxial_test_is_that_of_its_section(tmp_path, line, noise, how):
    write_biaxial_rows(tmp_path / "test.csv", biaxial_rows(BENT_LAW, ["1:1"]))
    (prepared,) = fit_setup(biaxial_project(tmp_path, line)).tests
    (comparison,) = prepared.comparisons(lambda *a: None, Weighting())
    assert comparison.objective.least_noise == pytest.approx(noise)
    assert comparison.objective.noise_is == how and comparison.objective.unit == "%"
