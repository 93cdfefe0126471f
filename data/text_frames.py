"""The points of a frame from a table in a text file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from .frame_rows import FrameRows
from .frames import FLAGGED, FrameOptions
from .text_cells import read_numbers
from .text_columns import flag_columns, quantity_columns
from .text_layouts import find_layout

#: Names of columns that say whether a row is good, but not in which way.
UNCLEAR = frozenset({"flag", "mask", "status", "quality", "state"})


def read_text_rows(
    path: Path,
    options: FrameOptions,
    *,
    comment: str | None = None,
    upper: bool = False,
    camera_axes: bool = False,
    names: Mapping[str, str] | None = None,
    status: tuple[str, Sequence[int]] | None = None,
) -> FrameRows:
    """The rows of the one frame in a text file.

    Parameters
    ----------
    comment : that of the format, where it has one of its own.
    upper : of two names that differ only in their letters' size, the large one is the length.
    names : what the format calls some quantities; the user's own come first.
    status : a column of states, and the values of good rows.

    Raises
    ------
    InputError : naming file, line and column: no such file, missing columns, cells that are not
        numbers.
    """
    own = {key: name.strip(' "') for key, name in (options.columns or {}).items()}
    named = {**(names or {}), **own}
    mark = options.comment if comment is None else comment
    wanted = [*options.quantities]
    layout = find_layout(path, wanted, named, mark, options.decimal, upper)
    columns = quantity_columns(path, layout, named, options)
    flags = flag_columns(path, layout, columns, options, status)
    numbers = {key: i for key, i in columns.items() if key not in ("valid", "invalid")}
    values, good = read_numbers(path, layout, numbers, flags)
    sigma = values.pop("sigma", None)
    headings = {key: layout.headings[i] for key, i in numbers.items() if key != "sigma"}
    unclear = [h.name for h in layout.headings if h.name.casefold() in UNCLEAR]
    notes = [
        f"column {name!r} is not used; flag_column or valid_column says what it means"
        for name in unclear
        if name not in (options.flag_column, options.valid_column)
    ]
    return FrameRows(
        values,
        {key: heading.name for key, heading in headings.items()},
        {key: heading.unit for key, heading in headings.items() if heading.unit},
        sigma=sigma,
        camera_axes=camera_axes,
        dropped={FLAGGED: int((~good).sum())},
        notes=tuple(notes),
    )
