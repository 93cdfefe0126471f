"""Text exports of GOM ARAMIS, GOM Correlate and ZEISS Correlate: lines of title, semicolons.

    # ARAMIS Professional
    id;x_undeformed [mm];y_undeformed [mm];z_undeformed [mm];ux [mm];uy [mm];uz [mm]

Source: the public readers of such files in crackpy (windows-1252, semicolons, places in the
reference state and displacements, NaN since 2020), aramis_cdt (undeformed coordinates and
displacements as exports of their own) and pypif (two lines of title, units in square brackets). The
German headings (`Verschiebung X`), the row of units and the decimal comma could not be confirmed
from a file; the words in `frames` stand for them. What is called "deformed" or "verformt"
is taken for a place after the motion, all else for one before it.
"""

from __future__ import annotations

import re
from pathlib import Path

from ..registry import Format, register_format
from ..text_frames import text_reader

_MAKER = re.compile(rb"\b(aramis|gom|zeiss)\b", re.IGNORECASE)


def recognises(path: Path, head: bytes) -> bool:
    """Return whether a line of title names the maker or the program."""
    return bool(_MAKER.search(b"\n".join(head[:4096].splitlines()[:10]).replace(b"\0", b"")))


register_format(
    Format(
        "aramis", "frame", "text of ARAMIS or ZEISS Correlate", text_reader("aramis"), recognises
    )
)
