"""Find out which quantity a column holds, by words in English, German and French.

Test machines name a load or an elongation; headings of image correlation (DIC) name a component,
its unit and the state of the sheet.
"""

import re
from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase
from functools import lru_cache
from itertools import permutations

from ..light_dataclasses import dataclass
from .units import MAX_NAME_LENGTH, STRAIN_UNITS, split_unit

#: Largest number of names in a header row.
MAX_COLUMNS = 2000
#: Words that make a column one of these quantities, in English, German and French exports.
WORDS = {
    quantity: frozenset(words.split())
    for quantity, words in {
        "elongation": "elongation extension displacement disp crosshead stroke travel position"
        " weg standardweg traversenweg verfahrweg kolbenweg längenänderung"
        " déplacement deplacement allongement",
        "load": "load force kraft standardkraft prüfkraft last",
        "time": "time zeit temps prüfzeit zeitstempel timestamp uhrzeit datetime",
        "pressure": "pressure druck überdruck innendruck p",
        "deflection": "deflection displacement durchbiegung weg",
        "height": "height apex rise deflection h z dz gauge laser höhe stich wölbung durchbiegung"
        " scheitel",
        "coordinate": "coordinate coord x y s position abstand ort",
    }.items()
}
#: Words of what a biaxial test measures along each yarn, and of the yarns: "n_w", "eps fill".
LOADS = frozenset("n f force load kraft last stress spannung tension sigma σ".split())
STRAINS = frozenset("e eps epsilon ε strain dehnung".split())
WARP = frozenset("w warp kette chaîne chaine x".split())
FILL = frozenset("f fill weft schuss trame y".split())
#: A symbol with the letter of its yarn: "Nx", "exx", "εy".
_SYMBOL_OF_YARN = re.compile(r"(\w+?)(w|f|xx?|yy?)")
#: Quantities that need a word of each of two sets.
PAIRS = {
    f"{yarn} {measured}": (words, along)
    for measured, words in (("load", LOADS), ("strain", STRAINS))
    for yarn, along in (("warp", WARP), ("fill", FILL))
}
#: Words of columns of elongation: those measured on the strip, which are elongations (or strains)
#: by themselves; then those of the machine's travel, which holds the slip in the grips and the
#: machine's own give too; then those that are mostly its travel ("Extension" of Instron,
#: "Axial Displacement" of MTS, "Standardweg" of Zwick).
ON_THE_STRIP = frozenset(
    "extensometer videoextensometer laserextensometer gauge gage video ave dic längenänderung"
    " extensomètre feindehnung feindehnungsaufnehmer feinweg wegaufnehmer feinwegaufnehmer"
    " dehnungsaufnehmer ansetzaufnehmer extensometerweg videoxtens laserxtens makroxtens"
    " multixtens lightxtens optixtens".split()
)
OF_THE_MACHINE = frozenset(
    "crosshead stroke position travel actuator traversenweg traversenposition traverse verfahrweg"
    " kolbenweg".split()
)
BETWEEN_GRIPS = frozenset(
    "extension displacement disp weg standardweg déplacement deplacement".split()
)
#: "Extension (Strain 1)" is of the first transducer of strain, "(Extension)" of the crosshead.
_TRANSDUCER = re.compile(r"\((?:strain|dehnung) ?\d*\)")
STRAIN_WORDS = frozenset(("strain", "dehnung", "déformation"))
#: A column with one of these words is none of them: "Tensile strain (Extension)", "Load rate".
OTHER_QUANTITIES = STRAIN_WORDS | frozenset(
    "stress rate speed velocity time cell cycle spannung zeit geschwindigkeit contrainte temps"
    " vitesse".split()
)
#: A column with one of these words is no elongation and no strain along the strip.
NOT_ALONG_STRIP = (OTHER_QUANTITIES - STRAIN_WORDS) | frozenset(
    "true wahre log logarithmic transverse lateral width quer querdehnung".split()
)
#: Whole names of the columns that say which specimen and which direction a row belongs to.
LABELS = {
    "specimen": {"specimen", "specimen id", "specimen label", "sample id", "specimen name"}
    | {"sample", "probe nr", "proben nr", "probennummer", "probenkennung", "prüfling", "versuch"}
    | {"specimen number", "specimen no", "sample name", "probe"},
    "ratio": {"ratio", "load ratio", "stress ratio", "lastverhältnis", "verhältnis"},
    "repetition": {"repetition", "repeat", "run", "trial", "wiederholung"},
    "axis": {"axis", "line", "achse"},
    "direction": {"direction", "series", "test direction", "orientation", "richtung"}
    | {"direction deg", "direction degrees"},
}
#: How files may name the three directions of strips; case, spaces and signs do not matter. "0" and
#: "90" are not here: whether 0 degrees is warp or fill differs between laboratories.
DIRECTION_ALIASES: Mapping[str, str] = {
    **{"warp": "warp", "fill": "fill", "weft": "fill", "kette": "warp", "schuss": "fill"},
    **{"chaîne": "warp", "chaine": "warp", "trame": "fill"},
    **dict.fromkeys("bias bias45 45bias 45 45deg 45grad 45degree".split(), "bias"),
    **dict.fromkeys(("45degreebias", "diagonal"), "bias"),
}


