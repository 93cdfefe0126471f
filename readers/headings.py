"""Interpret column headings of digital image correlation (DIC): quantity, unit and state."""

import re
from collections.abc import Mapping, Sequence

from ..light_dataclasses import dataclass
from .quantities import columns_named
from .units import MAX_NAME_LENGTH, split_unit

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
#: Components of a vector whose heading does not name it; displacements if their unit is a length.
_VECTOR = {f"v{axis}": f"d{axis}" for axis in "xyz"}
_DISPLACEMENT = frozenset("displacement displacements disp verschiebung verschiebungen".split())
_REFERENCE = frozenset("undeformed reference ref initial unverformt referenz".split())
_DEFORMED = frozenset("deformed current cur verformt aktuell".split())
_FILLING = frozenset(
    "coordinate coordinates coord coor position pos point koordinate koordinaten punkt punkte"
    " model horizontal vertical out of plane in component komponente richtung direction".split()
)
_OF_COMPONENTS = _DISPLACEMENT | _REFERENCE | _DEFORMED | _FILLING
_NUMBERED = frozenset("id number no nr num index nummer".split())
#: Headings of the number of a frame in a table of all frames, and of that of a point.
_FRAMES = frozenset("frame stage step image picture snapshot bild stufe schritt aufnahme".split())
_POINTS = frozenset("id index point punkt pointid subset marker node facet facette".split())
#: Quantities by their whole heading.
_FLAGS_AND_SIGMA = {
    "sigma": "sigma",
    **dict.fromkeys(("valid", "isvalid", "is valid", "validity", "gültig"), "valid"),
    **dict.fromkeys(("invalid", "rejected", "doubtful", "ungültig"), "invalid"),
}
_UNIT_AT_THE_END = re.compile(r"^(.*?)[\s_]+(µm|μm|um|inch|px|pixel)$", re.IGNORECASE)


@dataclass(frozen=True)
class Heading:
    """A column's heading.

    Attributes
    ----------
    name : str
        Heading as it stands in the file.
    unit : str
        Unit, "" where none is named.
    quantity : str
        x, y, z, dx, dy, dz, sigma, valid, invalid, frame, id, or "" for any other.
    state : str
        "reference" or "deformed" where the heading of a position says so, else "".
    """

    name: str
    unit: str
    quantity: str
    state: str = ""

    @property
    def scale(self) -> float | None:
        """Return the size of the unit in mm; None where no unit of length is named."""
        return LENGTHS.get(self.unit.casefold())

    @property
    def key(self) -> str:
        """Return the quantity, with " deformed" behind it for a position after the motion."""
        return f"{self.quantity} deformed" if self.state == "deformed" else self.quantity


def heading_of(name: str, unit: str = "") -> Heading:
    """Return the heading of a column; a unit in its name takes precedence over `unit`.

    >>> heading_of("disp.Horizontal Displacement U [mm]").quantity
    'dx'
    """
    if len(name) > MAX_NAME_LENGTH:
        return Heading(name, unit, "")
    plain, unit_in_name = split_unit(name)
    at_the_end = _UNIT_AT_THE_END.match(name)
    if at_the_end and not unit_in_name:
        plain, unit_in_name = at_the_end.groups()
    unit = unit_in_name or unit
    words = [word for word in re.split(r"[\W_]+", plain.casefold()) if word]
    quantity = _quantity_beside_components(words)
    if quantity:
        return Heading(name, unit, quantity)
    return Heading(name, unit, *_component(words, unit.casefold()))


def _quantity_beside_components(words: list[str]) -> str:
    """Return sigma, valid, invalid, frame or id where the words say that, else ""."""
    distinct = {*words}
    for quantity, synonyms in (("frame", _FRAMES), ("id", _POINTS)):
        if distinct & synonyms and distinct <= synonyms | _NUMBERED:
            return quantity
    return _FLAGS_AND_SIGMA.get(" ".join(words), "")


def _component(words: list[str], unit: str) -> tuple[str, str]:
    """Return the component of a position or displacement, and the state of a position."""
    is_length = unit in LENGTHS
    if unit and unit not in PIXELS.union(LENGTHS):
        return "", ""
    axes = _AXES | _VECTOR if is_length else _AXES
    components = [axes[word] for word in words if word in axes]
    further_words = set(words).difference(axes)
    if len(components) != 1 or not further_words <= _OF_COMPONENTS:
        return "", ""
    axis = components[0][-1]
    if components[0] != axis or further_words & _DISPLACEMENT:
        return f"d{axis}", ""
    if further_words & _REFERENCE:
        return axis, "reference"
    return axis, "deformed" if further_words & _DEFORMED else ""


def columns_of(
    headings: Sequence[Heading], named: Mapping[str, str], upper_is_length: bool = False
) -> dict[str, list[int]]:
    """Return the indices of the columns that may hold each quantity; "x deformed" is one.

    Of several columns, lengths are preferred to columns without a unit, and these to pixels. A
    column with the plain name of the quantity is preferred to all, unless `upper_is_length`: then,
    of two names that differ in case, the one with a capital letter is the length.

    Parameters
    ----------
    headings : sequence of Heading
    named : mapping
        Column names by quantity, as the user or the format gives them.
    upper_is_length : bool
        Whether capital letters mark lengths.
    """
    taken_names = {name.strip() for name in named.values()}
    candidates: dict[str, list[int]] = {}
    for index, heading in enumerate(headings):
        if heading.quantity and heading.name not in taken_names:
            candidates.setdefault(heading.key, []).append(index)
    columns = {
        key: _best(headings, indices, key, upper_is_length) for key, indices in candidates.items()
    }
    names = [heading.name for heading in headings]
    for quantity, name in named.items():
        columns[quantity] = columns_named(names, name.strip())
    return columns


def _best(
    headings: Sequence[Heading],
    columns: list[int],
    key: str,
    upper_is_length: bool,
) -> list[int]:
    """Return those columns of a quantity that most likely hold its lengths."""
    exact = [i for i in columns if headings[i].name == key]
    if exact and not upper_is_length:
        return exact

    def rank(index: int) -> tuple[int, bool]:
        heading = headings[index]
        is_small = upper_is_length and not heading.name[:1].isupper()
        if heading.unit.casefold() in PIXELS:
            return 2, is_small
        return int(not heading.scale), is_small

    best = min(map(rank, columns))
    return [i for i in columns if rank(i) == best]
