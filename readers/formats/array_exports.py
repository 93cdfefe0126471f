"""Exports as arrays: MAT-files of VIC-3D, Ncorr, MultiDIC; HDF5 of Istra4D; archives of pyALDIC-3D.

VIC-3D: a grid of X, Y, Z, U, V, W and sigma. Source: public scripts that load such files: X, Y, Z,
U, V, W are lengths, x, y, u, v in small letters pixels, and points with a sigma of -1 are bad. The
unit is not in the file: mm unless `length_unit` says otherwise (could not be confirmed).

Ncorr: displacements u, v on a grid of pixels. Source: MultiDIC's public reader of Ncorr
(`data_dic_save.displacements(i)`: plot_u_ref_formatted, plot_v_ref_formatted, plot_corrcoef_dic,
zero outside the region of interest; grid points are `dispinfo.spacing` + 1 pixels apart,
`dispinfo.pixtounits` is a pixel in `dispinfo.units`) and scripts on version 7.3. Rows count
downwards. There is no dz: a bubble needs `multidic`.

MultiDIC. Source: a public script that fills their `DIC3DPPresults`: for each frame a cell of
Points3D (n, 3), places in the frame as MultiDIC uses them, Disp.DispVec (n, 3) and corrComb, in the
calibration's unit, mm unless `length_unit` says otherwise.

DuoDIC. Source: its public sample of step 3, `DIC3D` with the same members, in axes of the first
camera (y down, z away from it).

Dantec Istra4D: coordinates/coordinate_x, mask, displacements/displacement_x. Source: the public
reader istra2py of the planar export (coordinates of the deformed state; mask is 0 where correlation
was lost). The third components are named alike by inference. Unit: mm unless `length_unit` says
otherwise.

pyALDIC-3D: .npz with all frames, .mat alike, and .csv, one a frame.

    points3D (frames, points, 3), U, V, W (frames, points), ref_coords, reproj_error, source
    x_px,y_px,X_mm,Y_mm,Z_mm,U,V,W

Source: pyALDIC-3D's own export (tables.py) and reconstruction (points3D and X_mm are the places in
the frame itself, displacements those since the first frame, NaN where correlation was lost; the
left camera's axes, so that y points down and z away from it). Its .mat cannot be recognised by its
names alone unless points3D is among them.
"""

import math
import zipfile
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy

from ...errors import InputError
from ...storage.reading import input_errors
from .. import mat_files
from ..frames import Array, Frame, FrameOptions, FrameRows, frame_of
from ..mat_files import LARGEST, RATIO, SMALL, is_mat, numbers_of, read_variables
from ..registry import Format, register_format
from ..text_frames import read_text

POSITIONS = [f"{axis} deformed" for axis in "xyz"]
DISPLACEMENTS = [f"d{axis}" for axis in "xyz"]


def _variable_names(path: Path, head: bytes) -> Collection[str] | None:
    """Return the names in a MAT-file; None of a damaged one, none of another file."""
    return mat_files.variable_names(path, head) if is_mat(head) else ()


def _frames(
    path: Path,
    options: FrameOptions,
    format: str,
    names: Mapping[str, str],
    tables: Iterable[Array],
    **settings: Any,
) -> list[Frame]:
    """Return a frame a table (points, names), with settings of its `FrameRows`.

    Raise InputError where the options name a column of flags, which these files do not have.
    """
    for key in ("flag_column", "valid_column"):
        if getattr(options, key) is not None:
            raise InputError(path, key, "is of tables in text; this file holds arrays")
    frames = []
    for table in tables:
        rows = FrameRows(dict(zip(names, table.T, strict=True)), names, **settings)
        frames.append(frame_of(rows, options, path, format))
    return frames


# VIC-3D -----------------------------------------------------------------------------------------

VIC3D = {"x": "X", "y": "Y", "z": "Z", "dx": "U", "dy": "V", "dz": "W", "sigma": "sigma"}


def recognises_vic3d(path: Path, head: bytes) -> bool:
    """Return whether X, Y, U, V and W are among the variables of a MAT-file, and no frames."""
    names = {*(_variable_names(path, head) or ())}
    return {*"XYUVW"} <= names and "points3D" not in names


