"""MAT-files of MultiDIC and DuoDIC, which make stereo correlation of Ncorr's planar one.

Source: a public script that fills their `DIC3DPPresults`: for each frame a cell of Points3D (n, 3),
places in the frame as MultiDIC uses them, Disp.DispVec (n, 3) and corrComb, in the calibration's
unit, mm unless `length_unit` says otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError
from ..frames import Frame, FrameOptions, FrameRows, frame_of
from ..mat_files import is_mat, read_variables, variable_names
from ..registry import Format, register_format

RESULTS = ("DIC3DPPresults", "DIC3DpairResults", "DIC3DAllPairsResults")


def recognises(path: Path, head: bytes) -> bool:
    """Return whether a MAT-file holds one of the results."""
    there = variable_names(path, head) if is_mat(head) else None
    return there is not None and any(name in there for name in RESULTS)


def read(path: Path, options: FrameOptions) -> Sequence[Frame]:
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


register_format(Format("multidic", "frame", "MAT-files of MultiDIC, DuoDIC", read, recognises))