@lru_cache(4096)
def means(name: str, quantity: str) -> bool:
    """Return whether a column of this name holds a quantity of `WORDS`, `PAIRS` or `LABELS`."""
    if len(name) > MAX_NAME_LENGTH:
        return False
    plain, unit = split_unit(name)
    plain = plain.casefold()
    if quantity == "time" and plain == "t":
        return bool(unit)
    if quantity in LABELS:
        return re.sub(r"[\W_]+", " ", plain).strip() in LABELS[quantity]
    words = _split_words(plain)
    if quantity in PAIRS:
        return _has_pair(words, *PAIRS[quantity])
    if quantity == "elongation" and (_is_measured_on_strip(plain) or NOT_ALONG_STRIP & {*words}):
        return NOT_ALONG_STRIP.isdisjoint(words)
    synonyms = WORDS[quantity]
    return not synonyms.isdisjoint(words) and (OTHER_QUANTITIES - synonyms).isdisjoint(words)


def _has_pair(words: list[str], measured: frozenset[str], yarn: frozenset[str]) -> bool:
    """Return whether one word names the measured quantity and another word the yarn."""
    # One word is not both: F is a force before the yarn, and the fill after another word.
    symbols = [match for match in map(_SYMBOL_OF_YARN.fullmatch, words) if match]
    pairs = [*permutations(words, 2), *((match[1], match[2][0]) for match in symbols)]
    if not any(a in measured and b in yarn for a, b in pairs):
        return False
    return (OTHER_QUANTITIES - measured).isdisjoint(words)


def columns_of(names: list[str], quantity: str, named: Mapping[str, str]) -> list[int]:
    """Return the columns that hold a quantity, by the name the user gives it, else by meaning.

    Where there is no column of elongation, those of strain are returned for it.
    """
    if quantity in named:
        return columns_named(names, named[quantity].strip())
    columns = [i for i, name in enumerate(names) if name and means(name, quantity)]
    if not columns and quantity == "elongation":
        return _strain_indices(names)
    return columns


def _strain_indices(names: list[str]) -> list[int]:
    """Return the places of columns whose names say that they hold a strain along the strip."""
    indices = []
    for index, name in enumerate(names):
        words = _words(name)
        if STRAIN_WORDS & words and NOT_ALONG_STRIP.isdisjoint(words):
            indices.append(index)
    return indices


def strain_columns(
    names: list[str], units: Mapping[str, str], named: Mapping[str, str]
) -> list[str]:
    """Return the names of the columns of strain, that measured closest to the specimen first."""
    if "strain" in named:
        return [names[i] for i in columns_named(names, named["strain"].strip())]
    strains = [names[i] for i in _strain_indices(names)]
    plain = [name for name in strains if not units[name] or units[name] in STRAIN_UNITS]
    return sorted(plain, key=distance_to_strip)


