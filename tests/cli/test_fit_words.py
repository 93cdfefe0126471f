"""What a fit says on the terminal: every number with its unit, the warning that matters."""

from dataclasses import replace
from itertools import permutations
from types import SimpleNamespace

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.cli.fits import lines_of, misfit_lines, modulus_lines, warning_lines
from bubblefit.cli.terminal import written_to
from bubblefit.errors import SOLVER, Note, foremost
from bubblefit.experiments.bubble.findings import FLAT_SHEET, SURFACES
from bubblefit.experiments.kinds import DOUBTFUL, UNSTABLE
from bubblefit.inference.assessment import BOUND, UNCERTAIN
from bubblefit.inference.noise import ABOVE_NOISE, DISCREPANCY, Misfit
from bubblefit.runs.best import MESH
from bubblefit.runs.result import ALONE, STARTS, Answer, answers

from ..projects import constant_strips


@pytest.fixture(scope="module")
def fit(tmp_path_factory):
    """Strips of constant moduli, one start."""
    project = bf.read_project(constant_strips(tmp_path_factory.mktemp("words")))
    return bf.fit(project, tests=["two"], starts=1, jobs=1)


def test_moduli_are_told_up_to_where_they_are_fitted_with_sigma_and_band_of_the_table(fit):
    told, table = answers(fit), fit.moduli()
    for name, component in (("E1", 0), ("E2", 1), ("G12", 2)):
        own = [one for one in told if one.modulus == name]
        end = fit.best.valid[component]
        assert [one.end for one in own] == [False] * (len(own) - 1) + [True]
        shown = [s for s in (0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3) if s < 0.95 * end]
        assert [one.strain for one in own] == [*shown, end]
        rows = table[table["modulus"] == name]
        for one in own:
            assert one.value == fit.law.modulus(name, one.strain)
            assert one.per_width == pytest.approx(one.value * fit.thickness)
            assert one.band[0] <= one.value <= one.band[1]
            for value, column in zip(
                (one.sigma, *one.band), ("sigma_relative", "lower_MPa", "upper_MPa"), strict=True
            ):
                expected = np.interp(one.strain, rows["strain"], rows[column])
                assert value == pytest.approx(expected, rel=1e-2)


def test_the_table_of_the_moduli(fit, monkeypatch):
    told = [
        Answer("E1", 0.0, 806.35, 653.14, 0.0441, (753.3, 842.7)),
        Answer("E1", 0.1073, 490.0, 396.9, 10.0, None, True),
        Answer("G12", 0.05, 13.972, 11.317),
    ]
    monkeypatch.setattr("bubblefit.runs.result.answers", lambda _: told)
    title, head, *rows = modulus_lines(fit)
    assert "with what noise and mesh" in title and f"times {fit.thickness:.4g} mm" in title
    assert head.split() == "strain MPa 1 sigma 95 % band, MPa kN/m".split()
    assert [" ".join(row.split()) for row in rows] == [
        "E1, along warp 0 % 806.4 4.4 % 753.3 to 842.7 653.1",
        "10.7 % 490 unknown not known 396.9 (the end)",
        "G12, in shear 5 % 13.97 not known not known 11.32",
    ]
    assert {len(row.removesuffix("  (the end)")) for row in rows} == {len(head)}
    bare = replace(fit, best=replace(fit.best, certainty=replace(fit.best.certainty, mesh=None)))
    assert "with what noise alone" in modulus_lines(bare)[0]


def test_the_misfit_stands_beside_the_noise():
    left = {
        "a": Misfit(0.31, 0.02, "given", "mm"),
        "b": Misfit(1.5, 30.0, "assumed", "N"),
        "c": Misfit(1.0, 0.0, "given", "N"),
    }
    assert misfit_lines(SimpleNamespace(misfits=left)) == [
        "misfit of a: 0.31 mm RMS, 16 times the noise (0.02 mm, given)",
        "misfit of b: 1.5 N RMS, 0.05 times the noise (30 N, assumed)",
        "misfit of c: 1 N RMS, no noise to compare with",
    ]


def test_what_makes_moduli_wrong_is_said_before_what_makes_them_unsure():
    wrong = [DISCREPANCY, UNSTABLE, ABOVE_NOISE, DOUBTFUL, FLAT_SHEET, SURFACES]
    unsure = [BOUND, UNCERTAIN, MESH]
    weights = [kind.weight for kind in (*wrong, *unsure, STARTS)]
    assert weights == sorted(weights, reverse=True)
    notes = [Note(STARTS, "one"), Note(MESH, "two"), Note(DISCREPANCY, "three")]
    for order in permutations(notes):
        assert foremost(order) == "three"
    assert foremost([Note(SOLVER, "none of these"), Note(ALONE, "it")]) == "it"
    assert foremost([Note(MESH, "first"), Note(MESH, "second")]) == "first"
    assert foremost([]) is None


def test_one_warning_and_how_many_more(tmp_path):
    notes = [Note(STARTS, "some failed"), Note(BOUND, "E1 touches", "two"), Note(MESH, "m")]
    warning, more = warning_lines(notes, tmp_path)
    assert warning == "warning: two: E1 touches"
    assert more.startswith("2 further notes: ") and str(tmp_path / "notes.csv") in more
    assert warning_lines(notes[:2], tmp_path)[1].startswith("1 further note: ")
    assert warning_lines(notes[:1], tmp_path) == ["warning: some failed"]
    assert warning_lines([], tmp_path) == []


def test_the_answer_comes_first_and_the_page_last(fit, tmp_path):
    assert written_to(tmp_path) == f"written to {tmp_path}"
    page = fit.report(tmp_path)
    lines = lines_of(fit, tmp_path)
    assert lines[: len(modulus_lines(fit))] == modulus_lines(fit)
    assert lines[-1] == written_to(tmp_path) and str(page) in lines[-1]
    (found,) = [line for line in lines if line.startswith("1 of 1 starts ended with a fit")]
    best, count = f"{fit.objective:.3g}", fit.result["analyses"]
    assert f"{fit.setup.objective_is}: best {best}, median {best}; {count} " in found
