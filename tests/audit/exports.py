"""Audit exports of a material card: read by parsers written from the target programs' manuals.

MSC Marc volume C (TABLE, NLELAST), CalculiX and Abaqus manuals (*USER MATERIAL, *FABRIC,
*UNIAXIAL), LS-DYNA's volume II (*MAT_034, *DEFINE_CURVE), Radioss' reference guide (/MAT/LAW58).
"""

import csv
import io
import json
import re
import tomllib
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from .laws import DIRECTION, MODULI, Law
from .ledger import Finding, Text, rounded_right
from .straight_strips import integral

N = r"([-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?)"
DENSITY = 1e-9  # t/mm3, that stands in where none is given
#: Words of programs and formats with numbers that are no results.
WORDING = (
    r"FORM(?:s)? [\d, and]+(?:of|or|14)?", r"FORM (?:-14|14|24)", r"LAW1?58", r"source of 2026",
    r"FUNC_1 to FUNC_3", r"ln\(1 \+ x\), y \(1 \+ x\)", r"to 57 x degrees", r"radioss-law58",
    r"TYPE16", r"AOPT 0", r"CSE = \d",
    r"ELFORM 5 or 9", r"E12", r"S1, S2", r"POISSON=\S+", r"type 73", r"\bbubblefit \d[\w.+-]*",
    r"constants 3 and 4", r"1e-6 on paths", r"Constant 8", r"constant 5", r"axis 1 of",
    r"direction [12]", r"node 1 to node 2", r"ORIENTATION 1 along the warp, 2 along",
    r"one element", r"2nd Piola-Kirchhoff", r"2 E12", r"\(E, nu\)", r"eps\^2/2", r"FORM 2",
)  # fmt: skip


def stress_of(law, name, strain):
    """Return the integral of a modulus (MPa) from 0 to a strain of either sign."""
    if strain < 0 and name != "G12":
        return strain * float(law.modulus(name, 0.0))
    return float(np.sign(strain)) * integral(law, name, abs(strain))


def strip(law, name, strain):
    """Return nominal strain and stress of a strip that is free to contract."""
    stress = stress_of(law, name, strain)
    if name == "E1":
        across = -law.nu12 * strain
    else:
        # E1 d(across) = -nu12 d(stress); a pushed fill pulls the warp.
        across = -law.nu12 * stress / float(law.modulus("E1", 0.0))
        if across > 0:
            wanted = -law.nu12 * stress
            across = brentq(lambda e: stress_of(law, "E1", e) - wanted, 0.0, 10.0 * across)
    power = 0.0 if law.thickness_change == "constant" else 1.0
    nominal = stress * np.exp(across) * np.exp(-power * (strain + across))
    return np.expm1(strain), nominal


def trellis(law, shear):
    """Return angle (rad), nominal stress on it, sin(angle) and the 2nd Piola-Kirchhoff stress.

    Yarns keep their length. shear : gamma12, of which the angle's sine is tanh. The 2nd
    Piola-Kirchhoff stress is (3,): along warp and fill, and in shear.
    """
    sine = np.tanh(shear)
    along = 0.25 * np.log1p(-sine * sine)
    e1, e2 = float(law.modulus("E1", 0.0)), float(law.modulus("E2", 0.0))
    nu21 = law.nu12 * e2 / e1
    share = 1 - law.nu12 * nu21
    cauchy = np.array([[(e1 + law.nu12 * e2) * along / share, stress_of(law, "G12", shear)],
                       [0.0, (e2 + nu21 * e1) * along / share]])  # fmt: skip
    cauchy[1, 0] = cauchy[0, 1]
    green = np.array([[1.0, sine], [sine, 1.0]])
    values, vectors = np.linalg.eigh(green)
    inverse = vectors @ np.diag(values**-0.5) @ vectors.T
    area = np.sqrt(1 - sine * sine)
    if law.thickness_change != "constant":
        area = 1.0
    second = area * inverse @ cauchy @ inverse
    angle = np.arcsin(sine)
    return angle, second[0, 1] * np.cos(angle), sine, np.array(
        [second[0, 0], second[1, 1], second[0, 1]]
    )  # fmt: skip


def curve(law, name, strains, measure):
    """Return (n, 2) strain and stress in a measure: nominal, green or true."""
    rows = []
    for strain in strains:
        if name == "G12":
            angle, nominal, sine, second = trellis(law, abs(strain))
            sign = np.sign(strain)
            if measure == "green":
                rows.append((sign * sine, sign * second[2]))
            elif measure == "nominal":
                rows.append((sign * angle, sign * nominal))
            else:
                rows.append((strain, stress_of(law, name, strain)))
            continue
        stretch, nominal = strip(law, name, strain)
        if measure == "green":
            rows.append((0.5 * np.expm1(2 * strain), nominal / (1 + stretch)))
        elif measure == "nominal":
            rows.append((stretch, nominal))
        else:
            rows.append((strain, stress_of(law, name, strain)))
    return np.array(rows)


