"""[[bubble]] of a project: conversion to mm and MPa, the examples, and one-line errors."""

import shutil
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bubblefit.experiments.bubble.recorded_frames import frame_times
from bubblefit.experiments.bubble.section import (
    LogSection,
    SheetSection,
    SheetSettings,
    outline_of,
    sheet_of,
)
from bubblefit.experiments.bubble.sheet import _on_disk, measured_sheet, sheet_nuisance
from bubblefit.experiments.bubble.targets import at_points, with_unloaded_positions
from bubblefit.experiments.bubble.test import BubbleTest, merge_increments
from bubblefit.experiments.fabric import Fabric
from bubblefit.experiments.sections import Place, Scales
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.outline import Outline
from bubblefit.project.project import Project, read_project
from bubblefit.readers.fields import DisplacementField
from bubblefit.readers.sections import whole_in_base_units
from bubblefit.runs.setup import prepare_fit
from bubblefit.solvers import registry
from bubblefit.solvers.calculix import sheets as calculix_sheets
from bubblefit.solvers.marc import analyses as marc_analyses
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...builders.projects import edited_project, known_bubble, project_file
from ...support.paths import EXAMPLES, KNOWN, SHARED
from ...support.refusals import complaint, complaint_with, refused

VALMEX = EXAMPLES / "bubble-valmex7318"
GRID = SHARED / "bubble"
CORD = "[[bubble.cord]]\nstiffness = 1e4\nends = %s\n[fit]"
R, ELLIPSE = "radius = 100.0", "ellipse = { major = %s }"


@pytest.fixture
def edit(tmp_path):
    return partial(edited_project, tmp_path)


def bubble(project: Project) -> BubbleTest:
    (test,) = project.tests.values()
    assert isinstance(test, BubbleTest)
    return test


def test_known_solution_is_table_4_2_in_mpa():
    p = bubble(read_project(KNOWN))
    assert p.pressures == pytest.approx([0.022, 0.059, 0.097, 0.132, 0.186, 0.251, 0.300])
    assert p.increments == p.data.increments == pytest.approx(sorted([0.006, 0.040, *p.pressures]))
    assert (p.outline.radius, p.elements, p.symmetry) == (100.0, 800, "quarter")
    assert p.data.beta[[0, 3, 7, 11]] == pytest.approx([-7.96788, 20.0439, 139.437, 806.35])
    assert (p.data.elements, p.data.symmetry) == (800, "quarter")
    assert (p.match_by, p.objective, p.name, p.weight) == ("points", "e", "bubble", 1.0)


def test_units_of_the_file_do_not_matter(edit, tmp_path):
    reference = bubble(read_project(KNOWN))
    in_bar = "[0.22, 0.59, 0.97, 1.32, 1.86, 2.51, 3.0]"

    def changed(*changes):
        return bubble(read_project(project_file(tmp_path, KNOWN.read_text(), *changes)))

    bar = changed(
        ('pressure = "kPa"', 'pressure = "bar"'),
        ("pressures = [22, 59, 97, 132, 186, 251, 300]", f"pressures = {in_bar}"),
        ("increments = [6, 40]", "increments = [0.06, 0.4]"),
    )
    assert bar.pressures == pytest.approx(reference.pressures)
    assert bar.increments == pytest.approx(reference.increments)
    mpa = bubble(edit('modulus = "GPa"', 'modulus = "MPa"'))
    assert mpa.data.beta == pytest.approx(reference.data.beta / 1000)
    metres = changed(
        ('length = "mm"', 'length = "m"'),
        ("radius = 100.0", "radius = 0.1"),
        ("thickness = 0.81", "thickness = 0.00081"),
    )
    assert metres.outline.radius == pytest.approx(reference.outline.radius)


def test_an_ellipse_in_place_of_the_radius(edit):
    p = bubble(edit("radius = 100.0", "ellipse = { major = 120, minor = 80, angle = 90 }"))
    assert (p.outline.major, p.outline.minor, p.outline.angle) == (120.0, 80.0, 90.0)
    np.testing.assert_allclose(p.model().mesh.points.max(axis=0), (80.0, 120.0, 0.0))
    assert str(p.settings()) != str(bubble(read_project(KNOWN)).settings())


