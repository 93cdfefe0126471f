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


#: Headings of a page for the columns of a CSV, and factors of their values.
HEADINGS = {
    "MPa": ("value, MPa", 1),
    "by_sigma": ("−2 log L by the 1 sigma of the fit", 1),
    "coefficients": ("number of coefficients", 1),
    "cross_validated": ("error at what was left out", 1),
    "fit_MPa": ("fit, MPa", 1),
    "fit_lower_MPa": ("band of the fit from, MPa", 1),
    "fit_sigma_relative": ("1 sigma of the fit, %", 100),
    "fit_upper_MPa": ("to, MPa", 1),
    "fitted": ("error of the fit", 1),
    "fitted_relative": ("relative error, fitted, %", 100),
    "fitted_rms": ("RMS error, fitted", 1),
    "foretold_relative": ("relative error, predicted, %", 100),
    "foretold_rms": ("RMS error, predicted", 1),
    "foretold_words": ("why not predicted", 1),
    "lower_MPa": ("samples from, MPa", 1),
    "median_MPa": ("median, MPa", 1),
    "minus_2_log_L": ("−2 log L", 1),
    "model": ("test", 1),
    "moduli": ("form of the moduli", 1),
    "off_finest": ("off the finest", 1),
    "off_finest_percent": ("off the finest, %", 1),
    "sigma_relative": ("1 sigma of the samples, %", 100),
    "size": ("size (edge, mm, or share of the load)", 1),
    "strain": ("strain, %", 100),
    "to_base": ("relative to the card's nu12", 1),
    "to_mean": ("relative to the mean", 1),
    "upper_MPa": ("samples to, MPa", 1),
    "weight_times": ("weight, times the project's", 1),
}


def heading_of(column):
    """Return heading and factor of a column of a CSV on a page: words, strains in percent."""
    if column in HEADINGS:
        return HEADINGS[column]
    match = re.fullmatch(r"sigma_(E1|E2|G12)(?:_at_(.+))?", column)
    if match:
        strain = f" at {100 * float(match[2]):.4g} % strain" if match[2] else ""
        return f"1 sigma of {match[1]}{strain}, %", 100
    match = re.fullmatch(r"(E1|E2|G12)_MPa at (.+)", column)
    if match:
        return f"{match[1]} at {100 * float(match[2]):.4g} % strain, MPa", 1
    if column.startswith("relative "):
        return f"error of {column[len('relative ') :]}, %", 100
    return column.replace("_", " "), 1


#: Tables of pages that repeat numbers of result.json, rounded.
REPEATED = re.compile(
    r"Intervals|Orders, limits and errors|Changes|Errors|Changes of the moduli|The memory|"
    r"Scatter of the moduli|The tests, best first|Numbers of each card|Apex|The cycles|"
    r"Each cycle predicted from the others"
)
#: Notes below such tables.
REPEATING = re.compile(
    r"Of 95 %|1 sigma of the moduli up to|Relative to the response|Permanent strain: at|Error: "
)


