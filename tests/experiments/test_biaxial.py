"""experiments/biaxial/__init__.py: [[biaxial]] of a project, its fits and held-out ratios."""

import json
from pathlib import Path

import bubblefit as bf
import numpy as np
import pandas as pd
import pytest
from bubblefit.experiments.base import UNMATCHED
from bubblefit.experiments.biaxial import BiaxialSection, TablesSection, read
from bubblefit.experiments.biaxial.paths import find_cycles, read_biaxial_table
from bubblefit.experiments.sections import Fabric, Place
from bubblefit.materials.biaxial_patch import biaxial_response
from bubblefit.materials.card import read_card
from bubblefit.materials.designers import shares
from bubblefit.materials.forms.polynomial import LoadRatio
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.runs import setup
from bubblefit.runs.check import check
from bubblefit.runs.compare import candidates as candidate_laws
from bubblefit.runs.result import Fit
from bubblefit.runs.simulation import simulate_cards
from bubblefit.solvers.registry import solver_named

from ..builders.biaxial_tests import (
    BENT_LAW,
    FIVE_RATIOS,
    HEAD,
    THICKNESS,
    biaxial_project,
    biaxial_rows,
    write_biaxial_rows,
)
from ..support.commands import in_process
from ..support.refusals import complaint_with


def test_file_listed_for_a_ratio_must_have_that_ratio(tmp_path):
    path = write_biaxial_rows(tmp_path / "x.csv", biaxial_rows(BENT_LAW, ["1:2"], cycles=2))
    table = read_biaxial_table(path)
    cycles = find_cycles(table.load, ["2:1"] * len(table.load))
    assert [c.ratio for c in cycles] == ["2:1", "2:1"]
    flat = write_biaxial_rows(
        tmp_path / "flat.csv", [("1:1", 2.0, 2.0, 0.1 * k, 0.2) for k in range(5)], HEAD
    )
    place = Place(tmp_path / "project.toml", "biaxial[0]", Fabric("fabric", 0.8))
    section = BiaxialSection(data=TablesSection(files=[flat.name]))
    complaint_with(["flat.csv", "no loading"], read, section, place, "flat")


def sixth_ratio(law):
    loads = np.outer(np.linspace(2, 30, 20), shares("1:5"))
    return biaxial_response(law, loads, THICKNESS).elongation


def test_biaxial_fit_finds_the_law_behind_the_strains(fitted_five_ratios):
    strain = np.linspace(0.0, 0.04, 21)
    for name in ("E1", "E2"):
        found, wanted = (law.modulus(name, strain) for law in (fitted_five_ratios.law, BENT_LAW))
        np.testing.assert_allclose(found, wanted, rtol=1e-4)
    assert fitted_five_ratios.objective < 1e-6
    found, wanted = sixth_ratio(fitted_five_ratios.law), sixth_ratio(BENT_LAW)
    assert np.abs(found - wanted).max() < 1e-4 * np.abs(wanted).max()
    # Nothing is known of the shear, and it is said.
    assert not fitted_five_ratios.best.certainty.moduli["G12"].determined.any()
    assert UNMATCHED in [note.kind for note in fitted_five_ratios.notes]
    assert fitted_five_ratios.best.reached[2] < 1e-3 and fitted_five_ratios.best.reached[0] > 0.02


