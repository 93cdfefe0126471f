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
from bubblefit.experiments.bubble import report as examined
from bubblefit.experiments.bubble.doubts import Apex
from bubblefit.experiments.bubble.objective import (
    FieldTarget,
    at_points,
    at_rest,
    counted_from,
    with_places,
)
from bubblefit.experiments.bubble.point_files import PointFiles, _frame_times
from bubblefit.experiments.bubble.section import (
    LogSection,
    Sheet,
    SheetSection,
    outline_of,
    sheet_of,
)
from bubblefit.experiments.bubble.sheet import _on_disk, measured_sheet, sheet_nuisance
from bubblefit.experiments.bubble.test import BubbleTest, KnownSolution, merge_increments
from bubblefit.experiments.kinds import Fabric, Output, Place, Scales
from bubblefit.meshes.disk import Outline, disk_mesh
from bubblefit.project.project import Project, read_project
from bubblefit.readers.fields import DisplacementField
from bubblefit.runs.setup import prepare_fit
from bubblefit.solvers import registry
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...complaints import complaint, complaint_with
from ...drawings import caught
from ...places import EXAMPLES, KNOWN, SHARED
from ...projects import edited, small

VALMEX = EXAMPLES / "bubble-valmex7318"
GRID = SHARED / "bubble"
R, ELLIPSE = "radius = 100.0", "ellipse = { major = %s }"


@pytest.fixture
def edit(tmp_path):
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
def test_real_examples(name, shared_data):
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


def test_pressures_in_the_headers_of_real_frames(shared_data, tmp_path):
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


def test_missing_data_says_what_to_do(tmp_path):
    project = VALMEX / "test1-linear.toml"
    for folder in (None, tmp_path / "nowhere", tmp_path):
        assert "--data DIR" in complaint(read_project, project, folder)
    p = bubble(read_project(project, need_data=False))
    assert isinstance(p.data, PointFiles) and p.data.files[0].name == "test1_00.csv"


def test_data_folder_is_relative_to_the_project(tmp_path):
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
        (R, f"{R}\nellipse = {{ major = 9, minor = 8 }}", ["bubble[0].radius", "both"]),
        (R, ELLIPSE % "80, minor = 120", ["bubble[0].ellipse.minor", "80 mm, got 120 mm"]),
        (R, ELLIPSE % "120, minor = 20", ["bubble[0].ellipse.minor", "4th part", "20 mm"]),
        (R, ELLIPSE % "1.2, minor = 0.7", ["bubble[0].ellipse.minor", "0.81 mm"]),
        (R, ELLIPSE % "120, minor = 80, angle = 30", ["bubble[0].symmetry", "'full'"]),
        (R, ELLIPSE % "120, minor = 80, angle = 120", ["bubble[0].ellipse.angle", "90"]),
        (R, ELLIPSE % "120", ["bubble[0].ellipse.minor", "missing"]),
        ("[22, 59, 97", "[22, 97, 59", ["bubble[0].pressures[2]", "59 after 97"]),
        ("[22, 59, 97", "[22, 22, 97", ["bubble[0].pressures[1]", "increase"]),
        ("[22, 59, 97", "[0, 59, 97", ["bubble[0].pressures[0]", "greater than 0"]),
        ("[6, 40]", "[6, 301]", ["bubble[0].increments[1]", "last pressure"]),
        ("-7.96788e-3,", "inf,", ["bubble[0].data.known_solution.beta[0]", "finite"]),
        ("[fit]", "[bubble.data.points]\nfiles=[]\n[fit]", ["bubble[0].data", "exactly one"]),
    ],
)
def test_bad_input_names_file_and_field(edit, tmp_path, old, new, words):
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


def test_files_that_cannot_be_had_are_named_with_what_to_do(tmp_path):
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


PLACE = Place(Path("p.toml"), "bubble[0]", Fabric("a fabric", 0.8))
METRES = replace(PLACE, scales=Scales(pressure=0.1, length=1000.0))


