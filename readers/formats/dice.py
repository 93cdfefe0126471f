"""Solution files of DICe: lines of `***`, a row of names, SIGMA and STATUS_FLAG.

    *** Digital Image Correlation Engine (DICe), Copyright 2014 Sandia Corporation
SUBSET_ID,COORDINATE_X,...,SIGMA,STATUS_FLAG,MODEL_COORDINATES_X,...,MODEL_DISPLACEMENT_X,...

Source: DICe's own (DICe_Schema.cpp; DICe.h numbers the states, of which those that failed are left
out; sigma is -1 where correlation failed) and public scripts that add MODEL_DISPLACEMENT to
MODEL_COORDINATES. COORDINATE_X is in pixels; y points down; that z points away from the camera
could not be confirmed (`camera_axes = false` leaves both). MODEL_ is in the calibration's unit.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ...errors import InputError
from ..frames import Frame, FrameOptions, frame_of
from ..registry import Format, register_format
from ..tables import read_lines
from ..text_frames import read_text_rows

#: The states of DICe.h in which a subset was found; all others are failures of some step.
SUCCESSFUL = (0, 1, 2, 3, 4, 6, 15, 18)
NAMES = {
    **{axis: f"MODEL_COORDINATES_{axis.upper()}" for axis in "xyz"},
    **{f"d{axis}": f"MODEL_DISPLACEMENT_{axis.upper()}" for axis in "xyz"},
}


def recognises(path: Path, head: bytes) -> bool:
    """Return whether the header is DICe's, or the row of names without one."""
    return (head.startswith(b"***") and b"DICe" in head) or head.startswith(b"SUBSET_ID")


def read(path: Path, options: FrameOptions) -> Sequence[Frame]:
    """Read the one frame of a file; without a stereo model it is refused."""
    top = "\n".join(text for _, text in read_lines(path, "***", any_encoding=True)[:3])
    if NAMES["x"] not in top and not options.columns:
        problem = f"has no {NAMES['x']}: planar and in pixels; run DICe with a stereo calibration"
        raise InputError(path, "", problem)
    good = "STATUS_FLAG", SUCCESSFUL
    # Without a stereo model, of columns that the user names, the model's are not asked for.
    names = {key: name for key, name in NAMES.items() if name in top}
    every = read_text_rows(path, options, comment="***", names=names, status=good, camera_axes=True)
    return [frame_of(rows, options, path, "dice") for rows in every]


register_format(Format("dice", "frame", "solution files of DICe", read, recognises))