@dataclass
class ExportedFile:
    """A file of an export: a heading of comment lines, and lines of data."""

    name: str
    text: str
    mark: str
    findings: list = field(default_factory=list)
    taken: int = 0  # numbers that were read and compared

    def __post_init__(self):
        self.lines = self.text.splitlines()
        heading, self.body = [], []
        for number, line in enumerate(self.lines, start=1):
            if line.startswith(self.mark):
                heading.append(line[len(self.mark) :].strip())
            else:
                self.body.append((number, Text(self.name, f"line {number}", line)))
        self.heading = Text(self.name, "heading", " ".join(" ".join(heading).split()))

    def find(self, place, message):
        self.findings.append(Finding(f"{self.name}: {place}", message))

    def claim(self, text, how="recomputed"):
        text.claim((0, len(text.text)), how)

    def numbers(self, count=None):
        """Return the next data lines as floats, claimed; stops at a line that holds words."""
        rows = []
        while self.body and (count is None or len(rows) < count):
            text = self.body[0][1]
            values = _floats(text.text)
            if values is None:
                break
            self.taken += len(values)
            rows.append(values)
            self.body.pop(0)
        return rows

    def skip_to(self, pattern):
        """Drop lines up to one that matches, and return it; None where there is none."""
        for k, (_, text) in enumerate(self.body):
            if re.search(pattern, text.text):
                self.body = self.body[k:]
                return text
        self.find(pattern, "no line reads so")
        return None

    def compare(self, place, values, expected, rel=1e-6, abs_=1e-9):
        values, expected = np.asarray(values, float), np.asarray(expected, float)
        if values.shape != expected.shape:
            self.find(place, f"has the shape {values.shape}, not {expected.shape}")
            return
        scale = np.abs(expected).max(initial=0.0)
        wrong = np.abs(values - expected) > np.maximum(
            rel * np.abs(expected), abs_ * (scale or 1e-3)
        )
        if wrong.any():
            first = tuple(int(k) for k in np.argwhere(wrong)[0])
            self.find(place, f"{first}: {values[first]:.9g}; expected {expected[first]:.9g}")

    def words(self, pattern, values, digits=3, needed=True):
        """Compare numbers of the heading."""
        seen = False
        for match in re.finditer(pattern, self.heading.text):
            seen = True
            self.heading.claim(match.span(), "wording")
            for k, value in enumerate(values, start=1):
                own = digits[k - 1] if isinstance(digits, list) else digits
                if value is None or match[k] is None:
                    continue
                self.heading.claim(match.span(k), "recomputed")
                if isinstance(value, str):
                    if match[k] != value:
                        self.find("heading", f"{match[0]!r}: expected {value}")
                elif not rounded_right(match[k], value, own, 1e-6):
                    self.find("heading", f"{match[0]!r}: expected {value:.6g}")
        if needed and not seen:
            self.find("heading", f"nothing reads like {pattern!r}")


def _floats(line):
    parts = [part for part in re.split(r"[,\s]+", line.strip()) if part]
    try:
        return [float(part.replace("d", "e").replace("D", "e")) for part in parts] or None
    except ValueError:
        return None


@dataclass
class ExportAudit:
    """Findings, and how many numbers of an export were audited."""

    findings: list
    numbers: int
    audited: int


def audit_export(folder, card, name, **options):
    """Return the audit of what `bubblefit export CARD --format NAME` left in a folder.

    options : those of the command that differ from the usual ones.
    """
    folder, settings = Path(folder), {"points": 121, "measure": "green", "density": None}
    settings |= {"compression": "law", "reach": 0.3, "given": options} | options
    settings.setdefault("form", "-14" if settings.get("for", "ls-dyna") == "ls-dyna" else "14")
    if settings.get("for") == "radioss":
        settings["measure"] = options.get("measure", "true")
    content = tomllib.loads(Path(card).read_text(encoding="utf-8"))
    law = Law.of_card(content)
    law.thickness_change = content.get("thickness_change", "constant")
    law.source, law.name = content.get("source", ""), content.get("name", "")
    law.certainty = content.get("certainty")
    for modulus, end in law.ends.items():
        if not end < 1e5:  # no range
            law.ends[modulus] = settings["reach"]
    law.unlimited = not content.get("valid_strain")
    files, others = [], []
    for path in sorted(folder.iterdir()):
        if path.name.endswith(".band.csv"):
            others.append(path)
        elif path.suffix in MARKS:
            files.append(ExportedFile(path.name, path.read_text(), MARKS[path.suffix]))
    audit = FORMATS[name]
    for file in files:
        if file.name.endswith((".f", ".c", ".law")):
            continue
        _heading(file, law, settings)
    audit({Path(file.name).suffix: file for file in files}, law, settings)
    findings = [finding for file in files for finding in file.findings]
    numbers = audited = 0
    for file in files:
        if file.name.endswith((".c",)) or (file.name.endswith(".f") and name == "abaqus-umat"):
            continue  # a program, the same for all cards
        for text in (file.heading, *(text for _, text in file.body)):
            missing = [span for span, how in text.claims.items() if how is None]
            own = [how for how in text.claims.values() if how != "wording"]
            numbers += len(own)
            audited += len(own) - len(missing)
            if missing:
                shown = ", ".join(text.text[max(a - 30, 0) : b + 15] for a, b in missing[:3])
                findings.append(Finding(f"{file.name}: {text.place}", f"nobody audits {shown!r}"))
        numbers += file.taken
        audited += file.taken
    for path in others:
        count = _band(path, law, findings)
        numbers, audited = numbers + count, audited + count
    if bool(others) != bool(law.certainty and law.certainty.get("band")):
        findings.append(Finding(str(folder), "band.csv does not go with the card's certainty"))
    return ExportAudit(findings, numbers, audited)


MARKS = {".csv": "#", ".txt": "#", ".dat": "$", ".f": "!", ".inp": "**", ".k": "$", ".rad": "#",
         ".c": "//", ".law": "#"}  # fmt: skip


def band_of(law, name, strain):
    """Return the ends (MPa) of the card's band, linear between its strains."""
    strains, low, high = law.certainty["band"][name]
    return [law.mpa * np.interp(strain, strains, own) for own in (low, high)]


def _band(path, law, findings):
    """Compare a .band.csv with the band of the card, at 41 strains."""
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    rows = list(csv.DictReader(io.StringIO("\n".join(lines))))
    count = 0
    for name in MODULI:
        own = [row for row in rows if row["modulus"] == name]
        strains = np.linspace(0, law.ends[name], 41)
        if len(own) != 41:
            findings.append(Finding(path.name, f"{name} has {len(own)} rows, not 41"))
            continue
        for row, strain in zip(own, strains, strict=True):
            low, high = band_of(law, name, strain)
            expected = [strain, float(law.modulus(name, strain)), low, high]
            keys = ("log_strain", "MPa", "lower_MPa", "upper_MPa")
            for key, value in zip(keys, expected, strict=True):
                count += 1
                if abs(float(row[key]) - value) > 2e-6 * abs(value) + 1e-12:
                    findings.append(
                        Finding(f"{path.name}: {name} at {strain:.4g}", f"{key} {row[key]}")
                    )
    return count


