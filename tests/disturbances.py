"""Faults put by hand into what a folder reports: a digit, a unit, exchanged rows, a count."""

import json
import random
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

NUMBER = re.compile(r"(?<![\w.:-])\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.:]|-\d)")
#: Texts of a page between tags that hold results: cells, sentences, facts.
SPAN = re.compile(r"<(td|p|li|dd)\b[^>]*>([^<]*\d[^<]*)</\1>")
#: What is no result.
APART = ("The record", "How to cite", "Files of the folder")


def copied(folder: Path, to: Path) -> Path:
    """Copy a folder without pictures, its page without scripts and drawings."""
    to.mkdir(parents=True)
    for path in folder.iterdir():
        if path.is_file() and path.suffix not in (".png", ".html", ".vtu", ".pvd"):
            shutil.copy(path, to)
    page = (folder / "report.html").read_text()
    page = re.sub(r"<(script|style)\b.*?</\1>", "", page, flags=re.S)
    (to / "report.html").write_text(
        re.sub(r"(<svg\b[^>]*>).*?</svg>", r"\1</svg>", page, flags=re.S)
    )
    return to


def changed(text: str, chance: random.Random) -> str:
    """Return a number with another third digit, or its last if it has fewer."""
    digits = [k for k, letter in enumerate(text.partition("e")[0]) if letter.isdigit()]
    first = next((k for k in digits if text[k] != "0"), digits[-1])
    at = [k for k in digits if k >= first][:3][-1]
    digit = (int(text[at]) + chance.choice((2, 3, 4, 6, 7, 8))) % 10
    return text[:at] + str(digit) + text[at + 1 :]


def disturbed(folder: Path, chance: random.Random) -> str:
    """Put one fault into a folder; return what it is."""
    faults = (_leaf, _leaf, _cell, _cell, _printed, _printed, _unit, _exchanged)
    return chance.choice(faults)(folder, chance)


def _leaf(folder: Path, chance: random.Random) -> str:
    path = next(folder / n for n in ("result.json", "check.json") if (folder / n).exists())
    content = json.loads(path.read_text())
    leaves = [
        own for own in _leaves(content, ())
        if not {"seed", "versions", "wall_s", "seconds", "cpu_s"} & {*map(str, own)}
    ]  # fmt: skip
    place = chance.choice(leaves)
    holder = content
    for key in place[:-1]:
        holder = holder[key]
    old = holder[place[-1]]
    holder[place[-1]] = old + 1 if isinstance(old, int) or abs(old) < 1e-9 else old * 1.02
    path.write_text(json.dumps(content, indent=1))
    return f"{path.name}: {'.'.join(map(str, place))}: {old} is {holder[place[-1]]}"


def _leaves(value: object, path: tuple) -> Iterator[tuple]:
    if isinstance(value, dict):
        for key, own in value.items():
            yield from _leaves(own, (*path, key))
    elif isinstance(value, list):
        for key, own in enumerate(value):
            yield from _leaves(own, (*path, key))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield path


def _tables(folder: Path) -> list[Path]:
    apart = ("notes.csv", "history.csv")
    return [path for path in sorted(folder.glob("*.csv")) if path.name not in apart]


def _cell(folder: Path, chance: random.Random) -> str:
    if not _tables(folder):
        return _printed(folder, chance)
    path = chance.choice(_tables(folder))
    lines = path.read_text().splitlines()
    while True:
        row = chance.randrange(1, len(lines))
        cells = lines[row].split(",")
        column = chance.randrange(len(cells))
        if '"' not in lines[row] and re.fullmatch(r"-?\d[\d.e+-]*", cells[column]):
            # Rounding is no number.
            if 0 < abs(float(cells[column])) < 1e-12:
                continue
            break
    old = cells[column]
    cells[column] = changed(old, chance)
    lines[row] = ",".join(cells)
    path.write_text("\n".join(lines) + "\n")
    name = lines[0].split(",")[column]
    return f"{path.name}: {name}, row {row}: {old} is {cells[column]}"


def _printed(folder: Path, chance: random.Random) -> str:
    path = folder / "report.html"
    page = path.read_text()
    ends = [match for match in SPAN.finditer(page) if NUMBER.search(match[2])]
    ends = [match for match in ends if not _section(page, match.start()).startswith(APART)]
    place = chance.choice(ends)
    number = chance.choice(list(NUMBER.finditer(place[2])))
    new = changed(number[0], chance)
    start = place.start(2) + number.start()
    path.write_text(page[:start] + new + page[start + len(number[0]) :])
    return f"page: {place[2][:70]!r}: {number[0]} is {new}"


def _section(page: str, at: int) -> str:
    """Return the heading above a place of a page; of its head "How to cite", which is apart."""
    heads = re.findall(r"<h2[^>]*>([^<]*)</h2>", page[:at])
    return heads[-1] if heads else "How to cite"


def _unit(folder: Path, chance: random.Random) -> str:
    path = folder / "report.html"
    page = path.read_text()
    pattern = r"<th[^>]*>([^<]*?(?<![\w/]))(MPa|GPa|kN/m|N|mm|%|kPa)</th>"
    units = list(re.finditer(pattern, page))
    place = chance.choice(units)
    new = {"MPa": "GPa", "GPa": "MPa", "kN/m": "N/m", "N": "kN", "mm": "m", "%": "‰", "kPa": "Pa"}
    path.write_text(page[: place.start(2)] + new[place[2]] + page[place.end(2) :])
    return f"page: heading {place[1]}{place[2]} has {new[place[2]]}"


def _exchanged(folder: Path, chance: random.Random) -> str:
    """Exchange the names of two rows of a table."""
    if not _tables(folder):
        return _leaf(folder, chance)
    path = chance.choice(_tables(folder))
    lines = path.read_text().splitlines()
    first = chance.randrange(1, len(lines) - 1)
    others = [
        k for k in range(1, len(lines))
        if lines[k].split(",")[0] != lines[first].split(",")[0]
        and lines[k].split(",")[1:] != lines[first].split(",")[1:]
    ]  # fmt: skip
    if not others:
        return _cell(folder, chance)
    second = chance.choice(others)
    a, b = (lines[k].split(",", 1) for k in (first, second))
    lines[first], lines[second] = f"{b[0]},{a[1]}", f"{a[0]},{b[1]}"
    path.write_text("\n".join(lines) + "\n")
    return f"{path.name}: rows {first} and {second} have each other's name"
