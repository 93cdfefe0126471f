"""Read measured files as their own small reader does: comma-separated, a header, units in names."""

import re
from pathlib import Path

import numpy as np
import pandas as pd

#: Of base units (mm, N, kPa, %) for what a header or a project names.
LENGTH = {"mm": 1.0, "m": 1000.0, "cm": 10.0, "in": 25.4}
FORCE = {"N": 1.0, "kN": 1000.0, "lbf": 4.4482216152605}


def table_of(path):
    """Return a CSV with a header as a DataFrame, or None where it is of another sort."""
    path = Path(path)
    if not path.exists() or path.suffix.lower() != ".csv":
        return None
    lines = [
        line for line in path.read_text(encoding="utf-8-sig").splitlines()
        if line.strip() and not line.startswith("#")
    ]  # fmt: skip
    if not lines or lines[0].count(",") < 1:
        return None
    try:
        return pd.read_csv(path, comment="#", encoding="utf-8-sig")
    except (ValueError, pd.errors.ParserError):
        return None


def column(table, words, units, named=None):
    """Return a column in base units by words of its name, None where there is none such."""
    for name in table.columns:
        plain = name.strip()
        if plain == named or (named is None and any(w in plain.lower() for w in words)):
            values = pd.to_numeric(table[name], errors="coerce").to_numpy(float)
            unit = re.search(r"[(\[_ ]([A-Za-z]+)[)\]]?$", plain)
            factor = units.get(unit[1], 1.0) if unit else 1.0
            return factor * values
    return None


def text_column(table, words):
    for name in table.columns:
        if any(word in name.lower() for word in words):
            return table[name].astype(str).str.strip().to_numpy()
    return None


def data_files(folder, test):
    """Return the files of a test as provenance.json lists them; None without a record."""
    record = folder.provenance
    if record is None:
        return None
    return [row for row in record["data"] if row["test"] == test]


def load_curves(folder, test, section):
    """Return {direction: [(specimen, elongation mm, load N)]} of a strips test; None if unread."""
    rows = data_files(folder, test)
    if not rows or section.get("data", {}).get("until_largest_load"):
        return None
    data = section.get("data", {})
    if data.get("polynomials") or data.get("load_unit") or data.get("length_unit"):
        return None
    named, curves = data.get("columns", {}), {}
    for row in rows:
        table = table_of(row["file"])
        if table is None:
            return None
        along = column(table, ("elongation", "disp", "extension"), LENGTH, named.get("elongation"))
        load = column(table, ("load", "force"), FORCE, named.get("load"))
        if along is None or load is None or not np.isfinite(along).all():
            return None
        directions = text_column(table, ("direction", "series"))
        if directions is None:
            directions = _listed_direction(data, row["name"], len(table))
        if directions is None:
            return None
        specimens = text_column(table, ("specimen", "sample"))
        for direction in dict.fromkeys(directions):
            of = directions == direction
            names = dict.fromkeys(specimens[of]) if specimens is not None else [None]
            for name in names:
                chosen = of if name is None else of & (specimens == name)
                parts = [(name, along[chosen], load[chosen])]
                if name is None:
                    parts = _split(directions[of][0], along[chosen], load[chosen])
                curves.setdefault(_plain(direction), []).extend(parts)
    return curves


def _split(name, along, load):
    """Return specimens without names: one begins where the elongation falls below half."""
    starts, reached = [0], 0.0
    for k, value in enumerate(along):
        if reached > 0 and value < 0.5 * reached:
            starts.append(k)
            reached = 0.0
        if value > 0.01 * along.max():
            reached = max(reached, value)
    if len(starts) == 1:
        return [(name, along, load)]
    ends = [*starts[1:], len(along)]
    return [(f"{name} {n}", along[a:b], load[a:b])
            for n, (a, b) in enumerate(zip(starts, ends, strict=True), start=1)]  # fmt: skip


def _plain(direction):
    return "bias" if direction.lower().startswith("bias") else direction.lower()


def _listed_direction(data, name, count):
    files = data.get("files")
    if isinstance(files, dict):
        for direction, names in files.items():
            if any(Path(own).name == name for own in names):
                return np.full(count, direction)
    return None


def polynomials(folder, test, section):
    """Return {direction: (gauge, final, coefficients from c0 on, scatter)} of a published file."""
    rows = data_files(folder, test)
    if not rows or not section.get("data", {}).get("polynomials"):
        return None
    table = table_of(rows[0]["file"])
    if table is None or "gauge_length_mm" not in table:
        return None
    found = {}
    for row in table.to_dict("records"):
        powers = [row.get(f"c{k}", 0.0) for k in range(13)]
        powers = [0.0 if pd.isna(own) else float(own) for own in powers]
        scatter = row.get("data_scatter_N", np.nan)
        lengths = row["gauge_length_mm"], row["final_length_mm"]
        found[_plain(row["direction"])] = (*lengths, np.array(powers), scatter)
    return found
