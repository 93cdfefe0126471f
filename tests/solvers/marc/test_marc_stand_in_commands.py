"""Commands with the stand-in for Marc, from end to end."""

import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from bubblefit.materials.card import MaterialCard, write_card
from bubblefit.materials.law import HypoelasticLaw

from ...commands import in_process as bubblefit
from ...commands import result_in
from ...fortran_build import BETA
from ...marc_stand_in_runs import marc

__all__ = ["marc"]

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
BUBBLE = """
[fabric]
thickness = 0.81
[law]
form = "linear"
strain_range = [0.1, 0.1, 0.1]
[law.bounds]
lower = [-0.5, 0.01, -3.0, 0.1, -10.0, 0.1]
upper = [0.5, 0.2, 10.0, 1.0, 10.0, 1.0]
[[bubble]]
radius = 100.0
pressures = [22, 59]
elements = 64
symmetry = "quarter"
[bubble.data.known_solution]
beta = [0, 0, -0.1, 0.08, 0, 0, 5.0, 0.2, 0, 0, -6.0, 0.8]
[fit]
starts = 1
tolerance = 1e-5
"""
SITE = 'executable = "./run_marc"\nincrements = 0\n'


def marc_rows(folder):
    history = pd.read_csv(folder / "history.csv", comment="#")
    return history[history.solver == "marc"]


@pytest.fixture
def site(marc):
    path = marc.folder / "site.toml"
    path.write_text(SITE + f'scratch = "{marc.folder}"\n')
    return path


@pytest.fixture
def finer(marc, site):
    """A site whose Marc takes more increments than the membrane: not the same solver."""
    path = marc.folder / "finer.toml"
    path.write_text(site.read_text().replace("increments = 0", "increments = 9"))
    return path


@pytest.fixture
def card(tmp_path):
    law = HypoelasticLaw(BETA, strain_range=np.full(3, 0.13))
    write_card(MaterialCard(law, 0.81, "test", "Table 4.2"), tmp_path / "card.toml")
    return tmp_path / "card.toml"


@pytest.mark.slow
def test_the_known_solution_is_found_in_four_runs_of_marc(marc, tmp_path):
    text = (EXAMPLES / "bubble-known-solution/project.toml").read_text()
    for old, new in (("elements = 800 ", "elements = 48 "), ("starts = 50", "starts = 1")):
        assert old in text
        text = text.replace(old, new, 1)
    (tmp_path / "project.toml").write_text(text)
    bubblefit("bubble", "project.toml", "--solver", "marc", "--marc", marc.program, "--jobs", 1,
              "--quiet", "--out", "out", cwd=tmp_path)  # fmt: skip
    e = marc_rows(tmp_path / "out").objective.to_numpy()
    # 1.6e-4, 7.5e-6, 5.6e-6, 5.2e-6: measured.
    assert e[0] < 1e-3 and len(e) <= 5
    assert e[1] < 3e-5, "six digits spoil it"
    result = result_in(tmp_path / "out")
    assert result["solver"] == "marc" and result["external_runs"] == len(e)


def test_a_bubble_fit_goes_on_after_runs_that_failed(marc, finer, tmp_path):
    (tmp_path / "project.toml").write_text(BUBBLE)
    fit = ("bubble", "project.toml", "--solver", "marc", "--marc", finer, "--jobs", 1, "--quiet",
           "--out", "out")  # fmt: skip
    # The first makes the data; the third is the second of the fit.
    marc.told("3015@3")
    bubblefit(*fit, cwd=tmp_path)
    rows = marc_rows(tmp_path / "out")
    failed = rows[rows.objective.isna()]
    assert len(failed) == 1 and "time step could not get smaller" in failed.status.iloc[0]
    assert sum("3015" in run for run in marc.runs) == 1
    assert result_in(tmp_path / "out")["objective"] < 1e-5


@pytest.mark.slow
def test_a_fit_whose_last_run_fails_is_resumed(marc, finer, tmp_path):
    (tmp_path / "project.toml").write_text(BUBBLE)
    fit = ("bubble", "project.toml", "--solver", "marc", "--marc", finer, "--jobs", 1, "--quiet",
           "--out", "out")  # fmt: skip
    # Data, two runs of the fit, then the best fit once more, and again.
    marc.told("licence@4,5")
    done = bubblefit(*fit, cwd=tmp_path, code=4)
    assert "does not run again: no licence" in done.stderr and "--resume" in done.stderr
    assert len(marc.runs) == 5
    # Data and the best fit are run again, nothing else; once more where it fails.
    marc.told("3015@7")
    bubblefit(*fit, "--resume", cwd=tmp_path)
    assert marc.runs[5:] == ["job none", "job 3015", "job none"]
    assert result_in(tmp_path / "out")["objective"] < 1e-5


