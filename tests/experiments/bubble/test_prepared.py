"""experiments/bubble/prepared.py: data and comparisons of a bubble in a fit."""

from dataclasses import replace

import bubblefit as bf
import numpy as np
import pandas as pd
import pytest
from bubblefit.experiments.base import Weighting
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.materials.memory import NAMES, Memory
from bubblefit.meshes.bubble_model import BubbleModel, default_increments
from bubblefit.meshes.disk import disk_mesh
from bubblefit.runs.setup import prepare_fit
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...builders.projects import fit_setup, known_bubble
from ...support.refusals import complaint_with


@pytest.mark.parametrize("factor", [2.0, 1.6])
def test_finer_comparison_divides_quads_and_increments(tmp_path, factor):
    setup = fit_setup(known_bubble(tmp_path))
    (prepared,) = setup.tests
    (own,) = prepared.comparisons(setup.make_solver, Weighting())
    found = prepared.refined(own, factor)
    assert found.name == own.name and found.objective is not own.objective
    quads = len(found.model.mesh.quads) / len(own.model.mesh.quads)
    assert quads == (4.0 if factor == 2.0 else pytest.approx(factor**2, rel=0.35))
    assert len(found.model.increments) == 2 * len(own.model.increments)
    assert found.model.increments[1::2] == pytest.approx(own.model.increments)
    assert found.model.pressures == own.model.pressures
    # The objective of the fit is as it was.
    assert own.objective.targets[0].sample is None
    assert found.objective.targets[0].sample.shape[1] == len(found.model.mesh.points)
    # Data of this very model are asked of no other.
    assert prepared.source == "known"
    (same,) = prepared.finer(setup.make_solver, Weighting(), factor)
    assert len(same.model.mesh.quads) == len(own.model.mesh.quads)


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
def inflation_history():
    levels = [1e-3 * p for p in KILO]
    steps = default_increments(levels)
    model = BubbleModel(disk_mesh(100.0, 48, "full"), 0.8, levels, steps, unloaded=True)
    return MembraneSolver(1e-11).run(model, LAW), model


@pytest.fixture(scope="module")
def inflations_folder(tmp_path_factory, inflation_history):
    home, (found, model) = tmp_path_factory.mktemp("twice"), inflation_history
    for k, (p, u) in enumerate(zip(KILO, found.displacement, strict=True), 1):
        table, path = np.hstack([model.mesh.points[:, :2], u]), home / f"step_{k}_{p:g}kPa.csv"
        np.savetxt(path, table, "%.14g", ",", header="x,y,dx,dy,dz", comments="")
    return home


def inflations_project(folder, bubble="", pressure=NAMED, memory=FITTED):
    path = folder / "project.toml"
    path.write_text(PROJECT.format(bubble=bubble, pressure=pressure, memory=memory))
    return bf.read_project(path)


def in_kilopascals(read):
    return (1e3 * np.array(read.tests["bubble"].pressures)).tolist()


def test_first_inflation_is_taken_by_default(inflations_folder):
    read = inflations_project(inflations_folder)
    assert (
        in_kilopascals(read) == pytest.approx(KILO[:4])
        and read.tests["bubble"].state == "first loading"
    )
    second = inflations_project(inflations_folder, "inflation = 2")
    assert in_kilopascals(second) == pytest.approx(KILO[7:])
    assert second.tests["bubble"].state == "conditioned"
    assert in_kilopascals(
        inflations_project(inflations_folder, 'inflation = "all"')
    ) == pytest.approx(KILO)
    listed = f"pressures = {KILO}"
    assert in_kilopascals(inflations_project(inflations_folder, listed, "")) == pytest.approx(
        KILO[:4]
    )
    assert in_kilopascals(
        inflations_project(inflations_folder, f'{listed}\ninflation = "all"', "")
    ) == pytest.approx(KILO)
    for bubble, pressure, words in (
        ("inflation = 3", NAMED, ["bubble[0].inflation", "3"]),
        ("inflation = 2\npressures = [20.0]", NAMED, ["bubble[0].pressures[0]"]),
        ('inflation = "all"\npressures = [20.0, 60.0]', NAMED, ["bubble[0].pressures"]),
        ('inflation = "all"\nincrements = [5.0]', NAMED, ["bubble[0].increments"]),
        ('inflation = "all"\nsheet.rim = "measured"', NAMED, ["bubble[0].sheet.rim"]),
        (f"pressures = {KILO[:-1]}", "", ["bubble[0].pressures", "11", "10"]),
    ):
        complaint_with(words, inflations_project, inflations_folder, bubble, pressure)
    read = inflations_project(inflations_folder, 'inflation = "all"', memory="")
    complaint_with(["bubble[0].inflation"], prepare_fit, read, list(read.tests.values()))


