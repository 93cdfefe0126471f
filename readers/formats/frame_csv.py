"""A frame as a table in text with a row of names: one row a point, one column a quantity.

Separator, decimal mark, row of names and row of units are found; the words that name a quantity are
those of `frame_headings`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..frames import Frame, FrameOptions, frame_of
from ..registry import Format, register_format
from ..text_frames import read_text_rows


def read(path: Path, options: FrameOptions) -> Sequence[Frame]:
    """Read the one frame of a table; columns that are not asked for are ignored."""
    return [frame_of(read_text_rows(path, options), options, path, "csv")]


register_format(Format("csv", "frame", "columns of text in any dialect", read))