def edge(radius: float | None = None, symmetry: str = "full", place: Place = PLACE, **ellipse):
    own = SimpleNamespace(**({"angle": 0.0} | ellipse)) if ellipse else None
    section: Any = SimpleNamespace(radius=radius, ellipse=own, symmetry=symmetry)
    return outline_of(section, place)


def test_edges_at_their_limits():
    assert edge(0.1, place=METRES) == Outline.circle(100.0)
    assert edge(0.81) == Outline.circle(0.81)
    assert edge(major=80.0, minor=80.0) == Outline(80.0, 80.0)
    assert edge(major=0.2, minor=0.1, angle=90.0, symmetry="quarter", place=METRES) == Outline(
        200.0, 100.0, 90.0
    )
    assert edge(major=400.0, minor=100.0).minor == 100.0


@pytest.mark.parametrize(
    ("said", "field"),
    [
        ({}, "radius"), ({"radius": 1.0, "major": 2.0}, "radius"), ({"radius": 0.8}, "radius"),
        ({"major": 2.0, "minor": 0.8}, "ellipse.minor"),
        ({"major": 2.0, "minor": 2.1}, "ellipse.minor"),
        ({"major": 401.0, "minor": 100.0}, "ellipse.minor"),
        ({"major": 200.0, "minor": 100.0, "angle": 30.0, "symmetry": "quarter"}, "symmetry"),
    ],
)  # fmt: skip
def test_edges_that_cannot_be(said, field):
    assert complaint(edge, **said).startswith(f"p.toml: bubble[0].{field}: ")


def test_load_steps_are_in_the_unit_of_the_file():
    steps = merge_increments(PLACE, "increments", [30.0, 10.0, 22.0 * (1 + 1e-10)], (0.022, 0.03))
    assert steps == pytest.approx((0.010, 0.022, 0.03)) and len(steps) == 3
    assert len(merge_increments(PLACE, "i", [22.0 * (1 + 1e-8)], (0.022, 0.03))) == 3
    assert merge_increments(METRES, "i", [0.1], (0.022,)) == pytest.approx((0.01, 0.022))
    assert complaint(merge_increments, PLACE, "increments", [10.0, 30.001], (0.03,)) == (
        "p.toml: bubble[0].increments[1]: expected a step up to the last pressure, got 30.001 "
        "beyond it"
    )


def sheet(place: Place = PLACE, **said: Any) -> Sheet:
    how = {"pressures": (0.02, 0.2), "symmetry": "full", "of_files": True, "offset": False}
    how |= {key: said.pop(key) for key in [*how] if key in said}
    return sheet_of(SheetSection(**said), place, **how)


def test_what_a_section_says_of_the_sheet():
    assert sheet() == Sheet() == Sheet(False, 8, 0, 3.0, False, 0.3, 0.5, False, (), None)
    found = sheet(
        METRES, surface="measured", degree=6, modes=3, prior=0.002, slack=True, slack_prior=0.1,
        misfit=0.0001, rim="measured", constant_field=["dz", "dx", "dz"],
    )  # fmt: skip
    assert found == Sheet(True, 6, 3, 2.0, True, 0.1, pytest.approx(0.1), True, (0, 2), None)
    assert sheet(from_pressure=200.0).since == 1 and sheet(METRES, from_pressure=0.2).since == 0
    assert sheet(from_pressure=20.0 * (1 + 9e-7)).since == 0
    assert sheet(modes=1, symmetry="quarter").modes == 1


