"""Exports of pyALDIC-3D: .npz with all frames, .mat alike, and .csv, one a frame.

    points3D (frames, points, 3), U, V, W (frames, points), ref_coords, reproj_error, source
    x_px,y_px,X_mm,Y_mm,Z_mm,U,V,W

Source: pyALDIC-3D's own export (tables.py) and reconstruction (points3D and X_mm are the places in
the frame itself, displacements those since the first frame, NaN where correlation was lost; the
left camera's axes, so that y points down and z away from it). Its .mat cannot be recognised by its
names alone unless points3D is among them.
"""

import math
import zipfile
import zlib
from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.lib import format as npy

from ...errors import InputError
from ...files import reading
from ..frames import Frame, FrameOptions, FrameRows, frame_of
from ..mat_files import LARGEST, RATIO, SMALL, is_mat, read_variables, variable_names
from ..registry import Format, register_format
from ..text_frames import read_text_rows

SIGNATURE = b"PK\x03\x04"


def array_names(path: Path) -> list[str]:
    """Return names of the arrays; none of what is no archive."""
    try:
        with zipfile.ZipFile(path) as archive:
            return [name[:-4] for name in archive.namelist() if name.endswith(".npy")]
    except (OSError, zipfile.BadZipFile, ValueError, NotImplementedError):
        return []


def read_arrays(path: Path, wanted: Collection[str]) -> dict[str, np.ndarray]:
    """Read the arrays of these names, those that there are; no Python objects."""
    try:
        with zipfile.ZipFile(path) as archive:
            there = {one.filename: one for one in archive.infolist()}
            members = {name: there[f"{name}.npy"] for name in wanted if f"{name}.npy" in there}
            return {name: _array(path, archive, one, name) for name, one in members.items()}
    except FileNotFoundError:
        raise InputError(path, "", "no such file") from None
    except (OSError, zipfile.BadZipFile, zlib.error, EOFError) as error:
        raise InputError(path, "", f"is not a whole .npz archive ({str(error)[:100]})") from None
    except (ValueError, NotImplementedError, RuntimeError, TypeError, MemoryError) as error:
        why = " ".join(str(error).split())[:100]
        raise InputError(path, "", f"cannot be read; is it damaged? ({why})") from None


def _array(path: Path, archive: zipfile.ZipFile, one: zipfile.ZipInfo, name: str) -> np.ndarray:
    with archive.open(one) as stream:
        version = npy.read_magic(stream)
        read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        shape, fortran, dtype = read(stream)
        if dtype.kind not in "fiubU":
            problem = "holds Python objects or records, which are not read: save plain numbers"
            raise InputError(path, f"array {name!r}", problem)
        size = math.prod(shape) * dtype.itemsize
        most = min(LARGEST, one.file_size, max(SMALL, RATIO * one.compress_size))
        if min(shape, default=0) < 0 or size > most:
            problem = f"says {shape} numbers, more than the file holds; is it damaged?"
            raise InputError(path, f"array {name!r}", problem)
        content = stream.read(size)
    if len(content) < size:
        raise InputError(path, f"array {name!r}", "ends early; is the file damaged?")
    return np.frombuffer(content, dtype).reshape(shape, order="F" if fortran else "C")


def recognises(path: Path, head: bytes) -> bool:
    """Return whether points3D is among the arrays, or x_px and X_mm among the headings."""
    if head.startswith(SIGNATURE):
        return "points3D" in array_names(path)
    if is_mat(head):
        return "points3D" in (variable_names(path, head) or ())
    return head.startswith(b"x_px,y_px,X_mm")


def read(path: Path, options: FrameOptions) -> Sequence[Frame]:
    """Read all frames of a file."""
    with reading(path), path.open("rb") as file:
        head = file.read(128)
    if not head.startswith(SIGNATURE) and not is_mat(head):
        deformed = options if options.coordinates else replace(options, coordinates="deformed")
        every = read_text_rows(path, deformed, camera_axes=True)
        return [frame_of(rows, deformed, path, "pyaldic") for rows in every]
    there = (read_variables if is_mat(head) else read_arrays)(path, ("points3D", *"UVW"))
    points = there.get("points3D")
    if not isinstance(points, np.ndarray) or points.ndim != 3 or points.shape[2] != 3:
        raise InputError(path, "points3D", "expected places (frames, points, 3)")
    if points.dtype.kind not in "fiu" or not points.size:
        raise InputError(path, "points3D", "expected numbers, found none")
    points = points.astype(float)
    moved = points - points[0]
    for i, name in enumerate("UVW"):
        given = there.get(name)
        if given is not None and given.shape != points.shape[:2]:
            problem = f"is {given.shape}, points3D {points.shape}: expected one a point and frame"
            raise InputError(path, name, problem)
        if given is not None:
            moved[:, :, i] = given.astype(float)
    names = {f"{axis} deformed": "points3D" for axis in "xyz"}
    names |= {f"d{axis}": name for axis, name in zip("xyz", "UVW", strict=True)}
    units = dict.fromkeys(names, "mm")
    frames = []
    for columns in np.concatenate([points, moved], axis=2):
        rows = FrameRows(dict(zip(names, columns.T, strict=True)), names, units, camera_axes=True)
        frames.append(frame_of(rows, options, path, "pyaldic"))
    return frames


register_format(Format("pyaldic", "frame", "npz, mat or CSV of pyALDIC-3D", read, recognises))
