"""CSV exports of LaVision DaVis (StrainMaster): semicolons, Latin-1, units in the headings.

    x[mm];y[mm];z[mm];x-displacement[mm];y-displacement[mm];z-displacement[mm]

Source: public scripts that read such files and add the displacement to x, y, z for the deformed
membrane, so that these are places in the reference state. How DaVis marks lost correlation in CSV
could not be confirmed: rows of zeros throughout and empty cells are left out; zeros in the
displacement alone are not.
"""

from __future__ import annotations

import re
from pathlib import Path

from ..registry import Format, register_format
from ..text_frames import text_reader

_NAMES = re.compile(rb"\bx\[\w+\].*\bx-displacement\[")


def recognises(path: Path, head: bytes) -> bool:
    """Return whether columns are called x and x-displacement, with a unit right behind."""
    return bool(_NAMES.search(head[:4096]))


register_format(Format("davis", "frame", "CSV of LaVision DaVis", text_reader("davis"), recognises))
