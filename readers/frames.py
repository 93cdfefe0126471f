"""Frames of image correlation (DIC): places at rest, displacements; headings as `formats` cite."""

import glob
import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, Note, NoteKind, check_one_of
from .registry import read_file
from .tables import LONGEST, called, split_unit

ORDER = NoteKind("order of frames")

Array = NDArray[np.float64]
#: Reference place and displacement, in the order of a frame's columns.
QUANTITIES = ("x", "y", "z", "dx", "dy", "dz")
PLACES = QUANTITIES[:3]
#: Why rows of a file are not used: what a table of provenance calls it.
FLAGGED, NEGATIVE_SIGMA = "flagged as doubtful", "sigma below zero"
ALL_ZERO, LOST, BELOW = "all zero", "without a value", "of words below the points"


@dataclass(frozen=True)
class FrameSource:
    """A record of what was read from a file; columns and units by quantity, as it has them."""

    format: str = ""
    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Frame:
    """A surface in one frame: points, displacement (m, 3) mm, NaN where correlation was lost.

    sigma : (m,) measure of error. ids : (m,) of the points. number : in a file of several.
    """

    points: Array
    displacement: Array
    path: Path | None = None
    dropped: Mapping[str, int] = field(default_factory=dict)
    sigma: Array | None = None
    source: FrameSource = field(default_factory=FrameSource)
    ids: Array | None = None
    number: float | None = None

    def __post_init__(self) -> None:
        if self.points.shape != self.displacement.shape or self.points.shape[1:] != (3,):
            shapes = f"{self.points.shape} and {self.displacement.shape}"
            raise ValueError(f"expected (m, 3) points and displacements, got {shapes}")


@dataclass(frozen=True)
class FrameOptions:
    """Options of a reader of frames.

    quantities : of `QUANTITIES`, those needed. columns : the file's own names. flag_column,
    valid_column : rows where the first is not zero, or the second is, are left out. length_scale :
    mm per unit where none is named. coordinates, camera_axes : state of the places, y down and z
    away; None where the format tells. planar : z, dz may lack. reference : a file of the places at
    rest.
    """

    quantities: tuple[str, ...] = QUANTITIES
    columns: Mapping[str, str] | None = None
    flag_column: str | None = None
    comment: str = "#"
    length_scale: float = 1.0
    valid_column: str | None = None
    decimal: Literal[".", ","] | None = None
    coordinates: Literal["reference", "deformed"] | None = None
    camera_axes: bool | None = None
    planar: bool = False
    reference: Path | None = None

    def __post_init__(self) -> None:
        if not 0 < self.length_scale < math.inf:
            problem = f"expected mm per unit, above 0, got {self.length_scale}"
            raise InputError(None, "length_scale", problem)
        for name in self.columns or ():
            check_one_of(name, QUANTITIES, "columns")


def read_frames(
    files: Sequence[Path | str], options: FrameOptions = FrameOptions(), format: str | None = None
) -> tuple[Frame, ...]:
    """Read frames in the order of the files; most formats have one a file."""
    if not files:
        raise InputError(None, "files", "expected one file a frame, got none")
    if options.reference is not None:
        return _moved_from(files, options.reference, options, format)
    found: list[Frame] = []
    for path in map(Path, files):
        frames: Sequence[Frame] = read_file("frame", path, format, options)
        for frame in frames:
            if np.isinf(frame.points).any() or np.isinf(frame.displacement).any():
                raise InputError(path, "", "lengths too large to be mm; is the length unit right?")
        found += frames
    return tuple(found)


def _moved_from(
    files: Sequence[Path | str], reference: Path, options: FrameOptions, format: str | None
) -> tuple[Frame, ...]:
    """Return frames of files of places less those at rest, paired by numbers, else row by row."""
    columns = {key: name for key, name in (options.columns or {}).items() if key in PLACES}
    asked = replace(options, quantities=PLACES, columns=columns, reference=None, coordinates=None)
    rest, *more = read_frames([reference], asked, format)
    if more:
        problem = f"expected the one frame of the undeformed sheet, found {1 + len(more)}"
        raise InputError(reference, "", problem)
    return tuple(_less(frame, rest) for frame in read_frames(files, asked, format))


