"""What auditors of several commands share: pages that show a CSV, notes, printed percentages."""

import re

import numpy as np
import pandas as pd

#: A printed number, as a group.
N = r"([-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?)"
#: Wording of a note on a strain that is beyond the range of a law; direction, strain, range.
BEYOND = rf"(warp|fill|shear) strain (?:reached )?{N} %(?: is|,) beyond [^%]*?{N} %"
MISSING = "\u2013"


def printed(value):
    """Return a number as tables of a page print it: four significant digits."""
    return f"{value:.4g}"


def percent(fraction):
    """Return a fraction as percent: two significant digits, whole from 99.5 % on."""
    return f"{100 * fraction:.0f} %" if fraction >= 0.995 else f"{100 * fraction:.2g} %"


def is_text(column):
    """Return whether a column holds texts; an empty one of texts has empty cells."""
    return not pd.api.types.is_numeric_dtype(column) or (column == "").all()


def page_of_csv(folder, ledger, file, title="The numbers"):
    """Compare a table of the page with a CSV: the same columns and rows, four digits."""
    table = folder.data(file)
    texts = [is_text(table[name]) for name in table]
    rows = []
    for row in table.itertuples(index=False):
        cells = []
        for value, text in zip(row, texts, strict=True):
            if text:
                missing = pd.isna(value)
                cells.append("" if missing else " ".join(str(value).split()))
            elif pd.isna(value):
                cells.append(np.nan)
            else:
                cells.append(int(value) if float(value).is_integer() and abs(value) < 1e4
                             else float(value))  # fmt: skip
        rows.append(cells)
    ledger.table(title, list(table), rows, digits=4, slack=1e-6)
    rows_of_title(ledger, title, len(rows))


def rows_of_title(ledger, title, count):
    """Compare the number of rows that the title of a closed table gives."""
    ledger.text(rf"^{title} \((\d+) rows\)$", [count], source="page", needed=False)


def claim_literal(ledger, words, how="consistent"):
    """Claim the numbers of a text that was looked at, wherever it stands."""
    for text in ledger.texts:
        plain = text.text.replace("\u00a0", " ")
        at = plain.find(words)
        while at >= 0:
            text.claim((at, at + len(words)), how)
            at = plain.find(words, at + 1)


def audit_notes(folder, ledger, more=()):
    """Compare the notes of result.json, notes.csv and the page, and count them.

    more : lines that the page shows as notes, of what stands elsewhere in result.json.
    """
    notes = folder.result.get("notes", [])
    if "notes.csv" in folder.tables:
        for key in ("of", "kind", "note"):
            texts = [note[key] for note in notes]
            ledger.column("notes.csv", key, texts, "consistent")
    elif notes:
        ledger.find("notes.csv", f"is missing; result.json has {len(notes)} notes")

    _shown_notes(ledger, notes, more)
    # The optimum of fewer tests than the card's: by how much it lies elsewhere.
    moved = r"(?:moved|,) (?:E1|E2|G12) by ([-+][\d.]+) %"
    ledger.text(moved, lambda match: [match[1]], needed=False)

    def times(match):
        after = match.string[match.end() :]
        kinds = {n["kind"] for n in notes if after.startswith(f"{n['of']}: {n['note'][:20]}")}
        return [sum(note["kind"] in kinds for note in notes)] if kinds else [None]

    ledger.text(r"note, (\d+) times \(notes\.csv has each\), as ", times, needed=False)


def _shown_notes(ledger, notes, more):
    """Notes on the page and the terminal are those of result.json, word by word."""
    lines = [f"{note['of']}: {note['note']}" if note["of"] else note["note"] for note in notes]
    lines = [" ".join(line.split()) for line in (*lines, *more)]
    for text in ledger.texts:
        plain = text.text.replace("\u00a0", " ")
        shown = [plain] if text.place.startswith(" > li ") and text.claims else []
        shown += [part for part in re.split(r"\bnotes?(?:, \d+ times \([^)]*\), as|:) ", plain)[1:]]
        if text.source not in ("page", "terminal"):
            continue
        for own in shown:
            words = " ".join(own.split())
            if not any(words.startswith(line) or line.startswith(words) for line in lines):
                ledger.find(f"{text.source}: note", f"result.json has no note {words[:80]!r}")


