"""A sheet that is inflated, released and inflated again: its frames, its check and its fit."""

from dataclasses import replace

import bubblefit as bf
import numpy as np
import pandas as pd
import pytest
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.materials.memory import NAMES, Memory
from bubblefit.meshes.bubble_model import BubbleModel, default_increments
from bubblefit.meshes.disk import disk_mesh
from bubblefit.readers.frame_choice import OTHER, RELEASED, choose_frames
from bubblefit.readers.inflations import branches_of, has_several
from bubblefit.runs.setup import prepare_fit
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...support.refusals import complaint_with

#: kPa in the order of time.
KILO = [20.0, 60, 120, 200, 140, 70, 30, 60, 120, 200, 260]
MEMORY = Memory((0.35, 0.45, 0.0), (1.6, 1.7, 1.0), (1.2, 1.1, 1.0))
LAW = HypoelasticLaw(
    [0, 0, 0, 20.0, 0, 0, 0, 150.0, 0, 0, 0, 400.0], 0.24, [1, 1, 1], memory=MEMORY
)
PROJECT = """
[fabric]
name = "made"
thickness = 0.8
[units]
modulus = "MPa"
[law]
form = "constant"
nu12 = 0.24
{memory}
[law.bounds]
E1 = [50, 2000]
E2 = [50, 2000]
G12 = [2, 100]
[[bubble]]
radius = 100.0
elements = 48
objective = "mm"
{bubble}
[bubble.data.points]
files = ["step*.csv"]
{pressure}
[fit]
jobs = 1
starts = 1
mesh_error = "told"
"""
NAMED = "[bubble.data.points.pressure]\nfrom_name = true"
FITTED = '[law.memory]\nwarp = "fitted"\nfill = "fitted"'


@pytest.fixture(scope="module")
def history():
    levels = [1e-3 * p for p in KILO]
    steps = default_increments(levels)
    model = BubbleModel(disk_mesh(100.0, 48, "full"), 0.8, levels, steps, unloaded=True)
    return MembraneSolver(1e-11).run(model, LAW), model


@pytest.fixture(scope="module")
def folder(tmp_path_factory, history):
    home, (found, model) = tmp_path_factory.mktemp("twice"), history
    for k, (p, u) in enumerate(zip(KILO, found.displacement, strict=True), 1):
        table, path = np.hstack([model.mesh.points[:, :2], u]), home / f"step_{k}_{p:g}kPa.csv"
        np.savetxt(path, table, "%.14g", ",", header="x,y,dx,dy,dz", comments="")
    return home


def project(folder, bubble="", pressure=NAMED, memory=FITTED):
    path = folder / "project.toml"
    path.write_text(PROJECT.format(bubble=bubble, pressure=pressure, memory=memory))
    return bf.read_project(path)


def kilo(read):
    return (1e3 * np.array(read.tests["bubble"].pressures)).tolist()


def test_inflations_are_found_in_the_order_of_time():
    seen = np.array([np.nan, 0, 10, 20, 19, 30, 30, 12, 5, 0, 11, 21, 33, np.nan])
    found = [branch.tolist() for branch in branches_of(seen)]
    assert found == [[1, 2, 3, 4, 5], [6, 7, 8, 9], [10, 11, 12]]
    assert has_several(seen) and not has_several(seen[[2, 5, 3, 7, 11, 10]])
    assert choose_frames(seen, inflation=1)[0] == (2, 4, 3, 5)
    assert choose_frames(seen, inflation=1)[1][RELEASED] == 3
    second = choose_frames(seen, inflation=2)
    assert second[0] == (10, 11, 12) and second[1][OTHER] == 7
    # The peak that is held counts once.
    assert choose_frames(seen, inflation="all")[0] == (2, 4, 3, 5, 7, 8, 10, 11, 12)
    assert choose_frames(seen, count=2, inflation="all")[0] == (4, 5, 7, 8, 11, 12)
    assert [branch.tolist() for branch in branches_of(seen[8:5:-1])] == [[0, 1, 2]]