def test_data_from_another_model_and_default_increments(edit):
    other = bubble(edit("# elements = 1800\n# increments", "elements = 1800\nincrements"))
    assert other.data.elements == 1800
    assert other.data.increments[0] == pytest.approx(0.004)
    assert set(other.pressures) <= set(other.data.increments)
    assert other.data.increments != other.increments
    reference = bubble(read_project(KNOWN)).increments
    assert bubble(edit("increments = [6, 40]", "")).increments == pytest.approx(reference)
    assert len(bubble(edit("increments = [6, 40]", "increments = [40, 22, 6]")).increments) == 9


@pytest.mark.parametrize("name", sorted(p.name for p in VALMEX.glob("*.toml")))
def test_real_examples(name, shared_data):
    p = bubble(read_project(VALMEX / name, shared_data / "bubble"))
    assert len(p.data.files) == len(p.pressures) == 20 and p.symmetry == "full"
    recorded = np.loadtxt(GRID / "grid_pressures.csv", delimiter=",", skiprows=1)
    indices = [int(f.stem[-2:]) for f in p.data.files]
    assert p.pressures == pytest.approx(recorded[indices, 2])
    assert p.data.options.flag_column == "flag"
    for file, bar in zip(p.data.files, recorded[indices, 1], strict=True):
        assert f"p_bar={bar:.6f}" in file.open().readline()


def test_missing_data_says_what_to_do(tmp_path):
    project = VALMEX / "test1-linear.toml"
    for folder in (None, tmp_path / "nowhere", tmp_path):
        assert "--data DIR" in complaint(read_project, project, folder)
    assert bubble(read_project(project, need_data=False)).data.files[0].name == "test1_00.csv"
    # The folder of the data is relative to the project.
    shutil.copy(project, tmp_path)
    (tmp_path / "data" / "grid").mkdir(parents=True)
    for i in range(20):
        (tmp_path / "data" / "grid" / f"test1_{i:02d}.csv").touch()
    files = bubble(read_project(tmp_path / project.name)).data.files
    assert all(f.is_file() for f in files) and tmp_path in files[0].parents


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("[bubble.match]", '[bubble.sheet]\nrim = "measured"\n[bubble.match]', ["sheet.rim"]),
        ("[bubble.match]", "[bubble.sheet]\nmodes = 46\n[bubble.match]", ["sheet.modes"]),
        ("[fit]", CORD % "[[90, 0], [90, 60]]", ["bubble[0].cord[0].ends", "on the disk", "60"]),
        ("[fit]", CORD % "[[9, 8], [9, 8]]", ["bubble[0].cord[0].ends", "apart"]),
        ("[fit]", CORD % "[[9, 8]]", ["bubble[0].cord[0].ends", "at least 2"]),
        ("[fit]", CORD % "[[0, 50], [50, 50]]", ["bubble[0].cord[0].ends", "mirror image"]),
        ("[fit]", CORD % "[[0, 0], [9, 8]]\nforce = [0, 1]", ["bubble[0].cord[0]:", "EA"]),
        ("radius =", "raduis =", ["bubble[0].raduis", "did you mean 'radius'"]),
        ("displacement_offset", "offset", ["bubble[0].nuisance.offset", "displacement_offset"]),
        (R, ELLIPSE % "120, minor = 80, angle = 120", ["bubble[0].ellipse.angle", "90"]),
        (R, ELLIPSE % "120", ["bubble[0].ellipse.minor", "missing"]),
        ("[22, 59, 97", "[22, 97, 59", ["bubble[0].pressures[2]", "59 after 97"]),
        ("[22, 59, 97", "[22, 22, 97", ["bubble[0].pressures[1]", "increase"]),
        ("[6, 40]", "[6, 301]", ["bubble[0].increments[1]", "last pressure"]),
        ("[fit]", "[bubble.data.points]\nfiles=[]\n[fit]", ["bubble[0].data", "exactly one"]),
        # Of the measured test.
        ("indices = [0, ", "indices = [", ["data.points.indices", "20 pressures", "got 19"]),
        ("indices =", "# indices =", ["data.points.indices", "missing"]),
        ("{index:02d}", "{number}", ["data.points.pattern", "{index}"]),
        ("{index:02d}", "02", ["data.points.pattern", "same file"]),
        ("pattern =", 'files = ["a.csv"]\npattern =', ["data.points", "exactly one"]),
    ],
)
def test_bad_input_names_file_and_field(edit, tmp_path, old, new, words):
    source = KNOWN if old in KNOWN.read_text() else VALMEX / "test1-linear.toml"
    said = complaint_with(words, edit, old, new, source=source, need_data=False)
    assert said.startswith(str(tmp_path / "project.toml"))