def _heading(file, law, settings):
    """Check what all headings have: card, units, thickness, band."""
    heading = file.heading
    for pattern in WORDING:
        for match in re.finditer(pattern, heading.text):
            heading.claim(match.span(), "wording")
    if f"card: {law.name}" not in heading.text:
        file.find("heading", f"does not name the card {law.name}")
    for words in (law.name, " ".join(law.source.split())):
        at = heading.text.find(words) if words else -1
        if at >= 0:
            heading.claim((at, at + len(words)), "echoed")
    file.words(rf"units: (?:mm, N, MPa|as beside each value); thickness {N} mm", [law.thickness], 6)
    if law.certainty and law.certainty.get("band"):
        at = heading.text.find(law.certainty["of"])
        if at < 0:
            file.find("heading", "does not say what the band is of")
        else:
            heading.claim((at, at + len(law.certainty["of"])), "echoed")
        file.words(rf"band of the moduli \({N} %", [95])
        for name in MODULI:
            end = law.ends[name]
            values = []
            for strain in (0.0, 0.5 * end, end):
                values += [*band_of(law, name, strain), 100 * strain]
            pattern = ", ".join(rf"{N} to {N} at {N} %" for _ in range(3))
            file.words(rf"{name}, MPa: {pattern}", values, [4, 4, 3] * 3)
    elif "band of the moduli: not known" not in heading.text:
        file.find("heading", "says nothing of a missing band")
    ends = rf"ends? at {N} % of log strain"
    file.words(ends, [100 * settings["reach"]], needed=False)
    file.words(rf"moduli are {N} of strain wide", [1e-6], needed=False)
    if settings["density"] is None:
        file.words(rf"the card has none, {N} t/mm3", [DENSITY], 6, needed=False)


def _coupling(file, law):
    """Stress lost without nu12, where both yarns have 5 % of log strain, or the least range."""
    strain = min(0.05, law.ends["E1"], law.ends["E2"])
    steps = np.linspace(0, strain, 2001)
    middle = 0.5 * (steps[1:] + steps[:-1])
    e1, e2 = law.modulus("E1", middle), law.modulus("E2", middle)
    share = 1 - law.nu12**2 * e2 / e1
    step = steps[1] - steps[0]
    both = [float(np.sum((e1 + law.nu12 * e2) / share) * step),
            float(np.sum((e2 + law.nu12 * e2) / share) * step)]  # fmt: skip
    lost = []
    for name, stress in zip(("E1", "E2"), both, strict=True):
        _, nominal = strip(law, name, strain)
        # Force over the reference area of the biaxial state: the other yarn is as long.
        power = 1.0 if law.thickness_change == "constant" else -1.0
        lost.append(100 * (1 - nominal / (stress * np.exp(power * strain))))
    words = rf"by {N} % along the warp and {N} % along the fill when both have {N} % of log"
    file.words(words, [*lost, 100 * strain], [2, 2, 3], needed=False)


def _along_yarns(file, law, kind):
    shears = np.linspace(0, law.ends["G12"], 200)
    if kind == "second":
        most = max(np.abs(trellis(law, g)[3][:2]).max() for g in shears)
        file.words(rf"\(2nd Piola-Kirchhoff, up to {N} MPa in the card\)", [most], needed=False)
    else:
        most = max(np.abs(trellis(law, g)[3][:2]).max() for g in shears)
        file.words(rf"in shear alone \(up to {N} MPa in the card\)", [most], needed=False)


def _strains(law, name, settings):
    """Return the strains of a table; None where the law has pieces, whose ends are points too."""
    single = law.form in ("constant", "linear", "quadratic", "cubic")
    return np.linspace(0, law.ends[name], settings["points"]) if single else None


def audit_csv(files, law, settings):
    file = files[".csv"]
    file.words(rf"at {N} log strains each", [settings["points"]], 6, needed=False)
    file.words(rf"nu12: {N}", [law.nu12], 6)
    header = file.body.pop(0)[1].text
    if header != "direction,log_strain,tangent_modulus_MPa,test_strain,test_stress_MPa":
        file.find("header", header)
    rows = list(csv.reader(text.text for _, text in file.body))
    for _, text in file.body:
        file.claim(text)
    for name in MODULI:
        own = np.array([row[1:] for row in rows if row[0] == DIRECTION[name]], dtype=float)
        strains = _strains(law, name, settings)
        file.compare(f"{DIRECTION[name]}: log_strain", own[:, 0],
                     own[:, 0] if strains is None else strains)  # fmt: skip
        file.compare(f"{DIRECTION[name]}: modulus", own[:, 1], law.modulus(name, own[:, 0]), 1e-5)
        test = curve(law, name, own[:, 0], "nominal")
        file.compare(f"{DIRECTION[name]}: test_strain", own[:, 2], test[:, 0])
        file.compare(f"{DIRECTION[name]}: test_stress", own[:, 3], test[:, 1], 1e-5)