def test_the_first_inflation_is_taken_unless_another_is_named(folder):
    read = project(folder)
    assert kilo(read) == pytest.approx(KILO[:4]) and read.tests["bubble"].state == "first loading"
    second = project(folder, "inflation = 2")
    assert kilo(second) == pytest.approx(KILO[7:])
    assert second.tests["bubble"].state == "conditioned"
    assert kilo(project(folder, 'inflation = "all"')) == pytest.approx(KILO)
    listed = f"pressures = {KILO}"
    assert kilo(project(folder, listed, "")) == pytest.approx(KILO[:4])
    assert kilo(project(folder, f'{listed}\ninflation = "all"', "")) == pytest.approx(KILO)
    for bubble, pressure, words in (
        ("inflation = 3", NAMED, ["bubble[0].inflation", "3"]),
        ("inflation = 2\npressures = [20.0]", NAMED, ["bubble[0].pressures[0]"]),
        ('inflation = "all"\npressures = [20.0, 60.0]', NAMED, ["bubble[0].pressures"]),
        ('inflation = "all"\nincrements = [5.0]', NAMED, ["bubble[0].increments"]),
        ('inflation = "all"\nsheet.rim = "measured"', NAMED, ["bubble[0].sheet.rim"]),
        (f"pressures = {KILO[:-1]}", "", ["bubble[0].pressures", "11", "10"]),
    ):
        complaint_with(words, project, folder, bubble, pressure)
    read = project(folder, 'inflation = "all"', memory="")
    complaint_with(["bubble[0].inflation"], prepare_fit, read, list(read.tests.values()))


def test_check_shows_how_far_the_sheet_is_conditioned(folder, history, tmp_path):
    found = bf.check(project(folder), out=tmp_path)
    lines = [line for line in found.lines() if "inflation 2 at" in line]
    table = pd.read_csv(tmp_path / "inflations.csv")
    assert len(lines) == len(table) == 3 and (table["inflation"] == 2).all()
    assert table["pressure_kPa"].tolist() == pytest.approx(KILO[1:4])
    heights = [np.quantile(np.linalg.norm(u, axis=1), 0.98) for u in history[0].displacement]
    assert table["first_mm"].tolist() == pytest.approx(heights[1:4], rel=1e-6)
    assert table["apex_mm"].tolist() == pytest.approx(heights[7:10], rel=1e-6)
    assert table["release_mm"][2] != table["release_mm"][2]  # no release frame so high
    higher = np.array(heights[7:10]) - heights[1:4]
    assert table["higher_mm"].tolist() == pytest.approx(higher, abs=1e-5)
    assert higher[0] > 1.0 and abs(higher[2]) < 0.01
    assert f"{table['apex_mm'][0]:.4g} mm" in lines[0]
    assert (tmp_path / "inflations.png").is_file()
    assert any("inflation 1 of 2" in line for line in found.lines())


def test_a_law_that_remembers_is_found_back_from_all_frames(folder):
    read = project(folder, 'inflation = "all"')
    found = bf.fit(read)
    assert found.objective < 1e-6
    assert found.law.beta == pytest.approx(LAW.beta, rel=1e-6)
    fitted = dict(zip(NAMES, found.law.memory.constants, strict=True))
    for name, true in zip(NAMES[:8], MEMORY.constants, strict=False):
        assert fitted[name] == pytest.approx(true, abs=1e-6), name
    test = read.tests["bubble"]
    model = test.models(None, "increments", 2)["bubble"]
    assert len(model.increments) == 2 * len(test.increments)
    assert np.array(model.increments)[model.reported] == pytest.approx(test.pressures)
    (one,) = prepare_fit(read, [test]).tests
    assert [len(one.view.fields), len(one.fields)] == [4, 11]
    assert replace(model, pressures=test.pressures).until(5).increments[-1] == test.pressures[5]