PLACE = Place(Path("p.toml"), "bubble[0]", Fabric("a fabric", 0.8))
METRES = replace(PLACE, scales=Scales(pressure=0.1, length=1000.0))


def edge(radius: float | None = None, symmetry: str = "full", **ellipse):
    own = SimpleNamespace(**({"angle": 0.0} | ellipse)) if ellipse else None
    section: Any = SimpleNamespace(radius=radius, ellipse=own, symmetry=symmetry)
    return outline_of(section, PLACE, 98.9)


@pytest.mark.parametrize(
    ("said", "found"),
    [
        ({"radius": 100.0}, Outline.circle(100.0)), ({}, "radius"),
        ({"radius": 0.81}, Outline.circle(0.81)), ({"radius": 0.8}, "radius"),
        ({"radius": 1.0, "major": 2.0}, "radius"), ({"major": 2.0, "minor": 0.8}, "ellipse.minor"),
        ({"major": 80.0, "minor": 80.0}, Outline(80.0, 80.0)),
        ({"major": 2.0, "minor": 2.1}, "ellipse.minor"),
        ({"major": 200.0, "minor": 100.0, "angle": 90.0, "symmetry": "quarter"},
         Outline(200.0, 100.0, 90.0)),
        ({"major": 400.0, "minor": 100.0}, Outline(400.0, 100.0)),
        ({"major": 401.0, "minor": 100.0}, "ellipse.minor"),
        ({"major": 200.0, "minor": 100.0, "angle": 30.0, "symmetry": "quarter"}, "symmetry"),
    ],
)  # fmt: skip
def test_edges_at_their_limits(said, found):
    if isinstance(found, str):
        assert complaint(edge, **said).startswith(f"p.toml: bubble[0].{found}: ")
    else:
        assert edge(**said) == found


def test_load_steps_beyond_the_last_are_named_in_the_unit_of_the_file():
    more = [0.030, 0.010, 0.022 * (1 + 1e-10)]
    steps = merge_increments(PLACE, "increments", more, (0.022, 0.03))
    assert steps == pytest.approx((0.010, 0.022, 0.03)) and len(steps) == 3
    assert len(merge_increments(PLACE, "i", [0.022 * (1 + 1e-8)], (0.022, 0.03))) == 3
    said = complaint(merge_increments, PLACE, "increments", [0.01, 0.030001], (0.03,))
    assert said.startswith("p.toml: bubble[0].increments[1]: ") and "30.001" in said


def sheet(place: Place = PLACE, **said: Any) -> SheetSettings:
    how = {"pressures": (0.02, 0.2), "symmetry": "full", "of_files": True, "offset": False}
    how |= {key: said.pop(key) for key in [*how] if key in said}
    section: Any = SimpleNamespace(
        sheet=whole_in_base_units(SheetSection(**said), place.scales), symmetry=how["symmetry"],
        nuisance=SimpleNamespace(displacement_offset=how["offset"]),
        data=SimpleNamespace(points="points" if how["of_files"] else None),
    )  # fmt: skip
    return sheet_of(section, place, how["pressures"])