def test_computed_data_have_no_measured_surface(tmp_path):
    rim = '[bubble.sheet]\nrim = "measured"\n[bubble.match]'
    path = small(tmp_path, ("[bubble.match]", rim))
    complaint_with(["sheet.rim", "nothing is measured"], read_project, path)


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ({"surface": "measured", "of_files": False}, "sheet.surface: nothing is measured"),
        ({"rim": "measured", "of_files": False}, "sheet.rim: nothing is measured"),
        ({"surface": "measured", "symmetry": "quarter"}, "sheet.surface: a measured surface"),
        ({"modes": 3, "symmetry": "quarter"}, "sheet.modes: 3 modes"),
        ({"prior": 1.0}, "sheet.prior: belongs to modes"),
        ({"slack_prior": 1.0}, "sheet.slack_prior: belongs to slack"),
        ({"misfit": 1.0}, "sheet.misfit: belongs to modes or slack"),
        ({"from_pressure": 20.1}, "sheet.from_pressure: expected one"),
        ({"from_pressure": 20.0, "pressures": (0.02,)}, "sheet.from_pressure: expected one"),
        ({"from_pressure": 20.0, "surface": "measured"}, "sheet.from_pressure: a surface"),
        ({"from_pressure": 20.0, "offset": True}, "nuisance.displacement_offset: "),
        ({"constant_field": ["dx"], "offset": True}, "nuisance.displacement_offset: "),
        ({"from_pressure": 20.0, "constant_field": ["dx"]}, "sheet.constant_field: takes out"),
        ({"constant_field": ["dx"], "pressures": (0.02,)}, "sheet.constant_field: nothing is"),
    ],
)
def test_what_a_sheet_cannot_be(said, words):
    assert complaint(sheet, **said).startswith(f"p.toml: bubble[0].{words}")


def measured(reach: float, height: float = 0.0, nan: bool = False) -> DisplacementField:
    turn = np.linspace(0, 2 * np.pi, 200)
    r = 100.0 * reach * np.sqrt(np.linspace(0, 1, 200))
    points = np.column_stack([r * np.cos(9 * turn), r * np.sin(9 * turn)])
    z = 600.0 + height * points[:, 0] / (200.0 * reach)
    if nan:
        z[100:] = np.nan
    return DisplacementField(0.1, points, np.zeros((200, 3)), z=z)


@pytest.mark.parametrize(
    ("field", "words"),
    [
        (measured(0.85), ""),
        (measured(0.849), "sheet.surface: points go out to 85 %"),
        (measured(0.9, nan=True), "sheet.surface: points go out to 63 %"),
        (measured(0.9, 49.0), ""), (measured(0.9, 52.0), "sheet.surface: heights"),
    ],
)  # fmt: skip
def test_heights_of_a_reference_picture(field, words):
    asked = Sheet(measured=True, degree=2), Outline.circle(100.0), [field]
    if words:
        assert complaint(measured_sheet, *asked).startswith(words)
    else:
        assert measured_sheet(*asked).surface is not None
    # The motion of the rim asks for no height.
    if np.isnan(field.z).any():
        assert _on_disk(field, asked[1], "rim").all()
        assert _on_disk(field, asked[1], "rim").sum() == 200
    rim = Sheet(moving_rim=True, degree=2)
    if field.points.max() < 84.95:
        assert "sheet.rim: points go out to 85 %" in complaint(measured_sheet, rim, *asked[1:])


def test_points_none_of_which_lies_on_the_disk():
    far = measured(2.0)
    far = replace(far, points=far.points[np.hypot(*far.points.T) > 101.0], z=None,
                  displacement=far.displacement[np.hypot(*far.points.T) > 101.0])  # fmt: skip
    said = complaint(measured_sheet, Sheet(moving_rim=True), Outline.circle(100.0), [far])
    assert said.startswith("sheet.rim: points go out to 0 %")


def test_priors_of_a_sheet_weigh_as_twenty_points():
    model: Any = SimpleNamespace(modes={"z0_1": None, "z0_x": None})
    scale = np.array([1.0, 4.0, 100.0])
    found = sheet_nuisance(Sheet(modes=2, prior=2.0, slack=True, misfit=0.1), model, scale)
    weight = pytest.approx(0.1 * np.sqrt(20) / 4)
    told = [(n.name, n.lower, n.upper, n.unit, n.scale, n.prior, n.weight) for n in found]
    assert told == [
        ("z0_1", -12.0, 12.0, "mm", 1.0, 2.0, weight),
        ("z0_x", -12.0, 12.0, "mm", 1.0, 2.0, weight),
        ("slack_warp", pytest.approx(-1.8), pytest.approx(1.8), "%", 0.01, 0.3, weight),
        ("slack_fill", pytest.approx(-1.8), pytest.approx(1.8), "%", 0.01, 0.3, weight),
    ]
    assert [n.model_parameter for n in found] == [n.name for n in found]