def audit_marc(files, law, settings):
    file = files[".dat"]
    multipliers, tables = None, {}
    worst = 0.0
    while file.body and re.match(r"table\b", file.body[0][1].text):
        title = file.body.pop(0)[1].text.split()[1]
        (number, *_), (kind, count, *_) = file.numbers(1)[0], file.numbers(1)[0]
        points = np.array(file.numbers(int(count)))
        tables[int(number)] = (title, points)
        if kind != 73:
            file.find(f"table {title}", f"is of the variable {kind:g}")
        if len(points) != count or (np.diff(points[:, 0]) <= 0).any():
            file.find(f"table {title}", "has not so many rising points")
        strain = np.abs(points[:, 0]) if title == "g12" else points[:, 0]
        file.compare(f"table {title}", points[:, 1], law.modulus(title.upper(), strain), 1e-6)
        name = title.upper()
        inside = points[:, 0][(points[:, 0] >= 0) & (points[:, 0] <= law.ends[name] * (1 + 1e-9))]
        if abs(inside.max() - law.ends[name]) > 1e-9:
            file.find(f"table {title}", "does not end with the range")
        low, high = points[0, 0], points[-1, 0]
        if title == "g12" and not np.isclose(low, -high):
            file.find("table g12", "does not run to minus the end")
        dense = np.linspace(0, law.ends[name], 20001)
        exact = law.modulus(name, dense)
        if law.form in ("constant", "linear", "quadratic", "cubic"):
            error = np.abs(np.interp(dense, points[:, 0], points[:, 1]) / exact - 1).max()
            worst = max(worst, error)
    file.words(rf"between {N} points", [settings["points"]], 6, needed=False)
    if worst > 1e-9:
        file.words(rf"off by {N} % at most", [100 * worst], 2, needed=False)
    else:
        file.words(rf"off by {N} % at most", [None], needed=False)
    text = file.skip_to("^nlelast")
    if text is None:
        return
    file.body.pop(0)
    while file.body and not file.body[0][1].text.strip():
        file.body.pop(0)
    file.claim(file.body.pop(0)[1], "wording")
    multipliers = file.numbers(1)[0]
    file.compare("nlelast: multipliers", multipliers, [1.0, 1.0, law.nu12, 1.0])
    numbers = [int(n) for n in file.numbers(1)[0]]
    named = [tables.get(number, ("none",))[0] for number in numbers]
    if named != ["e1", "e2", "none", "g12"] or numbers[2] != 0:
        file.find("nlelast: tables", f"of E1, E2, nu12, G12 are {named}")


def pieces_of(law):
    """Return (pieces, 5) by modulus of a polynomial: its end, and coefficients (MPa)."""
    found = {}
    for name in MODULI:
        start = {"G12": 0, "E2": 4, "E1": 8}[name]
        found[name] = np.array([[law.ends[name], *(law.mpa * law.beta[start : start + 4])]])
    return found


def _check_pieces(file, place, counts, pieces, law):
    """Evaluate pieces and compare with the law, whatever its form."""
    at = 0
    if min(counts) < 1 or sum(counts) != len(pieces) or any(len(own) != 5 for own in pieces):
        file.find(place, f"are {len(pieces)} of five numbers; {counts} are named")
        return
    for name, count in zip(MODULI, counts, strict=True):
        own = np.array(pieces[at : at + int(count)])
        at += int(count)
        end = own[-1, 0]
        if not np.isclose(end, law.ends[name], rtol=1e-9) and not (law.unlimited and end > 1):
            file.find(f"{place}: {name}", f"ends at {own[-1, 0]:g}, not {law.ends[name]:g}")
        strains = np.linspace(0, law.ends[name], 401)
        which = np.minimum(np.searchsorted(own[:, 0], strains * (1 - 1e-12)), len(own) - 1)
        values = [np.polyval(own[k, 1:], e) for k, e in zip(which, strains, strict=True)]
        jump = law.form == "trilinear"
        expected = law.modulus(name, strains)
        wrong = np.abs(np.array(values) / expected - 1) > 1e-8
        if wrong.sum() > (2 if jump else 0):
            first = int(np.argmax(wrong))
            file.find(f"{place}: {name} at {strains[first]:.4g}",
                      f"{values[first]:.9g} MPa, not {expected[first]:.9g}")  # fmt: skip


def audit_calculix(files, law, settings):
    file, moduli = files[".inp"], files[".law"]
    file.skip_to(r"^\*USER MATERIAL, CONSTANTS=9")
    file.claim(file.body.pop(0)[1], "wording")
    values = [value for row in file.numbers() for value in row]
    power = 1.0 if law.thickness_change == "constant" else 0.0
    first = moduli.body.pop(0)[1]
    match = re.fullmatch(r"bubblefit law (\d+)", first.text)
    number = float(match[1]) if match else np.nan
    moduli.claim(first)
    (counts,) = moduli.numbers(1)
    expected = [law.nu12, power, float(law.modulus("E1", 0)), float(law.modulus("G12", 0)), 0.0,
                3.0, 0.0, number, sum(counts)]  # fmt: skip
    file.compare("constants", values[:7] + values[8:], expected[:7] + expected[8:])
    if values[7] != number:
        file.find("constants", f"name the law {values[7]:g}, the file is of {number:g}")
    _check_pieces(moduli, "pieces", counts, moduli.numbers(), law)
    file.skip_to(r"^\*DEPVAR")
    if file.numbers(1) or file.body.pop(0) is None or file.numbers(1) != [[6.0]]:
        file.find("DEPVAR", "is not 6")


def audit_umat(files, law, settings):
    file = files[".inp"]
    text = file.skip_to(r"^\*USER MATERIAL, CONSTANTS=\d+, UNSYMM")
    if text is None:
        return
    count = int(re.search(r"CONSTANTS=(\d+)", text.text)[1])
    file.claim(text)
    file.body.pop(0)
    values = [value for row in file.numbers() for value in row]
    if len(values) != count:
        file.find("constants", f"are {len(values)}, not {count}")
    file.compare("nu12", [values[0]], [law.nu12])
    pieces = np.array(values[4:]).reshape(-1, 5)
    _check_pieces(file, "pieces", values[1:4], pieces, law)
    poisson = "0.5" if law.thickness_change == "incompressible" else "0"
    if f"POISSON={poisson}\n" not in file.text and f"POISSON={poisson} " not in file.text:
        file.find("heading", f"POISSON is not {poisson}")
    file.words(rf"ORIENTATION=\.\.\., POISSON=\S+ {N}", [law.thickness], 6)