def _less(frame: Frame, rest: Frame) -> Frame:
    """Return the frame of places with displacements from those at rest."""
    if np.isfinite(frame.displacement).any():
        problem = "holds displacements, and a reference is for files of places alone; leave it out"
        raise InputError(frame.path, "", problem)
    a = np.arange(len(frame.points))
    b = np.arange(len(rest.points))
    if frame.ids is not None and rest.ids is not None:
        _, a, b = np.intersect1d(frame.ids, rest.ids, return_indices=True)
    if len(a) != len(b) or not len(a):
        problem = (
            f"holds {len(a)} points, the reference {len(b)}, and no column of point numbers (id) in"
            " both says which are the same; export one, or all points of every frame"
        )
        raise InputError(frame.path, "", problem)
    sigma = None if frame.sigma is None else frame.sigma[a]
    moved = frame.points[a] - rest.points[b]
    return replace(frame, points=rest.points[b], displacement=moved, sigma=sigma, ids=None)


#: mm in one of each unit of length, by its name in small letters.
LENGTHS = {
    **dict.fromkeys(("mm", "millimeter", "millimetre", "millimeters", "millimetres"), 1.0),
    **dict.fromkeys(("cm", "centimeter", "centimetre"), 10.0),
    **dict.fromkeys(("m", "meter", "metre", "meters", "metres"), 1e3),
    **dict.fromkeys(("µm", "μm", "um", "micron", "microns", "micrometer", "mikrometer"), 1e-3),
    **dict.fromkeys(("in", "inch", "inches", "zoll", '"', "″"), 25.4),
    **dict.fromkeys(("mil", "mils", "thou"), 0.0254),
    **dict.fromkeys(("ft", "foot", "feet"), 304.8),
}
PIXELS = frozenset({"px", "pix", "pixel", "pixels"})
_AXES = {
    **dict(zip("xyz", "xyz", strict=True)),
    **{name: f"d{axis}" for axis, name in zip("xyz", "uvw", strict=True)},
    **{f"{letter}{axis}": f"d{axis}" for axis in "xyz" for letter in "du"},
}
#: Components of a vector without a word that says of what: displacements where they are lengths.
_VECTOR = {f"v{axis}": f"d{axis}" for axis in "xyz"}
_MOVED = frozenset("displacement displacements disp verschiebung verschiebungen".split())
_REFERENCE = frozenset("undeformed reference ref initial unverformt referenz".split())
_DEFORMED = frozenset("deformed current cur verformt aktuell".split())
_FILLING = frozenset(
    "coordinate coordinates coord coor position pos point koordinate koordinaten punkt punkte"
    " model horizontal vertical out of plane in component komponente richtung direction".split()
)
_VALID = frozenset({"valid", "isvalid", "is valid", "validity", "gültig"})
_INVALID = frozenset({"invalid", "rejected", "doubtful", "ungültig"})
#: Headings of the number of a frame in a table of all frames, and of that of a point.
_FRAMES = frozenset("frame stage step image picture snapshot bild stufe schritt aufnahme".split())
_POINTS = frozenset("id index point punkt pointid subset marker node facet facette".split())
_NUMBERED = frozenset("id number no nr num index nummer".split())
_UNIT_AT_THE_END = re.compile(r"^(.*?)[\s_]+(µm|μm|um|inch|px|pixel)$", re.IGNORECASE)


@dataclass(frozen=True)
class Heading:
    """A column's heading; quantity : of `QUANTITIES`, sigma, valid, invalid, frame, id, or ""."""

    name: str
    unit: str
    quantity: str
    state: str = ""

    @property
    def scale(self) -> float | None:
        """Return mm in one unit; None where no unit of length is named."""
        return LENGTHS.get(self.unit.casefold())


def heading_of(name: str, unit: str = "") -> Heading:
    """Return what a column holds; a unit in its name comes before one from a row of units.

    >>> heading_of("disp.Horizontal Displacement U [mm]").quantity
    'dx'
    """
    if len(name) > LONGEST:
        return Heading(name, unit, "")
    plain, own = split_unit(name)
    at_the_end = _UNIT_AT_THE_END.match(name)
    if not own and at_the_end:
        plain = at_the_end[1]
        own = at_the_end[2]
    unit = own or unit
    words = [word for word in re.split(r"[\W_]+", plain.casefold()) if word]
    whole = " ".join(words)
    if whole == "sigma":
        return Heading(name, unit, "sigma")
    for kind, of_kind in (("frame", _FRAMES), ("id", _POINTS)):
        if {*words} & of_kind and not {*words} - of_kind - _NUMBERED:
            return Heading(name, unit, kind)
    if whole in _VALID or whole in _INVALID:
        return Heading(name, unit, "valid" if whole in _VALID else "invalid")
    length = unit.casefold() in LENGTHS
    axes = _AXES | _VECTOR if length else _AXES
    found = [axes[word] for word in words if word in axes]
    others = {word for word in words if word not in axes}
    strange = others - _MOVED - _REFERENCE - _DEFORMED - _FILLING
    if len(found) != 1 or strange or not (length or unit.casefold() in PIXELS | {""}):
        return Heading(name, unit, "")
    quantity = found[0]
    if quantity not in "xyz" or others & _MOVED:
        return Heading(name, unit, f"d{quantity[-1]}")
    state = "reference" if others & _REFERENCE else "deformed" if others & _DEFORMED else ""
    return Heading(name, unit, quantity, state)


