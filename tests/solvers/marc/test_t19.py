"""solvers/marc/t19.py: post files to six digits, nothing partial taken for complete."""

import sys

import meshio
import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.solvers.marc.t19 import T19File
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from ...marc_stand_in.files import t19_text
from ...support.commands import output_of
from ...support.refusals import complaint, raised, refused

POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [2, 1, 0.5]], float)
QUADS = np.array([[0, 1, 2, 3], [1, 4, 5, 2]])
#: Six digits: half a unit in the last of them.
ROUNDING = 5.1e-6


def random_frames(count=3):
    random = np.random.default_rng(5)
    return [
        (float(i), {"Displacement": random.normal(size=(6, 3)),
                    "Reaction Force": 1e3 * random.normal(size=(6, 3))})
        for i in range(count)
    ]  # fmt: skip


def written_post_file(path, *arguments, **options):
    path.write_text(t19_text(POINTS, QUADS, *arguments, **options))
    return path


def test_frames_come_back_to_six_digits(tmp_path):
    given = random_frames()
    file = T19File(written_post_file(tmp_path / "job.t19", given))
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
    given = random_frames()
    path = written_post_file(tmp_path / "job.t19", given)
    mesh = meshio.read(path)
    np.testing.assert_array_equal(mesh.cells_dict["quad"], QUADS)
    assert mesh.field_data["time"][0] == 2.0 and mesh.field_data["increment"][0] == 2
    last = given[-1][1]["Displacement"]
    np.testing.assert_allclose(mesh.point_data["Displacement"], last, rtol=ROUNDING)
    code = f"import bubblefit, meshio; print(len(meshio.read({str(path)!r}).points))"
    assert output_of(sys.executable, "-c", code).strip() == "6"
    assert "of type 999" in complaint(meshio.read, written_post_file(path, given, element=999))


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
    path = written_post_file(tmp_path / "job.t19", [(0.0, {}), (time, {"Displacement": field})])
    empty, frame = T19File(path).frames()
    assert not empty.fields
    assert frame.time == pytest.approx(time, rel=ROUNDING, abs=1e-99)
    np.testing.assert_allclose(frame.fields["Displacement"], field, rtol=ROUNDING)


def test_older_files_have_no_count_before_the_time(tmp_path):
    lines = t19_text(POINTS, QUADS, random_frames()).replace("51801", "51800").splitlines()
    at = [i for i, line in enumerate(lines) if line.startswith("=beg=51800")]
    # Six numbers, and no count.
    for i in reversed(at):
        del lines[i + 3 : i + 6]
        del lines[i + 1]
    path = tmp_path / "job.t19"
    path.write_text("\n".join(lines) + "\n")
    assert [f.time for f in T19File(path).frames()] == [0.0, 1.0, 2.0]


def test_announced_vector_without_data_is_absent(tmp_path):
    lines = t19_text(POINTS, QUADS, random_frames(1)).splitlines()
    at = next(i for i, line in enumerate(lines) if line.startswith("Reaction Force"))
    lines[at + 2] = lines[at + 2].replace("-1", " 0", 1)
    del lines[at + 3 : at + 6]
    path = tmp_path / "job.t19"
    path.write_text("\n".join(lines) + "\n")
    (frame,) = T19File(path).frames()
    assert list(frame.fields) == ["Displacement"]


def read_post_file(path):
    return [frame.fields for frame in T19File(path).frames()]


def test_truncated_file_is_refused(tmp_path):
    whole = t19_text(POINTS, QUADS, random_frames(2)).encode()
    path = tmp_path / "job.t19"
    for size in (*range(0, len(whole), 11), *range(len(whole) - 200, len(whole))):
        path.write_bytes(whole[:size])
        refused(read_post_file, path)
    path.write_bytes(whole.replace(b"\n", b"  \r\n"))  # lines end as on Windows
    assert len(read_post_file(path)) == 2


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
def test_damage_is_named(tmp_path, old, new, match):
    text = t19_text(POINTS, QUADS, [(1.0, {"Displacement": np.ones((6, 3))})])
    assert old in text
    path = tmp_path / "job.t19"
    path.write_text(text.replace(old, new, 1))
    assert str(path) in str(raised(InputError, match, read_post_file, path))
    assert "cannot be read" in complaint(T19File, tmp_path / "none.t19")


@settings(
    max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(data=st.binary(max_size=300), where=st.integers(0, 3000), start=st.booleans())
def test_garbage_is_refused_or_read(tmp_path, data, where, start):
    whole = t19_text(POINTS, QUADS, random_frames(1)).encode()
    where = min(where, len(whole))
    path = tmp_path / "job.t19"
    path.write_bytes(data if start else whole[:where] + data + whole[where:])
    try:
        read_post_file(path)
    except InputError as error:
        assert str(path) in str(error)