def audit_hypela2(files, law, settings):
    file = files[".f"]
    values = {}
    for _, text in file.body:
        file.claim(text, "wording")
        match = re.fullmatch(r"\s*k\((\d+)\) = (\S+)", text.text)
        if match:
            values[int(match[1])] = float(match[2].replace("d", "e"))
        match = re.fullmatch(r"\s*(across|power) = (\S+)", text.text)
        if match:
            values[match[1]] = float(match[2].replace("d", "e"))
    constants = [values[k] for k in sorted(key for key in values if isinstance(key, int))]
    file.compare("nu12", [constants[0]], [law.nu12])
    file.compare("across", [values["across"]], [float(law.modulus("G12", 0))])
    file.compare("power", [values["power"]], [1.0 if law.thickness_change == "constant" else 0.0])
    _check_pieces(file, "pieces", constants[1:4], np.array(constants[4:]).reshape(-1, 5), law)
    pulled = min(0.1, np.expm1(law.ends["E1"]))
    if law.thickness_change == "constant":
        words = rf"pulled along the warp by {N} mm in (\d+) equal increments, free to contract: "
        values = [pulled, 100.0, stress_of(law, "E1", np.log1p(pulled))]
        file.words(rf"{words}the stress at the end must be {N} MPa", values, [7, 3, 6])
    file.words(rf"Sheared by gamma12 = {N} in one increment: tau12 = {N} MPa",
               [0.01, stress_of(law, "G12", 0.01)], [2, 6])  # fmt: skip
    file.taken += len(constants)
    file.heading.claim((0, len(file.heading.text)), "wording")
    _heading(file, law, settings)


def audit_fabric(files, law, settings):
    file = files[".inp"]
    _coupling(file, law)
    _along_yarns(file, law, "nominal")
    file.words(rf"nu12 = {N}", [law.nu12], 6, needed=False)
    file.skip_to(r"^\*DENSITY")
    file.body.pop(0)
    file.compare("density", file.numbers(1)[0], [settings["density"] or DENSITY])
    for component, name in enumerate(MODULI, start=1):
        text = file.skip_to(r"^\*UNIAXIAL, COMPONENT=")
        if text is None:
            return
        named = {f"*UNIAXIAL, COMPONENT={component}"}
        if name == "G12":
            named.add("*UNIAXIAL, COMPONENT=SHEAR")
        if text.text.strip() not in named:
            file.find("uniaxial", f"{text.text} stands for {DIRECTION[name]}")
        file.claim(text, "wording")
        file.body.pop(0)
        file.claim(file.body.pop(0)[1], "wording")
        points = np.array(file.numbers())[:, ::-1]
        _curve_points(file, DIRECTION[name], points, law, name, "nominal", settings)


def _curve_points(file, place, points, law, name, measure, settings):
    """Compare points (n, 2) of strain and stress with the law; a pushed yarn has the first."""
    strains = _strains(law, name, settings)
    positive = points[points[:, 0] >= 0]
    if strains is not None:
        file.compare(f"{place}: curve", positive, curve(law, name, strains, measure), 1e-6, 1e-10)
    negative = points[points[:, 0] < 0]
    if name == "G12":
        if len(negative):
            mirrored = -curve(law, name, -np.array(sorted(_inverse(negative[:, 0], name, measure))),
                              measure)  # fmt: skip
            file.compare(f"{place}: negative", negative, mirrored, 1e-6, 1e-10)
        return
    if settings["compression"] == "law" or not len(negative):
        strains = _inverse(negative[:, 0], name, measure)
        if len(negative):
            file.compare(f"{place}: pushed", negative, curve(law, name, strains, measure), 1e-6)


def _inverse(strain, name, measure):
    """Return log strains of strains in a measure."""
    strain = np.asarray(strain)
    if name == "G12":
        sine = {"green": strain, "nominal": np.sin(strain)}.get(measure)
        return strain if sine is None else np.arctanh(sine)
    return {"green": 0.5 * np.log1p(2 * strain), "nominal": np.log1p(strain)}.get(measure, strain)


def audit_dyna(files, law, settings):
    file = files[".k"]
    _coupling(file, law)
    _along_yarns(file, law, "second")
    file.words(r"at (-10) % of log strain", ["-10"], needed=False)
    file.words(rf"a, b: .*?{N}", [None], needed=False)
    text = file.skip_to(r"^\*MAT_FABRIC_TITLE")
    if text is None:
        return
    file.claim(text, "wording")
    file.body.pop(0)
    file.claim(file.body.pop(0)[1], "echoed")
    cards = []
    while len(cards) < (7 if settings["form"] == "-14" else 6):
        cards.append(_fixed(file.body[0][1].text))
        file.claim(file.body.pop(0)[1])
    e1, e2 = (float(law.modulus(name, 0)) for name in ("E1", "E2"))
    first = {1: settings["density"] or DENSITY, 2: e1, 3: e2, 5: law.nu12 * e2 / e1, 6: law.nu12}
    _fields(file, "card 1", cards[0], first)
    compression = 0.0 if settings["compression"] == "law" else 1.0
    _fields(file, "card 2", cards[1], {0: float(law.modulus("G12", 0)), 3: compression})
    _fields(file, "card 3", cards[2], {5: float(settings["form"])})
    curves = {}
    while file.body:
        text = file.skip_to(r"^\*DEFINE_CURVE_TITLE") if any(
            "DEFINE_CURVE" in t.text for _, t in file.body) else None  # fmt: skip
        if text is None:
            break
        file.body.pop(0)
        file.claim(file.body.pop(0)[1], "echoed")
        (number, sidr, sfa, sfo, offa, offo, *_) = _fixed(file.body[0][1].text)
        file.claim(file.body.pop(0)[1])
        if (sidr, sfa, sfo, offa, offo) != (0.0, 1.0, 1.0, 0.0, 0.0):
            file.find(f"curve {number:g}", "is scaled or shifted")
        curves[int(number)] = np.array(file.numbers())
    for place, name in zip((0, 1, 2), MODULI, strict=True):
        points = curves.get(int(cards[5][place]))
        if points is None:
            file.find("card 6", f"names no curve of {DIRECTION[name]}")
            continue
        if settings.get("for") == "openradioss":
            points = _converted(points, name)
            settings = settings | {"measure": "nominal"}
        _curve_points(file, DIRECTION[name], points, law, name, settings["measure"], settings)
    if settings["form"] == "-14":
        strains = np.linspace(0, min(law.ends["E1"], law.ends["E2"]), settings["points"])
        expected = equal_strain(law, strains, settings["measure"])
        for place, name in zip((0, 1), ("E1", "E2"), strict=True):
            points = curves.get(int(cards[6][place]), np.empty((0, 2)))
            file.compare(f"{DIRECTION[name]} biaxial", points, expected[name], 1e-6, 1e-9)


