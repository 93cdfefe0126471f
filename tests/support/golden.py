"""The terminal output of each command, kept in tests/golden/ and compared where it runs.

`pytest --rewrite-golden` writes the files anew. What differs from place to place and from day to
day is replaced. Words are compared exactly, and numbers as far as another processor rounds alike.
"""

import json
import os
import re
from itertools import zip_longest
from pathlib import Path

from bubblefit.cli.terminal import TABLE, WIDTH, wrapped

from ..audit import audit, audit_printed, is_known
from . import rounding
from .paths import ROOT

FOLDER = Path(__file__).parents[1] / "golden"
REPLACED = (
    # Progress, a line a minute where there is no terminal: of machines that take so long.
    (r"(?m)^.*\b\d+ of \d+ .*(\d s left|left not known yet)\n", ""),
    # Of a modulus whose band is as wide as itself, rounding decides where that begins.
    (
        r"Not known: ([^;]+; )?any modulus beyond the strains that the tests reach",
        "Not known: SPANS",
    ),
    (r"\d{4}-\d\d-\d\d", "DATE"),
    (r"\d\d:\d\d(:\d\d)?\b", "TIME"),
    (r"\b\d+(\.\d+)? s\b", "N s"),
    (r"\b\d+(\.\d+)? ?(s|ms)(?= left)", "N s"),
    (r"\b\d+ analys(e|i)s", "N analyses"),
    (r"version \d[\w.+-]*", "version V"),
    # Left over of a fit that is exact: rounding.
    (r"\b\d+(\.\d+)?e-(0[5-9]|[1-9]\d)\b", "0"),
)
#: A number by itself: neither E1 nor 150mm, and both numbers of 2:1.
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?!\.?\w)")
#: Behind whole numbers that are not counts: a unit, another column, the other end of a range.
NOT_COUNTED = re.compile(r" ([kMG]?Pa|k?N|m?m|mrad|J)\b| %| {2,}\S| to [-+\d]|$")
#: Numbers of a flat valley, which no data hold, and how far those of two processors may differ.
FLAT = (
    (re.compile(r"95 % from .*"), 0.02),
    (re.compile(r"uncertain by up to \d+ %"), 0.02),
    # In a row of moduli: sigma and band; of a modulus without a sigma, or with a large one, all.
    (re.compile(r"(?<= )(\d+(\.\d+)? %|unknown) +[\d.]+ to [\d.]+(?= )"), 0.02),
    (re.compile(r"(?<= % )[ \d.]+ (\d{3,} %|unknown) +[\d.]+ to .*"), 0.02),
)


def unbroken(text):
    """Return the text with wrapped lines whole: where they break depends on what is replaced."""
    whole, before = [], ""
    for line in text.splitlines():
        # What was broken did not fit.
        fits = len(before) + 1 + len(line.strip().partition(" ")[0]) <= WIDTH
        if fits or not line.startswith("    ") or any(map(TABLE.search, (line, whole[-1]))):
            whole.append(line)
        else:
            whole[-1] += f" {line.strip()}"
        before = line
    return "".join(f"{line}\n" for line in whole)


def normalised(text, folder):
    """Return the text without paths, dates, times, versions and digits of rounding."""
    for place, name in ((folder, "FOLDER"), (folder.name, "NAME"), (ROOT, "ROOT")):
        text = text.replace(str(place), name)
    text = unbroken(text)
    for pattern, words in REPLACED:
        text = re.sub(pattern, words, text)
    return "".join(f"{line.rstrip()}\n" for line in wrapped(text).splitlines())


def last_digit(number):
    """Return what one unit of the last digit of a written number is."""
    mantissa, _, exponent = number.partition("e")
    return 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))


def is_alike(number, expected, unit, share):
    """Say whether two written numbers differ by `unit`, or by `share` of them, at most."""
    values = float(number), float(expected)
    difference, size = abs(values[0] - values[1]), max(map(abs, values))
    return number == expected or difference <= max(1.001 * unit, share * size)


def is_alike_line(line, expected):
    """Say whether two lines have the same words, and numbers that differ by rounding only.

    Rounding moves the last of four digits or more, of a percentage in a flat valley any last digit,
    and no digit of a count.
    """
    # Columns are as wide as their numbers.
    words, expected_words = (" ".join(NUMBER.sub("#", text).split()) for text in (line, expected))
    if words != expected_words:
        return False
    flat = [
        (match.span(), share) for pattern, share in FLAT for match in pattern.finditer(expected)
    ]
    for number, reference in zip(NUMBER.finditer(line), NUMBER.finditer(expected), strict=True):
        unit = min(last_digit(number[0]), last_digit(reference[0]))
        has_four_digits = abs(float(reference[0])) > 999 * unit
        is_whole = number[0].isdigit() and reference[0].isdigit()
        is_count = is_whole and not NOT_COUNTED.match(expected, reference.end())
        share = max((s for (a, b), s in flat if a <= reference.start() < b), default=0.0)
        is_rough = share > 0 and expected.startswith(" %", reference.end())
        rounding = unit if is_rough or (has_four_digits and not is_count) else 0.0
        if not is_alike(number[0], reference[0], rounding, share):
            return False
    return True


def differences(text, expected):
    """Return the pairs of lines that differ by more than rounding."""
    lines, expected_lines = unbroken(text).splitlines(), unbroken(expected).splitlines()
    pairs = zip_longest(lines, expected_lines, fillvalue="(no line)")
    return [pair for pair in pairs if not is_alike_line(*pair)]


class Golden:
    """Compare what commands print, and audit the folders that they leave, once each."""

    def __init__(self, rewrite):
        self.rewrite = rewrite
        self.audited = {}

    def __call__(self, name, text, folder, printed=None):
        """Assert that a command run in `folder` printed what NAME.txt holds; pages have a head.

        printed : what it printed, where `text` is without what differs from run to run.
        """
        path, said = FOLDER / f"{name}.txt", normalised(text, folder)
        if self.rewrite:
            FOLDER.mkdir(exist_ok=True)
            path.write_text(said)
        assert path.exists(), f"there is no {path.name}: pytest --rewrite-golden writes it"
        assert differences(said, path.read_text()) == []
        for page in folder.rglob("page.json"):
            about = dict(json.loads(page.read_text())["about"])
            assert re.fullmatch(r"\d{4}-\d\d-\d\d", about["date"]), page
            of_a_project = page.parent.name not in ("verified", "cycles")
            assert not of_a_project or about["fabric"], page
        if rounding.VARIABLE in os.environ:
            return  # the auditor reads the files of the data, which are not disturbed
        self.audit(folder, printed or text)
        ledger = audit_printed(name, printed or text, folder)
        assert ledger is None or not ledger.findings, "\n".join(map(str, ledger.findings))

    def audit(self, folder, text=""):
        """Assert that a second implementation agrees with the pages below a folder."""
        names = ("report.html", "cycles.csv")
        written = {path.parent: path.stat().st_mtime_ns for n in names for path in folder.rglob(n)}
        fresh = [path for path, time in written.items() if self.audited.get(path) != time]
        self.audited |= written
        for path in fresh:
            finished = (path / "result.json").exists() or (path / "check.json").exists()
            if finished or is_known(path):
                # The folder that the command names is of what it printed.
                place = re.escape(str(path.relative_to(folder)))
                printed = re.search(rf"(page:|written to) {place}(/report.html)?(?![\w/])", text)
                ledger = audit(path, terminal=text if printed else "", base=folder)
                assert not ledger.findings, "\n".join([str(path), *map(str, ledger.findings)])
