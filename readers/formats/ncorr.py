"""MAT-files of Ncorr, a planar correlation, and of MultiDIC and DuoDIC, stereo made of Ncorr's.

Ncorr: displacements u, v on a grid of pixels. Source: MultiDIC's public reader of Ncorr
(`data_dic_save.displacements(i)`: plot_u_ref_formatted, plot_v_ref_formatted, plot_corrcoef_dic,
zero outside the region of interest; grid points are `dispinfo.spacing` + 1 pixels apart,
`dispinfo.pixtounits` is a pixel in `dispinfo.units`) and scripts on version 7.3. Rows count
downwards. There is no dz: a bubble needs `multidic`.

MultiDIC. Source: a public script that fills their `DIC3DPPresults`: for each frame a cell of
Points3D (n, 3), places in the frame as MultiDIC uses them, Disp.DispVec (n, 3) and corrComb, in the
calibration's unit, mm unless `length_unit` says otherwise.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError
from ..frames import Frame, FrameOptions, FrameRows, frame_of
from ..mat_files import is_mat, numbers_of, read_variables, variable_names
from ..registry import Format, register_format

SAVED = "data_dic_save"


def recognises(path: Path, head: bytes) -> bool:
    """Return whether a MAT-file holds what Ncorr saves, or cannot be inspected."""
    there = variable_names(path, head) if is_mat(head) else ()
    return there is None or SAVED in there


def read(path: Path, options: FrameOptions) -> Sequence[Frame]:
    """Read a frame for each picture."""
    saved = _only(path, read_variables(path, [SAVED]), SAVED)
    about = _only(path, saved, "dispinfo")
    frames = saved.get("displacements")
    if not isinstance(frames, list) or not frames or not isinstance(frames[0], dict):
        raise InputError(path, SAVED, "expected displacements of frames")
    spacing, scale = (_number(path, about, name) for name in ("spacing", "pixtounits"))
    unit, step = about.get("units"), (spacing + 1) * scale
    rows = (_rows(path, one, step, unit if isinstance(unit, str) else "") for one in frames)
    return [frame_of(one, options, path, "ncorr") for one in rows]


def _rows(path: Path, one: Mapping[str, Any], step: float, unit: str) -> FrameRows:
    u, v = (numbers_of(path, one, f"plot_{name}_ref_formatted") for name in "uv")
    if u.shape != v.shape or u.ndim != 2:
        raise InputError(path, "displacements", f"u and v are {u.shape} and {v.shape}")
    correlated = (u != 0) | (v != 0)
    if isinstance(one.get("plot_corrcoef_dic"), np.ndarray):
        coefficient = numbers_of(path, one, "plot_corrcoef_dic")
        correlated = coefficient != 0 if coefficient.shape == u.shape else correlated
    row, column = np.nonzero(correlated)
    values = {"x": column * step, "y": row * step, "dx": u[row, column], "dy": v[row, column]}
    names = {"x": "column", "y": "row", "dx": "plot_u_ref_formatted", "dy": "plot_v_ref_formatted"}
    return FrameRows(values, names, dict.fromkeys(values, unit), camera_axes=True)


def _only(path: Path, where: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    if not (found := _struct(where.get(name))):
        raise InputError(path, name, "this struct is missing; is it a file that Ncorr saved?")
    return found


def _number(path: Path, where: Mapping[str, Any], name: str) -> float:
    value = numbers_of(path, where, name)
    if value.size != 1 or not 0 <= value.flat[0] < 1e6:
        raise InputError(path, f"dispinfo.{name}", "expected one number, not below zero")
    return float(value.flat[0])


RESULTS = ("DIC3DPPresults", "DIC3DpairResults", "DIC3DAllPairsResults")


def recognises_multidic(path: Path, head: bytes) -> bool:
    """Return whether a MAT-file holds one of the results."""
    there = variable_names(path, head) if is_mat(head) else None
    return there is not None and any(name in there for name in RESULTS)


def read_multidic(path: Path, options: FrameOptions) -> Sequence[Frame]:
    """Read a frame for each cell."""
    there = read_variables(path, RESULTS)
    results = next((_struct(there[name]) for name in RESULTS if name in there), {})
    points, moved = results.get("Points3D"), _struct(results.get("Disp")).get("DispVec")
    if not isinstance(points, list) or not isinstance(moved, list) or len(points) != len(moved):
        raise InputError(path, "", "expected cells of Points3D and Disp.DispVec, one a frame")
    frames = []
    for place, move in zip(points, moved, strict=True):
        if not isinstance(place, np.ndarray) or not isinstance(move, np.ndarray):
            raise InputError(path, "", "expected arrays in Points3D and DispVec")
        if place.shape != move.shape or place.ndim != 2 or place.shape[1] != 3:
            raise InputError(path, "", f"Points3D and DispVec are {place.shape} and {move.shape}")
        values = {f"{axis} deformed": place[:, i].astype(float) for i, axis in enumerate("xyz")}
        values |= {f"d{axis}": move[:, i].astype(float) for i, axis in enumerate("xyz")}
        names = {name: "DispVec" if name[0] == "d" else "Points3D" for name in values}
        frames.append(frame_of(FrameRows(values, names), options, path, "multidic"))
    return frames


def _struct(value: Any) -> Mapping[str, Any]:
    one = value[0] if isinstance(value, list) and len(value) == 1 else None
    return one if isinstance(one, dict) else {}


for one in (
    Format("ncorr", "frame", "MAT-files of Ncorr (planar)", read, recognises),
    Format(
        "multidic", "frame", "MAT-files of MultiDIC, DuoDIC", read_multidic, recognises_multidic
    ),
):
    register_format(one)