@pytest.mark.parametrize("has_rest", [False, True])
def test_one_file_of_all_frames_of_inflations_is_read_as_a_file_each(
    inflations_folder, tmp_path, has_rest
):
    rows = []
    for k, p in enumerate(KILO, 1):
        table = np.loadtxt(inflations_folder / f"step_{k}_{p:g}kPa.csv", delimiter=",", skiprows=1)
        rows.append(np.column_stack([np.full(len(table), k), table]))
    if has_rest:
        rows.insert(0, rows[0] * [0, 1, 1, 0, 0, 0])
    header = "frame,x,y,dx,dy,dz"
    np.savetxt(tmp_path / "step.csv", np.vstack(rows), "%.14g", ",", header=header, comments="")
    listed = f"pressures = {KILO}\ninflation = 2"
    (expected,) = inflations_project(inflations_folder, listed, "").tests.values()
    project = inflations_project(tmp_path, listed, "")
    (test,) = project.tests.values()
    assert test.pressures == expected.pressures
    fields, expected_fields = (t.data.read_fields(t.pressures) for t in (test, expected))
    for field, expected_field in zip(fields, expected_fields, strict=True):
        np.testing.assert_array_equal(field.points, expected_field.points)
        np.testing.assert_array_equal(field.displacement, expected_field.displacement)
    assert any("inflation 2 of 2" in line for line in bf.check(project, out=tmp_path).lines())
    taken = test.data.recorded
    assert (taken.names[0], taken.count) == ("step.csv, frame 8", len(KILO))
    words = ["bubble[0].data.points.files", "each of 10 pressures, found"]
    listed = f"pressures = {[*KILO[:8], *KILO[9:]]}\ninflation = 2"
    complaint_with(words, inflations_project, tmp_path, listed, "")


def test_check_shows_conditioning_of_the_sheet(inflations_folder, inflation_history, tmp_path):
    found = bf.check(inflations_project(inflations_folder), out=tmp_path)
    lines = [line for line in found.lines() if "inflation 2 at" in line]
    table = pd.read_csv(tmp_path / "inflations.csv")
    assert len(lines) == len(table) == 3 and (table["inflation"] == 2).all()
    assert table["pressure_kPa"].tolist() == pytest.approx(KILO[1:4])
    heights = [
        np.quantile(np.linalg.norm(u, axis=1), 0.98) for u in inflation_history[0].displacement
    ]
    assert table["first_mm"].tolist() == pytest.approx(heights[1:4], rel=1e-6)
    assert table["apex_mm"].tolist() == pytest.approx(heights[7:10], rel=1e-6)
    assert table["release_mm"][2] != table["release_mm"][2]  # no release frame so high
    higher = np.array(heights[7:10]) - heights[1:4]
    assert table["higher_mm"].tolist() == pytest.approx(higher, abs=1e-5)
    assert higher[0] > 1.0 and abs(higher[2]) < 0.01
    assert f"{table['apex_mm'][0]:.4g} mm" in lines[0]
    assert (tmp_path / "inflations.png").is_file()
    assert any("inflation 1 of 2" in line for line in found.lines())


def test_law_with_memory_is_recovered_from_all_frames(inflations_folder):
    read = inflations_project(inflations_folder, 'inflation = "all"')
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
    assert (
        replace(model, pressures=test.pressures).up_to_frame(5).increments[-1] == test.pressures[5]
    )


@pytest.mark.parametrize(("count", "surface_count"), [(24, 0), (25, 2)])
def test_points_too_few_for_a_surface_are_matched_without(count, surface_count):
    """A polynomial of degree 4 in both directions takes 25 points."""
    random = np.random.default_rng(1)
    points = np.column_stack([random.uniform(-60.0, 60.0, (count, 2)), np.zeros(count)])
    rise = np.zeros((count, 3))
    rise[:, 2] = 20.0 - 2e-3 * (points[:, :2] ** 2).sum(axis=1)
    bubble = bf.Bubble(points, [rise, 1.2 * rise], [0.05, 0.1], radius=100.0, elements=48)
    law = bf.Law("constant", strain_range=[0.1, 0.1, 0.1])
    project = bf.Project.of(bubble, law, fabric=bf.Fabric("made", 0.8))
    (prepared,) = fit_setup(project).tests
    assert prepared.test.match_degree == 4 and len(prepared.surfaces) == surface_count
    assert prepared.source == "measured"