def test_places_at_rest_by_the_two_thirds_of_the_pressure():
    """In-plane 8 to 27 kPa: 4 to 9 units; what has moved at 8 is 4/5 of what moves between."""
    points = np.array([[10.0, 0.0], [0.0, 20.0]])
    moved = np.array([[0.5, 0.0, 9.0], [0.0, 1.0, 9.0]])
    first = DisplacementField(0.008, points, np.zeros((2, 3)))
    other = DisplacementField(0.027, points[::-1], moved[::-1])
    for fields, since in (([first, other], 0), ([other, first], 1)):
        for found in at_rest(fields, since):
            order = np.argsort(found.points[:, 1])
            assert found.points[order] == pytest.approx(np.array([[9.6, 0.0], [0.0, 19.2]]))
    seen = replace(first, displacement=np.full((2, 3), 1e-9))
    assert at_rest([seen, other], 0) == [seen, other]


def test_a_frame_shares_half_of_its_places():
    nodes = np.array([[float(k), 0.0] for k in range(5)])

    def target(pressure, *which):
        import scipy.sparse as sp

        sample = sp.csr_matrix(np.eye(5)[list(which)])
        return FieldTarget(pressure, np.array([[k, pressure, 1.0] for k in which]), sample)

    some = with_places([target(0.1, 0, 1, 2, 3), target(0.02, 4, 3, 2)], nodes)
    (found,) = counted_from(some, 1)
    np.testing.assert_allclose(found.displacement, [[0.0, 0.08, 0.0]] * 2, atol=1e-12)
    assert (found.frame, found.since, found.pressure) == (0, 1, 0.1)
    assert found.at(nodes)[:, 0].tolist() == [2.0, 3.0]
    few = with_places([target(0.1, 0, 1, 2), target(0.02, 4, 3, 2)], nodes)
    assert "100 and 20 kPa share 1 of 3" in complaint(counted_from, few, 1)


def test_points_that_lie_on_the_disk():
    mesh = disk_mesh(100.0, 48)
    test: Any = SimpleNamespace(outline=Outline.circle(100.0), place=PLACE, facet=None)

    def found(points):
        points = np.array(points, dtype=float)
        fields = [DisplacementField(0.2, points, np.zeros((len(points), 3)))]
        (target,), outside = at_points(test, fields, mesh)
        return len(target.displacement), outside

    far = [[900.0, k] for k in range(9)]
    assert found([[50.0, 0.0], *far]) == (1, 9)
    assert "200 kPa: 1 of 11 points" in complaint(found, [[50.0, 0.0], *far, [901.0, 0]])
    assert found([[10.0, 0.0], [0.0, -9.0]]) == (2, 0)
    assert "within 9.99 mm" in complaint(found, [[-9.99, 0.0], [0.0, 9.0]])


def times(folder: Path, count: int = 2, files: tuple[str, ...] = ("p1.csv", "p7.csv"), **said: Any):
    (folder / "t.csv").write_text("frame,time (ms)\n1,500\n2,1500\n")
    section = LogSection(file="l.csv", **said)
    return _frame_times(section, [folder / f for f in files], count, PLACE, folder).tolist()


