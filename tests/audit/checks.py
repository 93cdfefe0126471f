"""Auditor of `bubblefit check`: data as read, equilibrium of the apex, the estimate."""

import re

import numpy as np

from . import measured
from .bubbles import PRESSURE
from .common import percent
from .fields import apex, axes_of, centre_of, frames_of
from .ledger import NUM

FRAMES_HEADER = ["pressure, kPa", "file", "points", "dropped", "rise about the centre, mm"]


def audit_check(folder, ledger):
    """Audit check.json and the page of a check."""
    check = folder.check
    for test, doubts in check["tests"].items():
        for k, _ in enumerate(doubts):
            ledger.claim_json(("tests", test, k), "consistent", file="check.json")
    ledger.claim_json("choices", "consistent", file="check.json")
    ledger.claim_json("joined", "consistent", file="check.json")
    _doubts(ledger, check)
    if check.get("estimate"):
        _estimate(folder, ledger, check["estimate"])
    for test, curve in check.get("closed_form", {}).items():
        _closed_form(ledger, test, curve)
    sections = {
        kind: own for kind in ("bubble", "strips") for own in folder.project.get(kind, [])[:1]
    }
    if "bubble" in sections and len(folder.project["bubble"]) == 1:
        Bubble(folder, ledger, sections["bubble"]).audit()
    _strips(folder, ledger)


def _doubts(ledger, check):
    """Every doubt stands on the page, with its name and its test."""
    page = ledger.folder.page
    rows = [row for table in page.tables if table.title == "Doubts" for row in table.rows]
    words = " ".join(" ".join(row) for row in rows)
    for doubts in check["tests"].values():
        for doubt in doubts:
            text = doubt.get("text", doubt.get("note", "")) if isinstance(doubt, dict) else doubt
            if text and " ".join(text.split()) not in words:
                ledger.find("page: Doubts", f"is without {text[:60]!r}")
    # What was seen stands alike in check.json, on the page and on the terminal.
    for row in rows:
        for text in ledger.texts:
            at = text.text.find(row[-1])
            if len(row[-1]) > 10 and at >= 0:
                text.claim((at, at + len(row[-1])), "consistent")
    # The page also has shapes that no law keeps in equilibrium, which the estimate sees.
    unbalanced = [row for row in rows if row[-1].startswith("no law within the bounds keeps")]
    chi = (check.get("estimate") or {}).get("chi", {})
    for row in unbalanced:
        if f"(chi {chi.get(row[0], np.nan):.3g})" not in row[-1]:
            ledger.find("page: Doubts", f"{row[-1][:80]!r}; check.json has {chi}")
    count = sum(len(own) for own in check["tests"].values()) + len(unbalanced)
    _share_of_outliers(ledger)
    ledger.text(r"carry (\d+) doubts?", [count], needed=False)
    bad = [d for own in check["tests"].values() for d in own if _is_error(d)]
    if check["sound"] != (not bad):
        ledger.find("check.json: sound", f"is {check['sound']} with {len(bad)} errors")


def _share_of_outliers(ledger):
    """Outliers are so many percent of the points beside which they are counted."""

    def share(match):
        bad, judged = int(match[1]), int(match[2])
        if not 0 < bad <= judged:
            ledger.find("outliers", f"{match[0]!r}")
        return [match[1], match[2], None, f"{100 * bad / judged:.1f}"]

    ledger.text(rf"(\d+) of (\d+) points at {NUM} kPa \({NUM}\s?%\)", share, needed=False)


def _is_error(doubt):
    return doubt["severity"] == "error" and not doubt["trusted"]