def test_results_of_a_biaxial_fit_are_strains_in_percent(fitted_five_ratios, five_ratios_folder):
    out = five_ratios_folder / "out"
    ratios = json.loads((out / "result.json").read_text())["ratios"]
    assert list(ratios) == list(FIVE_RATIOS)
    one = ratios["2:1"]
    assert one["end_load_warp_kN_per_m"] == 30.0 and one["end_load_fill_kN_per_m"] == 15.0
    assert (one["cycle"], one["cycles"], one["matched"]) == (2, 2, 29)
    assert one["rms_warp_percent"] < 1e-6
    table = pd.read_csv(out / "paths.csv")
    part = table[table.ratio == "1:2"]
    loads = np.outer(np.linspace(2, 30, 30), [0.5, 1.0])
    strain = 100 * biaxial_response(BENT_LAW, loads, THICKNESS).elongation
    np.testing.assert_allclose(part.warp_strain_percent, strain[:, 0] - strain[0, 0], atol=1e-9)
    np.testing.assert_allclose(part.fill_model_percent, strain[:, 1] - strain[0, 1], atol=1e-5)
    np.testing.assert_allclose(part.warp_load_kN_per_m, loads[:, 0])
    residuals = fitted_five_ratios.residuals()
    assert len(residuals) == 5 * 2 * 29 and set(residuals.unit) == {"%"}
    assert set(residuals.quantity) == {"warp_strain", "fill_strain"}
    off = residuals.modelled - residuals.measured
    np.testing.assert_allclose(residuals.difference, off, atol=1e-12)
    assert (out / "paths.png").is_file()


def test_section_selects_ratios_loads_cycle_and_number_of_points(tmp_path):
    write_biaxial_rows(tmp_path / "test.csv", biaxial_rows(BENT_LAW, cycles=3, kept=0.01))

    def read(lines, file):
        path = biaxial_project(tmp_path, lines)
        path.write_text(path.read_text().replace('["test.csv"]', file))
        (test,) = bf.read_project(path).tests.values()
        return test

    lines = 'ratios = ["1:2", "2/1"]\nrange = [5, 20]\ncycle = 2\npoints = 8\nname = "cross"'
    test = read(lines, '["test.csv"]')
    assert [p.ratio for p in test.paths] == ["2:1", "1:2"] and test.name == "cross"
    for path in test.paths:
        assert path.cycle.number == 2 and len(path.load) == 8
        assert 5 <= path.load.max(axis=1).min() < 6 and 19 < path.load.max() <= 20
    ends = np.max([path.strain.max(axis=0) for path in test.paths], axis=0)
    assert test.reach.strain == (*np.log1p(ends), None) and 0.01 < ends[0] < 0.03
    # Files may be listed by ratio.
    for ratio in ("1:1", "2:1"):
        rows = [row[1:] for row in biaxial_rows(BENT_LAW, [ratio])]
        write_biaxial_rows(tmp_path / f"{ratio[0]}.csv", rows, HEAD.removeprefix("ratio,"))
    test = read("", '{ "1:1" = ["1.csv"], "2/1" = ["2.csv"] }')
    assert [p.ratio for p in test.paths] == ["1:1", "2:1"]
    for lines, file, words in (
        ("range = [20, 5]", '["test.csv"]', ["project.toml", "biaxial[0].range", "[20, 5]"]),
        ('ratios = ["1:1", "2-1"]', '["test.csv"]', ["biaxial[0].ratios[1]", "'2-1'"]),
        ("cycle = 4", '["test.csv"]', ["number 4"]), ("cycle = 0", "[]", ["biaxial[0].cycle"]),
        ("", '["none.csv"]', ["biaxial[0].data.files[0]", "--data"]),
        ("", '{ warp = ["1.csv"] }', ["biaxial[0].data.files.warp", "2:1"]),
    ):  # fmt: skip
        complaint_with(words, read, lines, file)


def test_check_lists_the_cycles(five_ratios_folder, tmp_path):
    found = check(bf.read_project(five_ratios_folder / "project.toml"))
    assert found.sound
    found.report(tmp_path)
    page = (tmp_path / "report.html").read_text()
    assert "Cycles as read" in page and (tmp_path / "biaxial.png").is_file()
    assert page.count("<td>yes</td>") == 5 or page.count(">yes<") == 5


