"""[[bubble]] of a project: conversion to mm and MPa, the examples, and one-line errors."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bubblefit.experiments.bubble import point_files
from bubblefit.experiments.bubble.point_files import PointFiles
from bubblefit.experiments.bubble.test import BubbleTest, KnownSolution
from bubblefit.experiments.kinds import Fabric, Place
from bubblefit.project.project import Project, read_project

from ...complaints import complaint, complaint_with
from ...places import EXAMPLES, KNOWN, SHARED
from ...projects import edited

VALMEX = EXAMPLES / "bubble-valmex7318"
GRID = SHARED / "bubble"


@pytest.fixture
def edit(tmp_path: Path):
    """Read the known-solution example after replacing one text by another."""
    return partial(edited, tmp_path)


def bubble(project: Project) -> BubbleTest:
    (test,) = project.tests.values()
    assert isinstance(test, BubbleTest)
    return test


def test_known_solution_is_table_4_2_in_mpa():
    p = bubble(read_project(KNOWN))
    assert isinstance(p.data, KnownSolution)
    assert p.pressures == pytest.approx([0.022, 0.059, 0.097, 0.132, 0.186, 0.251, 0.300])
    assert p.increments == pytest.approx(
        [0.006, 0.022, 0.040, 0.059, 0.097, 0.132, 0.186, 0.251, 0.300]
    )
    assert set(p.pressures) <= set(p.increments)
    assert (p.radius, p.thickness, p.elements, p.symmetry) == (100.0, 0.81, 800, "quarter")
    assert p.data.beta[[0, 3, 7, 11]] == pytest.approx([-7.96788, 20.0439, 139.437, 806.35])
    assert (p.data.elements, p.data.symmetry) == (800, "quarter")
    assert p.data.increments == p.increments
    assert (p.match_by, p.objective, p.name, p.weight) == ("points", "e", "bubble", 1.0)


def test_units_of_the_file_do_not_matter(edit):
    reference = bubble(read_project(KNOWN))
    bar = bubble(edit('pressure = "kPa"', 'pressure = "bar"'))
    assert bar.pressures == pytest.approx(np.array(reference.pressures) * 100)
    mpa = bubble(edit('modulus = "GPa"', 'modulus = "MPa"'))
    assert isinstance(mpa.data, KnownSolution) and isinstance(reference.data, KnownSolution)
    assert mpa.data.beta == pytest.approx(reference.data.beta / 1000)
    metre = bubble(edit('length = "mm"', 'length = "m"'))
    assert metre.radius == pytest.approx(reference.radius * 1000)


def test_an_ellipse_in_place_of_the_radius(edit):
    p = bubble(edit("radius = 100.0", "ellipse = { major = 120, minor = 80, angle = 90 }"))
    assert (p.outline.major, p.outline.minor, p.outline.angle) == (120.0, 80.0, 90.0)
    mesh = p.model().mesh
    np.testing.assert_allclose(mesh.points.max(axis=0), (80.0, 120.0, 0.0))
    assert str(p.settings()) != str(bubble(read_project(KNOWN)).settings())


def test_data_from_another_model(edit):
    other = bubble(edit("# elements = 1800\n# increments", "elements = 1800\nincrements"))
    assert isinstance(other.data, KnownSolution) and other.data.elements == 1800
    assert other.data.increments[0] == pytest.approx(0.004)
    assert set(other.pressures) <= set(other.data.increments)
    assert other.data.increments != other.increments


def test_default_increments_and_repeated_ones(edit):
    reference = bubble(read_project(KNOWN)).increments
    assert bubble(edit("increments = [6, 40]", "")).increments == pytest.approx(reference)
    assert len(bubble(edit("increments = [6, 40]", "increments = [40, 22, 6]")).increments) == 9


@pytest.mark.parametrize("name", sorted(p.name for p in VALMEX.glob("*.toml")))
def test_real_examples(name: str, shared_data: Path):
    p = bubble(read_project(VALMEX / name, shared_data / "bubble"))
    assert isinstance(p.data, PointFiles)
    assert len(p.data.files) == len(p.pressures) == 20 and p.symmetry == "full"
    recorded = np.loadtxt(GRID / "grid_pressures.csv", delimiter=",", skiprows=1)
    indices = [int(f.stem[-2:]) for f in p.data.files]
    assert p.pressures == pytest.approx(recorded[indices, 2])
    assert p.data.options.columns == {name: name for name in ("x", "y", "dx", "dy", "dz")}
    assert p.data.options.flag_column == "flag"
    for file, bar in zip(p.data.files, recorded[indices, 1], strict=True):
        assert f"p_bar={bar:.6f}" in file.open().readline()


def test_pressures_in_the_headers_of_real_frames(shared_data: Path, tmp_path: Path):
    """Those that the example writes out, read from "p_bar=" in each of the 20 files."""
    text = (VALMEX / "test1-cubic.toml").read_text()
    pattern, indices = (re.search(rf"(?m)^{key} = .*$", text)[0] for key in ("pattern", "indices"))
    text = text.replace(pattern, 'files = ["grid/test1_*.csv"]').replace(indices, "")
    listed = re.search(r"(?ms)^pressures = \[.*?\].*?$", text)[0]
    said = '[bubble.data.points.pressure]\ncolumn = "p_bar"\n'
    (tmp_path / "project.toml").write_text(text.replace(listed, "") + said)
    found = bubble(read_project(tmp_path / "project.toml", shared_data / "bubble"))
    asked = bubble(read_project(VALMEX / "test1-cubic.toml", shared_data / "bubble"))
    assert [f.name for f in found.data.files] == [f.name for f in asked.data.files]
    assert found.pressures == pytest.approx(asked.pressures, rel=1e-5)


def test_missing_data_says_what_to_do(tmp_path: Path):
    project = VALMEX / "test1-linear.toml"
    for folder in (None, tmp_path / "nowhere", tmp_path):
        assert "--data DIR" in complaint(read_project, project, folder)
    p = bubble(read_project(project, need_data=False))
    assert isinstance(p.data, PointFiles) and p.data.files[0].name == "test1_00.csv"


def test_data_folder_is_relative_to_the_project(tmp_path: Path):
    shutil.copy(VALMEX / "test2-cubic.toml", tmp_path)
    (tmp_path / "data" / "grid").mkdir(parents=True)
    for i in range(20):
        (tmp_path / "data" / "grid" / f"test2_{i:02d}.csv").touch()
    data = bubble(read_project(tmp_path / "test2-cubic.toml")).data
    assert isinstance(data, PointFiles) and all(f.is_file() for f in data.files)


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("radius = 100.0", "", ["bubble[0].radius", "missing"]),
        ("radius =", "raduis =", ["bubble[0].raduis", "did you mean 'radius'"]),
        ("[bubble.match]", "[bubble.matsch]", ["bubble[0].matsch", "did you mean 'match'"]),
        ("displacement_offset", "offset", ["bubble[0].nuisance.offset", "displacement_offset"]),
        ("radius = 100.0", 'radius = "100 mm"', ["bubble[0].radius", "number", "'100 mm'"]),
        ("radius = 100.0", "radius = -1.0", ["bubble[0].radius", "greater than 0"]),
        ("radius = 100.0", "radius = 0.5", ["bubble[0].radius", "thickness 0.81 mm"]),
        (
            "radius = 100.0",
            "radius = 100.0\nellipse = { major = 9, minor = 8 }",
            ["bubble[0].radius", "not both"],
        ),
        (
            "radius = 100.0",
            "ellipse = { major = 80, minor = 120 }",
            ["bubble[0].ellipse.minor", "at most the major 80 mm, got 120 mm", "'angle'"],
        ),
        (
            "radius = 100.0",
            "ellipse = { major = 120, minor = 20 }",
            ["bubble[0].ellipse.minor", "4th part", "got 20 mm"],
        ),
        (
            "radius = 100.0",
            "ellipse = { major = 1.2, minor = 0.7 }",
            ["bubble[0].ellipse.minor", "thickness 0.81 mm"],
        ),
        (
            "radius = 100.0",
            "ellipse = { major = 120, minor = 80, angle = 30 }",
            ["bubble[0].symmetry", "30 degrees from the yarns", "'full'"],
        ),
        (
            "radius = 100.0",
            "ellipse = { major = 120, minor = 80, angle = 120 }",
            ["bubble[0].ellipse.angle", "90"],
        ),
        ("radius = 100.0", "ellipse = { major = 120 }", ["bubble[0].ellipse.minor", "missing"]),
        ("[22, 59, 97", "[22, 97, 59", ["bubble[0].pressures[2]", "59 after 97"]),
        ("[22, 59, 97", "[22, 22, 97", ["bubble[0].pressures[1]", "increase"]),
        ("[22, 59, 97", "[0, 59, 97", ["bubble[0].pressures[0]", "greater than 0"]),
        ("[6, 40]", "[6, 301]", ["bubble[0].increments[1]", "last pressure"]),
        ("-7.96788e-3,", "inf,", ["bubble[0].data.known_solution.beta[0]", "finite"]),
        ("[fit]", "[bubble.data.points]\nfiles=[]\n[fit]", ["bubble[0].data", "exactly one"]),
    ],
)
def test_bad_input_names_file_and_field(edit, tmp_path: Path, old, new, words):
    assert complaint_with(words, edit, old, new).startswith(str(tmp_path / "project.toml"))


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("indices = [0, ", "indices = [", ["data.points.indices", "20 pressures", "got 19"]),
        ("indices =", "# indices =", ["data.points.indices", "missing"]),
        ("{index:02d}", "{number}", ["data.points.pattern", "{index}"]),
        ("{index:02d}", "02", ["data.points.pattern", "same file"]),
        ("pattern =", 'files = ["a.csv"]\npattern =', ["data.points", "exactly one"]),
        ('dz = "dz"', 'w = "dz"', ["data.points.columns.w", "allowed here: x, y, z, dx, dy, dz"]),
    ],
)
def test_bad_point_files(edit, old, new, words):
    complaint_with(words, edit, old, new, source=VALMEX / "test1-linear.toml", need_data=False)


def test_files_that_cannot_be_had_are_named_with_what_to_do(tmp_path: Path) -> None:
    """A pattern that nothing matches by itself, a file at fault by its path."""
    advice = "give the folder of the measured data with --data DIR"
    section = section_of("f*.csv")
    place = Place(tmp_path / "p.toml", "bubble[0]", Fabric("a fabric", 0.8))
    at = f"{tmp_path / 'p.toml'}: bubble[0].data.points.files"
    found = complaint(point_files._files, section, place)
    assert found == f"{at}: no file matches {str(tmp_path / 'f*.csv')!r}; {advice}"
    (tmp_path / "f1.csv").write_text("")
    section.files = ["f1.csv", "f*.csv"]
    found = complaint(point_files._files, section, place)
    assert found == f"{at}: {tmp_path / 'f1.csv'} is given twice; {advice}"
    # A forward analysis does without a pattern's files, not without sense.
    assert point_files._files(section_of("g*.csv"), replace(place, need_data=False)) == ()
    complaint(point_files._files, section, replace(place, need_data=False))


def section_of(*files: str) -> Any:
    return SimpleNamespace(files=list(files), pattern=None, indices=None, folder="")