def read_vic3d(path: Path, options: FrameOptions) -> Sequence[Frame]:
    """Read the one frame of a file."""
    names = VIC3D | dict(options.columns or {})
    variables = read_variables(path, [*names.values()])
    values = {
        key: numbers_of(path, variables, name).ravel(order="F")
        for key, name in names.items()
        if name in variables or key in options.quantities
    }
    if len({value.size for value in values.values()}) != 1:
        raise InputError(path, "", "X, Y, Z, U, V, W and sigma are not of one size")
    sigma = values.pop("sigma", None)
    rows = FrameRows(values, {key: names[key] for key in values}, sigma=sigma)
    return [frame_of(rows, options, path, "vic3d-mat")]


# Ncorr ------------------------------------------------------------------------------------------

SAVED = "data_dic_save"


def recognises_ncorr(path: Path, head: bytes) -> bool:
    """Return whether a MAT-file holds what Ncorr saves, or cannot be inspected."""
    names = _variable_names(path, head)
    return names is None or SAVED in names


def read_ncorr(path: Path, options: FrameOptions) -> Sequence[Frame]:
    """Read a frame for each picture."""
    saved = _required_struct(path, read_variables(path, [SAVED]), SAVED)
    info = _required_struct(path, saved, "dispinfo")
    frames = saved.get("displacements")
    if not isinstance(frames, list) or not frames or not isinstance(frames[0], dict):
        raise InputError(path, SAVED, "expected displacements of frames")
    spacing = _number(path, info, "spacing")
    scale = _number(path, info, "pixtounits")
    unit = info.get("units")
    step = (spacing + 1) * scale
    names = {"x": "column", "y": "row", "dx": "plot_u_ref_formatted", "dy": "plot_v_ref_formatted"}
    units = dict.fromkeys(names, unit if isinstance(unit, str) else "")
    tables = (_correlated_points(path, frame, step) for frame in frames)
    return _frames(
        path,
        options,
        "ncorr",
        names,
        tables,
        units=units,
        camera_axes=True,
    )


def _correlated_points(path: Path, frame: Mapping[str, Any], step: float) -> Array:
    """Return x, y, u, v (points, 4) of a frame where it was correlated; step: between points."""
    u = numbers_of(path, frame, "plot_u_ref_formatted")
    v = numbers_of(path, frame, "plot_v_ref_formatted")
    if u.shape != v.shape or u.ndim != 2:
        raise InputError(path, "displacements", f"u and v are {u.shape} and {v.shape}")
    is_correlated = (u != 0) | (v != 0)
    if isinstance(frame.get("plot_corrcoef_dic"), np.ndarray):
        coefficient = numbers_of(path, frame, "plot_corrcoef_dic")
        if coefficient.shape == u.shape:
            is_correlated = coefficient != 0
    row, column = np.nonzero(is_correlated)
    return np.column_stack([column * step, row * step, u[row, column], v[row, column]])


