"""What the columns of an image correlation's export are called, and the units they name.

The words are those of DaVis, VIC-3D, ARAMIS, MatchID, DICe and pyALDIC-3D exports, whose readers in
`formats` name the source of each, and of plain tables in English and German.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from .column_names import LONGEST, split_unit

#: mm in one of each unit of length, by its name in small letters.
LENGTHS = {
    **dict.fromkeys(("mm", "millimeter", "millimetre", "millimeters", "millimetres"), 1.0),
    **dict.fromkeys(("cm", "centimeter", "centimetre"), 10.0),
    **dict.fromkeys(("m", "meter", "metre", "meters", "metres"), 1e3),
    **dict.fromkeys(("µm", "μm", "um", "micron", "microns", "micrometer", "mikrometer"), 1e-3),
    **dict.fromkeys(("in", "inch", "inches", "zoll"), 25.4),
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
_UNIT_AT_THE_END = re.compile(r"^(.*?)[\s_]+(µm|μm|um|inch|px|pixel)$", re.IGNORECASE)


@dataclass(frozen=True)
class Heading:
    """A column's heading.

    Parameters
    ----------
    name : as the file has it.
    unit : as the file has it, "" for none.
    quantity : x, y, z, dx, dy, dz, sigma, valid, invalid; "" for anything else.
    state : of a coordinate, "reference" or "deformed" where the heading says so, else "".
    """

    name: str
    unit: str
    quantity: str
    state: str = ""

    @property
    def scale(self) -> float | None:
        """mm in one unit; None where no unit of length is named."""
        return LENGTHS.get(self.unit.casefold())


def heading_of(name: str, unit: str = "") -> Heading:
    """What a column holds.

    >>> heading_of("disp.Horizontal Displacement U [mm]").quantity
    'dx'

    unit : from a row of units below the names; one in the name itself comes first.
    """
    if len(name) > LONGEST:
        return Heading(name, unit, "")
    plain, own = split_unit(name)
    at_the_end = _UNIT_AT_THE_END.match(name)
    if not own and at_the_end:
        plain, own = at_the_end[1], at_the_end[2]
    unit = own or unit
    words = [word for word in re.split(r"[\W_]+", plain.casefold()) if word]
    whole = " ".join(words)
    if whole == "sigma":
        return Heading(name, unit, "sigma")
    if whole in _VALID or whole in _INVALID:
        return Heading(name, unit, "valid" if whole in _VALID else "invalid")
    axes = _AXES | _VECTOR if unit.casefold() in LENGTHS else _AXES
    found = [axes[word] for word in words if word in axes]
    others = {word for word in words if word not in axes}
    if len(found) != 1 or others - _MOVED - _REFERENCE - _DEFORMED - _FILLING:
        return Heading(name, unit, "")
    if unit and unit.casefold() not in LENGTHS and unit.casefold() not in PIXELS:
        return Heading(name, unit, "")
    quantity = found[0]
    if quantity in "xyz" and others & _MOVED:
        return Heading(name, unit, f"d{quantity}")
    if quantity not in "xyz":
        return Heading(name, unit, quantity)
    state = "reference" if others & _REFERENCE else "deformed" if others & _DEFORMED else ""
    return Heading(name, unit, quantity, state)


def columns_of(
    headings: Sequence[Heading], named: Mapping[str, str], upper: bool = False
) -> dict[str, list[int]]:
    """The columns that may hold each quantity; deformed coordinates are those of "x deformed".

    Of several, those with a unit of length come before those without, which come before pixels;
    a column of exactly the quantity's own name before all, unless `upper`.

    Parameters
    ----------
    named : the file's own names of some quantities, with or without the unit.
    upper : of two names that differ only in their letters' size, the large one is the length.
    """
    places: dict[str, list[int]] = {}
    taken = [name.strip() for name in named.values()]
    for index, heading in enumerate(headings):
        if heading.quantity and heading.name not in taken:
            key = heading.quantity
            key += " deformed" if heading.state == "deformed" else ""
            places.setdefault(key, []).append(index)
    found = {key: _best(headings, where, key, upper) for key, where in places.items()}
    for quantity, name in named.items():
        exact = [i for i, one in enumerate(headings) if one.name == name.strip()]
        plain = [i for i, one in enumerate(headings) if split_unit(one.name)[0] == name.strip()]
        found[quantity] = exact or plain
    return {key: where for key, where in found.items() if where or key in named}


def _best(headings: Sequence[Heading], where: list[int], key: str, upper: bool) -> list[int]:
    own = [i for i in where if headings[i].name == key]
    if own and not upper:
        return own

    def rank(index: int) -> tuple[int, int]:
        heading = headings[index]
        pixels = heading.unit.casefold() in PIXELS
        size = int(upper and not heading.name[:1].isupper())
        return (2 if pixels else int(bool(heading.scale is None)), size)

    best = min(rank(i) for i in where)
    return [i for i in where if rank(i) == best]
