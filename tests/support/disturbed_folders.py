"""Disturb finished folders: a digit, two rows, a number of a sentence; for tests of the auditor."""

import json
import re
import shutil

import pandas as pd

#: Not results: the auditor does not look at them.
NO_RESULTS = re.compile(r"seconds|wall_s|seed|versions|iterations|cached_runs|analyses\b")
LARGE = ("*.png", "*.vtu", "*.pvd", "analyses", "runs", "beams", "figures", "bubble-vtu")


def other_digit(text, random):
    """Return a printed number with another digit among its first three."""
    places = [k for k, sign in enumerate(text) if sign.isdigit()]
    mantissa = [k for k in places if not set(text[:k]) & set("eEdD")]
    significant = [k for k in mantissa if text[: k + 1].strip("0.-+") != ""] or mantissa
    place = significant[random.integers(min(3, len(significant)))]
    digit = str((int(text[place]) + random.integers(1, 9)) % 10)
    return text[:place] + digit + text[place + 1 :]


def changed_number(value, random):
    """Return another number: a count by one, else by a hundredth or with the other sign."""
    if isinstance(value, int) or (float(value).is_integer() and abs(value) < 100):
        return value + 1
    return -value if random.random() < 0.2 else 1.01 * value


def leaves(value, path=()):
    """Yield path and number of every leaf of a JSON value that is a result."""
    members = ()
    if isinstance(value, dict):
        members = value.items()
    elif isinstance(value, list):
        members = enumerate(value)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        if not NO_RESULTS.search(".".join(map(str, path))):
            yield path, value
    for key, member in members:
        yield from leaves(member, (*path, key))


def disturb_json(folder, random):
    file = folder / "result.json"
    result = json.loads(file.read_text())
    found = list(leaves(result))
    path, value = found[random.integers(len(found))]
    place = result
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = changed_number(value, random)
    file.write_text(json.dumps(result))
    return f"result.json: {'.'.join(map(str, path))}: {value} -> {place[path[-1]]}"


def tables(folder):
    """Return every CSV of a folder with a column of numbers, and these columns."""
    found = []
    for file in sorted(folder.glob("*.csv")):
        table = pd.read_csv(file, dtype=str, keep_default_na=False)
        numbers = [c for c in table if pd.to_numeric(table[c], errors="coerce").notna().any()]
        numbers = [c for c in numbers if not NO_RESULTS.search(c)]
        if numbers:
            found.append((file, table, numbers))
    return found


def disturb_cell(folder, random):
    every = tables(folder)
    if not every:
        return None
    file, table, columns = every[random.integers(len(every))]
    column = columns[random.integers(len(columns))]
    rows = pd.to_numeric(table[column], errors="coerce").dropna().index
    row = rows[random.integers(len(rows))]
    before = table.loc[row, column]
    table.loc[row, column] = repr(changed_number(float(before), random))
    table.to_csv(file, index=False)
    return f"{file.name}: {column}, row {row + 1}: {before} -> {table.loc[row, column]}"


def disturb_rows(folder, random):
    """Exchange two different rows of a column."""
    every = tables(folder)
    if not every:
        return None
    file, table, columns = every[random.integers(len(every))]
    columns = [c for c in columns if table[c].nunique() > 1]
    if not columns:
        return None
    column = columns[random.integers(len(columns))]
    first = random.integers(len(table))
    others = table.index[table[column] != table.loc[first, column]]
    second = others[random.integers(len(others))]
    values = table[column].copy()
    table.loc[first, column], table.loc[second, column] = values[second], values[first]
    table.to_csv(file, index=False)
    return f"{file.name}: {column}: rows {first + 1} and {second + 1} exchanged"


CELL = re.compile(r"(<td[^>]*>)([-+]?\d[\d.]*(?:e[-+]?\d+)?)(</td>)")
SENTENCE = re.compile(r"(?<=[ (])(\d+\.\d+)(?=(?:\u00a0| |&nbsp;)(?:%|MPa|N|mm|kPa))")


def disturb_page(folder, random, pattern=CELL, group=2):
    """Change a digit of a cell, or of a number with a unit in a sentence, of the page."""
    file = folder / "report.html"
    if not file.exists():
        return None
    text = file.read_text(encoding="utf-8")
    hidden = re.compile(r"<head>.*?</head>|<(script|svg)\b.*?</\1>|<h2[^>]*>How to cite.*", re.S)
    spans = [match.span() for match in hidden.finditer(text)]
    matches = [
        match
        for match in pattern.finditer(text)
        if not any(first <= match.start() < last for first, last in spans)
    ]
    if not matches:
        return None
    match = matches[random.integers(len(matches))]
    changed = other_digit(match[group], random)
    a, b = match.span(group)
    file.write_text(text[:a] + changed + text[b:], encoding="utf-8")
    return f"report.html: ...{text[max(a - 60, 0) : b + 10]}... -> {changed}"


def disturb_sentence(folder, random):
    return disturb_page(folder, random, SENTENCE, 1)


HEADING = re.compile(r"<th[^>]*>[^<]*?(?<![\w/])(MPa|GPa|kN/m|N|mm|%|kPa)</th>")
OTHER_UNIT = {
    "MPa": "GPa", "GPa": "MPa", "kN/m": "N/m", "N": "kN", "mm": "m", "%": "\u2030", "kPa": "Pa"
}  # fmt: skip


def disturb_unit(folder, random):
    """Give a column of a table of the page another unit."""
    file = folder / "report.html"
    text = file.read_text(encoding="utf-8")
    matches = list(HEADING.finditer(text))
    match = matches[random.integers(len(matches))]
    a, b = match.span(1)
    file.write_text(text[:a] + OTHER_UNIT[match[1]] + text[b:], encoding="utf-8")
    return f"report.html: a column of {match[1]} is of {OTHER_UNIT[match[1]]}"


DISTURBANCES = (disturb_json, disturb_cell, disturb_rows, disturb_page, disturb_sentence)


def disturbed(folder, target, disturb, random):
    """Copy a folder without its pictures, and disturb the copy; return what was changed."""
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(folder, target, ignore=shutil.ignore_patterns(*LARGE))
    return disturb(target, random)