def _required_struct(path: Path, fields: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    """Return a struct of a file of Ncorr; InputError if it is missing."""
    struct = _struct(fields.get(name))
    if not struct:
        raise InputError(path, name, "this struct is missing; is it a file that Ncorr saved?")
    return struct


def _struct(value: Any) -> Mapping[str, Any]:
    """Return the fields of a struct; none of anything else."""
    element = value[0] if isinstance(value, list) and len(value) == 1 else None
    return element if isinstance(element, dict) else {}


def _number(path: Path, fields: Mapping[str, Any], name: str) -> float:
    """Return a field that holds one number, not negative; InputError otherwise."""
    value = numbers_of(path, fields, name)
    if value.size != 1 or not 0 <= value.flat[0] < 1e6:
        raise InputError(path, f"dispinfo.{name}", "expected one number, not below zero")
    return float(value.flat[0])


# MultiDIC ---------------------------------------------------------------------------------------

#: By the name of their struct: whether places are in a camera's axes.
RESULTS = {
    "DIC3DPPresults": False,
    "DIC3DpairResults": False,
    "DIC3DAllPairsResults": False,
    "DIC3D": True,
}


def recognises_multidic(path: Path, head: bytes) -> bool:
    """Return whether a MAT-file holds one of the results."""
    return not {*RESULTS}.isdisjoint(_variable_names(path, head) or ())


def read_multidic(path: Path, options: FrameOptions) -> Sequence[Frame]:
    """Read a frame for each cell."""
    variables = read_variables(path, RESULTS)
    struct = next((name for name in RESULTS if name in variables), "DIC3D")
    results = _struct(variables.get(struct))
    points = results.get("Points3D")
    vectors = _struct(results.get("Disp")).get("DispVec")
    if not isinstance(points, list) or not isinstance(vectors, list) or len(points) != len(vectors):
        raise InputError(path, "", "expected cells of Points3D and Disp.DispVec, one a frame")
    pairs = list(zip(points, vectors, strict=True))
    for pair in pairs:
        _check_vectors(path, *pair)
    names = dict.fromkeys(POSITIONS, "Points3D") | dict.fromkeys(DISPLACEMENTS, "DispVec")
    tables = (np.hstack(pair).astype(float) for pair in pairs)
    return _frames(path, options, "multidic", names, tables, camera_axes=RESULTS[struct])


def _check_vectors(path: Path, points: Any, vectors: Any) -> None:
    """Refuse what are not as many vectors as points, (n, 3)."""
    if not isinstance(points, np.ndarray) or not isinstance(vectors, np.ndarray):
        raise InputError(path, "", "expected arrays in Points3D and DispVec")
    if points.shape != vectors.shape or points.ndim != 2 or points.shape[1] != 3:
        raise InputError(path, "", f"Points3D and DispVec are {points.shape} and {vectors.shape}")


# Istra4D ----------------------------------------------------------------------------------------

ISTRA = {
    **{f"{axis} deformed": f"coordinates/coordinate_{axis}" for axis in "xyz"},
    **{f"d{axis}": f"displacements/displacement_{axis}" for axis in "xyz"},
    "mask": "coordinates/mask",
}


def recognises_istra4d(path: Path, head: bytes) -> bool:
    """Return whether the file is plain HDF5, not MATLAB's."""
    return head.startswith(mat_files.SIGNATURE)


def read_istra4d(path: Path, options: FrameOptions) -> Sequence[Frame]:
    """Read the one frame of a file."""
    mat_files.check_readable(path, partial(_datasets, path))
    values = _datasets(path)
    if len({value.size for value in values.values()}) > 1:
        raise InputError(path, "", "coordinates, displacements and mask are not of one size")
    mask = values.pop("mask", None)
    if not {"x deformed", "y deformed", "dx", "dy"} <= {*values}:
        problem = "expected coordinates/coordinate_x and so on: export coordinates, displacements"
        raise InputError(path, "", problem)
    valid = None if mask is None else mask != 0
    rows = FrameRows(values, {key: ISTRA[key] for key in values}, valid=valid)
    return [frame_of(rows, options, path, "istra4d")]


def _datasets(path: Path) -> dict[str, Array]:
    """Read the arrays that the file has, flat."""
    with mat_files.open_hdf5(path) as file:
        items = {key: mat_files.member(path, file, name) for key, name in ISTRA.items()}
        return {
            key: mat_files.array_of(path, item, ISTRA[key]).ravel()
            for key, item in items.items()
            if item is not None
        }


# pyALDIC-3D -------------------------------------------------------------------------------------

ARCHIVE = b"PK\x03\x04"


def array_names(path: Path) -> list[str]:
    """Return names of the arrays; none of what is no archive."""
    try:
        with zipfile.ZipFile(path) as archive:
            return [name[:-4] for name in archive.namelist() if name.endswith(".npy")]
    except (OSError, zipfile.BadZipFile, ValueError, NotImplementedError):
        return []


def read_arrays(path: Path, names: Collection[str]) -> dict[str, np.ndarray]:
    """Read the arrays of these names that the file has; no Python objects."""
    with mat_files.library_errors(path, "an .npz archive"), zipfile.ZipFile(path) as archive:
        members = {member.filename: member for member in archive.infolist()}
        return {
            name: _read_array(path, archive, members[f"{name}.npy"], name)
            for name in names
            if f"{name}.npy" in members
        }


def _read_array(
    path: Path,
    archive: zipfile.ZipFile,
    member: zipfile.ZipInfo,
    name: str,
) -> np.ndarray:
    """Read one array, after checks of what its header says."""
    with archive.open(member) as stream:
        version = npy.read_magic(stream)
        is_version_1 = version == (1, 0)
        read_header = npy.read_array_header_1_0 if is_version_1 else npy.read_array_header_2_0
        shape, is_fortran, dtype = read_header(stream)
        if dtype.kind not in "fiubU":
            problem = "holds Python objects or records, which are not read: save plain numbers"
            raise InputError(path, f"array {name!r}", problem)
        size = math.prod(shape) * dtype.itemsize
        max_size = min(LARGEST, member.file_size, max(SMALL, RATIO * member.compress_size))
        if min(shape, default=0) < 0 or size > max_size:
            problem = f"says {shape} numbers, more than the file holds; is it damaged?"
            raise InputError(path, f"array {name!r}", problem)
        content = stream.read(size)
    if len(content) < size:
        raise InputError(path, f"array {name!r}", "ends early; is the file damaged?")
    return np.frombuffer(content, dtype).reshape(shape, order="F" if is_fortran else "C")


def recognises_pyaldic(path: Path, head: bytes) -> bool:
    """Return whether points3D is among the arrays, or x_px and X_mm among the headings."""
    if head.startswith(ARCHIVE):
        return "points3D" in array_names(path)
    if head.startswith(b"x_px,y_px,X_mm"):
        return True
    return "points3D" in (_variable_names(path, head) or ())


def read_pyaldic(path: Path, options: FrameOptions) -> Sequence[Frame]:
    """Read all frames of a file."""
    with input_errors(path), path.open("rb") as file:
        head = file.read(128)
    if not head.startswith(ARCHIVE) and not is_mat(head):
        deformed = options if options.coordinates else replace(options, coordinates="deformed")
        return read_text(path, deformed, "pyaldic", camera_axes=True)
    read = read_variables if is_mat(head) else read_arrays
    arrays = read(path, ("points3D", *"UVW"))
    points = _points_of_frames(path, arrays)
    displacements = points - points[0]
    for component, name in enumerate("UVW"):
        values = arrays.get(name)
        if values is None:
            continue
        if values.shape != points.shape[:2]:
            problem = f"is {values.shape}, points3D {points.shape}: expected one a point and frame"
            raise InputError(path, name, problem)
        displacements[:, :, component] = values.astype(float)
    names = dict.fromkeys(POSITIONS, "points3D") | dict(zip(DISPLACEMENTS, "UVW", strict=True))
    tables = np.concatenate([points, displacements], axis=2)
    units = dict.fromkeys(names, "mm")
    return _frames(
        path,
        options,
        "pyaldic",
        names,
        tables,
        units=units,
        camera_axes=True,
    )


def _points_of_frames(path: Path, arrays: Mapping[str, Any]) -> Array:
    """Return the positions (frames, points, 3) in each frame."""
    points = arrays.get("points3D")
    if not isinstance(points, np.ndarray) or points.ndim != 3 or points.shape[2] != 3:
        raise InputError(path, "points3D", "expected places (frames, points, 3)")
    if points.dtype.kind not in "fiu" or not points.size:
        raise InputError(path, "points3D", "expected numbers, found none")
    return points.astype(float)


register_format(Format("vic3d-mat", "frame", "MAT-files of VIC-3D", read_vic3d, recognises_vic3d))
register_format(
    Format("ncorr", "frame", "MAT-files of Ncorr (planar)", read_ncorr, recognises_ncorr)
)
register_format(
    Format("multidic", "frame", "MAT-files of MultiDIC, DuoDIC", read_multidic, recognises_multidic)
)
register_format(Format("istra4d", "frame", "HDF5 of Istra4D", read_istra4d, recognises_istra4d))
register_format(
    Format("pyaldic", "frame", "npz, mat or CSV of pyALDIC-3D", read_pyaldic, recognises_pyaldic)
)
