"""`bubblefit compare`: forms of the moduli, cross-validated."""

import csv
import json

import numpy as np
import pytest

from ..commands import in_process, one_line, result_in
from ..drawings import data
from ..projects import project_file

PROJECT = """
[fabric]
name = "made"
thickness = 0.8
[law]
strain_range = [0.14, 0.18, 0.1]
[law.bounds]
E1 = [0.02, 2.0]
E2 = [0.02, 1.0]
G12 = [0.005, 0.2]
[[strips]]
increments = 5
match = "points"
warp = { gauge_length = 20, final_length = 23 }
fill = { gauge_length = 20, final_length = 24 }
[strips.data]
files = ["points.csv"]
[fit]
seed = 3
"""


@pytest.fixture
def project(tmp_path):
    """Three specimens a direction of a fabric whose E1 is linear in strain and E2 constant."""
    random = np.random.default_rng(1)
    lines = ["direction,specimen,elongation (mm),load (N)"]
    for direction, end, e, slope in (("warp", 3.0, 300.0, 1500.0), ("fill", 4.0, 200.0, 0.0)):
        for specimen in "abc":
            u = np.linspace(0.2, end - 0.01, 12)
            strain = np.log1p(u / 20)
            # Cauchy stress times the width that nu12 = 0.24 leaves: near enough for a test.
            load = 20 * (e * strain + slope * strain**2 / 2) + random.normal(0, 2, len(u))
            lines += [
                f"{direction},{specimen},{a:.4f},{b:.3f}" for a, b in zip(u, load, strict=True)
            ]
    (tmp_path / "points.csv").write_text("\n".join(lines) + "\n")
    (tmp_path / "project.toml").write_text(PROJECT)
    return tmp_path / "project.toml"


def test_the_form_behind_the_data_is_found(project, tmp_path, drawn, golden):
    out = tmp_path / "out"
    forms = ["--form", "constant", "--form", "linear", "--form", "cubic"]
    arguments = ["compare", project, "--out", out, "--starts", 1, "--quiet", *forms]
    done = in_process(*arguments, "--json", cwd=tmp_path)
    result = result_in(out)
    assert json.loads(done.stdout) == result
    found = {f["form"]: f for f in result["forms"]}
    assert [f["coefficients"] for f in result["forms"]] == [3, 6, 12]
    # Nested forms: each fits at least as well; the noise of 2 N is all that is left.
    fitted = [f["fitted"] for f in result["forms"]]
    assert fitted[0] > fitted[1] > fitted[2] * 0.999
    assert found["constant"]["cross_validated"] > 2 * found["linear"]["cross_validated"]
    assert 3 < found["linear"]["cross_validated"] < 5
    assert result["simplest_as_good"] == "linear"
    assert len(found["linear"]["folds"]) == 3  # as many as specimens
    rows = list(csv.DictReader((out / "comparison.csv").open()))
    assert [r["moduli"] for r in rows] == ["constant", "linear", "cubic"]
    for name in ("laws.png", "loads.png", "report.html", "linear/material.toml"):
        assert (out / name).stat().st_size > 0
    words = "form of the moduli (number of coefficients)"
    (laws,) = (c.charts[0] for c in drawn if c.charts[0].x_label == words)
    assert list(laws.x_names) == ["constant (3)", "linear (6)", "cubic (12)"]
    assert laws.y_label == result["objective_is"]
    for key in ("fitted", "cross_validated"):
        wanted = [form[key] for form in result["forms"]]
        assert any(line[1] == pytest.approx(wanted, rel=1e-5) for line in data(laws)), key
    # A result is not written over; --resume takes every form as it is.
    in_process(*arguments, cwd=tmp_path, code=2)
    before = (out / "linear" / "starts.jsonl").read_text()
    (out / "result.json").unlink()
    again = in_process(*arguments, "--resume", cwd=tmp_path)
    golden("compare", again.stdout, tmp_path)
    assert (out / "linear" / "starts.jsonl").read_text() == before
    assert result_in(out) == result


def test_what_cannot_be_compared_is_refused(project, tmp_path):
    (tmp_path / "p.csv").write_text(
        "direction,gauge_length_mm,final_length_mm,c1\nwarp,20,23,300\nfill,20,24,200\n"
    )
    text = project.read_text()
    for old, new, says in (
        ('files = ["points.csv"]', 'polynomials = "p.csv"', "strips[0].match"),
        ("E1 = [0.02, 2.0]\nE2 = [0.02, 1.0]\nG12 = [0.005, 0.2]",
         "lower = [0.005, 0.02, 0.02]\nupper = [0.2, 1.0, 2.0]", "E1, E2, G12"),
        ('match = "points"', 'match = "polynomial"', 'match = "points"'),
        ('name = "made"', 'name = "made"\nwidth = 3', "fabric.width"),
    ):  # fmt: skip
        project_file(tmp_path, text, (old, new))
        run = ("compare", "project.toml", "--out", "o", "--form", "constant")
        one_line(in_process(*run, cwd=tmp_path, code=2), says)
        assert not (tmp_path / "o").exists()