def test_what_a_section_says_of_the_sheet():
    assert (
        sheet()
        == SheetSettings()
        == SheetSettings(False, 8, 0, 3.0, False, 0.3, 0.5, False, (), None)
    )
    found = sheet(
        METRES, surface="measured", degree=6, modes=3, prior=0.002, slack=True, slack_prior=0.1,
        misfit=0.0001, rim="measured", constant_field=["dz", "dx", "dz"],
    )  # fmt: skip
    assert found == SheetSettings(
        True, 6, 3, 2.0, True, 0.1, pytest.approx(0.1), True, (0, 2), None
    )
    assert sheet(from_pressure=200.0).since == 1 and sheet(METRES, from_pressure=0.2).since == 0
    assert sheet(from_pressure=20.0 * (1 + 9e-7)).since == 0
    assert sheet(modes=1, symmetry="quarter").modes == 1
    assert sheet(metric=3, metric_prior=0.2, misfit=0.1) == SheetSettings(
        misfit=pytest.approx(0.1), metric=3, metric_prior=0.2
    )


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ({"surface": "measured", "of_files": False}, "sheet.surface: nothing is measured"),
        ({"rim": "measured", "of_files": False}, "sheet.rim"), ({"prior": 1.0}, "sheet.prior"),
        ({"surface": "measured", "symmetry": "quarter"}, "sheet.surface: a measured surface"),
        ({"modes": 3, "symmetry": "quarter"}, "sheet.modes"), ({"misfit": 1.0}, "sheet.misfit"),
        ({"slack_prior": 1.0}, "sheet.slack_prior"), ({"metric_prior": 1.0}, "sheet.metric_prior"),
        ({"metric": 1, "symmetry": "quarter"}, "sheet.metric: a metric"),
        ({"metric": 1, "slack": True}, "sheet.metric: holds slack"),
        ({"from_pressure": 20.1}, "sheet.from_pressure: expected one"),
        ({"from_pressure": 20.0, "pressures": (0.02,)}, "sheet.from_pressure: expected one"),
        ({"from_pressure": 20.0, "surface": "measured"}, "sheet.from_pressure: a surface"),
        ({"from_pressure": 20.0, "offset": True}, "nuisance.displacement_offset: "),
        ({"constant_field": ["dx"], "offset": True}, "nuisance.displacement_offset: "),
        ({"from_pressure": 20.0, "constant_field": ["dx"]}, "sheet.constant_field: takes out"),
        ({"constant_field": ["dx"], "pressures": (0.02,)}, "sheet.constant_field: nothing is"),
    ],
)  # fmt: skip
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
        (measured(0.85), ""), (measured(0.849), "sheet.surface: points go out to 85 %"),
        (measured(0.9, nan=True), "sheet.surface: points go out to 63 %"),
        (measured(0.9, 49.0), ""), (measured(0.9, 52.0), "sheet.surface: heights"),
    ],
)  # fmt: skip
def test_heights_of_a_reference_picture(field, words):
    asked = Outline.circle(100.0), [field]
    surface, rim = SheetSettings(measured=True, degree=2), SheetSettings(moving_rim=True, degree=2)
    if words:
        assert complaint(measured_sheet, surface, *asked).startswith(words)
    else:
        assert measured_sheet(surface, *asked).surface is not None
    # The motion of the rim asks for no height.
    if field.points.max() < 84.95:
        assert "sheet.rim: points go out to 85 %" in complaint(measured_sheet, rim, *asked)
    else:
        assert _on_disk(field, asked[0], "rim").sum() == 200
    far = replace(field, points=field.points + 300.0)
    assert "sheet.rim: points go out to 0 %" in complaint(measured_sheet, rim, asked[0], [far])


def test_priors_of_a_sheet_weigh_as_twenty_points():
    model: Any = SimpleNamespace(modes={"z0_1": None, "z0_x": None}, strains={})
    scale = np.array([1.0, 4.0, 100.0])
    found = sheet_nuisance(SheetSettings(modes=2, prior=2.0, slack=True, misfit=0.1), model, scale)
    weight = pytest.approx(0.1 * np.sqrt(20) / 4)
    told = [(n.name, n.lower, n.upper, n.unit, n.scale, n.prior, n.weight) for n in found]
    assert told == [
        ("z0_1", -12.0, 12.0, "mm", 1.0, 2.0, weight),
        ("z0_x", -12.0, 12.0, "mm", 1.0, 2.0, weight),
        ("slack_warp", pytest.approx(-1.8), pytest.approx(1.8), "%", 0.01, 0.3, weight),
        ("slack_fill", pytest.approx(-1.8), pytest.approx(1.8), "%", 0.01, 0.3, weight),
    ]
    model.strains = {"metric_warp_1": None}
    found += sheet_nuisance(SheetSettings(metric=1, metric_prior=0.2, misfit=0.1), model, scale)[
        -1:
    ]
    assert (found[-1].upper, found[-1].scale, found[-1].weight) == (
        pytest.approx(1.2),
        0.01,
        weight,
    )
    assert [n.model_parameter for n in found] == [n.name for n in found]