def columns_of(
    headings: Sequence[Heading], named: Mapping[str, str], upper: bool = False
) -> dict[str, list[int]]:
    """Return the columns that may hold each quantity, with deformed places as "x deformed".

    Lengths come before columns without a unit, those before pixels; a quantity's own name before
    all, unless `upper`: then, of two names that differ in case, the large one is the length.
    """
    places: dict[str, list[int]] = {}
    names = [heading.name for heading in headings]
    taken = [name.strip() for name in named.values()]
    for index, heading in enumerate(headings):
        if heading.quantity and heading.name not in taken:
            deformed = " deformed" if heading.state == "deformed" else ""
            places.setdefault(heading.quantity + deformed, []).append(index)
    found = {key: _best(headings, where, key, upper) for key, where in places.items()}
    found |= {quantity: called(names, name.strip()) for quantity, name in named.items()}
    return {key: where for key, where in found.items() if where or key in named}


def _best(headings: Sequence[Heading], where: list[int], key: str, upper: bool) -> list[int]:
    own = [i for i in where if headings[i].name == key]
    if own and not upper:
        return own

    def rank(index: int) -> tuple[int, bool]:
        heading = headings[index]
        pixels = heading.unit.casefold() in PIXELS
        small = upper and not heading.name[:1].isupper()
        return 2 if pixels else int(not heading.scale), small

    best = min(map(rank, where))
    return [i for i in where if rank(i) == best]