def _estimate(folder, ledger, estimate):
    """Moduli of the estimate: within their bands, and alike on the page."""
    for line in findings_of_estimate(estimate, folder.project["fabric"]["thickness"]):
        ledger.find("check.json", line)
    rows = []
    for name, row in _rows_of(estimate):
        low, high = row["band"]
        marks = [r"\*" * bool(row[key]) for key in ("on_bound", "at_lower_bound", "at_upper_bound")]
        rows.append([
            name, 100 * row["strain"], (rf"(\S+?){marks[0]}", row["MPa"]),
            percent(row["sigma"]) if row["determined"] else "unknown",
            (rf"(\S+?){marks[1]} to (\S+?){marks[2]}", low, high),
        ])  # fmt: skip
    ledger.claim_json(("estimate", "moduli"), "consistent", file="check.json")
    header = ["modulus", "strain, %", "MPa", "1 sigma", "95 % band, MPa"]
    ledger.table("Estimated moduli", header, rows)
    rows = []
    for test, chi in estimate["chi"].items():
        ledger.json(("estimate", "chi", test), chi, "consistent", file="check.json")

        def beside(match, chi=chi):
            return [match[1], f"{chi:.3g}"]

        ledger.text(rf"off equilibrium, chi {NUM}", [f"{chi:.3g}"], needed=False)
        ledger.text(rf"up to {NUM} mm off equilibrium", lambda m: [m[1]], needed=False)
        rows.append([test, chi, None])
        del beside
    ledger.table("Distance from equilibrium", ["test", "chi", ""], rows)


