"""`bubblefit fit`: a bubble and strips of one fabric, fitted together."""

import shutil
from dataclasses import replace
from itertools import permutations

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.errors import SOLVER, Note, foremost
from bubblefit.experiments.bubble.findings import FLAT_SHEET, SURFACES
from bubblefit.experiments.kinds import DOUBTFUL, UNSTABLE
from bubblefit.inference.assessment import BOUND, UNCERTAIN
from bubblefit.inference.noise import ABOVE_NOISE, DISCREPANCY
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.runs.best import MESH, UNKNOWN
from bubblefit.runs.result import ALONE, STARTS, answers

from ..commands import in_process as quick
from ..commands import one_line, result_in
from ..projects import changed, constant_strips
from ..published_laws import TABLE_4_2
from .test_uniaxial_command import LENGTHS, write_points

TOGETHER = f"""
[fabric]
name = "One law, a bubble and strips"
thickness = 0.81
[units]
modulus = "GPa"
pressure = "kPa"
[law]
form = "cubic"
strain_range = [0.153, 0.232, 0.883]
[law.bounds]
E1 = [0.02, 3.0]
E2 = [0.02, 2.0]
G12 = [0.001, 0.6]
[fit]
mesh_error = "told"
[[bubble]]
radius = 100.0
pressures = [59, 132, 251]
increments = [6, 22, 40, 59, 97, 132, 186, 251]
elements = 384
symmetry = "quarter"
match = {{ by = "points" }}
[bubble.data.known_solution]
beta = {TABLE_4_2}
[[strips]]
increments = 10
match = "points"
[strips.data]
files = ["points.csv"]
""" + "".join(
    f"[strips.{d}]\ngauge_length = {a}\nfinal_length = {b}\n" for d, (a, b) in LENGTHS.items()
)


def project_in(folder, *changes):
    path = folder / "together.toml"
    path.write_text(changed(TOGETHER, *changes))
    return path


@pytest.fixture(scope="module")
def together(tmp_path_factory):
    folder = tmp_path_factory.mktemp("together")
    law = HypoelasticLaw(1e3 * np.array(TABLE_4_2), 0.24, [0.153, 0.232, 0.883])
    write_points(folder / "points.csv", law)
    options = ("--out", "out", "--starts", 1, "--jobs", 1)
    done = quick("fit", project_in(folder), *options, cwd=folder)
    return folder, done.stdout


def test_the_law_of_both_is_found(together, golden):
    folder, text = together
    golden("fit", text, folder)
    result = result_in(folder / "out")
    assert result["command"] == "fit" and list(result["tests"]) == ["bubble", "strips"]
    assert result["objective"] < 1e-6 and result["tests"]["strips"]["e_uniaxial_N"] < 1e-2
    error = result["tests"]["bubble"]["moduli_error"]
    # Over the strains of the corners of the grips, which no load curve shows much of.
    assert error["E1"] < 1e-3 and error["E2"] < 1e-3 and error["G12"] < 1e-3, error
    # All together as they are weighted in the fit: one uncertainty, said once. (That the best
    # estimate from all is never worse than from some: tests/experiments/strips/test_known_laws.py.)
    for name in ("E1", "E2", "G12"):
        both, bubble = (result["pinned"][s][name]["median"] for s in ("all together", "bubble"))
        assert both <= bubble
        assert both == result["uncertainty"]["median_relative_sigma"][name]


OTHERS = [
    ("[[bubble]]\n", "[[bubble]]\nweight = 2.0\n"),
    ("gauge_length = 20.022", "gauge_length = 20.5"),
    ("pressures = [59, 132, 251]", "pressures = [59, 186, 251]"),
]


def test_another_fit_ends_in_one_line(together, tmp_path):
    folder, _ = together
    run = ("fit", tmp_path / "together.toml", "--out", "out", "--starts", 1)
    shutil.copy(folder / "points.csv", tmp_path)
    shutil.copytree(folder / "out", tmp_path / "out")
    for change in OTHERS:
        project_in(tmp_path, change)
        one_line(quick(*run, "--resume", cwd=tmp_path, code=2), "--overwrite")
    # --data NAME=DIR names another folder of load curves; a computed bubble has no files.
    project_in(tmp_path)
    (tmp_path / "other").mkdir()
    (tmp_path / "points.csv").rename(tmp_path / "other" / "points.csv")
    one_line(quick(*run, "--resume", cwd=tmp_path, code=2), "points.csv")
    other = ("--data", "strips=other")
    quick(*run, "--resume", *other, cwd=tmp_path)
    other = (*other, "--data", "bubble=other")
    one_line(quick(*run, "--resume", *other, cwd=tmp_path, code=2), "bubble[0].data")


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    project = bf.read_project(constant_strips(tmp_path_factory.mktemp("words")))
    return bf.fit(project, tests=["two"], starts=1, jobs=1)


def test_moduli_are_told_up_to_where_they_are_fitted_with_sigma_and_band_of_the_table(fitted):
    sure = fitted.best.certainty
    sure = replace(sure, mesh={name: 0.3 + 0.0 * own for name, own in sure.sigma.items()})
    fitted = replace(fitted, best=replace(fitted.best, certainty=sure))
    told, table = answers(fitted), fitted.moduli()
    for name, component in (("E1", 0), ("E2", 1), ("G12", 2)):
        own = [one for one in told if one.modulus == name]
        end = fitted.best.valid[component]
        assert [one.end for one in own] == [False] * (len(own) - 1) + [True]
        shown = [s for s in (0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3) if s < 0.95 * end]
        assert [one.strain for one in own] == [*shown, end]
        rows = table[table["modulus"] == name]
        for one in own:
            assert one.value == fitted.law.modulus(name, one.strain)
            assert one.per_width == pytest.approx(one.value * fitted.thickness)
            assert one.band[0] <= one.value <= one.band[1] and one.sigma > 0.3
            for value, column in zip(
                (one.sigma, *one.band), ("sigma_relative", "lower_MPa", "upper_MPa"), strict=True
            ):
                expected = np.interp(one.strain, rows["strain"], rows[column])
                assert value == pytest.approx(expected, rel=1e-2)


def test_what_makes_moduli_wrong_is_said_before_what_makes_them_unsure():
    wrong = [MESH, DISCREPANCY, UNSTABLE, ABOVE_NOISE, DOUBTFUL, FLAT_SHEET, SURFACES]
    unsure = [BOUND, UNCERTAIN, UNKNOWN]
    weights = [kind.weight for kind in (*wrong, *unsure, STARTS)]
    assert weights == sorted(weights, reverse=True)
    notes = [Note(STARTS, "one"), Note(UNKNOWN, "two"), Note(DISCREPANCY, "three")]
    for order in permutations(notes):
        assert foremost(order) == "three"
    assert foremost([Note(SOLVER, "none of these"), Note(ALONE, "it")]) == "it"
    assert foremost([Note(MESH, "first"), Note(MESH, "second")]) == "first"
    assert foremost([]) is None
