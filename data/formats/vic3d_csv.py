"""CSV exports of Correlated Solutions VIC-3D: quoted headings, a sigma, perhaps lines above.

    "X [mm]","Y [mm]","Z [mm]","U [mm]","V [mm]","W [mm]","sigma [pixel]"

Source: public scripts that write and read such files (with `,` and, from German systems, `;` and
decimal commas and a line above the names), in which sigma is below zero where correlation was lost,
X, Y, Z are added to U, V, W for the deformed state, and rejected points have empty cells. Files
without units are older ones; there "x" in small letters is a place in the picture and "X" one in
space.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from ..frame_rows import frame_of
from ..frames import Frame, FrameOptions
from ..registry import Format, register_format
from ..text_frames import read_text_rows

_PLACE = re.compile(rb'"\s*X( \[\w+\])?\s*"')
_MOVED = re.compile(rb'"\s*(W|sigma)( \[\w+\])?\s*"')


def recognises(path: Path, head: bytes) -> bool:
    """Whether "X" and "W" or "sigma" are quoted headings."""
    top = head[:4096]
    return bool(_PLACE.search(top) and _MOVED.search(top))


def read(path: Path, options: FrameOptions) -> Sequence[Frame]:
    """The one frame of a file."""
    return [frame_of(read_text_rows(path, options, upper=True), options, path, "vic3d")]


register_format(Format("vic3d", "frame", "CSV of VIC-3D", read, recognises))