def _converted(points, name):
    """Return points as OpenRadioss' converter of *MAT_FABRIC hands them to LAW58."""
    strain, stress = points.T
    if name == "G12":
        return np.stack([np.radians(57 * strain), stress], 1)
    return np.stack([np.log1p(strain), stress * (1 + strain)], 1)


def equal_strain(law, strains, measure):
    """Return (n, 2) by yarn while both have the same log strain: D11 + D12 and D22 + D12."""
    rows = {}
    for name in ("E1", "E2"):
        points = []
        for strain in strains:
            middle = (np.arange(2000) + 0.5) * strain / 2000
            e1, e2 = law.modulus("E1", middle), law.modulus("E2", middle)
            own = {"E1": e1, "E2": e2}[name]
            stress = float(np.mean((own + law.nu12 * e2) / (1 - law.nu12**2 * e2 / e1)) * strain)
            stretch = np.exp(strain)
            force = stress * (stretch if law.thickness_change == "constant" else 1 / stretch)
            points.append(
                {
                    "nominal": (stretch - 1, force),
                    "green": (0.5 * (stretch**2 - 1), force / stretch),
                    "true": (
                        strain,
                        stress if law.thickness_change == "constant" else stress / stretch**2,
                    ),
                }[measure]
            )
        rows[name] = np.array(points)
    return rows


def _fixed(line):
    """Return eight fields of ten columns as floats, NaN where empty."""
    fields = [line[k : k + 10].strip() for k in range(0, 80, 10)]
    return [float(field) if field else np.nan for field in fields]


def _fields(file, place, values, expected):
    for k, value in expected.items():
        if not np.isclose(values[k], value, rtol=1e-6, atol=1e-15):
            file.find(f"{place}, field {k + 1}", f"is {values[k]:g}, not {value:g}")


def audit_radioss(files, law, settings):
    file = files[".rad"]
    _coupling(file, law)
    rows, functions, number = [], {}, None
    for _, text in file.body:
        values = _floats(text.text)
        file.claim(text, "wording")
        if text.text.startswith("/"):
            number = text.text.split("/")[2] if text.text.startswith("/FUNCT/") else None
        elif values is not None and text.text != law.name:
            file.taken += len(values)
            (rows if number is None else functions.setdefault(number, [])).append(values)
    file.compare("density", rows[0], [settings["density"] or DENSITY])
    e1, e2, g = (float(law.modulus(name, 0)) for name in ("E1", "E2", "G12"))
    if "/MAT/LAW58/1" in file.text:
        flex, crimps, scales = rows[1][4], rows[4][2:4], rows[5:8]
        file.compare("moduli", rows[1][:4], [e1, 0, e2, 0])
        end = float(np.arcsin(np.tanh(law.ends["G12"])))
        locked = [g, g * (1 + np.tan(end) ** 2), np.degrees(end)]
        file.compare("shear", rows[2][:3], locked)
        if any(rows[2][3:]) or any(rows[3]) or rows[4][:2] != [1, 1] or len(rows) != 8:
            file.find("numbers without a meaning", f"are {rows[2][3:]}, {rows[3]}, {rows[4][:2]}")
        file.compare("FLEX", rows[4][4:], [flex] * 2)
    else:
        crimps, scales = rows[1][:2], rows[3:6]
        share = 2 * crimps[0] + crimps[0] ** 2
        flex = 1e-3
        file.compare("FLEX", rows[1][2:], flex * share * np.array([e1, e1, e2]))
        if any(rows[2]) or any(rows[6]) or len(rows) != 7:
            file.find("numbers without a meaning", f"are {rows[2]}, {rows[6]}")
    file.compare("scales", scales, [[k, 1.0] for k in (101, 102, 103)])
    file.compare("crimps", crimps, [1e-4] * 2)
    for key, name in zip(("101", "102", "103"), MODULI, strict=True):
        points = np.array(functions.get(key, np.empty((0, 2))))
        if name == "G12" and len(points):
            points = points * [np.pi / 180, 1]
        _curve_points(file, DIRECTION[name], points, law, name, "nominal", settings)
    file.words(rf"nu12 = {N}", [law.nu12], 6, needed=False)
    file.words(rf"are {N}; under", [crimps[0]], 3, needed=False)
    file.words(rf"with {N} of its modulus", [flex], 3, needed=False)


