"""MAT-files of Correlated Solutions VIC-3D: a grid of X, Y, Z, U, V, W and sigma.

Source: public scripts that load such files: X, Y, Z, U, V, W are lengths, x, y, u, v in small
letters pixels, and points with a sigma of -1 are bad. The unit is not in the file: mm unless
`length_unit` says otherwise (could not be confirmed).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ...errors import InputError
from ..frame_rows import FrameRows, frame_of
from ..frames import Frame, FrameOptions
from ..mat_files import is_mat, numbers_of, read_variables, variable_names
from ..registry import Format, register_format

NAMES = {"x": "X", "y": "Y", "z": "Z", "dx": "U", "dy": "V", "dz": "W", "sigma": "sigma"}


def recognises(path: Path, head: bytes) -> bool:
    """Whether X, Y, U, V and W are among the variables of a MAT-file, and no frames."""
    there = variable_names(path, head) if is_mat(head) else None
    return there is not None and {*"XYUVW"} <= {*there} and "points3D" not in there


def read(path: Path, options: FrameOptions) -> Sequence[Frame]:
    """The one frame of a file."""
    names = NAMES | dict(options.columns or {})
    there = read_variables(path, [*names.values()])
    values = {
        key: numbers_of(path, there, name).ravel(order="F")
        for key, name in names.items()
        if name in there or key in options.quantities
    }
    if len({value.size for value in values.values()}) != 1:
        raise InputError(path, "", "X, Y, Z, U, V, W and sigma are not of one size")
    sigma = values.pop("sigma", None)
    names = {key: names[key] for key in values}
    return [frame_of(FrameRows(values, names, sigma=sigma), options, path, "vic3d-mat")]


register_format(Format("vic3d-mat", "frame", "MAT-files of VIC-3D", read, recognises))
