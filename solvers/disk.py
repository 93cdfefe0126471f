"""Whether a solver found the disk full."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from pathlib import Path

from .process import Outcome

#: Free space (bytes) at which a run that ended badly is said to have filled the disk.
FULL = 1024**2
#: What programs say who cannot write, in any case of letters.
WORDS = ("No space left on device", "File too large", "Disk quota exceeded")


def disk_full(folder: Path, lines: Iterable[str], outcome: Outcome) -> str:
    """What shows that the disk of a run was full, "" where nothing does.

    Parameters
    ----------
    lines : what the program printed.
    """
    if outcome.signal_name == "SIGXFSZ":
        return "a file would be larger than allowed"
    for line in lines:
        for words in WORDS:
            if words.lower() in line.lower():
                return words
    try:
        free = shutil.disk_usage(folder).free
    except OSError:
        return ""
    return f"{free} bytes left for {folder}" if free < FULL else ""