def test_places_at_rest_by_the_two_thirds_of_the_pressure():
    """In-plane 8 to 27 kPa: 4 to 9 units; what has moved at 8 is 4/5 of what moves between."""
    points = np.array([[10.0, 0.0], [0.0, 20.0]])
    moved = np.array([[0.5, 0.0, 9.0], [0.0, 1.0, 9.0]])
    first = DisplacementField(0.008, points, np.zeros((2, 3)))
    other = DisplacementField(0.027, points[::-1], moved[::-1])
    for fields, since in (([first, other], 0), ([other, first], 1)):
        for found in with_unloaded_positions(fields, since):
            order = np.argsort(found.points[:, 1])
            assert found.points[order] == pytest.approx(np.array([[9.6, 0.0], [0.0, 19.2]]))
    seen = replace(first, displacement=np.full((2, 3), 1e-9))
    assert with_unloaded_positions([seen, other], 0) == [seen, other]


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


def times(folder, count=2, files=("p1.csv", "p7.csv"), **said):
    (folder / "t.csv").write_text("frame,time (ms)\n1,500\n2,1500\n")
    section = LogSection(file="l.csv", **said)
    own, files = [None] * count, [folder / f for f in files]
    return frame_times(section, files, own, PLACE, folder)[0].tolist()


def test_times_of_frames(tmp_path):
    assert times(tmp_path, 3, rate=2.0) == [0.0, 0.5, 1.0]
    assert times(tmp_path, rate=2.0) == [0.0, 3.0]  # p1, p7
    assert times(tmp_path, rate=2.0, time_in_name=False) == [0.0, 0.5]
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
    assert complaint(times, tmp_path, **said).removeprefix(f"{tmp_path}/").startswith(words)


def test_a_cord_along_the_sheet_is_in_the_model_and_other_programs_refuse_it(tmp_path):
    """In metres; a quarter takes one along a symmetry line."""
    cord = "[[bubble.cord]]\nstrain = [0, 0.01]\nforce = [0, 300]\n"
    cord += "ends = [[-0.1, 0.0], [0.1, 0.0]]\n[fit]"
    path = known_bubble(tmp_path, ("radius = 100.0", "radius = 0.1"), ("[fit]", cord),
                 ("thickness = 0.81", "thickness = 0.81e-3"), ('"mm"', '"m"'))  # fmt: skip
    project = read_project(path)
    model = bubble(project).model()
    assert model.cords[0].ends.tolist() == [[-100.0, 0.0], [100.0, 0.0]]
    (prepared,) = prepare_fit(project, list(project.tests.values())).tests
    with_cord = prepared.fields[-1].displacement[:, 2].max()
    plain = MembraneSolver().run(replace(model, cords=()), prepared.known).displacement[-1, :, 2]
    assert with_cord < 0.9 * plain.max()
    law = HypoelasticLaw.linear(400.0, 400.0, 40.0)
    for analyse in (calculix_sheets.analyse_bubble, marc_analyses.analyse_bubble):
        assert refused(analyse, model, law, None, None).field == "cord"


class Other(MembraneSolver):
    name = identity = "other"


@pytest.mark.parametrize(
    ("said", "crime"),
    [('solver = "membrane"\nelements = 48\nsymmetry = "full"\n', True), ("elements = 108\n", False),
     ('solver = "other"\n', False), ("increments = [6, 41]\n", False)],
)  # fmt: skip
def test_the_inverse_crime(tmp_path, monkeypatch, said, crime):
    monkeypatch.setitem(registry.SOLVERS, "other", Other)
    known = "[bubble.data.known_solution]\n"
    project = read_project(known_bubble(tmp_path, (known, known + said)))
    (prepared,) = prepare_fit(project, list(project.tests.values())).tests
    assert prepared.by_this_model is crime
