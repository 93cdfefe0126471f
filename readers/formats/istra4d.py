"""HDF5 exports of Dantec Istra4D: coordinates/coordinate_x, mask, displacements/displacement_x.

Source: the public reader istra2py of the planar export (coordinates of the deformed state; mask is
0 where correlation was lost). The third components are named alike by inference. Unit: mm unless
`length_unit` says otherwise.
"""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ..frames import Frame, FrameOptions, FrameRows, frame_of
from ..mat_files import SIGNATURE, array_of, check_readable, member, open_hdf5
from ..registry import Format, register_format

NAMES = {
    **{f"{axis} deformed": f"coordinates/coordinate_{axis}" for axis in "xyz"},
    **{f"d{axis}": f"displacements/displacement_{axis}" for axis in "xyz"},
}
MASK = "coordinates/mask"


def recognises(path: Path, head: bytes) -> bool:
    """Return whether the file is plain HDF5, not MATLAB's."""
    return head.startswith(SIGNATURE)


def read(path: Path, options: FrameOptions) -> Sequence[Frame]:
    """Read the one frame of a file."""
    check_readable(path, partial(_arrays, path))
    there = _arrays(path)
    mask = there.pop("mask", None)
    if not {"x deformed", "y deformed", "dx", "dy"} <= {*there}:
        problem = "expected coordinates/coordinate_x and so on: export coordinates, displacements"
        raise InputError(path, "", problem)
    if len({value.size for value in [*there.values(), *([] if mask is None else [mask])]}) != 1:
        raise InputError(path, "", "coordinates, displacements and mask are not of one size")
    valid = None if mask is None else np.asarray(mask != 0)
    rows = FrameRows(there, {key: NAMES[key] for key in there}, valid=valid)
    return [frame_of(rows, options, path, "istra4d")]


def _arrays(path: Path) -> dict[str, NDArray[np.float64]]:
    """Read the arrays that there are, flat."""
    with open_hdf5(path) as file:
        found = {key: member(path, file, name) for key, name in [*NAMES.items(), ("mask", MASK)]}
        return {
            key: array_of(path, item, NAMES.get(key, MASK)).ravel()
            for key, item in found.items()
            if item is not None
        }


register_format(Format("istra4d", "frame", "HDF5 of Istra4D", read, recognises))
