"""The commands `study mesh`, `study nu12` and `compare`: tables, choices, refusals."""

import csv
import json
import re

import numpy as np
import pandas as pd
import pytest
from bubblefit.materials.card import MaterialCard, write_card
from bubblefit.materials.law import HypoelasticLaw

from ..builders.laws import TABLE_4_2
from ..builders.projects import project_file
from ..support.charts import check_convergence, data
from ..support.commands import in_process, one_line, result_in
from ..support.paths import KNOWN

#: Seconds of a level, in the table on the terminal.
SECONDS = re.compile(r"(?m)^( +\d+ +\d+) +\d+\.\d+")


def study(*arguments, cwd, code=0, card="card.toml"):
    name, *options = arguments
    run = ("study", name, "project.toml", "--card", card, *options)
    return in_process(*run, cwd=cwd, code=code).output


@pytest.fixture
def bubble(tmp_path):
    project_file(tmp_path, KNOWN.read_text(), ("elements = 800", "elements = 80"))
    law = HypoelasticLaw(1000 * np.array(TABLE_4_2), strain_range=[0.13] * 3)
    write_card(MaterialCard(law, 0.81, "Table 4.2"), tmp_path / "card.toml")
    return tmp_path


def test_study_of_mesh_of_a_bubble_converges(bubble, drawn, golden):
    run = ("mesh", "--levels", 3, "--coarser", 0, "--out", "out")
    done = study(*run, cwd=bubble)
    model = result_in(bubble / "out")["models"]["bubble"]
    counts = [level["elements"] for level in model["levels"]]
    assert counts[2] == 4 * counts[1]
    assert all(level["seconds"] > 0 and level["iterations"] > 0 for level in model["levels"])
    apex = model["quantities"]["apex at 300 kPa, mm"]
    assert apex["limit"] == pytest.approx(39.7838, abs=0.02)  # of 12800 quads on the quarter
    assert abs(apex["own_error"]) < 5e-3 and apex["own_error_against"] == "limit"
    assert len(model["quantities"]) == 8 and "rms_N" not in model
    table = pd.read_csv(bubble / "out/convergence.csv")
    assert len(table) == 3 * 8
    assert (table[table.elements == counts[-1]].off_finest == 0).all()
    coarse = table[(table.factor == 1) & (table.quantity == "apex at 300 kPa, mm")].iloc[0]
    assert coarse.value - coarse.off_finest == pytest.approx(apex["finest"])
    assert (bubble / "out/convergence.png").stat().st_size > 10_000
    check_convergence(drawn[-1], table, "elements")
    names = {s.name for s in drawn[-1].charts[0].series[:-2]}
    assert names == set(model["quantities"])
    golden("study-mesh", SECONDS.sub(r"\1  N", done), bubble, done)
    assert "--overwrite" in study(*run, cwd=bubble, code=2)


@pytest.mark.parametrize(
    ("run", "words"),
    [
        (("plan", "--strain", "inf,1,1"), "strains between 0 and 2"),
        (("plan", "--strain", "5,5,5"), "not in percent"),
        (("plan", "--noise", "strips=inf"), "expected KIND=VALUE above 0"),
        (("profile", "--modulus", "G12", "--modulus", "G12=0.02"), "once without strains"),
        (("validate", "--form", "linear"), "--form, --card: give one of them"),
    ],
)
def test_option_that_would_be_ignored_or_is_impossible_is_refused(bubble, run, words):
    name, *options = run
    command = (name, "project.toml", "--card", "card.toml", *options, "--out", "out")
    one_line(in_process(*command, cwd=bubble, code=2), words)


def test_study_of_nu12_of_a_bubble_prints_its_table(bubble, golden):
    golden("study-nu12", study("nu12", "--out", "out", cwd=bubble), bubble)


def test_study_without_a_finished_analysis_ends_with_4(bubble):
    # Of a card without a valid range nothing says how far it holds: E1 falls below zero soon.
    card = MaterialCard(HypoelasticLaw(1000 * np.array([*TABLE_4_2[:11], 0.02])), 0.81)
    write_card(card, bubble / "bad.toml")
    for command in ("mesh", "nu12"):
        done = study(command, cwd=bubble, code=4, card="bad.toml")
        assert len(done.splitlines()) == 1 and not (bubble / "out").exists()


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


def test_compare_finds_the_form_behind_the_data(project, tmp_path, drawn, golden):
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
    (laws,) = (c.charts[0] for c in drawn if c.name == "laws")
    assert list(laws.y_names) == ["constant (3)", "linear (6)", "cubic (12)"]
    assert laws.x_label == result["objective_is"]
    for key in ("fitted", "cross_validated"):
        wanted = [form[key] for form in result["forms"]]
        assert any(line[0] == pytest.approx(wanted, rel=1e-5) for line in data(laws)), key
    # A result is not written over; --resume takes every form as it is.
    in_process(*arguments, cwd=tmp_path, code=2)
    before = (out / "linear" / "starts.jsonl").read_text()
    (out / "result.json").unlink()
    golden("compare", in_process(*arguments, "--resume", cwd=tmp_path).stdout, tmp_path)
    assert (out / "linear" / "starts.jsonl").read_text() == before
    assert result_in(out) == result


def test_forms_that_cannot_be_compared_are_refused(project, tmp_path):
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