def test_times_of_frames(tmp_path):
    assert times(tmp_path, 3, rate=2.0) == [0.0, 0.5, 1.0]
    assert times(tmp_path, times="t.csv") == [0.5, 1.5]
    assert times(tmp_path, time_in_name=r"p(\d)") == [1.0, 7.0]
    assert times(tmp_path, time_in_name=r"p(\d)", rate=2.0) == [0.5, 3.5]
    assert times(tmp_path, files=("1s.csv", "70ms.csv"), time_in_name=True) == [1.0, 0.07]


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ({}, "expected one of"), ({"times": "t.csv", "time_in_name": True}, "expected one of"),
        ({"rate": 1.0, "times_column": "t"}, "times_column: "),
        ({"rate": 1.0, "times": "t.csv"}, "rate: "),
        ({"time_in_name": "p(.)", "count": 3}, "time_in_name: a file holds"),
        ({"time_in_name": True, "rate": 1.0}, "time_in_name: with"),
        ({"times": "t.csv", "count": 3}, "t.csv: expected one time for each of the 3 frames"),
    ],
)  # fmt: skip
def test_times_that_cannot_be_had(tmp_path, said, words):
    found = complaint(times, tmp_path, **said)
    assert found.removeprefix(f"{tmp_path}/").startswith(words)


def test_every_cell_of_what_is_seen(tmp_path, monkeypatch):
    drawn = caught(monkeypatch, examined, "rise_charts")
    monkeypatch.setattr(examined, "registration_picture", lambda *_: ("maps.png", "maps"))
    points = np.zeros((4, 2))
    fields = [
        DisplacementField(0.02, points, np.zeros((4, 3)), {"all zero": 2, "without a value": 1}),
        DisplacementField(0.2, points, np.zeros((4, 3)), path=Path("x/b.csv")),
    ]
    apexes = [Apex(0.2, 31.0, 0.012, 16.0, 0.5, (0.03, 0.05))]
    rim = SimpleNamespace(x=1.234, y=-0.5, error=0.123)
    axes = SimpleNamespace(off=-2.346, error=0.456, clear=0.876)
    view = SimpleNamespace(rises=np.array([3.0, 30.0]), apexes=apexes, rim=rim, axes=axes)
    test = SimpleNamespace(thickness=0.8, outline=None)
    prepared: Any = SimpleNamespace(fields=fields, view=view, test=test, registration=None)
    shown = examined.examine(prepared, Output(tmp_path))
    assert shown.facts == [
        ("the sheet rises about, mm", "1.23, -0.50 (+- 0.12)"),
        ("axes of symmetry, degrees from x and y", "-2.35 (+- 0.46, 88% clear)"),
    ]
    frames, equilibrium = shown.tables
    assert frames.rows == [
        [20.0, "computed", 4, "2 all zero, 1 without a value", 3.0],
        [200.0, "b.csv", 4, "none", 30.0],
    ]
    assert equilibrium.rows == [pytest.approx([200.0, 31.0, 12.0, 16.0, 0.5, 20.0, 3.0, 5.0])]
    assert [name for name, _ in shown.figures] == ["maps.png", "rises.png"]
    ((path, pressures, rises),) = drawn
    assert (path, pressures) == (tmp_path / "rises.png", [0.02, 0.2]) and rises is view.rises
    view.apexes, view.rim, view.axes = [], None, None
    bare = examined.examine(prepared, Output(tmp_path))
    assert bare.facts == [] and len(bare.tables) == 1


KNOWN_INVERSE_CRIME = "[bubble.data.known_solution]\n"


class Other(MembraneSolver):
    name = identity = "other"


@pytest.mark.parametrize(
    ("said", "crime"),
    [
        ("", True), ("elements = 48\n", True), ('symmetry = "full"\n', True),
        ('solver = "membrane"\n', True), ("elements = 108\n", False),
        ("increments = [4, 11, 40]\n", False), ('solver = "other"\n', False),
    ],
)  # fmt: skip
def test_the_inverse_crime(tmp_path, monkeypatch, said, crime):
    monkeypatch.setitem(registry.SOLVERS, "other", Other)
    project = read_project(small(tmp_path, (KNOWN_INVERSE_CRIME, KNOWN_INVERSE_CRIME + said)))
    (prepared,) = prepare_fit(project, list(project.tests.values())).tests
    assert prepared.by_this_model is crime