def columns_named(names: Sequence[str], label: str) -> list[int]:
    """Return the indices of columns of this name, or else of this name without the unit.

    A name may be a pattern such as "load*", for specimens side by side.
    """
    exact = [i for i, name in enumerate(names) if name == label]
    without_unit = [i for i, name in enumerate(names) if split_unit(name)[0] == label]
    return exact or without_unit or [i for i, name in enumerate(names) if fnmatchcase(name, label)]


def _words(name: str) -> set[str]:
    """Return the words of a name without its unit, in small letters; none of one too long."""
    if len(name) > MAX_NAME_LENGTH:
        return set()
    return set(_split_words(split_unit(name)[0].casefold()))


def is_along_fill(name: str) -> bool:
    """Return whether the name of a coordinate says that it is along the fill."""
    return not FILL.isdisjoint(_words(name))


def _split_words(plain: str) -> list[str]:
    """Return the words of a name, without digits and punctuation."""
    return re.split(r"[\W\d_]+", plain)


def _is_measured_on_strip(plain: str) -> bool:
    """Return whether a name says that a length is measured on the strip, not at the machine."""
    return not ON_THE_STRIP.isdisjoint(_split_words(plain)) or bool(_TRANSDUCER.search(plain))


def distance_to_strip(name: str) -> int:
    """Return where an elongation was measured: 0 on the strip, 2 by the machine, 1 if unknown."""
    if _is_measured_on_strip(split_unit(name)[0].casefold()):
        return 0
    return 2 if _words(name) & OF_THE_MACHINE else 1


def nearest_to_strip(names: list[str], columns: list[int]) -> list[int]:
    """Return those of some columns of elongation that were measured closest to the strip."""
    nearest = min((distance_to_strip(names[i]) for i in columns), default=0)
    return [i for i in columns if distance_to_strip(names[i]) == nearest]


def is_between_grips(name: str, is_chosen: bool) -> bool:
    """Return whether a column of elongation is the machine's travel from grip to grip.

    `is_chosen` says that the user named the column; then an ambiguous name counts as measured on
    the strip.
    """
    distance = distance_to_strip(name)
    if distance == 1 and not is_chosen:
        return bool(_words(name) & BETWEEN_GRIPS)
    return distance == 2


#: mm in one of each unit of length, by its name in small letters.
LENGTHS = {
    **dict.fromkeys(("mm", "millimeter", "millimetre", "millimeters", "millimetres"), 1.0),
    **dict.fromkeys(("cm", "centimeter", "centimetre", "centimeters", "centimetres"), 10.0),
    **dict.fromkeys(("m", "meter", "metre", "meters", "metres"), 1e3),
    **dict.fromkeys(("µm", "μm", "um", "micron", "microns", "micrometer", "micrometre"), 1e-3),
    **dict.fromkeys(("micrometers", "micrometres", "mikrometer"), 1e-3),
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
_WORD_IN_BRACKETS = re.compile(r"^(.*?)[\s_]*[(\[<{]\s*(\w+)\s*[)\]>}]$")


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
    in_brackets = _WORD_IN_BRACKETS.match(name)
    if at_the_end and not unit_in_name:
        plain, unit_in_name = at_the_end.groups()
    elif in_brackets and in_brackets[2].casefold() in LENGTHS:
        plain, unit_in_name = in_brackets.groups()
    unit = unit_in_name or unit
    words = [word for word in re.split(r"[\W_]+", plain.casefold()) if word]
    quantity = _quantity_beside_components(words)
    if quantity:
        return Heading(name, unit, quantity)
    return Heading(name, unit, *_component(words, unit.casefold()))


def is_of_no_length(unit: str) -> bool:
    """Return whether a unit is none of lengths, nor a word such as "ref" or "x" in its place."""
    words = set(re.findall(r"[^\W\d_]{2,}|[%‰°]", unit.casefold()))
    return unit.casefold() not in LENGTHS and not words <= _OF_COMPONENTS.union(_AXES)


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


def columns_by_quantity(
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