def audit_repeated(ledger):
    """Numbers of a verdict and of short tables are numbers of the files, rounded."""
    values = [v for v in ledger.values.values() if isinstance(v, int | float)]
    # The level, the part of a peak along which stiffness is taken, the angle of a bias strip.
    values += [95, 40, 90, 45]
    for file, column in ledger.columns:
        numbers = pd.to_numeric(ledger.folder.tables[file][column], errors="coerce")
        values += numbers.dropna().tolist()
        if column == "to_base":  # of which the page shows the change
            values += (numbers.dropna() - 1).tolist()
    values = np.abs(np.unique(np.array(values, dtype=float)))
    values = np.unique(np.concatenate([values, 100 * values, 1e-3 * values]))
    strings = " ".join(text.text for text in ledger.strings.values())

    def is_reported(number):
        value = abs(float(number.replace("−", "-")))
        digits = len(re.sub(r"e.*|^[-+−0.]+|\.", "", number)) or 1
        at = values[np.searchsorted(values, value * (1 - 1e-12)) - 1 :][:2] if len(values) else []
        close = any(abs(float(f"{own:.{digits}g}") - value) <= 1e-9 * value for own in at)
        exact = value == 0 or (np.abs(values - value) <= 0.51 * 10.0 ** -_decimals(number)).any()
        return close or exact or number in strings

    result = ledger.folder.result or {}
    tests = result.get("tests")
    numbers = [result, *tests.values()] if isinstance(tests, dict) else [result]
    verdicts = [own["verdict"] for own in numbers if isinstance(own, dict) and "verdict" in own]
    words = [v[key] for v in verdicts for key in ("sentence", "not_known", "next") if v.get(key)]
    words += [reason for verdict in verdicts for reason in verdict.get("reasons", [])]
    if not verdicts and ledger.folder.page is not None:  # the head of a page without result.json
        words += [text for tag, section, text in ledger.folder.page.sentences if not section]
    notes = (ledger.folder.result or {}).get("notes", [])
    notes = [
        (note.get("of") or "", note["note"].replace("\u00a0", " "))
        for note in notes
        if "note" in note
    ]

    def is_altered_note(line):
        """It begins as a note of the result does, and goes on otherwise."""
        begins = any(line.startswith(f"{of}: {note.split()[0]} ") for of, note in notes)
        return begins and not any(note in line for _, note in notes)

    for text in ledger.texts:
        plain = text.text.replace("\u00a0", " ")
        inside = any(own.replace("\u00a0", " ") in plain for own in words)
        table = (
            text.source == "page" and REPEATED.fullmatch(text.place.split(" > ")[1])
            if (text.place.count(" > ") > 1)
            else False
        )
        note = text.source == "page" and (
            REPEATING.match(text.text)
            or (text.place.startswith("The result > li ") and not is_altered_note(plain))
        )
        if ledger.folder.command is not None and ledger.folder.command.startswith("simulate"):
            note = note or "unstable equilibrium at" in text.text
            note = note or text.place.startswith("The result > chart ")
        if not (inside or table or note):
            continue
        for span, how in list(text.claims.items()):
            number = text.text[slice(*span)]
            if how is None and is_reported(number):
                text.claims[span] = "consistent"
    shown = {text.text.replace("\u00a0", " ") for text in ledger.printed}
    for verdict in verdicts if shown else ():
        title = f"{verdict['state'].capitalize()}: {verdict['sentence']}."
        if title.replace("\u00a0", " ") not in shown:
            ledger.find("terminal: verdict", f"does not say {title!r}")


def _decimals(number):
    """Return the position of the last digit of a printed number, behind the point."""
    mantissa, _, exponent = number.replace("−", "-").partition("e")
    return len(mantissa.partition(".")[2]) - int(exponent or 0)


def page_of_csv(folder, ledger, file, title="The numbers"):
    """Compare a table of the page with a CSV: the same columns and rows, four digits."""
    table = folder.data(file)
    texts = [is_text(table[name]) for name in table]
    headings = [heading_of(name) for name in table]
    table = table.copy()
    for name, (_, factor) in zip(list(table), headings, strict=True):
        if factor != 1:
            table[name] = factor * table[name]
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
    ledger.table(title, [heading for heading, _ in headings], rows, digits=4, slack=1e-6)
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
    options.setdefault("needed", bool(ledger.folder.terminal))
    return ledger.text(spaced, values, **options)


def audit_collections(folder, ledger):
    """The times of .pvd files are the kPa that the names of their files say, and rise."""
    for path in sorted(folder.path.glob("*.pvd")):
        sets = re.findall(r'timestep="([^"]+)" part="0" file="([^"]+)"', path.read_text())
        times = [float(time) for time, _ in sets]
        names = [float(re.search(r"-([\d.e+-]+)kPa", name)[1]) for _, name in sets]
        if not sets or not np.allclose(times, names, rtol=1e-5) or (np.diff(times) <= 0).any():
            ledger.find(f"{path.name}: timestep", f"is {times}; its files are of {names} kPa")