def told_alike(folder, name, command, site, *stiff, atol):
    bubblefit(*command, "--solver", "marc", "--marc", site, "--out", "marc-out", cwd=folder)
    bubblefit(*command, *stiff, "--out", "membrane-out", cwd=folder)
    found, expected = (
        pd.read_csv(next((folder / out).glob(name)), comment="#")
        for out in ("marc-out", "membrane-out")
    )
    assert list(found.columns) == list(expected.columns) and len(found) == len(expected)
    for column in found.select_dtypes("number"):
        if "wrinkle" not in column and expected[column].notna().all():
            np.testing.assert_allclose(found[column], expected[column], 1e-4, atol, err_msg=column)
    return found


def test_simulated_bubble_and_strips_are_the_membranes(site, card, tmp_path):
    (tmp_path / "project.toml").write_text(BUBBLE)
    command = ("simulate", "bubble", "project.toml", "--card", card)
    told_alike(tmp_path, "*.csv", command, site, atol=1e-6)
    assert result_in(tmp_path / "marc-out")["solver"] == "marc"
    strips(tmp_path)
    command = ("simulate", "uniaxial", "project.toml", "--card", card, "--overwrite")
    told_alike(tmp_path, "loads.csv", command, site, atol=1e-4)


def strips(folder):
    shutil.copy(EXAMPLES / "uniaxial-valmex7318/curves.csv", folder)
    text = (EXAMPLES / "uniaxial-valmex7318/project.toml").read_text()
    assert "increments = 100" in text
    (folder / "project.toml").write_text(text.replace("increments = 100", "increments = 10"))


@pytest.mark.slow
def test_uniaxial_fit(marc, site, tmp_path):
    strips(tmp_path)
    command = ("uniaxial", "project.toml", "--starts", 1, "--jobs", 1, "--quiet")
    bubblefit(*command, "--solver", "marc", "--marc", site, "--out", "marc-out", cwd=tmp_path)
    bubblefit(*command, "--out", "membrane-out", cwd=tmp_path)
    found, expected = (result_in(tmp_path / name) for name in ("marc-out", "membrane-out"))
    assert found["solver"] == "marc" and found["external_runs"] >= 1
    assert found["e_uniaxial_N"] == pytest.approx(expected["e_uniaxial_N"], rel=1e-3)


def test_simulated_bending_is_the_membranes(marc, site, card, tmp_path):
    command = ("simulate", "bend", "--diameter", 150, "--pressure", 140, "--card", card,
               "--element-size", 60, "--deflection", 6, "--frames", 3, "--jobs", 1,
               "--quiet")  # fmt: skip
    # The stand-in's wall carries compression, as Marc's elements do.
    stiff = ("--solver-option", "wall=stiff")
    found = told_alike(tmp_path, "load_deflection.csv", command, site, *stiff, atol=2e-3)
    assert len(marc.runs) == 2 and len(found) == 4


@pytest.mark.slow
def test_a_bending_project(marc, site, tmp_path):
    text = (EXAMPLES / "bend-valmex7318/project.toml").read_text()
    head, *cards = text[: text.index("[[cylinder]]")], *text.split("[[card]]")[1:2]
    for old, new in (
        ("element_size = 25.0", "element_size = 60.0"),
        ("deflection = 240.0", "deflection = 4.0"),
        ("places = [40.0, 100.0, 240.0]", "places = [4.0]"),
        ("slope_over = 20.0", "slope_over = 2.0"),
        ("frames = 60", "frames = 2"),
    ):
        assert old in head
        head = head.replace(old, new, 1)
    cases = "".join(f"[[cylinder]]\ndiameter = 150.0\npressure = {p}\n" for p in (110.0, 140.0))
    (tmp_path / "project.toml").write_text(f"{head}{cases}[[card]]{cards[0]}")
    marc.told("licence@1")
    bubblefit("bend", "project.toml", "--solver", "marc", "--marc", site, "--jobs", 1, "--quiet",
              "--out", "out", cwd=tmp_path, code=4)  # fmt: skip
    table = pd.read_csv(tmp_path / "out" / "load_deflection.csv", comment="#")
    # The first case had no licence, the second has its three frames.
    assert len(marc.runs) == 3 and len(table) == 3
    runs = pd.read_csv(tmp_path / "out" / "runs.csv", comment="#")
    assert len(runs) == 2 and "no licence" in (tmp_path / "out" / "runs.csv").read_text()


def test_doctor_proves_the_stand_in(marc, site, tmp_path):
    done = bubblefit("doctor", "--marc", site, "--json", cwd=tmp_path)
    (found,) = [s for s in json.loads(done.stdout)["solvers"] if s["name"] == "marc"]
    assert found["usable"] and found["difference"] < 1e-4 and len(marc.runs) == 4
    marc.told("3015")
    bubblefit("doctor", "--marc", site, cwd=tmp_path, code=4)
