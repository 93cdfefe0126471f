"""A series of files for ParaView: a collection that names one .vtu a time, and plays them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.sax.saxutils import quoteattr

from ..files import write_text

HEAD = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n  <Collection>\n'
TAIL = "  </Collection>\n</VTKFile>\n"


def write_pvd(path: Path, files: Sequence[tuple[float, Path]]) -> Path:
    """Write a collection of files that are there, each with its time.

    Parameters
    ----------
    path : ends in .pvd. files : time (whatever it counts: kPa) and file, named from the collection.

    Raises
    ------
    OutputError : the file cannot be written.
    """
    rows = [
        f'    <DataSet timestep="{time:.9g}" part="0" '
        f"file={quoteattr(file.relative_to(path.parent).as_posix())}/>\n"
        for time, file in files
    ]
    write_text(path, HEAD + "".join(rows) + TAIL)
    return path
