"""CSV exports of LaVision DaVis (StrainMaster): semicolons, Latin-1, units in the headings.

    x[mm];y[mm];z[mm];x-displacement[mm];y-displacement[mm];z-displacement[mm]

Source: public scripts that read such files and add the displacement to x, y, z for the deformed
membrane, so that these are places in the reference state. How DaVis marks lost correlation in CSV
could not be confirmed: rows of zeros throughout and empty cells are left out; zeros in the
displacement alone are not.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from ..frames import Frame, FrameOptions, frame_of
from ..registry import Format, register_format
from ..text_frames import read_text_rows

_NAMES = re.compile(rb"\bx\[\w+\].*\bx-displacement\[")


def recognises(path: Path, head: bytes) -> bool:
    """Return whether columns are called x and x-displacement, with a unit right behind."""
    return bool(_NAMES.search(head[:4096]))


def read(path: Path, options: FrameOptions) -> Sequence[Frame]:
    """Read the one frame of a file."""
    return [frame_of(read_text_rows(path, options), options, path, "davis")]


register_format(Format("davis", "frame", "CSV of LaVision DaVis", read, recognises))
