"""Field: files of DICe, DuoDIC, MultiDIC, muDIC and Ncorr, as the table in the documents has them.

Sources: DuoDIC's public sample of step 3 (struct DIC3D, MATLAB 7.3); issues of DICe on files with
pixels, stereo and model displacements beside each other and SSSIG zero throughout; muDIC's export.
"""

import re

import numpy as np
import pytest
from bubblefit.errors import InputError
from bubblefit.readers.frames import FrameOptions, read_frames
from bubblefit.readers.registry import format_of
from scipy.io import savemat

from ..support.paths import ROOT

PLACES = np.array(
    [[10.0, 10.0, 440.0], [50.0, 10.0, 441.0], [10.0, 50.0, 440.0], [50.0, 50.0, 442.0]]
)
MOTION = np.array([[0.1, 0.2, -0.3], [0.4, 0.2, -0.3], [0.1, 0.5, -0.3], [0.2, 0.2, -0.6]])


def documented():
    """Return the rows of the table, by file."""
    text = (ROOT / "docs" / "reference" / "project-file.md").read_text()
    rows = re.findall(r"^\| (.+?) \| (.+?) \| `(\w+)` \| (.+?) \|$", text, flags=re.M)
    return {file: (re.findall("`(.+?)`", names), name, words) for file, names, name, words in rows}


TABLE = documented()


def write_text(path, columns):
    rows = zip(*columns.values(), strict=True)
    lines = [",".join(columns), *(",".join(f"{v:g}" for v in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n")
    return path


def write_dice(path, stereo):
    pixels = {"SUBSET_ID": range(4), "COORDINATE_X": 10 * PLACES[:, 0]}
    pixels |= {
        "COORDINATE_Y": 10 * PLACES[:, 1],
        "DISPLACEMENT_X": 4 * [7],
        "DISPLACEMENT_Y": 4 * [8],
    }
    quality = {"SIGMA": 4 * [0.005], "SSSIG": 4 * [0], "MATCH": 4 * [0], "STATUS_FLAG": 4 * [4]}
    if not stereo:
        return write_text(path, pixels | quality)
    pixels |= {"STEREO_DISPLACEMENT_X": 4 * [9], "STEREO_DISPLACEMENT_Y": 4 * [11]}
    model = {f"MODEL_COORDINATES_{axis}": PLACES[:, k] for k, axis in enumerate("XYZ")}
    model |= {f"MODEL_DISPLACEMENT_{axis}": MOTION[:, k] for k, axis in enumerate("XYZ")}
    return write_text(path, pixels | model | quality)


def write_results(path, struct):
    cells = {name: np.empty((1, 2), dtype=object) for name in ("places", "moves")}
    for k in (0, 1):
        cells["places"][0, k], cells["moves"][0, k] = PLACES + k * MOTION, k * MOTION
    members = {
        "Points3D": cells["places"],
        "Disp": {"DispVec": cells["moves"]},
        "Faces": np.ones(3),
    }
    savemat(path, {struct: members})
    return path


def write_mudic(path):
    x, y = (PLACES + MOTION)[:, :2].T
    columns = {"d": range(4), "x": x, "y": y, "ux": MOTION[:, 0], "uy": MOTION[:, 1]}
    return write_text(path, columns | {"true_strain_xx": 4 * [0.01]})


def write_ncorr(path):
    grid = np.array([[0.0, 0.2], [0.1, 0.3]])
    names = "plot_u_ref_formatted", "plot_v_ref_formatted"
    saved = np.empty((1, 1), dtype=[(name, object) for name in names])
    for name in names:
        saved[name][0, 0] = grid
    about = {"spacing": 4.0, "pixtounits": 0.1, "units": "mm"}
    savemat(path, {"data_dic_save": {"displacements": saved, "dispinfo": about}})
    return path


def files_of(file, folder):
    """Write a file of a row for each name by which it is recognised."""
    names = TABLE[file][0]
    if file.startswith("DICe"):
        return [write_dice(folder / "DICe_solution_0.txt", "stereo" in file)]
    if "DIC3D" in names[0]:
        return [write_results(folder / f"{name}.mat", name) for name in names]
    return [(write_mudic if file == "muDIC" else write_ncorr)(folder / "file.mat")]


@pytest.mark.parametrize("file", TABLE)
def test_files_of_the_table_are_recognised_and_read_as_it_says(file, tmp_path):
    names, format_name, words = TABLE[file]
    for path in files_of(file, tmp_path):
        assert any(name.encode() in path.read_bytes() for name in names) or path.suffix == ".mat"
        assert format_of("frame", path).name == format_name
        if "refused" in words:
            with pytest.raises(InputError, match="planar and in pixels"):
                read_frames([path])
            continue
        columns = {"x": "x", "y": "y", "dx": "ux", "dy": "uy"} if "`columns`" in words else None
        frame = read_frames([path], FrameOptions(planar="planar" in words, columns=columns))[-1]
        if format_name == "ncorr":
            assert len(frame.points) == 3  # zeros are outside the region
            continue
        turned = np.array([1, -1, -1]) if "camera axes" in words else np.ones(3)
        count = 2 if "planar" in words else 3
        for values, expected in ((frame.points, PLACES), (frame.displacement, MOTION)):
            wanted = (expected * turned)[:, :count]
            np.testing.assert_allclose(values[:, :count], wanted, atol=1e-9)


def test_table_names_all_rows():
    assert len(TABLE) == 6 and {name for _, name, _ in TABLE.values()} == {
        "dice", "multidic", "mudic", "ncorr"}  # fmt: skip


def test_duodic_sample_of_step_3_has_its_stretches(shared_data):
    """A strip in tension: stretches of the last frame 1.264 along and 0.906 across."""
    pytest.importorskip("h5py")
    frames = read_frames([shared_data / "duodic" / "uniaxial_tension_DIC3Dstereo.mat"])
    assert [len(frames), len(frames[0].points)] == [20, 435]
    assert (frames[0].displacement == 0).all()
    last = frames[-1]
    planes = []
    for places in (last.points, last.points + last.displacement):
        centred = places - places.mean(axis=0)
        planes.append(centred @ np.linalg.svd(centred, full_matrices=False)[2][:2].T)
    gradient = np.linalg.lstsq(*planes, rcond=None)[0]
    stretches = np.linalg.svd(gradient)[1]
    np.testing.assert_allclose(stretches, [1.2643, 0.9057], rtol=2e-3)
    # The camera's z points away from it: the strip lies 0.44 to 0.46 m in front.
    assert -458.5 < last.points[:, 2].min() < last.points[:, 2].max() < -440
