"""MAT-files of Ncorr, a planar correlation: displacements u, v on a grid of pixels.

Source: MultiDIC's public reader of Ncorr (`data_dic_save.displacements(i)`: plot_u_ref_formatted,
plot_v_ref_formatted, plot_corrcoef_dic, zero outside the region of interest; grid points are
`dispinfo.spacing` + 1 pixels apart, `dispinfo.pixtounits` is a pixel in `dispinfo.units`) and
scripts on version 7.3. Rows count downwards. There is no dz: a bubble needs `multidic`.
"""

from __future__ import annotations

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
    value = where.get(name)
    if not isinstance(value, list) or len(value) != 1 or not isinstance(value[0], dict):
        raise InputError(path, name, "this struct is missing; is it a file that Ncorr saved?")
    return value[0]


def _number(path: Path, where: Mapping[str, Any], name: str) -> float:
    value = numbers_of(path, where, name)
    if value.size != 1 or not 0 <= value.flat[0] < 1e6:
        raise InputError(path, f"dispinfo.{name}", "expected one number, not below zero")
    return float(value.flat[0])


register_format(Format("ncorr", "frame", "MAT-files of Ncorr (planar)", read, recognises))
