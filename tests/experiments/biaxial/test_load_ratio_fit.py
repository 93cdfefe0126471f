"""Fits of a law that goes with the load ratio: its unknowns come back, and what is said of them."""

from __future__ import annotations

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.materials.card import read_card
from bubblefit.materials.designers import shares
from bubblefit.materials.forms.ratio import LoadRatio
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.materials.responses import biaxial_response
from bubblefit.runs.compare import candidates

from ...biaxial_files import THICKNESS, biaxial_project, rows_of, write_rows
from ...complaints import complaint_with

KNOWN = HypoelasticLaw([30.0, 800.0, 400.0, 1000.0, -300.0], 0.24, form=LoadRatio())


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("ratio")
    write_rows(place / "test.csv", rows_of(KNOWN))
    path = biaxial_project(place, form="load-ratio")
    # Its moduli depend on no strain: it needs no range, as the constant form needs none.
    path.write_text(path.read_text().replace("strain_range = [0.07, 0.07, 0.1]\n", ""))
    return place


@pytest.fixture(scope="module")
def fitted(folder):
    found = bf.fit(bf.read_project(folder / "project.toml"), starts=1)
    found.card.write(folder / "material.toml")
    return found


def test_five_ratios_give_its_unknowns_back(fitted):
    np.testing.assert_allclose(fitted.law.beta[1:], KNOWN.beta[1:], rtol=1e-7)
    assert fitted.objective < 1e-7


def test_a_sixth_ratio_is_foretold(fitted):
    loads = np.outer(np.linspace(2, 30, 20), shares("1:5"))
    wanted, found = (
        biaxial_response(law, loads, THICKNESS).elongation for law in (KNOWN, fitted.law)
    )
    np.testing.assert_allclose(found, wanted, atol=1e-8)


def test_the_card_is_as_sure_of_the_gains_as_of_the_moduli(folder, fitted):
    """The moduli at equal loads alone would leave two directions of five out."""
    card = read_card(folder / "material.toml")
    assert len(card.certainty.directions) == 5
    sigma = np.sqrt(np.diag(card.certainty.covariance))
    np.testing.assert_allclose(card.law.beta[1:], KNOWN.beta[1:], rtol=1e-7)
    assert (sigma[1:] > 0.05).all() and (sigma[1:] < 5.0).all()
    assert sigma[0] > 50.0  # nothing shears the fabric
    least = {name: float(card.law.modulus(name, 0.0, end)) for name, end in
             (("E1", 0.0), ("E1", 1.0), ("E2", 0.0), ("E2", 1.0))}  # fmt: skip
    assert min(least.values()) > 0


def test_which_forms_are_compared_unless_named(folder, tmp_path):
    path = folder / "project.toml"
    assert "load-ratio" in candidates(bf.read_project(path))
    other = tmp_path / "project.toml"
    text = path.read_text().replace("test.csv", str(folder / "test.csv"))
    other.write_text(text.replace("starts = 1", 'starts = 1\nsolver = "marc"'))
    project = bf.read_project(other)
    assert "cubic" in candidates(project) and "load-ratio" not in candidates(project)
    # Where it is asked for, it is refused before anything runs.
    assert "load-ratio" in candidates(project, ["load-ratio"])


def test_another_solver_is_refused_in_one_line(folder, tmp_path, ccx):
    path = tmp_path / "project.toml"
    text = (folder / "project.toml").read_text().replace("test.csv", str(folder / "test.csv"))
    path.write_text(text.replace("starts = 1", 'starts = 1\nsolver = "calculix"'))
    said = ["project.toml", "law.form", "solver membrane", "calculix takes moduli of strain"]
    complaint_with(said, bf.fit, bf.read_project(path), starts=1)