def notes_of_fit(folder, ledger, own, prefix=""):
    """Claim the notes that a study repeats of one of its fits; `own` is the fit's folder."""
    theirs = [note["note"] for note in own.result["notes"]]
    for note in folder.result["notes"]:
        if note["note"] in theirs and note["of"].startswith(prefix):
            claim_literal(ledger, note["note"])


def beyond_range(ledger, ends, reached=None):
    """Check notes on strains beyond the range of a law.

    ends : end of the range by direction. reached : function of (text, direction) that returns the
    strain, or None where it is not known elsewhere: then it must be beyond the range.
    """

    def numbers(match):
        direction, strain = match[1], float(match[2])
        end = ends.get(direction)
        if end is not None and strain < 99.9 * end:
            ledger.find(match[0], "calls a strain beyond a range that holds it")
        value = None if reached is None else reached(match.string, direction)
        value = strain / 100 if value is None else value
        return [direction, 100 * value, None if end is None else 100 * end]

    ledger.text(BEYOND, numbers, digits=[3, 3, 2], needed=False)


def echo(folder, ledger, command, *, tests=True):
    """Check command, title, project, card and tests of a study."""
    result, project = folder.result, folder.project
    ledger.json("command", command, "echoed")
    title = project.get("fabric", {}).get("name")
    if "title" in result and title:
        ledger.json("title", title, "echoed")
    thickness = project.get("fabric", {}).get("thickness")
    if title and thickness and folder.page is not None:
        millimetres = {"mm": 1.0, "m": 1e3}[project.get("units", {}).get("length", "mm")]
        ledger.fact("fabric", (rf"{re.escape(title)}, {N} mm.*", millimetres * thickness), "echoed")
    if tests and "tests" in result:
        known = [test["name"] for kind in ("strips", "bubble", "biaxial")
                 for test in project.get(kind, []) if "name" in test]  # fmt: skip
        wrong = [name for name in result["tests"] if known and name not in known]
        if wrong:
            ledger.find("result.json: tests", f"the project has no {wrong}")
        if folder.page is not None:
            ledger.fact("tests", ", ".join(result["tests"]), "echoed")
    for label in ("analyses", "card", "solver"):
        if label in result and folder.page is not None and isinstance(result[label], int | str):
            ledger.fact(label, result[label], "echoed" if label != "analyses" else "consistent")
    if "analyses" in result:
        ledger.text(r"(\d+) analyses", [result["analyses"]], needed=False)


def fit_folder(folder):
    """Return the folder of the fit whose card a study took, None where there is none."""
    from .folders import Folder

    card = folder.result.get("card")
    path = folder.base / str(card)
    beside = path.parent / "moduli.csv"
    return Folder(path.parent, base=folder.base) if path.is_file() and beside.exists() else None


def along(table, name, column, strain):
    """Return a column of moduli.csv of a modulus, at strains."""
    rows = table[table["modulus"] == name]
    return np.interp(strain, rows["strain"], rows[column])


def line(ledger, pattern, values, **options):
    """Compare a line of the terminal and of the page; spaces are any white space."""
    spaced = re.sub(r"(?<!\\) +", r"\\s+", pattern)
    return ledger.text(spaced, values, **options)


def audit_collections(folder, ledger):
    """The times of .pvd files are the kPa that the names of their files say, and rise."""
    for path in sorted(folder.path.glob("*.pvd")):
        sets = re.findall(r'timestep="([^"]+)" part="0" file="([^"]+)"', path.read_text())
        times = [float(time) for time, _ in sets]
        names = [float(re.search(r"-([\d.e+-]+)kPa", name)[1]) for _, name in sets]
        if not sets or not np.allclose(times, names, rtol=1e-5) or (np.diff(times) <= 0).any():
            ledger.find(f"{path.name}: timestep", f"is {times}; its files are of {names} kPa")
