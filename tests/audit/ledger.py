"""The ledger of all numbers that a folder reports, and of how each was checked."""

import math
import re
from collections import Counter
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

#: Not part of a word, of a dotted name, of a date or of a file's name.
NUMBER = re.compile(
    r"(?<![\w./:-])[-+\u2212]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w]|\.\w|-\d|/\w|:\d\d)"
)
#: A number within a pattern of `Ledger.text`.
NUM = r"([-+\u2212]?\d+(?:\.\d+)?(?:e[-+]?\d+)?)"
#: Numbers that are names.
NAMES = re.compile(r"\b(?:EN )?(?:EN|ISO) \d+(?:-\d+)?|-2 log L|\b1 sigma|\b\d+:\d+\b|\(\d+ rows\)")
HOW = ("recomputed", "consistent", "echoed")
#: Letters of a line of the terminal.
WIDTH = 80
#: No results: how long it took, versions, identity, seeds of the record.
EXEMPT = (
    ("result.json", r"versions\..*|(.*\.)?wall_s|(.*\.)?seconds|(.*\.)?seed(\.\d+)?|.*\.date"),
    ("starts.jsonl", r"(.*\.)?(wall_s|seconds|seed(\.\d+)?)"),
    ("check.json", r"(.*\.)?(version|cpu_s)"),
    ("history.csv", r"status .*"),
    ("page", r".*The record.*|.*How to cite.*|.*Files of the folder.*"),
    ("page", r".* fact (date|fabric|laboratory|wall time, s)"),
    ("terminal", r".*(page:|wall time|seconds|\d s\b).*"),
)


@dataclass(eq=False)
class Text:
    """A text with its numbers: a cell, a sentence, a string."""

    source: str
    place: str
    text: str
    claims: dict = field(default_factory=dict)  # by the span of a number

    def __post_init__(self):
        self.claims = {match.span(): None for match in NUMBER.finditer(self.text)}
        for match in NAMES.finditer(self.text):
            self.claim(match.span(), "wording")

    def claim(self, span, how):
        for place in self.claims:
            if place[0] < span[1] and span[0] < place[1]:
                self.claims[place] = how


@dataclass(frozen=True)
class Finding:
    """Something that is reported wrongly."""

    place: str
    message: str

    def __str__(self):
        return f"{self.place}: {self.message}"


def as_number(text):
    return float(text.replace("\u2212", "-"))


def rounded_right(text, value, digits=4, slack=1e-7):
    """Return whether a printed number is `value` with so many significant digits.

    slack : relative error that the value itself may have.
    """
    printed = as_number(text)
    if not math.isfinite(value):
        return False
    if value == 0.0 or abs(value) < 1e-300:
        return printed == 0.0
    last = 10.0 ** (math.floor(math.log10(abs(value)) + 1e-12) - digits + 1)
    return abs(printed - value) <= 0.5 * last * (1 + 1e-6) + slack * abs(value)


def close(value, expected, rel, abs_):
    return abs(value - expected) <= max(rel * abs(expected), abs_)


def _whole_lines(text):
    """Return the lines of a terminal; what was broken off a sentence is joined to it again."""
    lines, before = [], ""
    for line in text.splitlines():
        # What was broken did not fit.
        # A number stays with its unit.
        word = re.match(r"\S*(?: (?:%|[kMG]?Pa|k?N|mm|kN/m|J/m)\S*)?", line.strip())[0]
        full = len(before) + 1 + len(word) > WIDTH
        if full and re.match(r" {4,6}\S", line) and lines:
            lines[-1] += f" {line.strip()}"
        else:
            lines.append(line)
        before = line
    return lines


