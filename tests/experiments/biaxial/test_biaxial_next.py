"""Ratios left out and foretold, and ratios that could be tested next."""

from __future__ import annotations

from pathlib import Path

import bubblefit as bf
import numpy as np
import pandas as pd
import pytest
from bubblefit.experiments.biaxial.prepared import candidates
from bubblefit.experiments.kinds import Planning, Precision, Weighting
from bubblefit.materials.designers import shares
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.materials.responses import biaxial_response
from bubblefit.runs.result import Fit
from bubblefit.runs.setup import prepare_fit

from ...biaxial_files import THICKNESS, biaxial_project, rows_of, write_rows
from ...commands import in_process

TRUE = HypoelasticLaw.linear(900.0, 600.0, 30.0, 0.24)
#: What one ratio, unlike the others, was computed with.
ELSE = HypoelasticLaw.linear(1100.0, 600.0, 30.0, 0.24)


def test_a_ratio_is_foretold_by_the_other(tmp_path, monkeypatch):
    """Each of two was made of a fabric of its own, of which the other knows nothing."""
    monkeypatch.setattr(Fit, "report", lambda self, folder: Path(folder))
    write_rows(tmp_path / "test.csv", [*rows_of(TRUE, ["1:1"]), *rows_of(ELSE, ["2:1"])])
    biaxial_project(tmp_path, form="constant")
    command = ("validate", "project.toml", "--leave", "ratios", "--starts", 1, "--out", "out")
    in_process(*command, cwd=tmp_path)
    table = pd.read_csv(tmp_path / "out" / "validation.csv").set_index("test")
    assert sorted(table.index) == ["biaxial: 1:1", "biaxial: 2:1"]
    for ratio in ("1:1", "2:1"):
        loads = np.outer(np.linspace(2, 30, 30), shares(ratio))
        one, other = (100 * biaxial_response(e, loads, THICKNESS).elongation for e in (ELSE, TRUE))
        off = ((one - one[0]) - (other - other[0]))[1:]
        foretold = table.loc[f"biaxial: {ratio}"].foretold_rms
        assert foretold == pytest.approx(np.sqrt(np.mean(off**2)), rel=1e-3)
    # A fit to both meets one of them at least half.
    assert (table.fitted_rms / table.foretold_rms).min() < 0.5


def planning(tmp_path, noise=None, own=True) -> Planning:
    write_rows(tmp_path / "test.csv", rows_of(TRUE, ["1:1", "2:1"]))
    project = bf.read_project(biaxial_project(tmp_path, form="constant"))
    setup = prepare_fit(project, project.chosen(None, fitted=True))
    (prepared,) = setup.tests
    law = HypoelasticLaw(TRUE.beta, 0.24, [0.03, 0.04, 0.1], form=TRUE.form)
    precision = {"biaxial: 1:1": Precision(0.02, 2.0, 29), "biaxial: 2:1": Precision(0.03, 4.0, 29)}
    tests = [prepared] if own else []
    place = prepared.test.place
    return Planning(place, tests, precision if own else {}, law, setup.make_solver, noise)


def test_each_ratio_is_offered_up_to_the_strains_that_the_law_is_known_for(tmp_path):
    offered = candidates(planning(tmp_path))
    assert [c.name for c in offered] == [
        f"biaxial {r}" for r in ("1:1", "2:1", "1:2", "1:0", "0:1", "1:5", "5:1")
    ]
    assert {c.noise_is for c in offered} == {"that of biaxial"}
    for candidate in offered:
        (path,) = candidate.make().test.data.paths
        share = np.log1p(path.strain[-1]) / [0.03, 0.04]
        assert share.max() == pytest.approx(1.0, rel=1e-6) and len(path.load) == 20
        wanted = biaxial_response(TRUE, path.load, THICKNESS).elongation
        np.testing.assert_allclose(path.strain, wanted, rtol=1e-12)
        np.testing.assert_allclose(path.load[0], 0.05 * path.load[-1])


def test_the_noise_of_a_ratio_is_the_project_s_own_or_given_or_assumed(tmp_path):
    def noise(**options):
        candidate = candidates(planning(tmp_path, **options))[0]
        (one,) = candidate.make().comparisons(lambda *a: None, Weighting())
        return candidate.noise_is, one.objective.least_noise

    # The worse of both ratios, of which four neighbours err as one.
    own, known = noise()
    assert own == "that of biaxial" and known == pytest.approx(0.03 * np.sqrt(4.0 * 19 / 29))
    assert noise(noise=0.05) == ("given", pytest.approx(0.05))
    assert noise(own=False) == ("assumed", pytest.approx(0.01 * np.sqrt(19 / 5)))
