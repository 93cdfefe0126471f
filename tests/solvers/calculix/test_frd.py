"""solvers/calculix/frd.py: result files and printed tables; nothing partial passes for complete."""

import meshio
import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.project.project import read_project
from bubblefit.solvers.calculix.frd import FrdFile, PrintedFile

from ...builders.decks import cube_project, write_curve
from ...builders.frd_files import POINTS, QUADS, frd_frames, write_frd
from ...builders.projects import fit_setup
from ...support import needs
from ...support.refusals import complaint


@pytest.mark.parametrize(("flag", "digits"), [(1, 5e-6), (2, 1e-7), (3, 0)])
def test_fields_of_all_increments_come_back(tmp_path, flag, digits):
    given = frd_frames(3)
    file = FrdFile(write_frd(tmp_path / "job.frd", given, flag))
    np.testing.assert_array_equal(file.mesh.points, POINTS)
    assert [(kind, tuple(nodes)) for kind, nodes in file.mesh.elements] == [(9, q) for q in QUADS]
    for _ in range(2):  # frames can be read again
        found = list(file.frames())
        assert [(f.time, f.step, f.increment) for f in found] == [(1, 1, 7), (2, 2, 7), (3, 3, 7)]
        for frame, (_, u, state) in zip(found, given, strict=True):
            np.testing.assert_allclose(frame.fields["DISP"], u, rtol=digits)
            np.testing.assert_allclose(frame.fields["SDV"], state, rtol=digits)


@pytest.mark.parametrize("flag", [1, 3])
def test_truncated_file_is_refused(tmp_path, flag):
    whole = write_frd(tmp_path / "whole.frd", frd_frames(2), flag).read_bytes()
    assert len(list(FrdFile(tmp_path / "whole.frd").frames())) == 2
    part = tmp_path / "part.frd"
    # A prime stride meets every kind of place; the end mark byte by byte.
    for size in (*range(0, len(whole), 17), *range(len(whole) - 12, len(whole))):
        part.write_bytes(whole[:size])
        assert "part.frd" in complaint(lambda: list(FrdFile(part).frames()))


@pytest.mark.parametrize("flag", [1, 3])
def test_damaged_file_is_refused_or_read_as_finite_numbers(tmp_path, flag):
    whole = write_frd(tmp_path / "whole.frd", frd_frames(2), flag).read_bytes()
    random, part, refused = np.random.default_rng(1), tmp_path / "part.frd", 0
    for _ in range(400):
        bad = bytearray(whole)
        bad[random.integers(len(bad))] = random.integers(256)
        part.write_bytes(bad)
        try:
            for frame in FrdFile(part).frames():
                assert all(np.isfinite(v).all() for v in frame.fields.values())
        except InputError:
            refused += 1
    # A changed digit is a number like any other.
    assert refused > 20


def test_other_files_are_refused_as_no_result(tmp_path):
    for content in (b"", b"garbage\n", bytes(100)):
        (tmp_path / "job.frd").write_bytes(content)
        assert "not a CalculiX result file" in complaint(FrdFile, tmp_path / "job.frd")
    assert "No such file" in complaint(FrdFile, tmp_path / "none.frd")
    # Missing steps are no error.
    found = FrdFile(write_frd(tmp_path / "job.frd", frd_frames(4), 3, skip=(2,))).frames()
    assert [f.step for f in found] == [1, 3, 4]
    given = frd_frames(1)
    given[0][1][2, 1] = np.nan
    for flag in (1, 3):
        with pytest.raises(InputError, match="finite"):
            list(FrdFile(write_frd(tmp_path / "job.frd", given, flag)).frames())


def test_meshio_reads_the_written_files(tmp_path):
    given = frd_frames(3)
    mesh = meshio.read(write_frd(tmp_path / "job.frd", given, 3))
    (cells,) = mesh.cells
    assert (cells.type, cells.data.tolist()) == ("quad", [[0, 1, 2, 3], [1, 4, 5, 2]])
    np.testing.assert_array_equal(mesh.point_data["DISP"], given[2][1])
    assert mesh.field_data["time"] == [3.0]
    # Through to another format and back.
    meshio.write(tmp_path / "job.vtu", mesh)
    np.testing.assert_array_equal(meshio.read(tmp_path / "job.vtu").point_data["DISP"], given[2][1])
    with pytest.raises(InputError, match="truncated"):
        meshio.read(write_frd(tmp_path / "job.frd", frd_frames(1), 3, end=False))


TEXT = """
                        S T E P       1

 forces (fx,fy,fz) for set GRIP and time  0.5000000E+00

         5  1.000000E+00  2.000000E+00 -3.000000E+00
         7  1.500000E+00  0.000000E+00  4.000000E+00

 displacements (vx,vy,vz) for set ALL and time  0.5000000E+00

         2  0.000000E+00  1.000000-120  1.000000E-01
         5  0.000000E+00  0.000000E+00  2.000000E-01

 total force (fx,fy,fz) for set GRIP and time  0.5000000E+00

        2.500000E+00  2.000000E+00  1.000000E+00

 forces (fx,fy,fz) for set GRIP and time  0.1000000E+01

         5  2.000000E+00  4.000000E+00 -6.000000E+00
"""


def test_tables_of_sets_are_read_by_time(tmp_path):
    (tmp_path / "job.dat").write_text(TEXT)
    file = PrintedFile(tmp_path / "job.dat")
    assert file.mesh.numbers.tolist() == [2, 5, 7] and np.isnan(file.mesh.points).all()
    half, full = file.frames()
    assert (half.time, full.time) == (0.5, 1.0)
    assert half.fields["forces"][1:, 2].tolist() == [-3.0, 4.0]
    assert half.fields["displacements"][:2, 2].tolist() == [0.1, 0.2]
    assert half.fields["displacements"][0, 1] == 1e-120
    assert np.isnan(half.fields["forces"][0]).all() and [*full.fields] == ["forces"]


def test_forces_that_are_printed_are_those_of_the_frd_file(tmp_path):
    needs.calculix()
    loads = {}
    for result in ("job.frd", "job.dat"):
        folder = tmp_path / result
        folder.mkdir()
        write_curve(folder / "frame.csv")
        path = cube_project(
            folder,
            [('template = "frame.inp.j2"', f'template = "frame.inp.j2"\nresult = "{result}"')],
        )
        deck = folder / "frame.inp.j2"
        printed = "*NODE PRINT, NSET=GRIP\nU, RF\n*END STEP"
        deck.write_text(deck.read_text().replace("*END STEP", printed))
        problem = fit_setup(read_project(path)).problem()
        point = problem.evaluate(np.array([0.3, 0.08]), False)
        assert point is not None, problem.failure
        loads[result] = point.histories[0].load
    assert loads["job.dat"] == pytest.approx(loads["job.frd"], rel=1e-5)
