"""The project file: conversion to mm, N, MPa, the examples, and one-line errors."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.projects.bubble import BubbleProject, read_project
from bubblefit.projects.bubble_data import KnownSolution, PointFiles

EXAMPLES = Path(__file__).parents[1] / "examples"
KNOWN = EXAMPLES / "bubble-known-solution" / "project.toml"
VALMEX = EXAMPLES / "bubble-valmex7318"
GRID = Path(__file__).parents[2] / "shared" / "data" / "bubble"


@pytest.fixture
def edit(tmp_path: Path):
    """Read the known-solution example after replacing one text by another."""

    def read(old: str, new: str, source: Path = KNOWN, **options) -> BubbleProject:
        text = source.read_text()
        assert old in text
        path = tmp_path / "project.toml"
        path.write_text(text.replace(old, new, 1))
        return read_project(path, **options)

    return read


def complaint(call, *arguments, **options) -> str:
    with pytest.raises(InputError) as caught:
        call(*arguments, **options)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_known_solution_is_table_4_2_in_mpa():
    p = read_project(KNOWN)
    assert isinstance(p.data, KnownSolution)
    assert p.pressures == pytest.approx([0.022, 0.059, 0.097, 0.132, 0.186, 0.251, 0.300])
    assert p.increments == pytest.approx(
        [0.006, 0.022, 0.040, 0.059, 0.097, 0.132, 0.186, 0.251, 0.300]
    )
    assert set(p.pressures) <= set(p.increments)
    assert (p.radius, p.thickness, p.elements, p.symmetry) == (100.0, 0.81, 800, "quarter")
    assert p.data.beta[[0, 3, 7, 11]] == pytest.approx([-7.96788, 20.0439, 139.437, 806.35])
    assert p.lower.shape == p.upper.shape == (12,)
    assert (p.lower <= p.data.beta).all() and (p.data.beta <= p.upper).all()
    assert (p.data.elements, p.data.symmetry) == (800, "quarter")
    assert p.data.increments == p.increments
    assert (p.margin_E, p.margin_G) == pytest.approx((5.0, 0.5))
    assert p.strain_range == (0.13, 0.13, 0.13)
    assert (p.match_by, p.starts, p.seed, p.method, p.solver) == ("points", 50, 1, "lm", "membrane")
    assert p.max_analyses == 100 and replace(p, method="cobyla").max_analyses == 2000


def test_units_of_the_file_do_not_matter(edit):
    reference = read_project(KNOWN)
    bar = edit('pressure = "kPa"', 'pressure = "bar"')
    assert bar.pressures == pytest.approx(np.array(reference.pressures) * 100)
    mpa = edit('modulus = "GPa"', 'modulus = "MPa"')
    assert mpa.upper == pytest.approx(reference.upper / 1000)
    metre = edit('length = "mm"', 'length = "m"')
    assert metre.radius == pytest.approx(reference.radius * 1000)


def test_data_from_another_model(edit):
    other = edit("# elements = 1800\n# increments", "elements = 1800\nincrements")
    assert isinstance(other.data, KnownSolution) and other.data.elements == 1800
    assert other.data.increments[0] == pytest.approx(0.004)
    assert set(other.pressures) <= set(other.data.increments)
    assert other.data.increments != other.increments


def test_default_increments_and_repeated_ones(edit):
    reference = read_project(KNOWN).increments
    assert edit("increments = [6, 40]", "").increments == pytest.approx(reference)
    assert len(edit("increments = [6, 40]", "increments = [40, 22, 6]").increments) == 9


@pytest.mark.parametrize("degree, free", [(0, (3, 7, 11)), (1, (2, 3, 6, 7, 10, 11))])
def test_lower_degrees_keep_the_low_powers(tmp_path: Path, degree: int, free: tuple[int, ...]):
    text = (VALMEX / "test1-linear.toml").read_text()
    text = text.replace("degree = 0", f"degree = {degree}\nstrain_range = [0.1, 0.1, 0.1]")
    values = ", ".join("1.0" for _ in free)
    text = text.replace("[0.0001, 0.01, 0.01]", f"[{values}]")
    text = text.replace("[0.5, 1.5, 3.0]", f"[{values}]")
    path = tmp_path / "p.toml"
    path.write_text(text)
    p = read_project(path, need_data=False)
    assert p.free == free
    assert np.flatnonzero(p.full_beta(p.lower)).tolist() == list(free)


@pytest.mark.parametrize("name", sorted(p.name for p in VALMEX.glob("*.toml")))
def test_real_examples(name: str):
    if not GRID.is_dir():
        pytest.skip(f"no bubble data in {GRID}")
    p = read_project(VALMEX / name, data_folder=GRID)
    assert isinstance(p.data, PointFiles)
    assert len(p.data.files) == len(p.pressures) == 20 and p.symmetry == "full"
    recorded = np.loadtxt(GRID / "grid_pressures.csv", delimiter=",", skiprows=1)
    indices = [int(f.stem[-2:]) for f in p.data.files]
    assert p.pressures == pytest.approx(recorded[indices, 2])
    assert p.data.columns["dz"] == "dz" and p.data.flag_column == "flag"
    for file, bar in zip(p.data.files, recorded[indices, 1], strict=True):
        assert f"p_bar={bar:.6f}" in file.open().readline()


def test_missing_data_says_what_to_do(tmp_path: Path):
    project = VALMEX / "test1-linear.toml"
    for folder in (None, tmp_path / "nowhere", tmp_path):
        assert "--data DIR" in complaint(read_project, project, data_folder=folder)
    p = read_project(project, need_data=False)
    assert isinstance(p.data, PointFiles) and p.data.files[0].name == "test1_00.csv"
    assert (p.max_analyses, p.strain_range) == (100, (1.0, 1.0, 1.0))


def test_data_folder_is_relative_to_the_project(tmp_path: Path):
    shutil.copy(VALMEX / "test2-cubic.toml", tmp_path)
    (tmp_path / "data" / "grid").mkdir(parents=True)
    for i in range(20):
        (tmp_path / "data" / "grid" / f"test2_{i:02d}.csv").touch()
    data = read_project(tmp_path / "test2-cubic.toml").data
    assert isinstance(data, PointFiles) and all(f.is_file() for f in data.files)


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("radius = 100.0", "", ["bubble.radius", "missing"]),
        ("radius =", "raduis =", ["bubble.raduis", "did you mean 'radius'"]),
        ("[match]", "[matsch]", ["matsch", "did you mean 'match'"]),
        ("displacement_offset", "offset", ["fit.nuisance.offset", "displacement_offset"]),
        ('"kPa"', '"psi"', ["units.pressure", "'kPa', 'MPa', 'bar' or 'Pa'", "'psi'"]),
        ('modulus = "GPa"', 'modulus = "kPa"', ["units.modulus", "'GPa', 'MPa' or 'Pa'"]),
        ("radius = 100.0", 'radius = "100 mm"', ["bubble.radius", "number", "'100 mm'"]),
        ("radius = 100.0", "radius = -1.0", ["bubble.radius", "greater than 0"]),
        ("[22, 59, 97", "[22, 97, 59", ["bubble.pressures[2]", "59 after 97"]),
        ("[22, 59, 97", "[22, 22, 97", ["bubble.pressures[1]", "increase"]),
        ("[22, 59, 97", "[0, 59, 97", ["bubble.pressures[0]", "greater than 0"]),
        ("[6, 40]", "[6, 301]", ["bubble.increments[1]", "last pressure"]),
        ("1.0e2, 1.0e2, 1.0, 5.0e-1", "1.0e2, -20.0, 1.0, 5.0e-1", ["bounds.lower[5]", "beta_5"]),
        ("-1.0e-2,  0.0,", "0.0,", ["bounds.lower", "12 coefficients", "got 11"]),
        ("-1.0e-2,  0.0,", "nan, 0.0,", ["bounds.lower[0]", "finite", "nan"]),
        ("-7.96788e-3,", "", ["data.known_solution.beta", "12 coefficients", "got 11"]),
        ("-7.96788e-3,", "inf,", ["data.known_solution.beta[0]", "finite"]),
        ("degree = 3", "degree = 2", ["bounds.lower", "9 coefficients"]),
        ("degree = 3", "degree = 4", ["material.degree", "less than or equal to 3"]),
        ("strain_range = [0.13, ", "strain_range = [", ["material.strain_range", "3 items"]),
        ("strain_range", "# strain_range", ["material.strain_range", "missing"]),
        ("nu12 = 0.24", "nu12 = true", ["material.nu12", "number"]),
        ('constraints = "margin"', 'constraints = "boolean"', ["fit.constraints", "slsqp"]),
        ('kind = "bubble"', 'kind = "balloon"', ["project.kind", "'bubble'", "'balloon'"]),
        ("radius = 100.0", "radius = ", ["TOML syntax", "line"]),
        ("starts = 50", "starts = 0", ["fit.starts", "1"]),
        ("[match]", "[data.points]\nfiles=[]\n[match]", ["data", "exactly one"]),
    ],
)
def test_bad_input_names_file_and_field(edit, tmp_path: Path, old, new, words):
    message = complaint(edit, old, new)
    assert message.startswith(str(tmp_path / "project.toml"))
    for word in words:
        assert word in message, message


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("indices = [0, ", "indices = [", ["data.points.indices", "20 pressures", "got 19"]),
        ("indices =", "# indices =", ["data.points.indices", "missing"]),
        ("{index:02d}", "{number}", ["data.points.pattern", "{index}"]),
        ("{index:02d}", "02", ["data.points.pattern", "same file"]),
        ("pattern =", 'files = ["a.csv"]\npattern =', ["data.points", "exactly one"]),
        ('dz = "dz"', 'w = "dz"', ["data.points.columns.w", "allowed here: x, y, dx, dy, dz"]),
    ],
)
def test_bad_point_files(edit, old, new, words):
    message = complaint(edit, old, new, source=VALMEX / "test1-linear.toml", need_data=False)
    for word in words:
        assert word in message, message


def test_unreadable_files(tmp_path: Path):
    assert "bubblefit init" in complaint(read_project, tmp_path / "none.toml")
    assert "cannot be read" in complaint(read_project, tmp_path)
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    assert "UTF-8" in complaint(read_project, tmp_path / "binary.toml")
