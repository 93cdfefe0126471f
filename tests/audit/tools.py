"""Auditors of commands that print, or write one table: gauge, dic sphere, estimate, verify."""

import math
import re

import numpy as np
import pandas as pd
from scipy.optimize import least_squares

from . import measured
from .common import claim_literal
from .ledger import NUM, as_number

#: Points farther off a sphere than so many robust deviations are left out.
SIGMAS, MEDIAN = 4.0, 0.6744897501960817


def audit_sphere(folder, ledger):
    """Audit the CSV of `dic sphere`: spheres by least squares of the distance."""
    file = next(iter(folder.tables))
    table = folder.data(file)
    rows = []
    for k, row in enumerate(table.to_dict("records")):
        points = measured.table_of(folder.base / row["frame"]).iloc[:, :3].to_numpy(float)
        start = np.array([row["x_mm"], row["y_mm"], row["z_mm"], row["radius_mm"]])
        kept = np.ones(len(points), dtype=bool)
        for _ in range(20):
            found = least_squares(_distances, start, args=(points[kept],), xtol=1e-15, ftol=1e-15)
            off = np.abs(_distances(found.x, points))
            inside = off <= max(SIGMAS * float(np.median(off)) / MEDIAN, 1e-9 * found.x[3])
            if (inside == kept).all():
                break
            kept, start = inside, found.x
        *centre, radius = found.x
        deviation = _distances(found.x, points)[kept]
        variance = float(np.sum(deviation**2)) / (int(kept.sum()) - 4)
        errors = np.sqrt(variance * np.diag(np.linalg.inv(found.jac.T @ found.jac)))
        expected = {
            "points": int(kept.sum()), "left_out": int((~kept).sum()), "radius_mm": radius,
            "radius_error_mm": errors[3], "rms_mm": float(np.sqrt(np.mean(deviation**2))),
        }  # fmt: skip
        for axis, value, error in zip("xyz", centre, errors, strict=False):
            expected |= {f"{axis}_mm": value, f"{axis}_error_mm": error}
        for name, value in expected.items():
            limit = {"rel": 0.02, "abs": 1e-12} if "error" in name or "rms" in name else {
                "rel": 1e-7}  # fmt: skip
            ledger.column(file, name, np.array([float(value)]), rows=np.array([k]), **limit)
        rows.append(radius)
    # Of the radius that was said, which the deviations give.
    said = table["radius_mm"] / (1 + table["deviation_percent"] / 100)
    deviation = 100 * (np.array(rows) / float(np.median(said)) - 1)
    ledger.column(file, "deviation_percent", deviation, rel=1e-4)
    if np.ptp(said) > 1e-6 * said.mean():
        ledger.find(f"{file}: deviation_percent", "is of several radii")
    if folder.terminal:
        _printed_spheres(folder, ledger, table)


def _printed_spheres(folder, ledger, table):
    source = {"source": "terminal"}
    for row in table.to_dict("records"):
        ledger.text(
            rf"^\s*{row['frame']}\s+(\d+)\s+(\d+)\s+{NUM}\s+{NUM}\s+{NUM}, {NUM}, {NUM}\s+{NUM}\s+"
            rf"{NUM}",
            [row["points"], row["left_out"], row["radius_mm"], None, row["x_mm"], row["y_mm"],
             row["z_mm"], None, row["deviation_percent"]],
            digits=[6, 6, 6, 2, 4, 3, 5, 2, 2], **source,
        )  # fmt: skip
    deviation = table["deviation_percent"]
    worst = deviation[deviation.abs().idxmax()]
    ledger.text(rf"off by {NUM} % on average, {NUM} % at worst",
                [float(deviation.abs().mean()), float(worst)], digits=2, **source)  # fmt: skip
    ledger.text(rf"radius {NUM} mm", lambda m: [m[1]], **source)


def _distances(sphere, points):
    return np.linalg.norm(points - sphere[:3], axis=1) - sphere[3]


def audit_gauge(folder, ledger):
    """Audit the CSV of `gauge`: a length by frame, from the frames of the camera."""
    file = next(iter(folder.tables))
    table = folder.data(file)
    head = [line for line in (folder.path / file).read_text().splitlines() if line[:1] == "#"]
    numbers = re.search(
        rf"between \({NUM}, {NUM}\) and \({NUM}, {NUM}\) mm, {NUM} mm long", "\n".join(head)
    )
    lower, upper = (np.array([float(numbers[k]), float(numbers[k + 1])]) for k in (1, 3))
    lengths = []
    for name in table["file"]:
        path = next((folder.base / "frames").glob(name), folder.base / name)
        lengths.append(_length(path, lower, upper))
    lengths = np.array(lengths)
    rest = float(lengths[0] - table["elongation_mm"].iloc[0])
    ledger.column(file, "length_mm", lengths, rel=1e-6)
    ledger.column(file, "elongation_mm", lengths - rest, rel=1e-5, abs=1e-6)
    ledger.column(file, "strain", lengths / rest - 1, rel=1e-5, abs=1e-7)
    ledger.column(file, "log_strain", np.log(lengths / rest), rel=1e-5, abs=1e-7)
    numbers_of = table["file"].str.extract(r"(\d+)")[0].astype(int)
    ledger.column(file, "frame", numbers_of.to_numpy(), "echoed")
    _loads(folder, ledger, file, table)
    for name in ("specimen", "direction", "file"):
        if name in table:
            ledger.claim_column(file, name, "echoed")
            for text in ledger.texts:
                if text.source == file and text.place.startswith(name):
                    text.claims = dict.fromkeys(text.claims, "echoed")
    if folder.terminal:
        _printed_gauge(ledger, table, rest, head)