def audit_constants(files, law, settings):
    file = files[".csv"]
    lines = [text.text for _, text in file.body]
    for _, text in file.body:
        file.claim(text)
    rows = list(csv.DictReader(lines))
    chosen = [row for row in rows if row["chosen"] == "yes"]
    if len(chosen) != 1:
        file.find("chosen", f"{len(chosen)} rows are")
        return
    for k, row in enumerate(rows):
        e, f = float(row["E_warp_kN_per_m"]), float(row["E_fill_kN_per_m"])
        nu_w, nu_f = float(row["nu_warp"]), float(row["nu_fill"])
        share = 1 - nu_w * nu_f
        direct = [e / share, f / share, e * nu_w / share]
        keys = ("A_warp_kN_per_m", "A_fill_kN_per_m", "A_warp_fill_kN_per_m")
        file.compare(f"row {k + 1}: direct form", [float(row[key]) for key in keys], direct, 1e-5)
        if row["reciprocal"] == "yes":
            file.compare(f"row {k + 1}: reciprocity", [nu_w / f], [nu_f / e], 1e-5)
    _constants_words(file, rows, chosen[0], law, settings)
    _recompute_constants(file, rows, law, settings)


def _shear(law, settings):
    """Return the shear up to which G is averaged; a range that ends below 0.001 is none."""
    end = law.ends["G12"]
    return settings["given"].get("shear", end if end >= 1e-3 else 0.1)


def _constants_words(file, rows, chosen, law, settings):
    values = []
    for key in CONSTANTS:
        column = [float(row[key]) for row in rows]
        values += [min(column), max(column)]
    file.words(rf"over {N} choices of paths, squares and reciprocity: E warp {N} to {N}, "
               rf"E fill {N} to {N}, nu_warp {N} to {N}, nu_fill {N} to {N}",
               [float(len(rows)), *values], 4)  # fmt: skip
    shear = _shear(law, settings)
    mean = law.thickness * stress_of(law, "G12", shear) / shear
    for row in rows:
        file.compare("G", [float(row["G_kN_per_m"])], [mean], 1e-4)
    file.words(rf"G: mean tangent to a shear strain of {N} %", [100 * shear])
    moduli = law.thickness * law.modulus("G12", np.linspace(0, shear, 2001))
    ends = [moduli.min(), moduli.max()]
    file.words(rf"G from {N} to {N} kN/m along the shear", ends, 3, needed=False)
    highest = settings["given"].get("highest")
    file.words(rf"straight lines of load over strain from {N} to {N} kN/m",
               [settings["given"].get("lowest", 0.0), highest], 4)  # fmt: skip
    file.words(rf"of {N} paths of ratios 1:1, 2:1, 1:2, 1:0, 0:1", [float(chosen["paths"])])
    shares = ", ".join(rf"{w:g}:{f:g} {N} of {N} %" for w, f in RATIOS)
    file.words(rf"by ratio: {shares}; {N} % over all", [None] * 11, needed=False)
    file.words(r"\(nu12 of the card's law\)|nu_xy beside|one of both", [], needed=False)


def _recompute_constants(file, rows, law, settings):
    """Evaluate the law along the five ratios and find the constants of the chosen row."""
    match = re.search(rf"from {N} to {N} kN/m", file.heading.text)
    if match is None:
        return
    low, high = float(match[1]), settings["given"].get("highest") or float(match[2])
    paths = {ratio: biaxial_path(law, ratio, low, high) for ratio in RATIOS}
    for k, row in enumerate(rows):
        if row["minimise"] != "strain":
            continue
        wanted = list(RATIOS)
        if row["ratios"] != "all":
            wanted = [tuple(map(float, own.split(":"))) for own in row["ratios"].split()]
        unloaded, reciprocal = row["unloaded_yarns"] == "yes", row["reciprocal"] == "yes"
        found = constants_of(paths, wanted, unloaded, reciprocal)
        own = [float(row[key]) for key in CONSTANTS]
        file.compare(f"row {k + 1}: constants", own, found, 3e-3, 2e-5)


CONSTANTS = ("E_warp_kN_per_m", "E_fill_kN_per_m", "nu_warp", "nu_fill")
RATIOS = ((1.0, 1.0), (2.0, 1.0), (1.0, 2.0), (1.0, 0.0), (0.0, 1.0))


def biaxial_path(law, ratio, low, high, steps=400):
    """Return (n, 4): loads (kN/m of initial width) and strains (changes of length) of a path.

    The tangent law along proportional loads, by the midpoint rule.
    """
    direction = np.array(ratio) / max(ratio)

    def rate(strain, stress):
        e1, e2 = float(law.modulus("E1", strain[0])), float(law.modulus("E2", strain[1]))
        share = 1 - law.nu12**2 * e2 / e1
        tangent = np.array([[e1, law.nu12 * e2], [law.nu12 * e2, e2]]) / share
        # n = stress t exp(strain of the other yarn), over the area ratio where it is incompressible
        power = 0.0 if law.thickness_change == "constant" else 1.0
        width = np.exp(strain[::-1] - power * strain.sum())
        turned = np.diag(stress)[:, ::-1] - power * stress[:, None]
        loads = law.thickness * width[:, None] * (tangent + turned)
        change = np.linalg.solve(loads, direction)
        return change, tangent @ change

    loads = np.linspace(0, high, steps + 1)
    strain, stress, rows = np.zeros(2), np.zeros(2), [np.zeros(2)]
    for step in np.diff(loads):
        change, grown = rate(strain, stress)
        change, grown = rate(strain + 0.5 * step * change, stress + 0.5 * step * grown)
        strain, stress = strain + step * change, stress + step * grown
        rows.append(strain)
    at = np.linspace(low, high, 101)
    along = np.array([np.interp(at, loads, own) for own in np.array(rows).T])
    return np.column_stack([at[:, None] * direction, np.expm1(along.T)])