def test_simulation_judges_cards_by_ratio(five_ratios_folder, fitted_five_ratios, tmp_path):
    card = read_card(five_ratios_folder / "out" / "material.toml")
    project = bf.read_project(five_ratios_folder / "project.toml")
    found = simulate_cards(project, list(project.tests.values()), {"own": card}, tmp_path)
    ratios = found.numbers["cards"]["own"]["ratios"]
    assert set(ratios) == set(FIVE_RATIOS)
    assert all(told["rms_warp_percent"] < 1e-5 for told in ratios.values())
    assert ratios["1:0"]["shown_to_kN_per_m"] == 30.0
    assert (tmp_path / "paths.png").is_file() and len(pd.read_csv(tmp_path / "paths.csv")) == 150


TRUE = HypoelasticLaw.linear(900.0, 600.0, 30.0, 0.24)
#: What one ratio, unlike the others, was computed with.
ELSE = HypoelasticLaw.linear(1100.0, 600.0, 30.0, 0.24)


def test_held_out_ratio_is_predicted_by_the_others(tmp_path, monkeypatch):
    """Each of two was made of a fabric of its own, of which the other knows nothing."""
    monkeypatch.setattr(Fit, "report", lambda self, five_ratios_folder: Path(five_ratios_folder))
    write_biaxial_rows(
        tmp_path / "test.csv", [*biaxial_rows(TRUE, ["1:1"]), *biaxial_rows(ELSE, ["2:1"])]
    )
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


KNOWN = HypoelasticLaw([30.0, 800.0, 400.0, 1000.0, -300.0], 0.24, form=LoadRatio())


@pytest.fixture(scope="module")
def fitted_folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("ratio")
    write_biaxial_rows(place / "test.csv", biaxial_rows(KNOWN))
    path = biaxial_project(place, form="load-ratio")
    # Its moduli depend on no strain: it needs no range, as the constant form needs none.
    path.write_text(path.read_text().replace("strain_range = [0.07, 0.07, 0.1]\n", ""))
    return place


def test_five_ratios_determine_a_load_ratio_law(fitted_folder, tmp_path):
    """The moduli at equal loads alone would leave two directions of five out."""
    found = bf.fit(bf.read_project(fitted_folder / "project.toml"), starts=1)
    assert found.objective < 1e-7
    np.testing.assert_allclose(sixth_ratio(found.law), sixth_ratio(KNOWN), atol=1e-8)
    found.card.write(tmp_path / "material.toml")
    card = read_card(tmp_path / "material.toml")
    assert len(card.certainty.directions) == 5
    sigma = np.sqrt(np.diag(card.certainty.covariance))
    np.testing.assert_allclose(card.law.beta[1:], KNOWN.beta[1:], rtol=1e-7)
    # With 0.01 % of noise, that of the first row of each ratio in all others of it.
    assert (sigma[1:] > 0.05).all() and (sigma[1:] < 20.0).all()
    assert sigma[0] > 50.0  # nothing shears the fabric
    assert min(card.law.modulus(name, 0.0, end) for name in ("E1", "E2") for end in (0.0, 1.0)) > 0


def test_forms_of_load_ratio_are_compared_and_need_the_membrane(
    fitted_folder, tmp_path, monkeypatch
):
    path, other = fitted_folder / "project.toml", tmp_path / "project.toml"
    text = path.read_text().replace("test.csv", str(fitted_folder / "test.csv"))

    def solved_by(solver):
        other.write_text(text.replace("starts = 1", f'starts = 1\nsolver = "{solver}"'))
        return bf.read_project(other)

    assert "load-ratio" in candidate_laws(bf.read_project(path))
    project = solved_by("marc")
    assert "cubic" in candidate_laws(project) and "load-ratio" not in candidate_laws(project)
    # Where it is asked for, it is refused before anything runs.
    assert "load-ratio" in candidate_laws(project, ["load-ratio"])
    said = ["project.toml", "law.form", "membrane", "marc"]
    monkeypatch.setattr(setup, "usable_solver", lambda name, *options: solver_named(name))
    complaint_with(said, bf.fit, project, starts=1)
