"""Field: exports that people ask about, each read as it is meant or refused with what to do.

Sources: issues of DICe (names of columns by version), muDIC (positions of the deformed picture, in
pixels), DuoDIC and MultiDIC (structs of their own), and logs of pressure sensors with short names.
"""

import bubblefit as bf
import numpy as np
import pytest
import scipy
from bubblefit.errors import InputError
from bubblefit.readers.fields import fields_of_frames
from bubblefit.readers.frames import FrameOptions, read_frames
from bubblefit.readers.machine_tables import TableOptions, read_machine_table

from ..builders.biaxial_tests import biaxial_project, biaxial_rows, write_biaxial_rows
from .test_biaxial_mistakes import LAW

PLACES = np.array([[10.0, 10.0], [50.0, 10.0], [10.0, 50.0], [50.0, 50.0]])


@pytest.mark.parametrize("plural", ["COORDINATES", "COORDINATE"])
def test_coordinates_of_dice_are_read_in_singular_and_plural(tmp_path, plural):
    path = tmp_path / "DICe_solution_01.txt"
    places = ",".join(f"MODEL_{plural}_{axis}" for axis in "XYZ")
    moved = ",".join(f"MODEL_DISPLACEMENT_{axis}" for axis in "XYZ")
    rows = [f"{k},{x},{y},0.5,0,4,{x},{y},1.0,0.1,0.2,0.3" for k, (x, y) in enumerate(PLACES)]
    head = f"SUBSET_ID,COORDINATE_X,COORDINATE_Y,SIGMA,STATUS_FLAG,MATCH,{places},{moved}"
    path.write_text("\n".join([head, *rows]) + "\n")
    (frame,) = read_frames([path], FrameOptions(camera_axes=False))
    assert frame.points[:, :2] == pytest.approx(PLACES)
    assert frame.displacement == pytest.approx(np.tile([0.1, 0.2, 0.3], (4, 1)))


def write_mudic(folder):
    moved = 0.25 * PLACES
    rows = [
        f"{k},{x + u},{y + v},{u},{v},0.2"
        for k, ((x, y), (u, v)) in enumerate(zip(PLACES, moved, strict=True))
    ]
    path = folder / "mudic.csv"
    path.write_text("\n".join(["d,x,y,ux,uy,true_strain_xx", *rows]) + "\n")
    return path, moved


def test_fields_of_mudic_are_refused_as_pixels(tmp_path):
    path, _ = write_mudic(tmp_path)
    with pytest.raises(InputError, match=r"of muDIC, which writes pixels.*the mm of a pixel"):
        read_frames([path], FrameOptions(planar=True))


def test_positions_of_mudic_are_those_of_the_deformed_picture(tmp_path):
    path, moved = write_mudic(tmp_path)
    columns = {"x": "x", "y": "y", "dx": "ux", "dy": "uy"}
    (frame,) = read_frames([path], FrameOptions(columns=columns, planar=True))
    assert frame.points[:, :2] == pytest.approx(PLACES)
    assert frame.displacement[:, :2] == pytest.approx(moved)
    strain = (frame.displacement[1, 0] - frame.displacement[0, 0]) / 40.0
    assert strain == pytest.approx(0.25)


def test_frame_without_values_says_to_leave_it_out(tmp_path):
    path = tmp_path / "frame.csv"
    path.write_text("x,y,z,dx,dy,dz\n" + "1.0,2.0,0.0,NaN,NaN,NaN\n" * 3)
    frames = read_frames([path])
    with pytest.raises(InputError, match=r"leave this frame and its pressure out"):
        fields_of_frames(frames, [0.1])


def test_short_names_of_a_log_are_found(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t [s],p [kPa]\n0,0\n1,10\n2,20\n")
    options = TableOptions(columns={"pressure": "p"}, quantities=("time", "pressure"))
    table = read_machine_table(path, options)
    assert table.column("time") == "t [s]"


def test_missing_time_of_a_log_is_named(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("n,p [kPa]\n0,0\n1,10\n2,20\n")
    options = TableOptions(columns={"pressure": "p"}, quantities=("time", "pressure"))
    with pytest.raises(InputError, match=r"no column of time in the header row; .* has: n, p"):
        read_machine_table(path, options)


def test_mat_file_of_an_unknown_program_is_named_with_its_variables(tmp_path):
    path = tmp_path / "own.mat"
    scipy.io.savemat(path, {"MyStruct": {"a": np.ones(3)}, "other": 1.0})
    with pytest.raises(InputError, match=r"MAT-file of no program .*, with: MyStruct, other"):
        read_frames([path])


def test_rows_that_are_thinned_are_said_to_be_thinned(tmp_path):
    write_biaxial_rows(tmp_path / "test.csv", biaxial_rows(LAW, ["1:1"], rows=200))
    project = bf.read_project(biaxial_project(tmp_path))
    ((_, choices),) = bf.check(project).choices.items()
    assert "148 thinned to at most 50 of a ratio" in "; ".join(choices)
