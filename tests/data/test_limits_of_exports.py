"""What readers of binary exports take and refuse: shapes, sizes, counts, just within and beyond."""

from __future__ import annotations

import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest
from bubblefit.readers import hdf5_files, mat_files, npz_files
from bubblefit.readers.frames import FrameOptions, read_frames
from bubblefit.readers.hdf5_files import array_of, member, open_hdf5
from bubblefit.readers.mat_files import read_variables, variable_names
from bubblefit.readers.npz_files import array_names, read_arrays

from .. import dic_exports
from ..complaints import complaint
from .test_hostile_frames import mat, npy, part, variable

PLACES = np.arange(12.0).reshape(4, 3)
MOVED = 0.01 * PLACES + 0.5


# --- .npz ----------------------------------------------------------------------------------------


def test_arrays_of_an_archive(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    np.savez_compressed(path, a=PLACES, b=np.asfortranarray(PLACES), c=np.array("text"))
    found = read_arrays(path, ["a", "b", "c", "d"])
    assert sorted(found) == ["a", "b", "c"] and str(found["c"]) == "text"
    np.testing.assert_array_equal(found["a"], PLACES)
    np.testing.assert_array_equal(found["b"], PLACES)
    assert array_names(path) == ["a", "b", "c"] and array_names(tmp_path / "no.npz") == []
    assert complaint(read_arrays, tmp_path / "no.npz", ["a"]).endswith("no.npz: no such file")


def archive(path: Path, shape: str, body: bytes, kind: str = "<f8", packed: bool = False) -> Path:
    header = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}".encode()
    how = zipfile.ZIP_DEFLATED if packed else zipfile.ZIP_STORED
    with zipfile.ZipFile(path, "w", how) as out:
        out.writestr("a.npy", npy(header.ljust(117) + b"\n", body))
    return path


