"""`bubblefit fit`: a bubble and strips of one fabric, fitted together."""

import re
import shutil

import numpy as np
import pandas as pd
import pytest
from bubblefit.materials.law import HypoelasticLaw

from ..commands import in_process as quick
from ..commands import one_line, result_in
from ..projects import changed
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
    """Bubble and strips of one law, fitted together from one start."""
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
    # estimate from all is never worse than from some: tests/experiments/strips/test_certainty.py.)
    for name in ("E1", "E2", "G12"):
        both, bubble = (result["pinned"][s][name]["median"] for s in ("all together", "bubble"))
        assert both <= bubble
        assert both == result["uncertainty"]["median_relative_sigma"][name]


def test_the_files_agree(together):
    out = together[0] / "out"
    result = result_in(out)
    weights, parts = result["weights"], result["mean_relative_error"]
    total = sum(weights[k] * parts[k] for k in ("bubble", "strips"))
    assert result["objective"] == pytest.approx(total, rel=1e-3, abs=1e-9)
    history = pd.read_csv(out / "history.csv")
    assert len(history) == result["analyses"]
    alone = history["status"].str.contains(" alone: ")
    assert 0 < alone.sum() < len(history)
    assert history["objective"][alone].isna().all()
    # Beneath the fit's tolerance warm and cold analyses differ by rounding.
    assert history["objective"].min() == pytest.approx(result["objective"], rel=1e-3, abs=1e-9)
    page = (out / "report.html").read_text()
    figures = re.findall(r'title="([^"]+\.png)"', page)
    drawn = {p.name for p in out.glob("*.png")}
    own = {"strips-loads.png", "bubble-profiles.png", "bubble-heights.png", "strips-bias.png"}
    assert {"pinned.png", *own} <= drawn and {"strips-bias.png"} <= set(figures) <= drawn
    charts = {"moduli", "bubble cuts", "bubble residual", "strips loads", "pinned", "optima"}
    assert charts <= set(re.findall(r'"name":"([^"]+)"', page))
    assert (out / "strips-bias.vtu").exists() and (out / "bubble-bubble.pvd").exists()
    loads = pd.read_csv(out / "strips-loads.csv")
    assert set(loads["direction"]) == set(LENGTHS)
    residuals = pd.read_csv(out / "residuals.csv")
    assert set(residuals["test"]) == {"bubble", "strips"}


BAD = [
    (("[[strips]]\n", "[[strips]]\nthickness = 0.9\n"), "strips[0].thickness"),
    (("[[bubble]]\n", "[[bubble]]\nweight = 0\n"), "bubble[0].weight"),
    (('files = ["points.csv"]', 'files = ["none.csv"]'), "none.csv"),
    (("[fabric]", '[project]\nkind = "joint"\n[fabric]'), "From version 0.1"),
    (("pressures = [59, 132, 251]", "pressures = []"), "bubble[0].pressures"),
    (("[[strips]]\n", '[[strips]]\nname = "bubble"\n'), "strips[0].name"),
]
OTHERS = [
    ("[[bubble]]\n", "[[bubble]]\nweight = 2.0\n"),
    ("gauge_length = 20.022", "gauge_length = 20.5"),
    ("pressures = [59, 132, 251]", "pressures = [59, 186, 251]"),
]


def test_bad_projects_and_another_fit_end_in_one_line(together, tmp_path):
    folder, _ = together
    shutil.copy(folder / "points.csv", tmp_path)
    run = ("fit", tmp_path / "together.toml", "--out", "out", "--starts", 1)
    for change, words in BAD:
        project_in(tmp_path, change)
        one_line(quick(*run, cwd=tmp_path, code=2), words)
        assert not (tmp_path / "out").exists()
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


def test_only_some_of_the_tests(together, tmp_path):
    """By name, or by kind: strips alone from the same file."""
    shutil.copy(together[0] / "points.csv", tmp_path)
    project_in(tmp_path, ("[[bubble]]", "[fit]\nmax_analyses = 5\n[[bubble]]"))
    run = ("together.toml", "--starts", 1, "--jobs", 1, "--quiet", "--out")
    quick("fit", *run, "one", "--test", "strips", cwd=tmp_path)
    quick("uniaxial", *run, "kind", cwd=tmp_path)
    one, kind = result_in(tmp_path / "one"), result_in(tmp_path / "kind")
    assert one["beta"] == kind["beta"] and list(one["tests"]) == ["strips"]
    assert one["e_uniaxial_N"] == kind["e_uniaxial_N"]
    bad = quick("fit", *run, "two", "--test", "none", cwd=tmp_path, code=2)
    one_line(bad, "'none'", "bubble, strips")