def _closed_form(ledger, test, curve):
    """Stress rises with strain by a power, of which modulus over secant is one constant."""
    strain, stress, modulus = (
        np.array(curve[name]) for name in ("strain", "stress_MPa", "modulus_MPa")
    )
    power = modulus * strain / stress
    if (np.diff(strain) <= 0).any() or np.ptp(power) > 1e-9 * power[0]:
        ledger.find(f"check.json: closed_form.{test}", "stress is no power of a rising strain")
    ledger.claim_json(("closed_form", test), "consistent", file="check.json")
    places = dict.fromkeys((0, len(strain) // 2, len(strain) - 1))
    pattern = ", ".join(rf"{NUM} at {NUM} %" for _ in places)
    values = [part for k in places for part in (f"{modulus[k]:.3g}", f"{100 * strain[k]:.2g}")]
    ledger.text(rf"closed form, E1 = E2, MPa: {pattern}", values)


def _rows_of(estimate):
    return [(name, row) for name, moduli in estimate["moduli"].items() for row in moduli]


def findings_of_estimate(estimate, thickness):
    """Return what is wrong with the moduli of an estimate, of check.json or of `--json`.

    thickness : mm, by which MPa make kN/m.
    """
    found = []
    for name, moduli in estimate["moduli"].items():
        strains = [row["strain"] for row in moduli]
        if strains != sorted(strains):
            found.append(f"estimate.{name}: strains do not rise")
    for name, row in _rows_of(estimate):
        low, high = row["band"]
        value, sigma, half = row["MPa"], row["sigma"], (high - low) / 2 / row["MPa"]
        place = f"estimate.{name} at {row['strain']:.3g}"
        if not low <= value <= high:
            found.append(f"{place}: {value:.4g} lies outside {low:.4g} to {high:.4g}")
        # Of a narrow band both sides are two standard deviations.
        if half < 0.05 and not 0.6 < half / (1.96 * sigma) < 1.6:
            found.append(f"{place}: sigma {sigma:.3g} beside a half band of {half:.3g}")
        if not np.isclose(row["kN_per_m"], value * thickness, rtol=1e-9):
            found.append(f"{place}: kN_per_m is not MPa times {thickness} mm")
        both = row["at_lower_bound"] and row["at_upper_bound"]
        if row["determined"] != (sigma < 1.0 and not both):
            found.append(f"{place}: determined is {row['determined']} with sigma {sigma:.3g}")
    return found


class Bubble:
    """The tables of one bubble, from its files."""

    def __init__(self, folder, ledger, section):
        self.folder, self.ledger, self.section = folder, ledger, section
        scale = {"mm": 1.0, "m": 1000.0}[folder.project.get("units", {}).get("length", "mm")]
        self.radius = scale * section["radius"]
        self.frames = self._frames()

    def _frames(self):
        """Return name, kPa, places, displacements, heights of each file; None if not plain."""
        frames = frames_of(self.folder, self.section)
        if frames is None:
            return None
        unit = self.folder.project.get("units", {}).get("pressure", "kPa")
        pressures = [pressure * PRESSURE[unit] for pressure in self.section["pressures"]]
        return [(name, p, *own) for (name, *own), p in zip(frames, pressures, strict=False)]

    def audit(self):
        registered = any(t.title == "Registration" for t in self.folder.page.tables)
        if self.frames is None or (registered and not self._registered()):
            self._as_printed()
            return
        rows = []
        for name, pressure, places, moved, _ in self.frames:
            near = np.hypot(*places.T) < 0.25 * self.radius
            rise = float(np.median(moved[near if near.any() else slice(None), 2]))
            rows.append([pressure, name, len(places), "none", rise])
        self.ledger.table("Frames", FRAMES_HEADER, rows, "recomputed", slack=1e-6)
        self._apexes()
        self._centre()

    def _registered(self):
        """Turn the frames by the registration of the page, and check what was found of it.

        Only of a plane that is hardly tilted: origin and warp are enough to turn by.
        """
        table = self.folder.page.table("Registration")
        cells = {row[0]: row[1:] for row in table.rows}
        tilt = float(re.search(NUM, cells["plane of the rim"][0])[1])
        origin = [float(own) for own in cells["centre of the rim, mm"][0].split(", ")]
        warp, how = cells["warp, degrees from the camera's x"]
        if tilt > 1.0 or any("beyond" in own for own in cells["plane of the rim"]):
            return False
        c, s = np.cos(np.radians(float(warp))), np.sin(np.radians(float(warp)))
        turn = np.array([[c, s], [-s, c]])
        self.frames = [
            (name, pressure, (places - origin[:2]) @ turn.T,
             np.column_stack([moved[:, :2] @ turn.T, moved[:, 2]]), heights - origin[2])
            for name, pressure, places, moved, heights in self.frames
        ]  # fmt: skip
        centre, error = centre_of(self.frames, self.radius)
        told = re.search(rf"found where the sheet does not rise, \+- {NUM}", table.rows[1][2])
        title = "page: Registration"
        if told:
            ratio = float(told[1]) / error
            if np.hypot(*centre) > 3 * error + 0.02 or not 0.8 < ratio < 1.25:
                self.ledger.find(title, f"centre {told[0]}; {centre} +- {error:.2g} is left")
        angle = axes_of(self.frames[-1])
        clear = re.search(rf"\((\d+)\s?% clear\), \+- {NUM}; the (stiffer|softer)", how)
        if clear and int(clear[1]) > 50:
            off = (angle + 45) % 90 - 45
            if abs(off) > 3 * float(clear[2]) + 3 or float(clear[2]) > 5:
                self.ledger.find(title, f"axes are {off:.2f} degrees off the warp, {how}")
            _, _, strain, _ = apex(*self.frames[-1][2:], self.radius)
            if len(self.frames) > 1:
                # What the pressure added; a sheet may be strained before.
                strain = np.subtract(strain, apex(*self.frames[0][2:], self.radius)[2])
            if (strain[0] > strain[1]) == (clear[3] == "stiffer"):
                self.ledger.find(title, f"warp strained by {strain[0]:.3g}, fill {strain[1]:.3g}")
        rises = [own[3][:, 2].max() for own in self.frames]
        if rises != sorted(rises):
            self.ledger.find(title, "the rise does not grow with the pressure")
        self.ledger.table("Registration", None, table.rows, "recomputed")
        return True

    def _as_printed(self):
        """Of other files: rows by rising pressure, and what a row says of itself."""
        ledger = self.ledger
        for table in ledger.folder.page.tables:
            if table.title == "Frames":
                rises = [float(value) for value in table.column("rise about the centre, mm")]
                if rises != sorted(rises):
                    ledger.find("page: Frames", "the rise does not grow with the pressure")
                ledger.table("Frames", FRAMES_HEADER, table.rows)
            elif table.title.startswith(("Registration", "Equilibrium", "Frames taken")):
                ledger.table(table.title, None, table.rows)
        for label in ("the sheet rises about, mm", "axes of symmetry, degrees from x and y"):
            if any(own == label for *_, own, _ in ledger.folder.page.facts):
                ledger.fact(label, ledger.folder.page.fact(label))

    def _apexes(self):
        """Force, curvature and strain at the apex, from a polynomial about the centre."""
        title = "Equilibrium of the apex, without a model"
        header = ["pressure, kPa", "apex, mm", "k1 + k2, 1/m", "force, kN/m", "+-", "stress, MPa",
                  "strain along warp, %", "along fill, %"]  # fmt: skip
        tables = [t for t in self.folder.page.tables if t.title == title]
        if not tables:
            return
        thickness = self.folder.project["fabric"]["thickness"]
        rows = []
        for row, (_, pressure, places, moved, heights) in zip(
            tables[0].rows, self.frames, strict=True
        ):
            told = [float(cell) for cell in row]
            height, curvature, strain, scatter = apex(places, moved, heights, self.radius)
            force = pressure / 1000 / told[2] * 1000  # N/mm, of kPa and 1/m
            for name, own, right, limit in (
                ("apex", told[1], height, 0.01), ("k1 + k2", told[2], 1000 * curvature, 0.05),
                ("strain along warp", told[6], 100 * strain[0], 0.06),
                ("along fill", told[7], 100 * strain[1], 0.06),
            ):  # fmt: skip
                if abs(own - right) > limit * abs(right) + 0.02:
                    self.ledger.find(
                        f"page: {title}, {row[0]} kPa", f"{name} is {own}; {right:.4g}"
                    )
            # By the scatter of the points about the shape, of whichever degree.
            ratio = told[4] / (told[3] * scatter / curvature)
            if not 0.9 < ratio < 1.1:
                self.ledger.find(f"page: {title}, {row[0]} kPa", f"+- {told[4]}: {ratio:.2g} times")
            rows.append([pressure, row[1], row[2], force, row[4], told[3] / thickness, *row[6:]])
        self.ledger.table(title, header, rows, "recomputed", slack=1e-3)

    def _centre(self):
        """The centre about which the sheet rises, with its standard error, and its axes."""
        label = "the sheet rises about, mm"
        text = self.folder.page.fact(label)
        match = re.fullmatch(rf"{NUM}, {NUM} \(\+- {NUM}\)", text)
        if match:
            centre, error = centre_of(self.frames, self.radius)
            told = [float(own) for own in match.groups()]
            off = np.hypot(told[0] - centre[0], told[1] - centre[1])
            if off > 3 * max(error, told[2]) + 0.02 or not 0.8 < (told[2] + 1e-9) / error < 1.25:
                self.ledger.find(f"page: {label}", f"is {text}; {centre} +- {error:.2g}")
        if text:
            self.ledger.fact(label, text, "recomputed")
        label = "axes of symmetry, degrees from x and y"
        text = self.folder.page.fact(label)
        if text:
            match = re.match(rf"{NUM} \(\+- {NUM}, (\d+)\s?% clear\)", text)
            angle = axes_of(self.frames[-1])
            if match and int(match[3]) > 50:
                off = (float(match[1]) - angle + 45) % 90 - 45
                if abs(off) > 3 * float(match[2]) + 3:
                    self.ledger.find(f"page: {label}", f"is {text}; {angle:.1f}")
            self.ledger.fact(label, text)


def _strips(folder, ledger):
    """Load curves as read, and the table after EN ISO 1421."""
    sections = folder.project.get("strips", [])
    if len(sections) != 1 or folder.page is None:
        return
    titles = [table.title for table in folder.page.tables]
    section = sections[0]
    if "Load curves as read" not in titles:
        return
    data = section.get("data", {})
    files = data.get("files", [])
    files = [f for own in files.values() for f in own] if isinstance(files, dict) else files
    where = folder.project_path.parent
    record = {"data": [{"test": "strips", "name": f, "file": str(where / f)} for f in files]}
    folder.provenance = folder.provenance or record
    curves = measured.load_curves(folder, "strips", section)
    rows, gauges = [], {}
    table = folder.page.table("Load curves as read")
    if curves is None:
        ledger.table("Load curves as read", None, table.rows)
        return
    for direction, own in curves.items():
        gauge = section.get(direction, {}).get("gauge_length")
        for name, along, load in own:
            end = 100 * float(np.log1p(along[-1] / gauge)) if gauge else None
            rows.append([direction, str(name if name is not None else direction), len(load),
                         float(along[0]), float(along[-1]), end, float(load[0]),
                         float(load.max())])  # fmt: skip
        gauges[direction] = gauge
    header = ["direction", "specimen", "points", "first elongation, mm", "last, mm",
              "last log strain, %", "first load, N", "largest load, N"]  # fmt: skip
    ledger.table("Load curves as read", header, rows, "recomputed")


COMMANDS = {"check": audit_check}