def _length(path, lower, upper):
    """Return the distance of the gauge's ends, each by a plane through the points around it."""
    table = pd.read_csv(path, comment="#").dropna().to_numpy(float)
    ends = []
    for end in (lower, upper):
        away = np.hypot(*(table[:, :2] - end).T)
        near = table[away < 3.0]
        terms = np.column_stack([near[:, :2] - end, np.ones(len(near))])
        ends.append(np.linalg.lstsq(terms, near[:, :3] + near[:, 3:], rcond=None)[0][2])
    return float(np.linalg.norm(ends[1] - ends[0]))


def _loads(folder, ledger, file, table):
    """Loads rise with the time of the frames; the machine's export is read by its own lines."""
    if "load_N" not in table:
        return
    path = folder.base / "machine.csv"
    ledger.claim_column(file, "load_N", "consistent")
    if not path.exists():
        return
    rows = [line.split(",") for line in path.read_text().splitlines()]
    start = next(k for k, row in enumerate(rows) if "s" in row and "kN" in row)
    units = rows[start]
    values = np.array([row for row in rows[start + 1 :] if len(row) == len(units)], dtype=float)
    load, time = 1000 * values[:, units.index("kN")], values[:, units.index("s")]
    # A frame every so many seconds: the first and the last tell how many.
    frames = table["frame"].to_numpy(float)
    first = float(np.interp(table["load_N"].iloc[0], load, time))
    step = (float(np.interp(table["load_N"].iloc[-1], load, time)) - first) / np.ptp(frames)
    expected = np.interp(first + step * (frames - frames[0]), time, load)
    ledger.column(file, "load_N", expected, rel=1e-6, abs=1e-6)


def _printed_gauge(ledger, table, rest, head):
    source = {"source": "terminal"}
    last = table.iloc[-1]
    ledger.text(rf"^gauge length {NUM} mm; (\d+) frames, lost in (\d+)",
                lambda m: [rest, m[2], m[3]], digits=5, **source)  # fmt: skip
    top = table.loc[table["elongation_mm"].idxmax()]
    ledger.text(
        rf"^elongation up to {NUM} mm: strain {NUM} %, log strain {NUM} %",
        lambda m: [m[1], m[2], m[3]] if as_number(m[1]) >= top["elongation_mm"] * 0.999 else [
            top["elongation_mm"], 100 * top["strain"], 100 * top["log_strain"]],
        digits=4, **source,
    )  # fmt: skip
    if "load_N" in table:
        ledger.text(rf"^(\d+) points, loads up to {NUM} N", [len(table), float(last["load_N"])],
                    digits=4, **source)  # fmt: skip
    ledger.text(rf"gauge_length = {NUM}", [rest], digits=5, **source)
    # Warnings are those of the file's head.
    for text in ledger.texts:
        for line in head:
            words = line.removeprefix("# note: ")
            if text.source == "terminal" and words in text.text:
                text.claim((0, len(text.text)), "consistent")
            elif text.text.startswith(("warning: ", "correlation lost: ", "note: ")):
                text.claim((0, len(text.text)), "consistent")


def audit_printed_verify(folder, ledger):
    """Audit the terminal of `verify`: ours beside theirs, and whether all numbers are met."""
    row = re.compile(rf"^(.*\S)\s+{NUM}\s+{NUM}(?: (\S+))?\s+{NUM} %\s+{NUM}  ")
    met, count = 0, 0
    for text in ledger.texts:
        match = row.match(text.text)
        if match is None:
            continue
        count += 1
        ours, theirs, off, allowed = (as_number(match[k]) for k in (2, 3, 5, 6))
        share = 100 * (ours / theirs - 1)
        # Both are printed with six digits.
        if abs(share - off) > 1.2e-3 + 0.05 * abs(share):
            ledger.find(f"terminal: {match[1]}", f"is off by {share:+.2g} %, not {off}")
        met += abs(share) <= allowed + 1e-3
        text.claims = dict.fromkeys(text.claims, "recomputed")
    ledger.text(r"all (\d+) numbers are met", [met if met == count else -1], "recomputed")