@dataclass(frozen=True, eq=False)
class FrameRows:
    """One frame as its file has it; ids, number : as those of `Frame`.

    values : (rows,) by quantity, also "x deformed"; NaN where correlation was lost. valid, sigma :
    (rows,), sigma below zero where lost. camera_axes : y points down and z away from the camera.
    """

    values: Mapping[str, Array]
    names: Mapping[str, str]
    units: Mapping[str, str] = field(default_factory=dict)
    valid: NDArray[np.bool_] | None = None
    sigma: Array | None = None
    camera_axes: bool = False
    dropped: Mapping[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    ids: Array | None = None
    number: float | None = None


def frame_of(rows: FrameRows, options: FrameOptions, path: Path, format: str) -> Frame:
    """Return the frame of the rows in mm, without flagged, negative sigma, or all zero ones."""
    notes = list(rows.notes)
    values = {name: _in_mm(rows, name, options, path) for name in rows.values}
    keep, dropped = _kept(rows, values)
    values = {name: value[keep] for name, value in values.items()}
    sigma, ids = (None if own is None else own[keep] for own in (rows.sigma, rows.ids))
    _complete(values, options, notes)
    missing = [name for name in options.quantities if name not in values]
    if missing:
        there = ", ".join(rows.names.values())[:300]
        problem = f"no column of {' and '.join(missing)}; name them with columns. Read: {there}"
        if set(missing) <= {"z", "dz"}:
            problem = f"planar correlation, without {' and '.join(missing)}; a stereo one is needed"
        raise InputError(path, "", problem)
    unknown = np.full(int(keep.sum()), np.nan)
    table = np.column_stack([values.get(quantity, unknown) for quantity in QUANTITIES])
    if rows.camera_axes if options.camera_axes is None else options.camera_axes:
        table[:, [1, 2, 4, 5]] *= -1.0
        notes.append("y and z are turned over: in the file y points down, z away from the camera")
    named = {name: unit for name, unit in rows.units.items() if unit}
    source = FrameSource(format, dict(rows.names), named, tuple(notes))
    return Frame(table[:, :3], table[:, 3:], path, dropped, sigma, source, ids, rows.number)


def _in_mm(rows: FrameRows, name: str, options: FrameOptions, path: Path) -> Array:
    unit = rows.units.get(name, "")
    if unit.casefold() in PIXELS:
        problem = f"is in pixels; export lengths, or name a column of {name} in mm with columns"
        raise InputError(path, f"column {rows.names[name]!r}", problem)
    scale = LENGTHS.get(unit.casefold(), options.length_scale)
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(rows.values[name] * scale)


def _kept(rows: FrameRows, values: Mapping[str, Array]) -> tuple[NDArray[np.bool_], dict[str, int]]:
    """Return the mask of rows that are points, and counts of the others by reason."""
    zero = np.all([value == 0 for value in values.values()], axis=0)
    keep = np.ones(len(zero), dtype=bool)
    dropped = {name: number for name, number in rows.dropped.items() if number}
    at_rest = all((np.nan_to_num(v) == 0).all() for name, v in values.items() if name[0] == "d")
    if at_rest and zero.sum() == 1:
        zero[:] = False
    reasons = [(FLAGGED, ~keep if rows.valid is None else ~rows.valid)]
    reasons += [(NEGATIVE_SIGMA, ~keep if rows.sigma is None else rows.sigma < 0), (ALL_ZERO, zero)]
    for reason, bad in reasons:
        if (bad & keep).any():
            dropped[reason] = dropped.get(reason, 0) + int((bad & keep).sum())
            keep &= ~bad
    return keep, dropped


def _complete(values: dict[str, Array], options: FrameOptions, notes: list[str]) -> None:
    """Add reference places and displacements, each computed from the other where missing."""
    if options.coordinates == "deformed":
        for axis in {*"xyz"} & {*values}:
            values[f"{axis} deformed"] = values.pop(axis)
    after = [axis for axis in "xyz" if f"{axis} deformed" in values]
    back = [axis for axis in after if axis not in values and f"d{axis}" in values]
    forth = [axis for axis in after if axis in values and f"d{axis}" not in values]
    for axis in back:
        values[axis] = values[f"{axis} deformed"] - values[f"d{axis}"]
    for axis in forth:
        values[f"d{axis}"] = values[f"{axis} deformed"] - values[axis]
    if back:
        state = "are places in the deformed state; the displacement is taken off"
        notes.append(f"{', '.join(back)} {state}")
    if forth:
        notes.append(f"displacements along {', '.join(forth)} are deformed less reference places")
    if options.planar and not {"z", "dz", "z deformed"} & set(values):
        values["z"] = values["dz"] = np.zeros_like(values["x"])
        notes.append("planar correlation: z and dz are taken to be zero")


def frame_files(
    given: Sequence[str], field: str = "files", folder: Path | None = None
) -> tuple[list[Path], Note | None]:
    """Return the files, those of a pattern by the numbers in their names; a note on order."""
    files: list[Path] = []
    names = [own if folder is None else str(folder / own) for own in given]
    for own, name in zip(given, names, strict=True):
        if not os.path.exists(name) and glob.has_magic(name):
            # The folder's own name is no pattern.
            wanted = own if folder is None else str(Path(glob.escape(str(folder))) / own)
            found = [Path(f) for f in glob.glob(wanted, recursive=True) if not Path(f).is_dir()]
            if not found:
                raise InputError(None, field, f"no file matches {name!r}")
            files += sorted(found, key=_numbers)
        elif os.path.isdir(name):
            problem = f"expected files; quote a pattern such as {str(Path(name) / '*.csv')!r}"
            raise InputError(name, field, f"is a folder, {problem}")
        else:
            files.append(Path(name))
    for i, file in enumerate(files):
        if file in files[:i]:
            raise InputError(file, field, "is given twice")
    by_number = sorted(files, key=_numbers)
    as_shell = list(map(str, files)) == names and sorted(files, key=str) == files != by_number
    if not as_shell:  # which sorts frame_10 before frame_2
        return files, None
    first, second = next((a, b) for a, b in zip(files, by_number, strict=True) if a != b)
    order = f"frames in the order given: {first.name} before {second.name}"
    return files, Note(ORDER, f"{order}; quote the pattern to have them by number")


def _numbers(file: Path) -> list[tuple[bool, int, str]]:
    """Return a sort key: digits as numbers, numbers before letters."""
    parts = re.findall(r"\d+|\D+", str(file))
    return [(not p.isdecimal(), int(p) if p.isdecimal() else 0, p) for p in parts]
