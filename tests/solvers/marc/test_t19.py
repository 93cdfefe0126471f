"""Marc's post and status files: six digits, and nothing partial taken for whole."""

import sys

import meshio
import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.cylinder_model import inflated_cylinder
from bubblefit.meshes.disk import disk_mesh
from bubblefit.solvers.marc.analyses import bubble_deck, cylinder_deck
from bubblefit.solvers.marc.ending import exit_number, increments, repeated
from bubblefit.solvers.marc.settings import MarcSettings
from bubblefit.solvers.marc.t19 import T19File
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from ...marc_stand_in.files import sts_text, t19_text
from ...support import needs
from ...support.commands import output_of
from ...support.refusals import complaint, raised, refused

POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [2, 1, 0.5]], float)
QUADS = np.array([[0, 1, 2, 3], [1, 4, 5, 2]])
#: Six digits: half a unit in the last of them.
ROUNDING = 5.1e-6


def frames(count=3):
    random = np.random.default_rng(5)
    return [
        (float(i), {"Displacement": random.normal(size=(6, 3)),
                    "Reaction Force": 1e3 * random.normal(size=(6, 3))})
        for i in range(count)
    ]  # fmt: skip


def written(path, *arguments, **options):
    path.write_text(t19_text(POINTS, QUADS, *arguments, **options))
    return path


def test_every_frame_comes_back_to_six_digits(tmp_path):
    given = frames()
    file = T19File(written(tmp_path / "job.t19", given))
    np.testing.assert_array_equal(file.mesh.numbers, range(1, 7))
    np.testing.assert_allclose(file.mesh.points, POINTS)
    assert [kind for kind, _ in file.mesh.elements] == [139, 139]
    np.testing.assert_array_equal(np.array([n for _, n in file.mesh.elements]), QUADS + 1)
    for _ in range(2):  # and again
        found = list(file.frames())
        assert [(f.increment, f.time) for f in found] == [(0, 0.0), (1, 1.0), (2, 2.0)]
        for frame, (_, fields) in zip(found, given, strict=True):
            assert frame.fields.keys() == fields.keys()
            for name, values in fields.items():
                np.testing.assert_allclose(frame.fields[name], values, rtol=ROUNDING)


def test_meshio_reads_mesh_and_last_frame(tmp_path):
    given = frames()
    path = written(tmp_path / "job.t19", given)
    mesh = meshio.read(path)
    np.testing.assert_array_equal(mesh.cells_dict["quad"], QUADS)
    assert mesh.field_data["time"][0] == 2.0 and mesh.field_data["increment"][0] == 2
    last = given[-1][1]["Displacement"]
    np.testing.assert_allclose(mesh.point_data["Displacement"], last, rtol=ROUNDING)
    code = f"import bubblefit, meshio; print(len(meshio.read({str(path)!r}).points))"
    assert output_of(sys.executable, "-c", code).strip() == "6"
    assert "of type 999" in complaint(meshio.read, written(path, given, element=999))


NUMBERS = st.floats(-1e120, 1e120, allow_nan=False).map(lambda x: 0.0 if abs(x) < 1e-120 else x)


@settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    values=arrays(float, (6, 3), elements=NUMBERS),
    time=st.floats(0, 1e4, allow_subnormal=False),
    scalar=st.booleans(),
)
def test_any_numbers_come_back(tmp_path, values, time, scalar):
    field = values[:, :1] if scalar else values
    path = written(tmp_path / "job.t19", [(0.0, {}), (time, {"Displacement": field})])
    empty, frame = T19File(path).frames()
    assert not empty.fields
    assert frame.time == pytest.approx(time, rel=ROUNDING, abs=1e-99)
    np.testing.assert_allclose(frame.fields["Displacement"], field, rtol=ROUNDING)


def test_older_files_have_no_count_before_the_time(tmp_path):
    lines = t19_text(POINTS, QUADS, frames()).replace("51801", "51800").splitlines()
    at = [i for i, line in enumerate(lines) if line.startswith("=beg=51800")]
    # Six numbers, and no count.
    for i in reversed(at):
        del lines[i + 3 : i + 6]
        del lines[i + 1]
    path = tmp_path / "job.t19"
    path.write_text("\n".join(lines) + "\n")
    assert [f.time for f in T19File(path).frames()] == [0.0, 1.0, 2.0]


def test_a_vector_that_is_only_announced_has_no_data(tmp_path):
    lines = t19_text(POINTS, QUADS, frames(1)).splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith("Reaction Force"))
    lines[at + 2] = lines[at + 2].replace("-1", " 0", 1)
    del lines[at + 3 : at + 6]
    path = tmp_path / "job.t19"
    path.write_text("\n".join(lines) + "\n")
    (frame,) = T19File(path).frames()
    assert list(frame.fields) == ["Displacement"]


def read(path):
    return [frame.fields for frame in T19File(path).frames()]