def audit_printed_estimate(folder, ledger):
    """Audit the terminal of `estimate`: kN/m, bands that hold their value, rising strains."""
    thickness = folder.project["fabric"]["thickness"]
    ledger.text(rf"kN/m: times {NUM} mm", [thickness])
    ledger.text(r"95 % band, MPa", [])
    row = re.compile(
        rf"^(?:(E1|E2|G12), \w+ \w+)?\s+{NUM} %\s+{NUM}\*?\s+({NUM} %|unknown|not known)?\s+"
        rf"{NUM}\*? to {NUM}\*?\s+{NUM}(  \(end\))?$"
    )
    last = -1.0
    for text in ledger.texts:
        match = row.match(text.text)
        if match is None:
            continue
        strain, value, low, high, width = (as_number(match[k]) for k in (2, 3, 6, 7, 8))
        place = f"terminal: {text.text.strip()}"
        ledger.compare_text(place, match[8], value * thickness, 4, 6e-4)
        if not low * (1 - 1e-3) <= value <= high * (1 + 1e-3):
            ledger.find(place, "the value lies outside its band")
        if match[1] is None and strain < last:
            ledger.find(place, "strains do not rise")
        if match[4] and match[4][0].isdigit():
            half = (high - low) / 2 / value
            sigma = as_number(match[4].removesuffix(" %")) / 100
            if half < 0.2 and not 0.5 < half / (1.96 * sigma) < 1.6:
                ledger.find(place, f"1 sigma {sigma:.3g} beside a half band of {half:.3g}")
        last = strain
        text.claims = dict.fromkeys(text.claims, "consistent")
        del width
    _left(folder, ledger)


def _left(folder, ledger):
    """What is left, and chi: over the scatter of the specimens, of strips."""
    for section in folder.project.get("strips", []):
        name = section.get("name", "strips")
        record = {"data": [
            {"test": name, "name": f, "file": str(folder.base / f)}
            for f in section.get("data", {}).get("files", [])
        ]}  # fmt: skip
        folder.provenance = record
        curves = measured.load_curves(folder, name, section) or {}
        for direction, own in curves.items():
            along = np.concatenate([c[1] for c in own])
            load = np.concatenate([c[2] for c in own])
            powers = np.vander(along / along.max(), 5, increasing=True)[:, 1:]
            off = load - powers @ np.linalg.lstsq(powers, load, rcond=None)[0]
            scatter = float(off.std(ddof=1))

            specimens = len(own)

            def chi(match, scatter=scatter, specimens=specimens):
                rms, told = as_number(match[1]), as_number(match[2])
                ratio = rms / scatter
                if specimens > 1 and not math.isclose(ratio, told, rel_tol=0.12):
                    ledger.find(f"terminal: {match[0]}", f"{rms} over {scatter:.4g} is {ratio:.3g}")
                return [match[1], match[2]]

            ledger.text(rf"^{name}: {direction}: {NUM} N RMS are left, chi {NUM}", chi,
                        "recomputed", needed=False)  # fmt: skip


def audit_verify(folder, ledger):
    """Audit the folder of `verify`: deviations, and tables of the page that repeat them."""
    result = folder.result
    for number, row in enumerate(result["numbers"]):
        off = row["ours"] - row["theirs"]
        off = off if row["absolute"] else off / abs(row["theirs"])
        place = ("numbers", number)
        for key in ("ours", "theirs", "allowed"):
            ledger.claim_json((*place, key), "echoed")
        ledger.json((*place, "deviation"), off, rel=1e-9)
        ledger.json((*place, "met"), abs(off) <= row["allowed"])
    missed = [row["what"] for row in result["numbers"] if not row["met"]]
    ledger.json("ok", not missed)
    ledger.json(("verdict", "reasons"), missed)
    count = len(result["numbers"])
    for pattern in (r"all (\d+) numbers are met", r"(\d+) of (\d+) numbers are missed"):
        counts = [count] if "all" in pattern else [len(missed), count]
        ledger.text(pattern, counts, needed=False)
    header = ["quantity", "ours", "theirs", "unit", "off", "allowed", "", "source"]
    for subject in dict.fromkeys(row["subject"] for row in result["numbers"]):
        rows = []
        for row in (row for row in result["numbers"] if row["subject"] == subject):
            factor, unit = (1.0, row["unit"]) if row["absolute"] else (100.0, "%")
            off, allowed = factor * row["deviation"], factor * row["allowed"]
            words = f"{off:+.4f} {unit}", f"{allowed:.4g} {unit}", "met" if row["met"] else "MISSED"
            values = [float(row["ours"]), float(row["theirs"]), row["unit"]]
            rows.append([row["what"], *values, *map(str.strip, words), row["source"]])
        ledger.table(subject, header, rows)
        for row in rows:
            claim_literal(ledger, row[0])
            claim_literal(ledger, row[-1])
    if folder.terminal:
        audit_printed_verify(folder, ledger)


COMMANDS = {"verify": audit_verify}
PRINTED = {"verify": audit_printed_verify, "estimate": audit_printed_estimate}
TABLES = {"gauge": audit_gauge, "sphere": audit_sphere}