def test_numbers_that_an_archive_can_hold(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    whole = archive(path, "(2, 3)", np.arange(6.0).tobytes())
    assert read_arrays(whole, ["a"])["a"].tolist() == [[0, 1, 2], [3, 4, 5]]
    # 54 numbers are as long as file and header together: said to be too short, not too many.
    short = archive(path, "(17,)", b"\0" * 8)
    assert complaint(read_arrays, short, ["a"]) == (
        f"{path}: array 'a': ends early; is the file damaged?"
    )
    for shape in ("(1000, 3)", "(-1, 3)"):
        said = complaint(read_arrays, archive(path, shape, b"\0" * 8), ["a"])
        assert said == (
            f"{path}: array 'a': says {shape} numbers, more than the file holds; is it damaged?"
        )
    for kind in ("|O", "<c16", "<M8[s]"):
        assert complaint(read_arrays, archive(path, "(1,)", b"\0" * 16, kind), ["a"]) == (
            f"{path}: array 'a': holds Python objects or records, which are not read: save plain "
            "numbers"
        )


def test_packed_numbers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Up to 64 MiB always, beyond by what is packed, never more than 1 GiB."""
    assert (npz_files.LARGEST, npz_files.SMALL, npz_files.RATIO) == (2**30, 2**26, 100)
    assert (mat_files.LARGEST, mat_files.SMALL, mat_files.RATIO) == (2**30, 2**26, 100)
    zeros = archive(tmp_path / "a.npz", "(4096,)", b"\0" * 32768, packed=True)
    with zipfile.ZipFile(zeros) as packed:
        share = 32768 / packed.getinfo("a.npy").compress_size
    monkeypatch.setattr(npz_files, "SMALL", 32767)
    monkeypatch.setattr(npz_files, "RATIO", share * 1.001)
    assert len(read_arrays(zeros, ["a"])["a"]) == 4096
    monkeypatch.setattr(npz_files, "RATIO", share * 0.999)
    assert "more than the file holds" in complaint(read_arrays, zeros, ["a"])
    monkeypatch.setattr(npz_files, "SMALL", 32768)
    assert len(read_arrays(zeros, ["a"])["a"]) == 4096
    monkeypatch.setattr(npz_files, "LARGEST", 32767)
    assert "more than the file holds" in complaint(read_arrays, zeros, ["a"])


# --- pyALDIC-3D ----------------------------------------------------------------------------------


def pyaldic(path: Path, **arrays: np.ndarray) -> Path:
    np.savez(path, **arrays)
    return path


@pytest.mark.parametrize(
    ("arrays", "words"),
    [
        ({"points3D": PLACES}, "points3D: expected places (frames, points, 3)"),
        ({"points3D": np.zeros((1, 3, 2))}, "points3D: expected places (frames, points, 3)"),
        ({"points3D": np.zeros((1, 3, 4))}, "points3D: expected places (frames, points, 3)"),
        ({"points3D": np.zeros((1, 0, 3))}, "points3D: expected numbers, found none"),
        ({"points3D": np.full((1, 1, 3), "a")}, "points3D: expected numbers, found none"),
        (
            {"points3D": np.zeros((1, 4, 3)), "V": np.zeros((1, 3))},
            "V: is (1, 3), points3D (1, 4, 3): expected one a point and frame",
        ),
    ],
)
def test_pyaldic_without_places(tmp_path: Path, arrays, words: str) -> None:
    assert complaint(read_frames, [pyaldic(tmp_path / "a.npz", **arrays)]).endswith(words)


def test_pyaldic_displacements_are_those_of_the_file_where_it_has_them(tmp_path: Path) -> None:
    points = np.array([PLACES, PLACES + MOVED])
    own = np.array([0 * PLACES[:, 0], [7.0, 8.0, 9.0, 10.0]])
    _, frame = read_frames([pyaldic(tmp_path / "a.npz", points3D=points, V=own)])
    np.testing.assert_allclose(frame.displacement[:, [0, 2]], MOVED[:, [0, 2]] * [1, -1])
    np.testing.assert_allclose(frame.displacement[:, 1], -own[1])
    np.testing.assert_allclose(frame.points[:, 0], PLACES[:, 0])
    assert set(frame.source.units.values()) == {"mm"}
    assert frame.source.columns["dy"] == "V" and frame.source.columns["x deformed"] == "points3D"


# --- MATLAB --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("places", "moved"), [((4, 3), (5, 3)), ((4, 2), (4, 2)), ((4, 4), (4, 4)), ((4, 3), (4, 2))]
)
def test_multidic_of_other_shapes(tmp_path: Path, places, moved) -> None:
    from scipy.io import savemat

    cells = {name: np.empty((1, 1), dtype=object) for name in ("p", "u")}
    cells["p"][0, 0], cells["u"][0, 0] = np.zeros(places), np.zeros(moved)
    results = {"Points3D": cells["p"], "Disp": {"DispVec": cells["u"]}}
    savemat(tmp_path / "a.mat", {"DIC3DPPresults": results})
    said = complaint(read_frames, [tmp_path / "a.mat"])
    assert said.endswith(f"a.mat: Points3D and DispVec are {places} and {moved}")


def test_columns_of_multidic(tmp_path: Path) -> None:
    (path,) = dic_exports.multidic(tmp_path, [(PLACES, MOVED)])
    _, frame = read_frames([path])
    assert frame.source.columns == {
        "x deformed": "Points3D", "y deformed": "Points3D", "z deformed": "Points3D",
        "dx": "DispVec", "dy": "DispVec", "dz": "DispVec",
    }  # fmt: skip
    assert frame.source.units == {}
    np.testing.assert_allclose(frame.points[:4], PLACES, atol=1e-12)


def ncorr(path: Path, u, v, about=(4.0, 0.1, "mm"), coefficient=None) -> Path:
    from scipy.io import savemat

    fields = {"plot_u_ref_formatted": u, "plot_v_ref_formatted": v}
    if coefficient is not None:
        fields["plot_corrcoef_dic"] = coefficient
    saved = np.empty((1, 1), dtype=[(name, object) for name in fields])
    for name, grid in fields.items():
        saved[name][0, 0] = grid
    said = dict(zip(("spacing", "pixtounits", "units"), about, strict=True))
    savemat(path, {"data_dic_save": {"displacements": saved, "dispinfo": said}})
    return path


def test_ncorr_of_grids_that_do_not_agree(tmp_path: Path) -> None:
    path, planar = tmp_path / "a.mat", FrameOptions(planar=True)
    said = complaint(read_frames, [ncorr(path, np.ones((2, 3)), np.ones((3, 2)))], planar)
    assert said == f"{path}: displacements: u and v are (2, 3) and (3, 2)"
    cube = np.ones((2, 2, 2))
    said = complaint(read_frames, [ncorr(path, cube, cube)], planar)
    assert said == f"{path}: displacements: u and v are (2, 2, 2) and (2, 2, 2)"
    for about, name in (((-1.0, 0.1, "mm"), "spacing"), ((4.0, 1e6, "mm"), "pixtounits")):
        said = complaint(read_frames, [ncorr(path, np.eye(2), np.eye(2), about)], planar)
        assert said == f"{path}: dispinfo.{name}: expected one number, not below zero"


def test_ncorr_takes_what_it_correlated(tmp_path: Path) -> None:
    """Places a grid point apart are 5 pixels of 0.1 mm; row 0 is the upper one."""
    path, planar = tmp_path / "a.mat", FrameOptions(planar=True)
    u, v = np.array([[0.0, -0.2], [0.0, 0.0]]), np.array([[0.0, 0.0], [-0.4, 0.0]])
    (frame,) = read_frames([ncorr(path, u, v)], planar)
    np.testing.assert_allclose(frame.points, [[0.5, 0, 0], [0, -0.5, 0]])
    np.testing.assert_allclose(frame.displacement, [[-0.2, 0, 0], [0, 0.4, 0]])
    # Its own coefficient says better where a point did not move.
    right = np.array([[0.0, 0.1], [0.0, 0.1]])
    (frame,) = read_frames([ncorr(path, u, v, coefficient=right)], planar)
    np.testing.assert_allclose(frame.points, [[0.5, 0, 0], [0.5, -0.5, 0]])
    (frame,) = read_frames([ncorr(path, u, v, (0.0, 1.0, "mm"), np.ones((3, 3)))], planar)
    np.testing.assert_allclose(frame.points, [[1, 0, 0], [0, -1, 0]])


def test_istra4d_of_arrays_that_do_not_agree(tmp_path: Path) -> None:
    import h5py

    def written(mask: int = 4, dx: int = 4, **left: str) -> Path:
        path = tmp_path / "a.hdf5"
        with h5py.File(path, "w") as file:
            for axis in "xyz":
                file[f"coordinates/coordinate_{axis}"] = np.ones((2, 2))
                file[f"displacements/displacement_{axis}"] = np.ones(dx if axis == "x" else 4)
            if mask:
                file["coordinates/mask"] = np.array([1, 0, 2, 1, 1])[:mask]
            for name in left.values():
                del file[name]
        return path

    for mask in (0, 4):
        (frame,) = read_frames([written(mask)])
        assert len(frame.points) == (3 if mask else 4)
    sizes = "coordinates, displacements and mask are not of one size"
    for path in (written(5), written(0, 3), written(3)):
        assert complaint(read_frames, [path]) == f"{path}: {sizes}"
    for name in ("coordinates/coordinate_x", "displacements/displacement_y"):
        said = complaint(read_frames, [written(name=name)])
        assert said.endswith(
            "expected coordinates/coordinate_x and so on: export coordinates, displacements"
        )


def test_variables_in_turn(tmp_path: Path) -> None:
    """What is neither a matrix nor packed is passed over; a size is filled up to eight bytes."""
    body = variable(6, [1, 1], part(9, struct.pack("<d", 2.5)))
    path, content = tmp_path / "a.mat", mat(body)
    other = struct.pack("<II", 7, 5) + b"\0" * 8
    named = body.replace(b"X", b"Y")
    path.write_bytes(content + other + part(14, named) + b"\0" * 7)
    assert variable_names(path, content) == ["X", "Y"]
    assert read_variables(path, ["Y"])["Y"].tolist() == [[2.5]]
    path.write_bytes(content[:126] + b"XX" + content[128:])
    assert complaint(read_variables, path, ["X"]) == f"{path}: is not a MAT-file; is it damaged?"


def test_hdf5_members_and_sizes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import h5py

    path = tmp_path / "a.hdf5"
    with h5py.File(path, "w") as file:
        file["group/numbers"] = np.arange(4, dtype="i2")
        file["group/words"] = "text"
        file["empty"] = h5py.Empty("f8")
    with open_hdf5(path) as file:
        assert member(path, file, "group/none") is member(path, file, "group/numbers/x") is None
        numbers = member(path, file, "group/numbers")
        assert array_of(path, numbers, "n").tolist() == [0.0, 1.0, 2.0, 3.0]
        for thing in (file["group"], file["group/words"]):
            said = complaint(array_of, path, thing, "n")
            assert said == f"{path}: n: expected an array of numbers"
        assert complaint(array_of, path, file["empty"], "n").startswith(f"{path}: n: says it holds")
        # Each becomes a number of eight bytes.
        monkeypatch.setattr(hdf5_files, "LARGEST", 32)
        assert len(array_of(path, numbers, "n")) == 4
        monkeypatch.setattr(hdf5_files, "LARGEST", 31)
        said = complaint(array_of, path, numbers, "n")
        assert said == f"{path}: n: says it holds (4,) numbers; is it damaged?"
    path.write_bytes(b"no such thing")
    said = complaint(open_hdf5(path).__enter__)
    assert said.startswith(f"{path}: cannot be read as HDF5; is it damaged? (")


def test_matlab_7_3_by_class_and_by_depth(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import h5py

    path = tmp_path / "a.mat"
    with h5py.File(path, "w") as file:

        def write(name: str, data, kind: str, **attributes) -> None:
            file[name] = data
            file[name].attrs["MATLAB_class"] = np.bytes_(kind)
            for key, value in attributes.items():
                file[name].attrs[key] = value

        write("grid", np.arange(6.0).reshape(3, 2), "double")
        write("text", np.array([[97], [98], [0]], dtype="u2"), "char")
        write("truth", np.array([[0, 1]], dtype="u1"), "logical")
        write("none", np.zeros(2, dtype="u8"), "double", MATLAB_empty=1)
        write("blank", np.zeros(2, dtype="u8"), "char", MATLAB_empty=1)
        write("object", np.zeros((1, 6), dtype="u4"), "string", MATLAB_object_decode=3)
        references = np.array([[file["grid"].ref, file["text"].ref]], dtype=h5py.ref_dtype)
        write("cells", references, "cell")
        file["inner/a"], file["inner/b"] = np.ones((1, 1)), np.zeros((1, 1))
        deep = file.create_group("deep")
        for _ in range(15):
            deep = deep.create_group("g")
        deep["n"] = np.ones((1, 1))
        # Cells within each other are as deep as structs are.
        inner = file["grid"].ref
        for k in range(17):
            write(f"cell{k}", np.array([[inner]], dtype=h5py.ref_dtype), "cell")
            inner = file[f"cell{k}"].ref
    names = ["grid", "text", "truth", "none", "blank", "object", "cells", "inner", "deep", "x"]
    found = mat_files._variables_73(path, names)
    assert "x" not in found
    assert found["grid"].tolist() == [[0, 2, 4], [1, 3, 5]]
    assert (found["text"], found["blank"], found["object"]) == ("ab", "", None)
    assert found["truth"].dtype == bool and found["truth"].tolist() == [[False], [True]]
    assert found["none"].shape == (0, 0)
    assert found["cells"][0].tolist() == found["grid"].tolist() and found["cells"][1] == "ab"
    assert [sorted(one) for one in found["inner"]] == [["a", "b"]]
    # Sixteen within each other, and no more.
    with h5py.File(path, "a") as file:
        file.move("deep", "top/deep")
    too_many = "has too many parts; is the file damaged?"
    assert len(mat_files._variables_73(path, ["cell15"])["cell15"]) == 1
    assert complaint(mat_files._variables_73, path, ["cell16"]) == f"{path}: cell16: {too_many}"
    assert complaint(mat_files._variables_73, path, ["top"]).endswith(too_many)
    monkeypatch.setattr(mat_files, "MOST_PARTS", 3)
    assert len(mat_files._variables_73(path, ["cells"])["cells"]) == 2
    monkeypatch.setattr(mat_files, "MOST_PARTS", 2)
    assert complaint(mat_files._variables_73, path, ["cells"]) == f"{path}: cells: {too_many}"
    monkeypatch.setattr(mat_files, "MOST_PARTS", 1)
    assert complaint(mat_files._variables_73, path, ["cells"]) == f"{path}: cells: {too_many}"


# --- text ----------------------------------------------------------------------------------------

ZONE = "VARIABLES = x y z dx dy dz\nZONE {keys}\n1 2 3 4 5 6\n7 8 9 10 11 12\n"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("{keys}", "I=1", "line 2: the zone says 1 points, its numbers are 2"),
        ("{keys}", "I=2 J=2 K=3", "line 2: the zone says 2 x 2 x 3 points, its numbers are 2"),
        ("12", "", "line 2: expected 6 numbers a point, found 11 numbers in the zone"),
        ("1 2 3 4 5 6\n7 8 9 10 11 12", "", "line 2: expected 6 numbers a point, found 0 "
         "numbers in the zone"),
        ("1 2 3", "x" * 41 + " 2 3", "line 3: expected numbers, found '" + "x" * 40 + "'"),
        ("1 2 3", "1.2.3" + "4" * 40, "line 3: expected a number, found '1.2.3" + "4" * 35 + "'"),
        ("{keys}", "F=FEBLOCK", "line 2: a zone of points as POINT or BLOCK is needed, this is "
         "'FEBLOCK'"),
        ("{keys}", "ZONETYPE=FEQUAD", "line 2: a zone of points as POINT or BLOCK is needed, this "
         "is 'POINT FEQUAD'"),
        ("VARIABLES = x y z dx", "VARIABLES = x x z dx", "VARIABLES: the variable of x may be one "
         "of several; name one with columns. The file has: x, x, z, dx, dy, dz"),
        ("x y z", "a b c", "VARIABLES: no places are among them; the file has: a, b, c, dx, dy, "
         "dz"),
    ],
)  # fmt: skip
def test_zones_of_tecplot_that_are_none(tmp_path: Path, old: str, new: str, words: str) -> None:
    path = tmp_path / "a.dat"
    path.write_text(ZONE.replace(old, new).format(keys="I=2"))
    assert complaint(read_frames, [path]) == f"{path}: {words}"


def test_rows_of_a_zone_are_points_by_its_flags(tmp_path: Path) -> None:
    path = tmp_path / "a.dat"
    text = "VARIABLES = x y z dx dy dz {}\nZONE\n1 2 3 4 5 6 0\n7 8 9 10 11 12 1\n"
    for flag, options, first in (
        ("valid", FrameOptions(), 7.0), ("invalid", FrameOptions(), 1.0),
        ("f", FrameOptions(flag_column="f"), 1.0), ("f", FrameOptions(valid_column="f"), 7.0),
    ):  # fmt: skip
        path.write_text(text.format(flag))
        (frame,) = read_frames([path], options)
        assert frame.points[:, 0].tolist() == [first], (flag, options)
        assert frame.dropped == {"flagged as doubtful": 1}
    said = complaint(read_frames, [path], FrameOptions(valid_column="g"))
    assert "the variable of valid 'g' is missing; name one with columns" in said