class Ledger:
    """Every number of a folder; see the package for how auditors claim them."""

    def __init__(self, folder):
        self.folder = folder
        self.findings = []
        self.leaves = {}  # (file, path) -> claim
        self.values = {}
        self.strings = {}  # (file, path) -> Text
        self.columns = {}  # (file, column) -> array of claims, 0 none, -1 no number, 1.. HOW
        self.texts = []
        self.cells = {}  # (number of the table, row, column) -> Text
        self._read()
        self._names()

    # What there is

    def _read(self):
        folder = self.folder
        if folder.result is not None:
            self._add_json("result.json", folder.result, ())
        if folder.check is not None:
            self._add_json("check.json", folder.check, ())
        for k, start in enumerate(folder.starts):
            self._add_json("starts.jsonl", start, (k,))
        if folder.card_text is not None:
            self._add_json("material.toml", folder.card_text, ())
        for file, table in folder.tables.items():
            self._add_csv(file, table)
        if folder.page is not None:
            self._add_page(folder.page)
        for k, line in enumerate(_whole_lines(folder.terminal), start=1):
            self.texts.append(Text("terminal", f"line {k}: {line.strip()}", line))

    def _add_json(self, file, value, path):
        if isinstance(value, dict):
            for key, member in value.items():
                self._add_json(file, member, (*path, key))
        elif isinstance(value, list):
            for k, member in enumerate(value):
                self._add_json(file, member, (*path, k))
        elif isinstance(value, str):
            text = Text(file, ".".join(map(str, path)), value)
            self.texts.append(text)
            self.strings[file, path] = text
            self.values[file, path] = value
        else:
            self.values[file, path] = value
            if isinstance(value, int | float) and not isinstance(value, bool):
                self.leaves[file, path] = None

    def _add_csv(self, file, table):
        for column in table:
            numbers = pd.to_numeric(table[column], errors="coerce")
            is_number = numbers.notna() | table[column].isin(["nan", "inf", "-inf"])
            self.columns[file, column] = np.where(is_number, 0, -1).astype(np.int8)
            for text in table.loc[~is_number, column].unique():
                self.texts.append(Text(file, f"{column} {text}", text))

    def _add_page(self, page):
        for number, table in enumerate(page.tables):
            place = f"{table.section} > {table.title}"
            for k, name in enumerate(table.header):
                self.cells[number, -1, k] = Text("page", f"{place} > heading {name}", name)
            for row, cells in enumerate(table.rows):
                for k, (name, cell) in enumerate(zip(table.header, cells, strict=True)):
                    self.cells[number, row, k] = Text(
                        "page", f"{place} > {cells[0]} > {name}", cell
                    )
        self.texts += self.cells.values()
        # Sentences that stand in a fact have its label as their place.
        labels = {text: label for _, _, label, text in page.facts}
        for tag, section, text in page.sentences:
            fact = f" fact {labels[text]}" if tag == "dd" and text in labels else ""
            self.texts.append(Text("page", f"{section} > {tag}{fact or f' {text}'}", text))
        for number, count in page.counts.items():
            if count is not None and number < len(page.tables):
                title, rows = page.tables[number].title, len(page.tables[number].rows)
                if count != rows:
                    self.find(f"page: {title}", f"({count} rows) stands above {rows} rows")

    def _names(self):
        """Numbers in names that the project gives are no results."""
        fabric = self.folder.project.get("fabric", {})
        names = {fabric.get("name"), fabric.get("lab"), (self.folder.result or {}).get("title")}
        for name in filter(None, names):
            for text in self.texts:
                for match in re.finditer(re.escape(" ".join(str(name).split())), text.text):
                    text.claim(match.span(), "wording")

    # What auditors say

    @property
    def printed(self):
        """Return what a terminal showed but the line that names the page, all of `report`."""
        texts = [text for text in self.texts if text.source == "terminal"]
        return [text for text in texts if not text.text.startswith("page:")]

    def find(self, place, message):
        self.findings.append(Finding(place, message))

    def json(self, path, expected, how="recomputed", *, file="result.json", rel=1e-6, abs=0.0):
        """Compare a leaf or a branch of a JSON file (or material.toml), and claim its numbers.

        path : key, or tuple of keys and numbers. expected : None where null is right.
        """
        path = path if isinstance(path, tuple) else (path,)
        if isinstance(expected, dict):
            for key, member in expected.items():
                self.json((*path, key), member, how, file=file, rel=rel, abs=abs)
            return
        if isinstance(expected, list | tuple | np.ndarray):
            for k, member in enumerate(expected):
                self.json((*path, k), member, how, file=file, rel=rel, abs=abs)
            if (file, (*path, len(expected))) in self.values:
                self.find(self._name(file, path), f"has more than {len(expected)} members")
            return
        place = self._name(file, path)
        if (file, path) not in self.values:
            # An empty list or mapping has no leaves.
            self.find(place, f"is missing; expected {expected!r}")
            return
        value = self.values[file, path]
        self.claim_json(path, how, file=file)
        if isinstance(expected, float) and not math.isfinite(expected):
            expected = None
        if isinstance(expected, bool | str | None) or isinstance(value, bool | str | None):
            if value != expected:
                self.find(place, f"is {value!r}; expected {expected!r}")
            if isinstance(value, str) and isinstance(expected, str):
                self._claim_text(self.strings[file, path], how)
        elif not close(value, expected, rel, abs):
            self.find(place, f"is {value!r}; expected {expected!r}")

    @staticmethod
    def _name(file, path):
        return f"{file}: {'.'.join(map(str, path))}"

    def claim_json(self, path, how, *, file="result.json"):
        """Claim a leaf, or all leaves of a branch, that were looked at otherwise."""
        path = path if isinstance(path, tuple) else (path,)
        if (file, path) in self.leaves:
            self.leaves[file, path] = how
            return
        for own, at in self.leaves:
            if own == file and at[: len(path)] == path:
                self.leaves[own, at] = how

    def column(self, file, column, expected, how="recomputed", *, rel=2e-8, abs=0.0, rows=None):
        """Compare a column of a CSV and claim it; rows : mask or indices, None for all.

        expected : numbers (NaN: an empty cell), or texts.
        """
        if (file, column) not in self.columns:
            self.find(f"{file}: {column}", "there is no such column")
            return
        table = self.folder.tables[file]
        at = np.arange(len(table)) if rows is None else np.arange(len(table))[rows]
        texts = table[column].to_numpy()[at]
        self.claim_column(file, column, how, rows=at)
        if np.ndim(expected) == 0:
            expected = np.full(len(at), expected)
        expected = np.asarray(expected)
        if len(expected) != len(at):
            self.find(f"{file}: {column}", f"has {len(at)} rows; expected {len(expected)}")
            return
        if expected.dtype.kind in "OUS":
            wrong = np.array([str(own) != text for own, text in zip(expected, texts, strict=True)])
            there = set(texts)
            for text in self.texts:
                if text.source == file and text.text in there and text.place.startswith(column):
                    self._claim_text(text, how)
        else:
            values = pd.to_numeric(pd.Series(texts), errors="coerce").to_numpy(float)
            expected = expected.astype(float)
            limit = np.maximum(rel * np.abs(expected), abs)
            with np.errstate(invalid="ignore"):
                wrong = ~(np.abs(values - expected) <= limit)
            wrong &= ~((values == expected) | (np.isnan(values) & np.isnan(expected)))
        if wrong.any():
            first = int(np.flatnonzero(wrong)[0])
            self.find(
                f"{file}: {column}, row {at[first] + 1}",
                f"is {texts[first]!r}; expected {expected[first]} ({int(wrong.sum())} rows differ)",
            )

    def claim_column(self, file, column, how, *, rows=None):
        """Claim a column that was looked at otherwise."""
        claims = self.columns[file, column]
        at = slice(None) if rows is None else rows
        claims[at] = np.where(claims[at] < 0, -1, 1 + HOW.index(how))

    def table(
        self, title, header, rows, how="consistent", *, digits=4, number=0, slack=1e-7, units=None
    ):
        """Compare a table of the page with what it must hold, and claim its numbers.

        Parameters
        ----------
        title : heading of the table.
        header : texts of its columns, units included; None: not compared.
        rows : lists of cells. str: the cell's text. Number: rounded to `digits` significant
            digits. int: as it stands. Tuple (pattern, numbers...): the text must match the
            regular expression, whose groups are these numbers. None: not looked at.
        digits : of the numbers; or one count a column.
        number : of the tables of this title.
        """
        tables = self.folder.page.tables
        fitting = [k for k, table in enumerate(tables) if table.title == title]
        if len(fitting) <= number:
            self.find(f"page: {title}", "there is no such table")
            return
        at = fitting[number]
        table = tables[at]
        if header is not None:
            for k in range(len(table.header)):
                self._claim_text(self.cells[at, -1, k], "wording")
            if list(header) != table.header:
                self.find(f"page: {title}", f"has the columns {table.header}; expected {header}")
                return
        if len(rows) != len(table.rows):
            self.find(f"page: {title}", f"has {len(table.rows)} rows; expected {len(rows)}")
        for k, (expected, cells) in enumerate(zip(rows, table.rows, strict=False)):
            for column, (cell, text) in enumerate(zip(expected, cells, strict=True)):
                if cell is None:
                    continue
                own = digits[column] if isinstance(digits, list | tuple) else digits
                place = f"page: {title}, row {k + 1} ({cells[0]}), {table.header[column]}"
                self.compare_text(place, text, cell, own, slack)
                self._claim_text(self.cells[at, k, column], how)

    def compare_text(self, place, text, expected, digits=4, slack=1e-7):
        """Compare a printed text with a text, a number, or a pattern with numbers."""
        if isinstance(expected, tuple):
            match = re.fullmatch(expected[0], text)
            if match is None:
                self.find(place, f"is {text!r}; expected such as {expected[0]!r}")
                return
            for group, value in zip(match.groups(), expected[1:], strict=True):
                self.compare_text(place, group, value, digits, slack)
        elif isinstance(expected, str):
            if text != expected:
                self.find(place, f"is {text!r}; expected {expected!r}")
        elif expected is None or (isinstance(expected, float) and not math.isfinite(expected)):
            if text not in ("\u2013", "", "nan", "None"):
                self.find(place, f"is {text!r}; expected nothing")
        elif isinstance(expected, int | np.integer):
            if text != str(expected):
                self.find(place, f"is {text!r}; expected {expected}")
        elif not NUMBER.fullmatch(text) or not rounded_right(text, expected, digits, slack):
            self.find(place, f"is {text!r}; expected {expected:.{digits + 3}g} to {digits} digits")

    def fact(self, label, expected, how="consistent", *, digits=4, heading=None):
        """Compare a fact of the page (label and value): as `table` compares a cell."""
        facts = self.folder.page.facts
        fitting = [t for _, h, own, t in facts if own == label and heading in (None, h)]
        if not fitting:
            self.find(f"page: {label}", "there is no such fact")
            return
        self.compare_text(f"page: {label}", fitting[0], expected, digits)
        for text in self.texts:
            if text.source == "page" and f"> dd fact {label}" in text.place:
                if text.text == fitting[0]:
                    self._claim_text(text, how)

    def text(self, pattern, expected, how="consistent", *, digits=4, source=None, needed=True):
        """Compare the numbers of all sentences that hold a pattern, and claim them.

        pattern : regular expression, searched in every text of the folder. Its groups are what is
            compared with `expected`, in turn; other numbers within it are wording.
        expected : numbers or texts, one a group; or a function of the match that returns them
            (or None, where this sentence is of something else).
        source : "page", "terminal", a file; None: everywhere. needed : it must be in one text.
        """
        expression, seen = re.compile(pattern), False
        for text in self.texts:
            if source is not None and text.source != source:
                continue
            for match in expression.finditer(text.text.replace("\u00a0", " ")):
                values = expected(match) if callable(expected) else expected
                if values is None:
                    continue
                seen = True
                text.claim(match.span(), "wording")
                place = f"{text.source}: {text.place}"
                for k, value in enumerate(values, start=1):
                    if value is None or match[k] is None:
                        continue
                    own = digits[k - 1] if isinstance(digits, list | tuple) else digits
                    self.compare_text(place, match[k], value, own)
                    text.claim(match.span(k), how)
        if needed and not seen:
            self.find(source or "texts", f"nothing reads like {pattern!r}")
        return seen

    @staticmethod
    def _claim_text(text, how):
        for span in text.claims:
            text.claims[span] = how

    # How many

    def _exempt(self, source, place):
        return any(source == s and re.fullmatch(p, place, flags=re.S) for s, p in EXEMPT)

    def counts(self):
        """Return how many numbers are of each kind: of HOW, exempt, unclaimed, by source."""
        counts = {}

        def count(source, kind, number=1):
            counts.setdefault(source, Counter())[kind] += number

        for (file, path), how in self.leaves.items():
            place = ".".join(map(str, path))
            exempt = how is None and self._exempt(
                file, place.partition(".")[2] or place if file == "starts.jsonl" else place
            )
            count(file, "exempt" if exempt else how or "unclaimed")
        for (file, _), claims in self.columns.items():
            kinds, numbers = np.unique(claims[claims >= 0], return_counts=True)
            for kind, number in zip(kinds, numbers, strict=True):
                count(file, HOW[kind - 1] if kind else "unclaimed", int(number))
        for text in self.texts:
            exempt = None in text.claims.values() and self._exempt(text.source, text.place)
            for how in text.claims.values():
                if how != "wording":
                    count(text.source, "exempt" if how is None and exempt else how or "unclaimed")
        return counts

    def unclaimed(self):
        """Return a line a place whose numbers nobody claims."""
        lines = []
        for (file, path), how in self.leaves.items():
            place = ".".join(map(str, path))
            short = place.partition(".")[2] or place if file == "starts.jsonl" else place
            if how is None and not self._exempt(file, short):
                lines.append(f"{file}: {place}")
        for (file, column), claims in self.columns.items():
            if (claims == 0).any():
                lines.append(f"{file}: {column} ({int((claims == 0).sum())} rows)")
        for text in self.texts:
            if None in text.claims.values() and not self._exempt(text.source, text.place):
                lines.append(f"{text.source}: {text.place}: {text.text!r}")
        return lines