def test_every_truncation_is_refused(tmp_path):
    whole = t19_text(POINTS, QUADS, frames(2)).encode()
    path = tmp_path / "job.t19"
    for size in (*range(0, len(whole), 11), *range(len(whole) - 200, len(whole))):
        path.write_bytes(whole[:size])
        refused(read, path)
    path.write_bytes(whole.replace(b"\n", b"  \r\n"))  # lines end as on Windows
    assert len(read(path)) == 2


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        (" 0.100000E+01", " 0.1O0000E+01", "could not convert"),
        (" 0.100000E+01", "          NaN", "not a finite number"),
        (" 0.100000E+01", "*************", "could not convert"),
        ("            6            2", "            7            2", "nodes|line"),
        ("----", "++++", "without its end"),
        ("=beg=52401", "=bog=52401", "beginning of a block"),
        ("Verification Data)\n            0            0            0            1            2",
         "Verification Data)\n            1            0            0            1            2",
         "new mesh"),
    ],
)  # fmt: skip
def test_what_is_damaged_is_named(tmp_path, old, new, match):
    text = t19_text(POINTS, QUADS, [(1.0, {"Displacement": np.ones((6, 3))})])
    assert old in text
    path = tmp_path / "job.t19"
    path.write_text(text.replace(old, new, 1))
    assert str(path) in str(raised(InputError, match, read, path))
    assert "cannot be read" in complaint(T19File, tmp_path / "none.t19")


@settings(
    max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.binary(max_size=300), where=st.integers(0, 3000), start=st.booleans())
def test_garbage_is_refused_or_read_and_never_more(tmp_path, data, where, start):
    whole = t19_text(POINTS, QUADS, frames(1)).encode()
    where = min(where, len(whole))
    path = tmp_path / "job.t19"
    path.write_bytes(data if start else whole[:where] + data + whole[where:])
    try:
        read(path)
    except InputError as error:
        assert str(path) in str(error)


# .sts


def test_increments_as_they_appear(tmp_path):
    text, path = sts_text([0.5, 1.0, 1.5], increments=[1, 2, 2]), tmp_path / "job.sts"
    assert increments(path) == []
    seen = []
    for size in range(0, len(text) + 1, 7):
        path.write_text(text[:size])
        now = increments(path)
        assert now[: len(seen)] == seen, "half a line was taken for one"
        seen = now
    path.write_text(text)
    assert [(i.increment, i.time) for i in increments(path)] == [(1, 0.5), (2, 1.0), (2, 1.5)]
    assert sum(i.iterations for i in increments(path)) == 9 and repeated(increments(path)) == 1


@pytest.mark.parametrize(
    "line",
    [" Job ends with exit number :    3004", "          job ends with exit number     3004",
     "Exit number 3004"],
)  # fmt: skip
def test_exit_numbers_in_every_spelling(tmp_path, line):
    (tmp_path / "job.sts").write_text(f"exit number 1\n{line}\n")
    assert exit_number(tmp_path / "none", tmp_path / "job.sts") == 3004
    assert exit_number(tmp_path / "none") is None


@given(st.binary(max_size=400))
@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_garbage_is_no_status(tmp_path, data):
    path = tmp_path / "job.sts"
    path.write_bytes(data)
    increments(path)
    exit_number(path)


@pytest.fixture
def other():
    return needs.library("meshioplusplus")


LAW = HypoelasticLaw.linear(800.0, 400.0, 60.0)


@pytest.mark.parametrize("kind", ["bubble", "cylinder"])
def test_decks_by_another_reader(tmp_path, other, kind):
    if kind == "bubble":
        mesh = disk_mesh(100.0, 48, "quarter")
        deck = bubble_deck(BubbleModel(mesh, 0.81, (0.01, 0.03)), LAW, MarcSettings())
        names = ["rim", "symmetry_x", "symmetry_y"]
    else:
        model = inflated_cylinder(200.0, 0.1, 0.81, 80.0, deflections=[20.0])
        mesh, names = model.mesh, ["symmetry_x", "symmetry_z", "support_bottom"]
        deck = cylinder_deck(model, LAW, MarcSettings(), np.zeros_like(mesh.points))
    path = tmp_path / "job.dat"
    path.write_text(deck)
    found = other.read(str(path))
    np.testing.assert_allclose(found.points, mesh.points, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(found.cells[0].data, mesh.quads)
    sets = {region.name: np.sort(np.ravel(region.entries)) for region in found.regions}
    for name in names:
        np.testing.assert_array_equal(sets[name], mesh.node_sets[name])
    np.testing.assert_array_equal(sets["fabric"], range(len(mesh.quads)))


def test_post_files_by_another_reader(tmp_path, other):
    random = np.random.default_rng(0)
    points, quads = random.normal(size=(40, 3)), np.arange(36).reshape(9, 4)
    moved = random.normal(size=(40, 3))
    path = tmp_path / "job.t19"
    path.write_text(t19_text(points, quads, [(2.5, {"Displacement": moved})]))
    found, ours = other.read(str(path)), T19File(path)
    (frame,) = ours.frames()
    np.testing.assert_array_equal(found.points, ours.mesh.points)
    np.testing.assert_array_equal(found.point_data["Displacement"], frame.fields["Displacement"])
    assert found.field_data["meshio:time"][0] == frame.time == 2.5
