"""Tables in text files: cells and lines, what columns are called, and the units they name."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import date
from itertools import permutations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..files import content_of
from ..files import pandas as pd

#: Cells, in small letters, that stand for no value: empty, and what C, .NET and spreadsheets write.
HOLES = ("", "nan", "-nan", "-nan(ind)", "1.#qnan", "-1.#ind", "n. def.", "n/a", "---")


@dataclass(frozen=True, eq=False)
class TextTable:
    """Cells as text, a column a name of the header, with the line of each row from 1."""

    path: Path
    cells: pd.DataFrame
    lines: NDArray[np.intp]
    decimal: str = "."

    def numbers(self, column: str, holes: bool = False) -> NDArray[np.float64]:
        """Return one column as finite numbers, (rows,); with `holes`, those of `HOLES` give NaN."""
        text = plain = self.text(column)
        if self.decimal != ".":
            # A point beside decimal commas marks thousands, or a mistake: no number either way.
            plain = text.str.replace(".", "?", regex=False)
            plain = plain.str.replace(self.decimal, ".", regex=False)
        value = pd.to_numeric(plain, errors="coerce").to_numpy(dtype=float)
        bad = ~np.isfinite(value)
        stripped = [cell.strip() for cell in text[bad]]
        if bad.any() and (
            # One cell with both marks says which is which, for the others of its column too.
            any(is_grouped(cell, self.decimal) for cell in stripped)
            or are_thousands([cell.strip() for cell in text], self.decimal)
        ):
            plain = pd.Series([_ungrouped(cell.strip(), self.decimal) for cell in text])
            value = pd.to_numeric(plain, errors="coerce").to_numpy(dtype=float)
            bad = ~np.isfinite(value)
        if holes and bad.any():
            # Only of the rows in question: text costs more than numbers.
            bad[bad] = ~text[bad].str.strip().str.lower().isin(HOLES).to_numpy(dtype=bool)
        if bad.any():
            first = int(np.argmax(bad))
            more = int(bad.sum()) - 1
            cell = text.iloc[first].strip()
            problem = f"expected a number, found {repr(cell[:40]) if cell else 'nothing'}"
            if _GROUPED.fullmatch(cell):
                problem += "; write numbers without marks of thousands"
            if more:
                problem += f"; so in {more} more row{'s' * (more > 1)}"
            raise InputError(self.path, f"line {self.lines[first]}, column {column!r}", problem)
        return value

    def stamps(self, column: str) -> NDArray[np.float64] | None:
        """Return wall-clock times, (rows,) s since the first midnight; None of others."""
        text = [cell.strip() for cell in self.text(column)]
        if not text or not is_stamp(text[0]):
            return None
        found = [_STAMP.fullmatch(cell) for cell in text]
        if None in found:
            row = found.index(None)
            problem = f"expected a time as {text[0]!r}, found {text[row][:40]!r}"
            raise InputError(self.path, f"line {self.lines[row]}, column {column!r}", problem)
        known = [one for one in found if one is not None]
        clock = np.array([_of_day(one) for one in known])
        dates = [one["date"] for one in known]
        day = np.cumsum(np.diff(clock, prepend=clock[0]) < -HALF_A_DAY, dtype=np.intp)
        if any(dates):
            try:
                day = _day_numbers(dates)
            except (TypeError, ValueError):
                problem = "expected a date before each time, of day, month and year"
                raise InputError(self.path, f"column {column!r}", problem) from None
        return np.asarray(clock + 2 * HALF_A_DAY * day)

    def text(self, column: str) -> pd.Series:
        """Return one column as it stands in the file."""
        names = [str(name) for name in self.cells.columns]
        check_one(self.path, names, column)
        return self.cells[column]


def check_one(path: Path, names: Sequence[str], column: str) -> None:
    """Refuse a name that is not in the header, or twice."""
    if names.count(column) != 1:
        what = "appears twice" if column in names else "is missing"
        problem = f"this column {what}; the file has: {', '.join(names)[:300]}"
        raise InputError(path, f"column {column!r}", problem)


#: Cells that may be missing from the ends of rows, beyond as many as a file has letters.
MOST_MISSING = 10**7


def check_width(path: Path, line: int, width: int, rows: int, letters: int) -> None:
    """Refuse a table that is mostly holes: a long row of names, far shorter rows."""
    if width * rows > letters + MOST_MISSING:
        problem = f"{width} names, and {rows} rows that are far shorter; is it a table?"
        raise InputError(path, f"line {line}", problem)


def check_row(
    path: Path,
    line: int,
    row: Sequence[str],
    width: int,
    separator: str | None,
    names: str,
    short: bool = False,
) -> None:
    """Refuse a row with more cells than names; with `short`, one of blanks that has fewer."""
    if any(row[width:]) or (short and separator is None and len(row) < width):
        problem = f"expected {width} cells as in {names}, found {len(row)}"
        if separator == ",":
            problem += "; decimal commas need another separator, or quotation marks"
        raise InputError(path, f"line {line}", problem)


def read_table(path: Path) -> TextTable:
    """Read a table with a header line, without blank lines and those that start with "#"."""
    numbered = read_lines(path)
    if len(numbered) < 2:
        found = "only a header line" if numbered else "nothing"
        raise InputError(path, "", f"expected a header line and rows of numbers, found {found}")
    rows = []
    for number, text in numbered:
        try:
            rows.append(next(csv.reader([text], strict=True)))
        except csv.Error as error:
            problem = f"a quotation mark that is not closed, or too long a cell ({error})"
            raise InputError(path, f"line {number}", problem) from None
        check_row(path, number, rows[-1], len(rows[0]), ",", "the header")
    lines = np.array([number for number, _ in numbered])
    header = [name.strip() for name in rows[0]]
    width = len(header)
    check_width(path, lines[0], width, len(rows), sum(len(text) for _, text in numbered))
    whole = [(row + [""] * width)[:width] for row in rows[1:]]
    return TextTable(path, pd.DataFrame(whole, columns=header, dtype=str), lines[1:])


def read_lines(path: Path, comment: str = "#", any_encoding: bool = False) -> list[tuple[int, str]]:
    """Read the lines, from 1, but blanks and comments; any_encoding : UTF-16 and Latin-1 too."""
    save = "save it as a comma-separated table"
    try:
        content = content_of(path)
        marked = any_encoding and content.startswith((b"\xff\xfe", b"\xfe\xff"))
        try:
            text = content.decode("utf-16" if marked else "utf-8-sig")
        except UnicodeDecodeError:
            if marked or not any_encoding:
                raise
            text = content.decode("latin-1")
    except FileNotFoundError:
        raise InputError(path, "", "no such file") from None
    except OSError as error:
        raise InputError(path, "", f"cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise InputError(path, "", f"is not text in UTF-8; {save}") from None
    if "\0" in text:
        raise InputError(path, "", f"is not a text file; {save}")
    kept = enumerate(text.replace("\r\n", "\n").replace("\r", "\n").split("\n"), start=1)
    return [(n, t) for n, t in kept if t.strip() and not (comment and t.startswith(comment))]


NUMBER = r"[+-]?(?:\d++[.,]?\d*+|[.,]\d++)(?:[eE][+-]?\d++)?"
_NUMBER = re.compile(NUMBER)
_COMMA = re.compile(r"[+-]?\d*+,\d++([eE][+-]?\d++)?")
_GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}((,\d{3})+|(\.\d{3})+)")
_BELOW_1000 = re.compile(r"[+-]?\d{1,3}")

#: "1 013,5", "1'013.5": no mark of decimals stands before three digits here.
_BLANKS = re.compile(r"(?<=\d)[ '’\u00a0\u2009\u202f](?=\d{3}(?!\d))")


def is_grouped(cell: str, decimal: str) -> bool:
    """Return whether a cell holds a number whose thousands are marked, beyond any doubt."""
    other = "," if decimal == "." else "."
    both = rf"[+-]?[1-9]\d{{0,2}}(\{other}\d{{3}})+\{decimal}\d+"
    return bool(re.fullmatch(both, cell)) or (
        bool(_BLANKS.search(cell)) and is_number(_BLANKS.sub("", cell))
    )


def are_thousands(cells: Sequence[str], decimal: str) -> bool:
    """Return whether all are whole numbers, some with marks of thousands, some plain above 99."""
    other = "," if decimal == "." else "."
    marked = [cell for cell in cells if other in cell]
    plain = [cell for cell in cells if other not in cell and cell.casefold() not in HOLES]
    return (
        bool(marked)
        and all(map(_GROUPED.fullmatch, marked))
        and all(map(_BELOW_1000.fullmatch, plain))
        and any(len(cell.lstrip("+-")) == 3 for cell in plain)
    )


def _ungrouped(cell: str, decimal: str) -> str:
    """Return a number without marks of thousands and with a decimal point; else no number."""
    cell = _BLANKS.sub("", cell)
    other = "," if decimal == "." else "."
    if not re.fullmatch(rf"[+-]?([1-9]\d{{0,2}}(\{other}\d{{3}})+(\{decimal}\d*)?)", cell):
        return cell.replace(other, "?").replace(decimal, ".")
    return cell.replace(other, "").replace(decimal, ".")


def is_number(cell: str) -> bool:
    """Return whether a cell holds one number, with either mark."""
    return bool(_NUMBER.fullmatch(cell))


HALF_A_DAY = 43200.0
#: "12.03.2021 14:02:11,500", "2021-03-12T14:02:11.5Z", "2:02:11 PM".
_STAMP = re.compile(
    r"(?:(?P<date>\d{1,4}[./-]\d{1,2}[./-]\d{1,4})[T,]? ?)?"
    r"(?P<h>\d{1,2}):(?P<m>[0-5]\d):(?P<s>[0-5]\d(?:[.,]\d+)?)"
    r"(?: ?(?P<half>[AaPp])\.?[Mm]\.?)?(?: ?(?:Z|UTC|[+-]\d\d:?\d\d))?"
)


def is_stamp(cell: str) -> bool:
    """Return whether a cell holds a time of a wall clock, with or without its date."""
    return bool(_STAMP.fullmatch(cell))


def _of_day(stamp: re.Match[str]) -> float:
    """Return seconds since midnight."""
    hour = int(stamp["h"])
    half = stamp["half"]
    hour = hour % 12 + 12 * (half in "Pp") if half else hour
    return 3600.0 * hour + 60.0 * int(stamp["m"]) + float(stamp["s"].replace(",", "."))


def _day_numbers(dates: Sequence[str]) -> NDArray[np.intp]:
    """Return days since the first; of the orders of day and month that of the shorter time."""
    parts = [[int(part) for part in re.split("[./-]", one)] for one in dates]
    found = []
    for order in ((0, 1, 2), (2, 1, 0), (2, 0, 1)):
        with suppress(ValueError):
            days = [date(*(one[i] for i in order)).toordinal() for one in parts]
            found.append(np.array(days) - days[0])
    return min(found, key=np.ptp)


def decimal_mark(path: Path, cells: Sequence[tuple[int, str, str]]) -> str:
    """Return the decimal mark of cells that should be numbers: (line, column, text)."""
    by_column: dict[str, list[str]] = {}
    for _, name, cell in cells:
        by_column.setdefault(name, []).append(cell)
    points = any("." in cell and is_number(cell) for _, _, cell in cells)
    if points and any(_COMMA.fullmatch(cell) for _, _, cell in cells):
        # Marks of thousands say nothing of the decimal mark, but that it is the other.
        whole = {n for n, own in by_column.items() for mark in ".," if are_thousands(own, mark)}
        cells = [one for one in cells if one[1] not in whole]
        points = any("." in cell and is_number(cell) for _, _, cell in cells)
    commas = [one for one in cells if _COMMA.fullmatch(one[2])]
    if not commas or points:
        return "."
    if all(_GROUPED.fullmatch(cell) for _, _, cell in commas):
        number, name, cell = commas[0]
        problem = f"{cell!r}: is the comma a decimal mark, or does it mark thousands? say decimal"
        raise InputError(path, f"line {number}, column {name!r}", problem)
    return ","


#: Words of a label of rows that are no readings, one of the first in it and nothing else.
_STATISTICS = frozenset(
    "mean average avg mittel mittelwert median std sd stdev stdabw deviation standardabweichung"
    " variation variationskoeffizient cov cv variance varianz min max minimum maximum range"
    " spannweite".split()
)
_BESIDE = frozenset("standard dev of the coefficient value values wert".split())


def has_statistic(row: Sequence[str]) -> bool:
    """Return whether a cell of a row labels a mean, a deviation, a least or largest value."""
    for cell in row:
        words = {*re.split(r"[\W\d_]+", cell.casefold())} - {""} if len(cell) < LONGEST else set()
        if words & _STATISTICS and words <= _STATISTICS | _BESIDE:
            return True
    return False


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
    }.items()
}
#: Words of what a biaxial test measures along each yarn, and of the yarns: "n_w", "eps fill".
LOADS = frozenset("n f force load kraft stress spannung tension".split())
STRAINS = frozenset("eps epsilon strain dehnung".split())
WARP = frozenset("w warp kette x".split())
FILL = frozenset("f fill weft schuss y".split())
#: Quantities that need a word of each of two sets.
PAIRS = {
    f"{yarn} {what}": (words, along)
    for what, words in (("load", LOADS), ("strain", STRAINS))
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
OTHERS = STRAIN_WORDS | frozenset(
    "stress rate speed velocity time cell cycle spannung zeit geschwindigkeit".split()
)
#: A column with one of these words is no elongation and no strain along the strip.
NEVER = (OTHERS - STRAIN_WORDS) | frozenset(
    "true wahre log logarithmic transverse lateral width quer querdehnung".split()
)
#: Whole names of the columns that say which specimen and which direction a row belongs to.
LABELS = {
    "specimen": {"specimen", "specimen id", "specimen label", "sample id", "specimen name"}
    | {"sample", "probe nr", "proben nr", "probennummer", "probenkennung", "prüfling", "versuch"}
    | {"specimen number", "specimen no", "sample name", "probe"},
    "ratio": {"ratio", "load ratio", "stress ratio", "lastverhältnis", "verhältnis"},
    "repetition": {"repetition", "repeat", "run", "trial", "wiederholung"},
    "direction": {"direction", "series", "test direction", "orientation", "richtung"},
}
#: How files may name the three directions of strips; case, spaces and signs do not matter. "0" and
#: "90" are not here: whether 0 degrees is warp or fill differs between laboratories.
DIRECTION_ALIASES: Mapping[str, str] = {
    **{"warp": "warp", "fill": "fill", "weft": "fill", "kette": "warp", "schuss": "fill"},
    **dict.fromkeys("bias bias45 45bias 45 45deg 45degree 45degreebias diagonal".split(), "bias"),
}
#: mm in one of each unit of length, N in one of each unit of load.
LENGTH_UNITS = {
    "mm": 1.0,
    "cm": 10.0,
    "m": 1e3,
    "µm": 1e-3,
    "μm": 1e-3,
    "um": 1e-3,
    "in": 25.4,
    "ft": 304.8,
    "mil": 0.0254,
}
LOAD_UNITS = {
    "N": 1.0,
    "kN": 1e3,
    "daN": 10.0,
    "mN": 1e-3,
    "kgf": 9.80665,
    "kp": 9.80665,
    "gf": 9.80665e-3,
    "lbf": 4.4482216152605,
    "kip": 4448.2216152605,
    "ozf": 0.27801385095378,
}
#: Other names of units, in small letters; a weight is that of its mass.
OTHER_NAMES = {
    "n": "N",
    "kn": "kN",
    "lb": "lbf",
    "lbs": "lbf",
    "lbf": "lbf",
    "g": "gf",
    "kg": "kgf",
    "in": "in",
    "inch": "in",
    "inches": "in",
    "zoll": "in",
    '"': "in",
    "″": "in",
    "mils": "mil",
    "thou": "mil",
    "kips": "kip",
    "kipf": "kip",
    "oz": "ozf",
}
#: N/mm in one of each unit of load per width of the strip.
WIDTH_LOAD_UNITS = {
    "kN/m": 1.0,
    "N/mm": 1.0,
    "N/m": 1e-3,
    "N/cm": 0.1,
    "N/50mm": 0.02,
    "N/5cm": 0.02,
    "daN/5cm": 0.2,
    "lbf/in": 4.4482216152605 / 25.4,
}
#: One in each unit of strain.
STRAIN_UNITS = {"%": 0.01, "‰": 1e-3, "mm/mm": 1.0, "m/m": 1.0, "in/in": 1.0, "-": 1.0, "1": 1.0}
#: MPa in one of each unit of pressure.
PRESSURE_UNITS = {
    "Pa": 1e-6,
    "hPa": 1e-4,
    "mbar": 1e-4,
    "kPa": 1e-3,
    "psi": 6.894757293168e-3,
    "bar": 0.1,
    "MPa": 1.0,
}
#: Seconds in one of each unit of time.
TIME_UNITS = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0}
#: Letters of a name, and names of a table: what is longer is none, and would take its time.
LONGEST, MOST_NAMES = 300, 2000
_KNOWN = (
    r"%|‰|mm/mm|kN/m|N/mm|N/cm|N/50mm|N/5cm|daN/5cm|N/m|mm|cm|kN|kn|N|n|m|kPa|MPa|hPa|Pa|mbar|bar"
    "|psi|lbf/in|lbf|lbs|lb|kgf|kg|kips|kip|gf|g|ozf|daN|inches|inch|in|ft|mils|mil|µm|μm|um"
)
# "Strain (Extension)", "Load (Channel 1)": what is long or has a blank in it is no unit.
_UNIT = r"[A-Za-zµμ°%‰\"″][A-Za-z0-9µμ°%‰/^*·²-]{0,6}"
_PER_WIDTH = re.compile(r"N ?/ ?(50?) ?([cm]m)\b")
_IN_BRACKETS = re.compile(rf"^(.*?)[\s_]*[(\[<{{]\s*({_UNIT}|)\s*[)\]>}}]$")
_AT_THE_END = re.compile(rf"^(.*?)(?:\s*[/,]\s*|\s+in\s+|[\s_]+)({_KNOWN})$")


def plain_unit(text: str) -> str:
    """Return a text with a load per 5 cm of width, "N / 5 cm", in one word."""
    return _PER_WIDTH.sub(r"N/\1\2", text)


def split_unit(name: str) -> tuple[str, str]:
    """Return a column's name without its unit, and the unit, "" when it names none.

    >>> split_unit("Load (kN)"), split_unit("Weg in mm"), split_unit("load_N"), split_unit("Time")
    (('Load', 'kN'), ('Weg', 'mm'), ('load', 'N'), ('Time', ''))
    """
    if len(name) > LONGEST:
        return name, ""
    name = plain_unit(name)
    found = _IN_BRACKETS.match(name) or _AT_THE_END.match(name)
    return (found[1].strip(), found[2].strip()) if found else (name, "")


def means(name: str, quantity: str) -> bool:
    """Return whether a column holds `quantity`, one of those in `WORDS`, `PAIRS` and `LABELS`."""
    if len(name) > LONGEST:
        return False
    plain = split_unit(name)[0].casefold()
    if quantity in LABELS:
        return re.sub(r"[\W_]+", " ", plain).strip() in LABELS[quantity]
    listed = _listed(plain)
    if quantity == "elongation" and (_measured_on_strip(plain) or NEVER & {*listed}):
        return NEVER.isdisjoint(listed)
    if quantity not in PAIRS:
        return not (ours := WORDS[quantity]).isdisjoint(listed) and not (OTHERS - ours) & {*listed}
    what, along = PAIRS[quantity]
    # One word is not both: F is a force before the yarn, and the fill after another word.
    both = any(a in what and b in along for a, b in permutations(listed, 2))
    return both and not (OTHERS - what) & {*listed}


def columns_of(names: list[str], quantity: str, named: Mapping[str, str]) -> list[int]:
    """Return the columns that hold a quantity, by the name given for it, else by meaning."""
    if quantity in named:
        return called(names, named[quantity].strip())
    found = [i for i, name in enumerate(names) if name and means(name, quantity)]
    return found or (_strains(names) if quantity == "elongation" else [])  # a strain alone


def _strains(names: list[str]) -> list[int]:
    every = map(_words, names)
    return [i for i, own in enumerate(every) if STRAIN_WORDS & own and NEVER.isdisjoint(own)]


def strain_columns(
    names: list[str], units: Mapping[str, str], named: Mapping[str, str]
) -> list[str]:
    """Return the columns of strains along the specimen, the nearest to it first."""
    if "strain" in named:
        return [names[i] for i in called(names, named["strain"].strip())]
    strains = [names[i] for i in _strains(names)]
    found = [n for n in strains if not units[n] or units[n] in STRAIN_UNITS]
    return sorted(found, key=distance_to_strip)


def called(names: Sequence[str], asked: str) -> list[int]:
    """Return the columns of this name, else those that have it without their unit."""
    exact = [i for i, name in enumerate(names) if name == asked]
    return exact or [i for i, name in enumerate(names) if split_unit(name)[0] == asked]


def _words(name: str) -> set[str]:
    """Return the words of a name without its unit, in small letters; none of one too long."""
    return set() if len(name) > LONGEST else set(_listed(split_unit(name)[0].casefold()))


def _listed(plain: str) -> list[str]:
    return re.split(r"[\W\d_]+", plain)


def _measured_on_strip(plain: str) -> bool:
    return not ON_THE_STRIP.isdisjoint(_listed(plain)) or bool(_TRANSDUCER.search(plain))


def distance_to_strip(name: str) -> int:
    """Return where an elongation was measured: 0 on the strip, 2 by the machine, else 1."""
    if _measured_on_strip(split_unit(name)[0].casefold()):
        return 0
    return 2 if _words(name) & OF_THE_MACHINE else 1


def nearest_to_strip(names: list[str], which: list[int]) -> list[int]:
    """Return those columns of elongation that were measured nearest to the strip."""
    best = min((distance_to_strip(names[i]) for i in which), default=0)
    return [i for i in which if distance_to_strip(names[i]) == best]


def is_between_grips(name: str, chosen: bool) -> bool:
    """Return whether a column of elongation is the machine's travel; chosen : by a user."""
    rank = distance_to_strip(name)
    return rank == 2 or (rank == 1 and not chosen and bool(_words(name) & BETWEEN_GRIPS))


def scale_of(unit: str, units: Mapping[str, float]) -> float | None:
    """Return what one `unit` is in mm or N; None for a unit that is not in `units`."""
    return units[unit] if unit in units else units.get(OTHER_NAMES.get(unit.casefold(), unit))
