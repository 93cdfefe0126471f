"""How many independent loads the specimens of a direction hold, and what it does to sigma."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bubblefit.experiments.strips.data import Strip
from bubblefit.experiments.strips.prepared import PLACES, SPECIMENS, independent_loads, loads_alike
from bubblefit.inference.noise import Noise
from bubblefit.project.project import read_project
from bubblefit.readers.curves import LoadCurve, fit_load_polynomial, specimen_scatter

from ...projects import constant_strips

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


def test_specimens_that_differ_by_a_factor_count_as_specimens() -> None:
    factors = np.array([0.9, 0.97, 1.0, 1.02, 1.11])
    assert independent_loads(strip(factors[:, None] * WHOLE)) == pytest.approx(4.0, rel=1e-6)


def test_loads_that_err_by_themselves_count_by_themselves() -> None:
    random = np.random.default_rng(4)
    noise = 5.0 * random.standard_normal((6, len(WHOLE)))
    assert independent_loads(strip(WHOLE + noise)) > 0.6 * 5 * len(WHOLE)


def test_sigma_is_the_scatter_of_what_specimens_say() -> None:
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


def test_what_nobody_knows() -> None:
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


def test_a_fit_reckons_with_specimens(tmp_path: Path) -> None:
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