def constants_of(paths, ratios, unloaded, reciprocal):
    """Return E_warp, E_fill (kN/m), nu_warp, nu_fill of least squares of strains.

    Each path is replaced by its regression line over the larger load, at ten points.
    """
    terms, strains = [], []
    for ratio in ratios:
        path = paths[ratio]
        larger = path[:, :2].max(axis=1)
        for yarn in (0, 1):
            if ratio[yarn] == 0 and not unloaded:
                continue
            slope = np.polyfit(larger, path[:, 2 + yarn], 1)[0]
            for load in np.linspace(larger[0], larger[-1], 10) - larger[0]:
                own, other = load * np.array(ratio)[[yarn, 1 - yarn]] / max(ratio)
                row = np.zeros(4)
                row[yarn], row[2 + yarn] = own, other
                terms.append(row)
                strains.append(slope * load)
    terms = np.array(terms)
    if reciprocal:
        terms = np.column_stack([terms[:, :2], terms[:, 2] + terms[:, 3]])
    solved = np.linalg.lstsq(terms, np.array(strains), rcond=None)[0]
    # eps_w = n_w / E_w - nu_w n_f / E_f, and so along the fill
    e, f = 1 / solved[0], 1 / solved[1]
    cross = [solved[2], solved[-1]]
    return [e, f, -cross[0] * f, -cross[1] * e]


def audit_design(files, law, settings, thickness_of=None):
    """Values of GSA or RFEM, against each other and the chosen constants beside them."""
    file = files[".txt"]
    values = {}
    for _, text in file.body:
        match = re.match(r"(.*?)\s{2,}(\S+|not given)  (\S.*)", text.text)
        if match:
            values[match[1]] = (match[2], match[3])
        file.claim(text)
    constants = chosen_constants(law, settings, file)
    per = 1.0 if "Warp modulus" in values else law.thickness
    unit = "kN/m" if per == 1.0 else "N/mm^2"
    named = {"Warp modulus": 0, "E_x (warp)": 0, "Weft modulus": 1, "E_y (fill)": 1,
             "nu_xy (fill contracts)": 3, "nu_yx (warp contracts)": 2,
             "Poisson's ratio (warp-weft)": 3}  # fmt: skip
    for name, place in named.items():
        if name in values:
            expected = constants[place] / (per if place < 2 else 1.0)
            file.compare(name, [float(values[name][0])], [expected], 3e-3)
            if values[name][1] != (unit if place < 2 else "no unit"):
                file.find(name, f"has the unit {values[name][1]}")
    shear = _shear(law, settings)
    for name in ("Shear modulus", "G_xy"):
        if name in values:
            mean = law.thickness * stress_of(law, "G12", shear) / shear / per
            file.compare(name, [float(values[name][0])], [mean], 1e-4)
    if "thickness d of the surface" in values:
        file.compare("thickness", [float(values["thickness d of the surface"][0])], [law.thickness])
    for yarn in ("warp", "fill"):
        for words, key in (("prestress, {}", "prestress_{}"),
                           ("compensation (strain kept), {}", "kept_{}")):  # fmt: skip
            given = settings["given"].get(key.format(yarn))
            shown = values.get(words.format(yarn), (None,))[0]
            if (given is None and shown != "not given") or (
                given is not None and not np.isclose(float(shown), given)
            ):
                file.find(words.format(yarn), f"is {shown}; {given} was given")
    _design_words(file, law, settings)


def _design_words(file, law, settings):
    """Check the heading as that of constants; choices of evaluation stand in its table only."""
    shear = _shear(law, settings)
    moduli = law.thickness * law.modulus("G12", np.linspace(0, shear, 2001))
    file.words(rf"G: mean tangent to a shear strain of {N} %", [100 * shear])
    ends = [moduli.min(), moduli.max()]
    file.words(rf"G from {N} to {N} kN/m along the shear", ends, 3, needed=False)
    values = [settings["given"].get("lowest", 0.0), settings["given"].get("highest")]
    file.words(rf"straight lines of load over strain from {N} to {N} kN/m", values, 4)
    shares = ", ".join(rf"{w:g}:{f:g} {N} of {N} %" for w, f in RATIOS)
    file.words(rf"by ratio: {shares}; {N} % over all", [None] * 11, needed=False)
    paths = [float(settings["given"].get("paths", 8))]
    file.words(rf"of {N} paths of ratios 1:1, 2:1, 1:2, 1:0, 0:1", paths)
    spans = ", ".join(rf"{name} {N} to {N}" for name in ("E warp", "E fill", "nu_warp", "nu_fill"))
    file.words(rf"over {N} choices of paths, squares and reciprocity: {spans}", [None] * 9)


def chosen_constants(law, settings, file):
    match = re.search(rf"from {N} to {N} kN/m", file.heading.text)
    low, high = float(match[1]), settings["given"].get("highest") or float(match[2])
    paths = {ratio: biaxial_path(law, ratio, low, high) for ratio in RATIOS}
    unloaded = str(settings["given"].get("paths", "8")) == "10"
    return constants_of(paths, list(RATIOS), unloaded, True)


FORMATS = {
    "csv": audit_csv,
    "marc": audit_marc,
    "marc-hypela2": audit_hypela2,
    "calculix": audit_calculix,
    "abaqus-umat": audit_umat,
    "abaqus-fabric": audit_fabric,
    "ls-dyna-mat34": audit_dyna,
    "radioss-law58": audit_radioss,
    "radioss-law158": audit_radioss,
    "constants": audit_constants,
    "gsa": audit_design,
    "rfem": audit_design,
}


def audit_words(said, folder):
    """Compare what the command printed as JSON with the headings of the files."""
    findings, content = [], json.loads(said)
    listed = {Path(name).name for name in content["files"]}
    there = {path.name for path in Path(folder).iterdir() if path.suffix in MARKS}
    if listed != {name for name in there if not name.endswith(".band.csv")} | (listed & there):
        findings.append(Finding("files", f"{sorted(listed)} are listed, {sorted(there)} are there"))
    texts = [path.read_text() for path in Path(folder).iterdir() if path.suffix in MARKS]
    plain = [re.sub(r"[\s$*!#]+", "", text) for text in texts]
    for key in ("carries", "loses", "confirm"):
        for words in content[key]:
            if not any(re.sub(r"[\s$*!#]+", "", words) in text for text in plain):
                findings.append(Finding(key, f"no heading says: {words}"))
    return findings
