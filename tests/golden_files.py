"""The terminal output of each command, kept in tests/golden/ and compared where it runs.

`pytest --rewrite-golden` writes the files anew. Numbers stay as printed; what differs from place
to place and from day to day is replaced.
"""

import json
import re
from pathlib import Path

from bubblefit.cli.terminal import TABLE, WIDTH, wrapped

from .places import ROOT

FOLDER = Path(__file__).parent / "golden"
REPLACED = (
    # Progress, a line a minute where there is no terminal: of machines that take so long.
    (r"(?m)^.*\b\d+ of \d+ .*(\d s left|left not known yet)\n", ""),
    # Of a modulus whose band is as wide as itself, rounding decides where that begins.
    (r"not known: [^;]+(?=; next)", "not known: SPANS"),
    (r"\d{4}-\d\d-\d\d", "DATE"),
    (r"\d\d:\d\d(:\d\d)?\b", "TIME"),
    (r"\b\d+(\.\d+)? s\b", "N s"),
    (r"\b\d+(\.\d+)? ?(s|ms)(?= left)", "N s"),
    (r"\b\d+ analys(e|i)s", "N analyses"),
    (r"version \d[\w.+-]*", "version V"),
    # Left over of a fit that is exact: rounding.
    (r"\b\d+(\.\d+)?e-(0[5-9]|[1-9]\d)\b", "0"),
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


class Golden:
    def __init__(self, rewrite):
        self.rewrite = rewrite

    def __call__(self, name, text, folder):
        """Assert that a command run in `folder` printed what NAME.txt holds; pages have a head."""
        path, said = FOLDER / f"{name}.txt", normalised(text, folder)
        if self.rewrite:
            FOLDER.mkdir(exist_ok=True)
            path.write_text(said)
        assert path.exists(), f"there is no {path.name}: pytest --rewrite-golden writes it"
        assert said == path.read_text()
        for page in folder.rglob("page.json"):
            about = dict(json.loads(page.read_text())["about"])
            assert re.fullmatch(r"\d{4}-\d\d-\d\d", about["date"]) and about["fabric"], page
