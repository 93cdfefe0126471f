"""CSV exports of Correlated Solutions VIC-3D: quoted headings, a sigma, perhaps lines above.

    "X [mm]","Y [mm]","Z [mm]","U [mm]","V [mm]","W [mm]","sigma [pixel]"

Source: public scripts that write and read such files (with `,` and, from German systems, `;` and
decimal commas and a line above the names), in which sigma is below zero where correlation was lost,
X, Y, Z are added to U, V, W for the deformed state, and rejected points have empty cells. Files
without units are older ones; there "x" in small letters is a place in the picture and "X" one in
space.

MAT-files hold a grid of X, Y, Z, U, V, W and sigma. Source: public scripts that load such files: X,
Y, Z, U, V, W are lengths, x, y, u, v in small letters pixels, and points with a sigma of -1 are
bad. The unit is not in the file: mm unless `length_unit` says otherwise (could not be confirmed).
"""

import re
from collections.abc import Sequence
from pathlib import Path

from ...errors import InputError
from ..frames import Frame, FrameOptions, FrameRows, frame_of
from ..mat_files import is_mat, numbers_of, read_variables, variable_names
from ..registry import Format, register_format
from ..text_frames import text_reader

_PLACE = re.compile(rb'"\s*X( \[\w+\])?\s*"')
_MOVED = re.compile(rb'"\s*(W|sigma)( \[\w+\])?\s*"')


def recognises(path: Path, head: bytes) -> bool:
    """Return whether "X" and "W" or "sigma" are quoted headings."""
    top = head[:4096]
    return bool(_PLACE.search(top) and _MOVED.search(top))


NAMES = {"x": "X", "y": "Y", "z": "Z", "dx": "U", "dy": "V", "dz": "W", "sigma": "sigma"}


def recognises_vic3d_mat(path: Path, head: bytes) -> bool:
    """Return whether X, Y, U, V and W are among the variables of a MAT-file, and no frames."""
    there = variable_names(path, head) if is_mat(head) else None
    return there is not None and {*"XYUVW"} <= {*there} and "points3D" not in there


def read_vic3d_mat(path: Path, options: FrameOptions) -> Sequence[Frame]:
    """Read the one frame of a file."""
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


for one in (
    Format("vic3d", "frame", "CSV of VIC-3D", text_reader("vic3d", upper=True), recognises),
    Format("vic3d-mat", "frame", "MAT-files of VIC-3D", read_vic3d_mat, recognises_vic3d_mat),
):
    register_format(one)
