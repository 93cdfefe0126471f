"""Presenter of biaxial tests: errors of strain of a fit, of its card, and tables in percent."""

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.runs.simulation import simulate_cards

from ...builders.biaxial_tests import BENT_LAW, biaxial_project, biaxial_rows, write_biaxial_rows

RATIOS = ("1:1", "2:1", "0:1")


def test_simulated_paths_have_the_rms_errors_of_the_fit(tmp_path):
    rows = biaxial_rows(BENT_LAW, RATIOS, rows=8)
    noise = np.random.default_rng(5).normal(0.0, 0.05, (len(rows), 2))
    rows = [
        (*row[:3], row[3] + warp, row[4] + fill)
        for row, (warp, fill) in zip(rows, noise.tolist(), strict=True)
    ]
    write_biaxial_rows(tmp_path / "test.csv", rows)
    project = bf.read_project(biaxial_project(tmp_path, form="constant")).with_fit(jobs=1)
    fit = bf.fit(project, starts=1)
    (findings,) = fit.findings.values()
    tests = list(project.tests.values())
    simulation = simulate_cards(project, tests, {"fitted": fit.card}, tmp_path / "out")
    (numbers,) = simulation.numbers["cards"].values()
    for ratio in RATIOS:
        for name in ("rms_warp_percent", "rms_fill_percent"):
            fitted = findings.numbers["ratios"][ratio][name]
            assert numbers["ratios"][ratio][name] == pytest.approx(fitted, rel=1e-5)
            assert fitted > 0.01
