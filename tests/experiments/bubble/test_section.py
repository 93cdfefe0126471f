"""experiments/bubble/section.py: [[bubble]] of a project in mm and MPa, and its mistakes."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from bubblefit.experiments.bubble.registration import RegistrationOptions
from bubblefit.experiments.bubble.section import (
    RegistrationSection,
    SheetSection,
    SheetSettings,
    outline_of,
    registration_options,
    sheet_of,
)
from bubblefit.experiments.sections import Place, Scales
from bubblefit.meshes.disk import Outline
from bubblefit.project.project import read_project
from bubblefit.readers.sections import whole_in_base_units

from ...builders.projects import project_file
from ...support.paths import EXAMPLES, KNOWN, SHARED
from ...support.refusals import complaint, complaint_with
from .cases import ELLIPSE, PLACE, R, bubble_of_project, read_camera_bubble

VALMEX = EXAMPLES / "bubble-valmex7318"
GRID = SHARED / "bubble"
CORD = "[[bubble.cord]]\nstiffness = 1e4\nends = %s\n[fit]"


def test_units_of_the_file_do_not_change_the_bubble(edited_bubble, tmp_path):
    reference = bubble_of_project(read_project(KNOWN))
    in_bar = "[0.22, 0.59, 0.97, 1.32, 1.86, 2.51, 3.0]"

    def changed(*changes):
        return bubble_of_project(read_project(project_file(tmp_path, KNOWN.read_text(), *changes)))

    bar = changed(
        ('pressure = "kPa"', 'pressure = "bar"'),
        ("pressures = [22, 59, 97, 132, 186, 251, 300]", f"pressures = {in_bar}"),
        ("increments = [6, 40]", "increments = [0.06, 0.4]"),
    )
    assert bar.pressures == pytest.approx(reference.pressures)
    assert bar.increments == pytest.approx(reference.increments)
    mpa = bubble_of_project(edited_bubble('modulus = "GPa"', 'modulus = "MPa"'))
    assert mpa.data.beta == pytest.approx(reference.data.beta / 1000)
    metres = changed(
        ('length = "mm"', 'length = "m"'),
        ("radius = 100.0", "radius = 0.1"),
        ("thickness = 0.81", "thickness = 0.00081"),
    )
    assert metres.outline.radius == pytest.approx(reference.outline.radius)


def test_ellipse_in_place_of_the_radius(edited_bubble):
    p = bubble_of_project(
        edited_bubble("radius = 100.0", "ellipse = { major = 120, minor = 80, angle = 90 }")
    )
    assert (p.outline.major, p.outline.minor, p.outline.angle) == (120.0, 80.0, 90.0)
    np.testing.assert_allclose(p.model().mesh.points.max(axis=0), (80.0, 120.0, 0.0))
    assert str(p.settings()) != str(bubble_of_project(read_project(KNOWN)).settings())


@pytest.mark.parametrize("name", sorted(p.name for p in VALMEX.glob("*.toml")))
def test_examples_of_measured_bubbles_are_read(name, shared_data):
    p = bubble_of_project(read_project(VALMEX / name, shared_data / "bubble"))
    assert len(p.data.files) == len(p.pressures) == 20 and p.symmetry == "full"
    recorded = np.loadtxt(GRID / "grid_pressures.csv", delimiter=",", skiprows=1)
    indices = [int(f.stem[-2:]) for f in p.data.files]
    assert p.pressures == pytest.approx(recorded[indices, 2])
    assert p.data.options.flag_column == "flag"
    for file, bar in zip(p.data.files, recorded[indices, 1], strict=True):
        assert f"p_bar={bar:.6f}" in file.open().readline()


@pytest.mark.parametrize(
    "old, new, words",
    [
        ("[bubble.match]", '[bubble.sheet]\nrim = "measured"\n[bubble.match]', ["sheet.rim"]),
        (
            "[bubble.match]",
            "[bubble.sheet]\nmodes = 46\n[bubble.match]",
            ["sheet.modes", "equal to 45"],
        ),
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
def test_bad_input_names_file_and_field(edited_bubble, tmp_path, old, new, words):
    source = KNOWN if old in KNOWN.read_text() else VALMEX / "test1-linear.toml"
    said = complaint_with(words, edited_bubble, old, new, source=source, need_data=False)
    assert said.startswith(str(tmp_path / "project.toml"))


def test_marks_of_a_registration_are_in_the_unit_of_the_files():
    section = RegistrationSection(
        plane="camera", centre=[0.1, 0.0, 0.5], warp_points=[[0, 0, 0.5], [0, 0.2, 0.5]],
        warp_is="soft", remove_clamp_motion=False,
    )  # fmt: skip
    assert registration_options(section, PLACE, 1000.0) == RegistrationOptions(
        plane="camera",
        centre=(100.0, 0.0, 500.0),
        warp_points=((0.0, 0.0, 500.0), (0.0, 200.0, 500.0)),
        warp_is_stiff=False,
        remove_clamp_motion=False,
    )


METRES = replace(PLACE, scales=Scales(pressure=0.1, length=1000.0))


def edge_of(radius: float | None = None, symmetry: str = "full", **ellipse):
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
def test_bad_edges_are_refused(said, found):
    if isinstance(found, str):
        assert complaint(edge_of, **said).startswith(f"p.toml: bubble[0].{found}: ")
    else:
        assert edge_of(**said) == found


def sheet_settings(place: Place = PLACE, **said: Any) -> SheetSettings:
    how = {"pressures": (0.02, 0.2), "symmetry": "full", "of_files": True, "offset": False}
    how |= {key: said.pop(key) for key in [*how] if key in said}
    section: Any = SimpleNamespace(
        sheet=whole_in_base_units(SheetSection(**said), place.scales), symmetry=how["symmetry"],
        nuisance=SimpleNamespace(displacement_offset=how["offset"]),
        data=SimpleNamespace(points="points" if how["of_files"] else None),
    )  # fmt: skip
    return sheet_of(section, place, how["pressures"])


def test_section_of_the_sheet_has_its_defaults():
    assert (
        sheet_settings()
        == SheetSettings()
        == SheetSettings(False, None, 0, 3.0, False, 0.3, 0.5, False, (), None)
    )
    found = sheet_settings(
        METRES, surface="measured", degree=6, modes=3, prior=0.002, slack=True, slack_prior=0.1,
        misfit=0.0001, rim="measured", constant_field=["dz", "dx", "dz"],
    )  # fmt: skip
    assert found == SheetSettings(
        True, 6, 3, 2.0, True, 0.1, pytest.approx(0.1), True, (0, 2), None
    )
    assert (
        sheet_settings(from_pressure=200.0).reference_frame == 1
        and sheet_settings(METRES, from_pressure=0.2).reference_frame == 0
    )
    assert sheet_settings(from_pressure=20.0 * (1 + 9e-7)).reference_frame == 0
    assert sheet_settings(modes=1, symmetry="quarter").modes == 1
    assert sheet_settings(metric=3, metric_prior=0.2, misfit=0.1) == SheetSettings(
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
def test_bad_section_of_the_sheet_names_its_field(said, words):
    assert complaint(sheet_settings, **said).startswith(f"p.toml: bubble[0].{words}")


@pytest.mark.parametrize(
    "more",
    ['lense = "35 mm"', "lens = 35", 'lens = ""', 'lens = "35\\nmm"', 'lens = "%s"' % (301 * "m")],
)
def test_bad_correlation_section_names_its_field(camera_folder, more):
    said = complaint(read_camera_bubble, camera_folder, f"{more}\n")
    assert f"bubble[0].data.points.correlation.{more.split()[0]}" in said and "\n" not in said
