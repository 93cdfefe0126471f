"""Find out which quantity a column holds, by the words of its name in English and German."""

import re
from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase
from functools import lru_cache
from itertools import permutations

from .units import MAX_NAME_LENGTH, STRAIN_UNITS, split_unit

#: Largest number of names in a header row.
MAX_COLUMNS = 2000
#: Words that make a column one of these quantities, in English and German exports.
WORDS = {
    quantity: frozenset(words.split())
    for quantity, words in {
        "elongation": "elongation extension displacement disp crosshead stroke travel position"
        " weg standardweg traversenweg verfahrweg kolbenweg längenänderung",
        "load": "load force kraft standardkraft prüfkraft",
        "time": "time zeit prüfzeit zeitstempel timestamp uhrzeit datetime",
        "pressure": "pressure druck überdruck innendruck p",
        "deflection": "deflection displacement durchbiegung weg",
        "height": "height apex rise deflection h z dz gauge laser höhe stich wölbung durchbiegung"
        " scheitel",
        "coordinate": "coordinate coord x y s position abstand ort",
    }.items()
}
#: Words of what a biaxial test measures along each yarn, and of the yarns: "n_w", "eps fill".
LOADS = frozenset("n f force load kraft stress spannung tension".split())
STRAINS = frozenset("eps epsilon strain dehnung".split())
WARP = frozenset("w warp kette x".split())
FILL = frozenset("f fill weft schuss y".split())
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
    " feindehnung feindehnungsaufnehmer feinweg wegaufnehmer feinwegaufnehmer dehnungsaufnehmer"
    " ansetzaufnehmer extensometerweg videoxtens laserxtens makroxtens multixtens lightxtens"
    " optixtens".split()
)
OF_THE_MACHINE = frozenset(
    "crosshead stroke position travel actuator traversenweg traversenposition traverse verfahrweg"
    " kolbenweg".split()
)
BETWEEN_GRIPS = frozenset("extension displacement disp weg standardweg".split())
#: "Extension (Strain 1)" is of the first transducer of strain, "(Extension)" of the crosshead.
_TRANSDUCER = re.compile(r"\((?:strain|dehnung) ?\d*\)")
STRAIN_WORDS = frozenset(("strain", "dehnung"))
#: A column with one of these words is none of them: "Tensile strain (Extension)", "Load rate".
OTHER_QUANTITIES = STRAIN_WORDS | frozenset(
    "stress rate speed velocity time cell cycle spannung zeit geschwindigkeit".split()
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
    **dict.fromkeys("bias bias45 45bias 45 45deg 45degree 45degreebias diagonal".split(), "bias"),
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
    if not any(a in measured and b in yarn for a, b in permutations(words, 2)):
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
