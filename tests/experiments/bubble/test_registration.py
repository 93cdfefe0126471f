"""experiments/bubble/registration.py: a test anywhere in view comes into its coordinates."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import bubblefit as bf
import numpy as np
import pytest
from bubblefit.experiments.bubble import KIND
from bubblefit.experiments.bubble.findings import registration_numbers
from bubblefit.experiments.bubble.placement import rotation_about_z
from bubblefit.experiments.bubble.point_files import PointFiles
from bubblefit.experiments.bubble.registration import (
    RegistrationOptions,
    clamp_radius,
    register,
    register_fields,
)
from bubblefit.experiments.bubble.section import CorrelationSection
from bubblefit.inference.reported import moduli_error
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel, default_increments
from bubblefit.meshes.disk import Outline, elliptic_disk_mesh
from bubblefit.meshes.sampling import Facet, SmoothReading
from bubblefit.readers.fields import DisplacementField, read_fields
from bubblefit.readers.frames import Frame, FrameOptions
from bubblefit.reports.kinds.bubble import CORRELATION_NAMES, correlation_table
from bubblefit.runs.law_setup import law_of
from bubblefit.solvers.membrane.solver import MembraneSolver
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from ...builders.bubbles import CIRCLE, TURN, in_camera, noisy, with_clamp
from ...builders.projects import replaced_once
from ...support.commands import in_process, result_in
from ...support.refusals import complaint, complaint_with
from .cases import (
    BUBBLE_FRAMES,
    CLAMP_RADIUS,
    FRAMES_BEYOND_CLAMP,
    PROJECT_FILTER,
    camera_grid,
    elliptic_frames,
    noisy_frames,
    orthotropic_shape,
    read_camera_bubble,
    rotation_by,
    seen_by_camera,
)


@settings(max_examples=5)
@given(
    warp=st.floats(-80, 80),
    tilt=st.floats(-25, 25),
    x=st.floats(-50, 50),
    y=st.floats(-50, 50),
    z=st.floats(-700, 700),
)
def test_test_anywhere_in_view_is_registered(warp, tilt, x, y, z):
    turn = rotation_by("zx", [warp, tilt])
    moved, found = register(
        [seen_by_camera(f, turn, (x, y, z)) for f in BUBBLE_FRAMES], (CLAMP_RADIUS, CLAMP_RADIUS)
    )
    for ours, true in zip(moved, BUBBLE_FRAMES, strict=True):
        # Warp and fill have no sense: a half turn is the same test.
        sense = np.sign(found.placement.axes[0] @ turn[:, 0])
        flip = np.array([sense, sense, 1.0])
        np.testing.assert_allclose(ours.points * flip, true.points, atol=0.1)
        np.testing.assert_allclose(ours.displacement * flip, true.displacement, atol=0.03)
    assert found.placement.tilt == pytest.approx(abs(tilt), abs=1e-6)
    np.testing.assert_allclose(found.placement.origin, (x, y, z), atol=0.02)
    assert found.plane_of == "edge" and found.warp is not None and found.rim is not None
    assert found.warp.error < 0.1 and found.rim.error < 0.01


def test_sheet_rising_away_from_the_camera_is_turned_not_mirrored():
    turn = rotation_by("x", 180.0)
    frames = [seen_by_camera(f, turn, (0.0, 0.0, 500.0)) for f in BUBBLE_FRAMES]
    moved, found = register(frames, (CLAMP_RADIUS, CLAMP_RADIUS), RegistrationOptions(warp=0.0))
    np.testing.assert_allclose(moved[-1].displacement, BUBBLE_FRAMES[-1].displacement, atol=0.02)
    assert found.placement.tilt == pytest.approx(180.0, abs=1e-6)
    assert np.linalg.det(found.placement.axes) == pytest.approx(1.0)


@pytest.mark.parametrize("angle", [3.0, 183.0])
def test_plane_of_the_camera_is_kept_where_the_sheet_is_inclined(angle):
    turn = rotation_by("x", angle)
    frames = [seen_by_camera(f, turn, (0.0, 0.0, 500.0)) for f in BUBBLE_FRAMES]
    options = RegistrationOptions(plane="camera", centre=(0.0, 0.0, 500.0), warp=0.0)
    moved, found = register(frames, (CLAMP_RADIUS, CLAMP_RADIUS), options)
    of_camera = np.diag([1.0, 1.0, 1.0] if angle < 90.0 else [1.0, -1.0, -1.0])
    np.testing.assert_allclose(found.placement.axes, of_camera, atol=1e-12)
    np.testing.assert_allclose(moved[-1].displacement, frames[-1].displacement @ of_camera)


def test_plane_is_that_of_the_clamp_and_its_motion_is_removed():
    """A sheet that bulges by 4 mm before the test does not tilt the plane; the clamp moves."""
    first = FRAMES_BEYOND_CLAMP[0].points.copy()
    x, y = first[:, :2].T / CLAMP_RADIUS
    first[:, 2] = np.clip(1 - x**2 - y**2, 0, None) * (4.0 + 2.0 * x)
    frames = []
    for k, frame in enumerate(FRAMES_BEYOND_CLAMP):
        after = first + frame.displacement
        moved = after @ rotation_by("xyz", [0.2 * k, -0.1 * k, 0.3 * k]).T + (
            0.5 * k,
            -0.2,
            0.7 * k,
        )
        frames.append(Frame(first, moved - first))
    registered, found = register(frames, (CLAMP_RADIUS, CLAMP_RADIUS))
    assert found.plane_of == "clamp" and found.placement.tilt < 1e-4
    for ours, true in zip(registered, FRAMES_BEYOND_CLAMP, strict=True):
        np.testing.assert_allclose(ours.displacement, true.displacement, atol=0.02)
    np.testing.assert_allclose(registered[0].points[:, 2], first[:, 2], atol=1e-3)
    shift = [float(np.linalg.norm(m.shift)) for m in found.motions]
    assert shift[0] == pytest.approx(0.2, abs=1e-6) and found.motions[2].point_count > 100
    # The vector of the turn by xyz angles of 0.4, -0.2 and 0.6 degrees.
    assert found.motions[2].angle == pytest.approx(
        np.degrees(Rotation.from_euler("xyz", [0.4, -0.2, 0.6], degrees=True).magnitude()), abs=1e-3
    )
    numbers = registration_numbers(found)
    assert numbers["plane"] == {"of": "clamp", "deviation_mm": found.flatness}
    assert numbers["centre"] == {"error_mm": found.rim.error}
    assert numbers["warp"] == {"error_degrees": found.warp.error, "clear": found.warp.clarity}
    turns = [motion.angle for motion in found.motions]
    told = {"removed": True, "shift_mm": pytest.approx(shift), "turn_degrees": turns}
    assert numbers["clamp_motion"] == told
    options = RegistrationOptions(remove_clamp_motion=False)
    left, found = register(frames, (CLAMP_RADIUS, CLAMP_RADIUS), options)
    assert np.abs(left[2].displacement - FRAMES_BEYOND_CLAMP[2].displacement).max() > 1.0
    assert found.motions[2].angle > 0.5
    assert not registration_numbers(found)["clamp_motion"]["removed"]


def test_given_plane_centre_and_axes_are_taken():
    """The marks lie along 30 degrees, beyond which the shape itself has its axes at 0."""
    marks = ((0.0, 0.0, 0.0), (np.cos(np.pi / 6), 0.5, 0.0))
    options = RegistrationOptions(plane="camera", centre=(3.0, -2.0, 0.0), warp_points=marks)
    moved, found = register(BUBBLE_FRAMES, (CLAMP_RADIUS, CLAMP_RADIUS), options)
    assert found.warp is None and found.rim is None and found.plane_of == "camera"
    assert found.warp_angle == pytest.approx(30.0)
    said = registration_numbers(found)
    assert (said["centre"], said["warp"]) == ("given", "given")
    expected = rotation_about_z(30.0).coordinates(BUBBLE_FRAMES[0].points - (3.0, -2.0, 0.0))
    np.testing.assert_allclose(moved[0].points, expected, atol=1e-9)
    both = complaint(RegistrationOptions, warp=1.0, warp_points=marks)
    assert "warp_points: expected an angle" in both and "not both" in both
    back = replace(options, warp_points=((1.0, 1.0, 0.0), (0.0, 2.0, 0.0)))
    assert register(BUBBLE_FRAMES, (CLAMP_RADIUS, CLAMP_RADIUS), back)[
        1
    ].warp_angle == pytest.approx(-45.0)
    one = replace(options, warp_points=(marks[0], marks[0]))
    assert "warp_points: expected two different points" in complaint(
        register, BUBBLE_FRAMES, (CLAMP_RADIUS, CLAMP_RADIUS), one
    )


def test_marks_are_in_the_axes_of_the_files_where_these_are_turned_over(tmp_path):
    turn, shift = rotation_by("zx", [30.0, 4.0]), np.array([7.0, 11.0, 500.0])
    frames = [seen_by_camera(frame, turn, shift) for frame in FRAMES_BEYOND_CLAMP]
    marks = np.vstack([shift, shift + 50.0 * turn[:, 0]])
    registrations = []
    for flip in ([1, 1, 1], [1, -1, -1]):
        files = [tmp_path / f"{frame}_{flip[1]}.csv" for frame in range(len(frames))]
        for file, frame in zip(files, frames, strict=True):
            table = np.hstack([frame.points * flip, frame.displacement * flip])
            np.savetxt(file, table, "%.9f", ",", header="x,y,z,dx,dy,dz", comments="")
        options = FrameOptions(camera_axes=flip[1] < 0)
        fields = read_fields(files, (0.02, 0.1, 0.2), options)
        centre, end = map(tuple, marks * flip)
        known = {"centre": centre}, {"warp_points": (centre, end)}, {"warp": 30.0}
        for options in (RegistrationOptions(**keys) for keys in known):
            registrations.append(register_fields(fields, CIRCLE, options)[1])
    for found in registrations:
        assert found.warp_angle == pytest.approx(30.0, abs=0.2)
        np.testing.assert_allclose(found.placement.origin, shift, atol=0.1)


@pytest.mark.parametrize("sigma", [0.0, 0.01])
def test_sheet_that_rises_alike_all_around_has_the_axes_of_its_plane(sigma):
    frames = [orthotropic_shape(camera_grid(5.0), rise) for rise in (8.0, 20.0, 30.0)]
    for frame in frames:
        x, y = frame.points[:, :2].T / CLAMP_RADIUS
        frame.displacement[:, 2] = frame.displacement[:, 2].max() * (1 - x**2 - y**2)
    frames = noisy_frames(frames, sigma, np.random.default_rng(2))
    seen = [seen_by_camera(f, rotation_by("z", 17.5), (0.0, 0.0, 0.0)) for f in frames]
    options = RegistrationOptions(centre=(0.0, 0.0, 0.0))
    _, found = register(seen, (CLAMP_RADIUS, CLAMP_RADIUS), options)
    assert found.warp_angle == pytest.approx(17.5, abs=0.1) and found.warp.error < 0.5


def test_registration_errors_reflect_noise():
    """Over eight draws of noise, the errors said are those made, within a factor of two."""
    rng, made, said = np.random.default_rng(4), [], []
    frames = [orthotropic_shape(camera_grid(7.0), rise) for rise in (8.0, 20.0, 30.0)]
    for _ in range(8):
        found = register(noisy_frames(frames, 0.05, rng), (CLAMP_RADIUS, CLAMP_RADIUS))[1]
        made.append((found.warp_angle, np.linalg.norm(found.placement.origin[:2])))
        said.append((found.warp.error, found.rim.error))
    ratio = np.mean(said, axis=0) / np.sqrt(np.mean(np.square(made), axis=0))
    assert ((0.5 < ratio) & (ratio < 2.0)).all(), ratio


def test_undetermined_registration_asks_for_input():
    points = camera_grid()
    on = np.clip(1 - (points[:, :2] ** 2).sum(axis=1) / CLAMP_RADIUS**2, 0.0, None)
    moved = np.stack([on * points[:, 0] * 0.02, on * points[:, 1] * 0.02, 10.0 * on], axis=1)
    alike = [Frame(points, moved * [1, 1, rise]) for rise in (1, 2, 3)]
    half = [
        Frame(f.points[f.points[:, 0] > 0], f.displacement[f.points[:, 0] > 0])
        for f in BUBBLE_FRAMES
    ]
    noise = noisy_frames(BUBBLE_FRAMES, 0.3, np.random.default_rng(1))
    both = {"rim_angle": 0.0, "centre": (0, 0, 0)}
    for frames, radii, options, words in (
        (
            noisy_frames(alike, 0.02, np.random.default_rng(1)),
            (CLAMP_RADIUS, CLAMP_RADIUS),
            {},
            "give the angle",
        ),
        (half, (CLAMP_RADIUS, CLAMP_RADIUS), {}, "directions only; give the centre"),
        (BUBBLE_FRAMES, (5.0, 5.0), {}, "expected at least 48 points on the disk, got 1;"),
        ([Frame(points, 0 * points)], (CLAMP_RADIUS, CLAMP_RADIUS), {}, "nothing moves"),
        (
            BUBBLE_FRAMES,
            (CLAMP_RADIUS, CLAMP_RADIUS),
            {"plane": "clamp"},
            "too few points beyond the rim",
        ),
        (noise, (100.0, 99.9), {"rim_angle": 0.0}, "too round to tell the warp"),
        (elliptic_frames(0.0), (100.0, 70.0), both, "expected the warp, too"),
    ):
        assert words in complaint(register, frames, radii, RegistrationOptions(**options))


@pytest.mark.parametrize(("reach", "within"), [(1.0, 0.05), (1.25, 0.6)])
def test_direction_of_an_elliptic_rim_gives_the_warp(reach, within):
    """Its major axis lies 25 degrees from the warp, and the camera sees the warp at 40."""
    frames = elliptic_frames(25.0, reach)
    turn = rotation_by("zx", [40.0, 5.0])
    options = RegistrationOptions(rim_angle=25.0)
    seen_frames = [seen_by_camera(f, turn, (6.0, -4.0, 500.0)) for f in frames]
    moved, found = register(seen_frames, (100.0, 70.0), options)
    sense = np.sign(found.placement.axes[0] @ turn[:, 0])
    flip = np.array([sense, sense, 1.0])
    np.testing.assert_allclose(moved[-1].points * flip, frames[-1].points, atol=within)
    assert found.warp is not None and found.rim is not None and found.warp.clarity is None
    assert found.plane_of == ("edge" if reach == 1.0 else "clamp")
    assert found.rim.angle == pytest.approx(25.0, abs=0.02)
    across, _ = register(seen_frames, (70.0, 100.0), RegistrationOptions(rim_angle=115.0))
    np.testing.assert_allclose(across[-1].points * flip, frames[-1].points, atol=within)
    fields = [
        DisplacementField(0.1 * k, f.points[:, :2], f.displacement, z=f.points[:, 2])
        for k, f in enumerate(seen_frames, start=1)
    ]
    of_fields, registration = register_fields(fields, Outline(100.0, 70.0, 25.0))
    np.testing.assert_array_equal(of_fields[-1].points, moved[-1].points[:, :2])
    assert registration.warp_angle == found.warp_angle
    # Given: by the angle, or by two marks on the fabric.
    marks = tuple(tuple(p) for p in np.array([[0.0, 0, 0], [30, 0, 0]]) @ turn.T)
    for known in ({"warp": found.warp_angle}, {"warp_points": marks}):
        fixed = register(seen_frames, (100.0, 70.0), RegistrationOptions(rim_angle=25.0, **known))
        np.testing.assert_allclose(fixed[0][-1].points * flip, frames[-1].points, atol=within)
        assert fixed[1].warp is None


@pytest.mark.parametrize("off", [0.0, 2.0])
def test_radius_of_the_clamp_needs_no_first_guess(clean_bubble, off):
    """Within 0.3 % of the true one, which changes moduli by some 1 %; in camera coordinates too."""
    fields = noisy(with_clamp(clean_bubble), 0.02)
    radius, edge = clamp_radius(in_camera(TURN("z", 0.0), (off, 0.0, 0.0))(fields))
    assert radius == pytest.approx(100.0, rel=3e-3) and edge.still_count > 200
    seen = in_camera(TURN("x", 12.0), (30.0, 20.0, 500.0))(fields)
    assert clamp_radius(seen, RegistrationOptions())[0] == pytest.approx(radius, rel=1e-4)
    # A release ends at a low pressure, where nothing but the noise moves.
    low = replace(fields[0], pressure=1e-4, displacement=0.01 * fields[0].displacement)
    released = in_camera(TURN("x", 12.0), (30.0, 20.0, 500.0))((*fields, *noisy([low], 0.02)))
    assert clamp_radius(released, RegistrationOptions())[0] == pytest.approx(radius, rel=1e-3)
    # Points of the clamp just beyond the rim, on one side, do not draw its centre there.
    near = np.hypot(*fields[0].points.T) > 100.0
    kept = ~near | (fields[0].points[:, 1] < 0.0) | (np.hypot(*fields[0].points.T) > 102.0)
    some = tuple(
        replace(f, points=f.points[kept], z=f.z[kept], displacement=f.displacement[kept])
        for f in fields
    )
    seen = in_camera(TURN("z", 0.0), (3.0, -4.0, 600.0))(some)
    _, found = register_fields(seen, CIRCLE, RegistrationOptions())
    assert np.abs(found.rim.error) < 0.05
    assert found.placement.origin[:2] == pytest.approx((3.0, -4.0), abs=0.1)
    complaint_with(["radius", "stand still"], clamp_radius, clean_bubble)


OUTLINE = Outline(120.0, 80.0, 30.0)
KILO = [40, 120, 250]
LAW_ELLIPTIC_FIT = HypoelasticLaw.linear(700.0, 300.0, 15.0)
OVAL = replaced_once(
    PROJECT_FILTER,
    ("[0.02, 0.3]", "[0.002, 0.1]"),
    ("radius = 100.0", "ellipse = { major = 120, minor = 80, angle = 30 }"),
    ("[30, 120]", "[40, 120, 250]"),
    ("108\nSYMMETRY", "112"),
    ('"a.csv", "b.csv"]', '"0.csv", "1.csv", "2.csv"]\ncolumns = { z = "z" }'),
    ("FILTER", "[bubble.data.points.registration]"),
)


@pytest.fixture(scope="module")
def elliptic_folder(tmp_path_factory):
    """A test on the mesh of the fit, seen by a camera whose x is 20 degrees from the warp."""
    place = tmp_path_factory.mktemp("oval")
    mesh = elliptic_disk_mesh(OUTLINE, 112)
    pressures = [1e-3 * p for p in KILO]
    model = BubbleModel(mesh, 0.8, pressures, default_increments(pressures))
    turn = Rotation.from_euler("z", 20.0, degrees=True).as_matrix().T
    line = np.linspace(-1, 1, 25)
    points = np.stack([axis.ravel() for axis in np.meshgrid(line, line)], axis=1)
    points = OUTLINE.places(points[np.hypot(*points.T) < 0.98])
    sample, inside = SmoothReading.of(mesh).matrix(points)
    places = np.column_stack([points[inside], np.zeros(inside.sum())]) @ turn + [2.0, -3.0, 600.0]
    for k, moved in enumerate(MembraneSolver().run(model, LAW_ELLIPTIC_FIT).displacement):
        table = np.hstack([places, (sample @ moved) @ turn])
        np.savetxt(place / f"{k}.csv", table, "%.7f", ",", header="x,y,z,dx,dy,dz", comments="")
    (place / "project.toml").write_text(OVAL)
    return place


def test_elliptic_bubble_seen_by_a_turned_camera_gives_its_moduli(elliptic_folder):
    in_process(
        "bubble",
        elliptic_folder / "project.toml",
        "--out",
        elliptic_folder / "out",
        cwd=elliptic_folder,
    )
    result = result_in(elliptic_folder / "out")
    law = bf.read_card(elliptic_folder / "out" / "material.toml").law
    # The turn of the rim is told to a few tenths of a degree; G12 feels it.
    for name, modulus, within in (("E1", 700.0, 0.01), ("E2", 300.0, 0.01), ("G12", 15.0, 0.06)):
        assert float(law.modulus(name, 0.02)) == pytest.approx(modulus, rel=within), name
    assert result["registration"]["warp_degrees"] == pytest.approx(20.0, abs=0.6)
    assert result["registration"]["warp"]["clear"] is None


ONE_START = ("--starts", 1, "--jobs", 1)
SHIFT = np.array([3.0, -4.0, 600.0])
#: kPa.
SHOWN = [22, 59, 97, 132, 186, 251, 300]
REGISTRATION = "[bubble.data.points.registration]\n"


def project_of_registered_fit(seen, name: str, more: str = ""):
    folder, text, _ = seen
    path = folder / f"{name}.toml"
    path.write_text(text.replace(REGISTRATION, REGISTRATION + more))
    return path


def test_registered_fit_has_the_moduli_of_the_sheet(camera_folder):
    folder, _, known = camera_folder
    path, out = project_of_registered_fit(camera_folder, "found"), folder / "out"
    done = in_process("bubble", path, *ONE_START, "--out", out, cwd=folder)
    result = result_in(out)
    law = bf.read_card(out / "material.toml").law
    errors = moduli_error(law, known, np.array(list(result["strain_reached"].values())))
    assert max(errors.values()) < 0.01, errors
    said = result["registration"]
    assert said["warp_degrees"] == pytest.approx(12.0, abs=0.06)
    assert said["tilt_degrees"] == pytest.approx(3.0, abs=1e-3)
    np.testing.assert_allclose(said["origin_mm"], SHIFT, atol=0.02)
    page = (out / "report.html").read_text()
    for words in (
        "registration.png", "found by symmetry", "Frames taken", "clock.png", "5.00 s, given",
        '<td>camera</td><td class="text">two of 5 &lt;MP&gt;</td>',
        '<td>lens and aperture</td><td class="text">not given</td>',
        '<td>coordinates</td><td class="text">registered on the rim</td>',
        f'<td>images evaluated</td><td class="text">{len(SHOWN)}</td>',
    ):  # fmt: skip
        assert words in page, words
    taken = result["data"]["pressures"]["taken"]
    assert [one["pressure_kPa"] for one in taken] == pytest.approx(SHOWN)
    assert [one["frame"].split("_")[1][0] for one in taken] == [*"0123456"]
    assert "valve.csv: 7 of 7 frames taken" in done.output and "5.00 s, given" in done.output
    assert (out / "registration.png").stat().st_size > 20_000


def test_changed_registration_is_another_fit(camera_folder):
    marks = [
        bf.read_project(project_of_registered_fit(camera_folder, "a", more))
        .tests["bubble"]
        .settings()
        for more in ("", "warp = 12.0\n", 'warp_is = "soft"\n')
    ]
    assert len({str(mark) for mark in marks}) == 3


@pytest.mark.parametrize(
    ("more", "key"),
    [
        ("warp = 1.0\nwarp_points = [[0, 0, 0], [1, 0, 0]]", ".warp_points"),
        ("warp_points = [[1, 0, 0], [1, 0, 0]]", ".warp_points"),
        ('plane = "floor"', ".plane"),
        ("warp = 400.0", ".warp"), ("centre = [1.0, 2.0]", ".centre"),
        ("centre = [500.0, 0.0, 600.0]\nplane = 'clamp'", ""),
    ],
)  # fmt: skip
def test_bad_registration_settings_name_their_field(camera_folder, more, key):
    def prepare():
        project = bf.read_project(project_of_registered_fit(camera_folder, "bad", f"{more}\n"))
        test = project.tests["bubble"]
        KIND.prepare(test, law_of(project, [test.reach]), MembraneSolver)

    assert f"bubble[0].data.points.registration{key}" in complaint(prepare)


def registration_page(
    correlation: dict[str, str], facet: Facet | None = None, **more: Any
) -> dict[str, str]:
    usual = {"name": "one", "noise": None, "match_by": "points", "match_degree": 4}
    data = PointFiles((), None, correlation=correlation)
    test = SimpleNamespace(**(usual | {"data": data, "facet": facet} | more))
    field = SimpleNamespace(source=SimpleNamespace(format="matchid"), points=range(7))
    prepared: Any = SimpleNamespace(test=test, fields=[field], dropped_count=2, registration=None)
    (table,) = correlation_table(prepared)
    assert table.title == "Image correlation: one"
    return {str(name): str(words) for name, words in table.rows}


def test_page_says_which_camera_settings_are_missing():
    rows = registration_page({})
    unknown = [name for name, words in rows.items() if words == "not given"]
    assert unknown == ["noise floor of a displacement", *CORRELATION_NAMES.values()]
    assert rows["software and format of the export"] == "matchid"
    assert rows["points in an image"] == "7 to 7" and rows["points left out as doubtful"] == "2"
    assert registration_page({}, noise=0.0123)["noise floor of a displacement"] == "0.0123 mm"
    assert "degree 4" in registration_page({}, match_by="surfaces")["smoothing"]
    # The filter gives subset and step where nobody else does.
    for own, facet, subset, step in (
        ({}, Facet(4.0, 1, 3, 1.5), "4 mm", "1.5 mm"), ({}, Facet(4.0), "4 mm", "not given"),
        ({"subset": "19 pixels"}, Facet(4.0, 1, 3, 1.5), "19 pixels", "1.5 mm"),
    ):  # fmt: skip
        rows = registration_page(own, facet)
        assert (rows["subset size"], rows["step size"]) == (subset, step)


def test_page_lists_the_keys_of_the_correlation_section(camera_folder):
    keys = list(CorrelationSection.model_fields)
    assert set(keys) == {"software", *CORRELATION_NAMES}
    said = {key: f"the {key}, 3 mm" for key in keys}
    lines = "".join(f'{key} = "{words}"\n' for key, words in said.items())
    ((test,), (plain,)) = (
        read_camera_bubble(camera_folder, more).tests.values() for more in (lines, "")
    )
    # Words change no result.
    assert test.data.correlation == said and test.settings() == plain.settings()
    rows = registration_page(test.data.correlation)
    assert {key: rows[name] for key, name in CORRELATION_NAMES.items()} == {
        key: said[key] for key in CORRELATION_NAMES
    }
    assert rows["software and format of the export"] == "the software, 3 mm; matchid"
