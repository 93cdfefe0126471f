"""Auditor of strip tests within a fit."""

import re

import numpy as np

from . import measured
from .ledger import NUM

DIRECTIONS = ("warp", "fill", "bias")
#: Forces of the table after EN ISO 1421 are for a width of 50 mm.
PER_WIDTH = 50.0


def objective(audit, test, section):
    """Return the mean relative error of a test among several, or its sum of RMS errors."""
    weights = {**dict.fromkeys(DIRECTIONS, 1.0), **section.get("weights", {})}
    total, share = 0.0, 0.0
    for name, rows in audit.blocks.items():
        own, _, direction = name.partition(": ")
        if own != test:
            continue
        rms = float(np.sqrt(np.mean(rows["difference"] ** 2)))
        largest = float(rows["measured"].abs().max())
        relative = audit.several or _setting(audit, section, "objective", "N") == "relative"
        total += weights[direction] * (rms / largest if relative else rms)
        share += weights[direction]
    return total / share if audit.several else total


def _setting(audit, section, key, usual):
    defaults = audit.folder.project.get("defaults", {}).get("strips", {})
    return section.get(key, defaults.get(key, usual))


#: Independent places along one curve; specimens behind a polynomial, as ISO 1421 asks for.
PLACES, SPECIMENS = 1.25, 5


def alike(audit, test, section, direction, count):
    """Return how many loads of a direction vary together; None where specimens tell it."""
    curves = measured.load_curves(audit.folder, test, section)
    if measured.polynomials(audit.folder, test, section) is not None:
        return max(1.0, count / (PLACES * (SPECIMENS - 1)))
    if curves is None or len(curves.get(direction, [])) != 1:
        return None
    return max(1.0, count / PLACES)


def audit(audit, test, section, numbers):
    """Audit numbers, tables and files of one test of strips."""
    prefix = f"{test}-" if audit.several else ""
    Strips(audit, test, section, numbers, prefix).audit()


class Strips:
    def __init__(self, audit, test, section, numbers, prefix):
        self.audit_of, self.test, self.section, self.numbers = audit, test, section, numbers
        self.prefix, self.ledger, self.folder = prefix, audit.ledger, audit.folder
        self.curves = measured.load_curves(self.folder, test, section)
        self.published = measured.polynomials(self.folder, test, section)
        self.path = ("tests", test)
        scale = measured.LENGTH[self.folder.project.get("units", {}).get("length", "mm")]
        self.width = scale * _setting(audit, section, "width", 25.0 / scale)
        self.increments = _setting(audit, section, "increments", 100)
        self.match = _setting(audit, section, "match", "polynomial")
        self.scale = scale

    def audit(self):
        self.lines = {}
        for direction, own in self.numbers["directions"].items():
            self._direction(direction, own)
        ledger = self.ledger
        total = sum(own["rms_N"] for own in self.numbers["directions"].values())
        ledger.json((*self.path, "e_uniaxial_N"), total, "recomputed", rel=1e-9)
        ledger.json((*self.path, "matched_by"), self.match)
        self._loads()
        self._standard()
        self._words()

    def _direction(self, direction, own):
        """RMS, lengths, scatter and counts of one direction."""
        ledger, path = self.ledger, (*self.path, "directions", direction)
        rows = self.audit_of.blocks[f"{self.test}: {direction}"]
        rms = float(np.sqrt(np.mean(rows["difference"] ** 2)))
        ledger.json((*path, "rms_N"), rms, rel=1e-6)
        ledger.json((*path, "matched"), len(rows))
        weights = {**dict.fromkeys(DIRECTIONS, 1.0), **self.section.get("weights", {})}
        ledger.json((*path, "weight"), weights[direction], "echoed")
        if set(rows["quantity"]) != {"load"} or set(rows["unit"]) != {"N"}:
            ledger.find(f"residuals.csv: {self.test}, {direction}", "is not of loads in N")
        gauge, final = self._lengths(direction, own)
        ledger.json((*path, "gauge_length_mm"), gauge, "echoed", rel=1e-9)
        ledger.json((*path, "final_length_mm"), final, "echoed", rel=1e-9)
        self._measured(direction, rows, gauge, final, path)
        self._end(direction, own, path)

    def _lengths(self, direction, own):
        if self.published is not None:
            return self.published[direction][:2]
        section = self.section.get(direction, {})
        lengths = [own["gauge_length_mm"], own["final_length_mm"]]
        for k, key in enumerate(("gauge_length", "final_length")):
            if key in section:
                lengths[k] = self.scale * section[key]
        if "final_length" not in section and self.curves and direction in self.curves:
            longest = max(along.max() for _, along, _ in self.curves[direction])
            lengths[1] = lengths[0] + longest
        return lengths

    def _measured(self, direction, rows, gauge, final, path):
        """The rows are the points up to the final length, or the polynomial at the increments."""
        ledger, file = self.ledger, "residuals.csv"
        mask = rows.index.to_numpy()
        line = scatter = None
        if self.published is not None:
            powers = self.published[direction][2]
            line = np.polynomial.Polynomial(powers)
            scatter = self.published[direction][3]
        elif self.curves is not None and direction in self.curves:
            along = np.concatenate([c[1] for c in self.curves[direction]])
            load = np.concatenate([c[2] for c in self.curves[direction]])
            inside = (along >= 0) & (along <= (final - gauge) * (1 + 1e-9))
            line = self._fitted(along, load)
            scatter = float((load - line(along)).std(ddof=1))
            along, load = along[inside], load[inside]
            self._left_out(direction, int((~inside).sum()))
        self.lines[direction] = line
        if scatter is not None and np.isfinite(scatter):
            ledger.json((*path, "scatter_N"), float(scatter), rel=1e-6)
        else:
            ledger.claim_json((*path, "scatter_N"), "consistent")
        if self.match == "points":
            if self.curves is None or direction not in self.curves:
                ledger.claim_column(file, "measured", "consistent", rows=mask)
                ledger.claim_column(file, "elongation_mm", "consistent", rows=mask)
                return
            order = np.lexsort((load, along))
            seen = np.lexsort((rows["measured"], rows["elongation_mm"]))
            ledger.column(file, "elongation_mm", along[order], rel=1e-8, abs=1e-9, rows=mask[seen])
            ledger.column(file, "measured", load[order], rel=1e-8, abs=1e-7, rows=mask[seen])
            return
        along = (final - gauge) * np.arange(1, self.increments + 1) / self.increments
        ledger.column(file, "elongation_mm", along, rel=1e-8, rows=mask)
        if line is None:
            ledger.claim_column(file, "measured", "consistent", rows=mask)
        else:
            ledger.column(file, "measured", line(along), rel=1e-7, abs=1e-6, rows=mask)

    def _left_out(self, direction, count):
        """The note on points beyond the final length."""
        of = f"{self.test}, {direction}" if self.audit_of.several else direction
        words = "points beyond the final length (or before zero) were left out"
        notes = [
            note["note"] for note in self.audit_of.result["notes"]
            if note["of"] == of and note["kind"] == "points left out"
        ]  # fmt: skip
        expected = [f"{count} {words}"] if count and self.match == "points" else []
        if notes != expected:
            self.ledger.find(f"notes: {of}", f"are {notes}; expected {expected}")
        self.ledger.text(rf"^(?:{of}: )?(\d+) points beyond the final", lambda m: [m[1]],
                         needed=False)  # fmt: skip

    def _fitted(self, along, load):
        """Return the load polynomial of all points: least squares, through the origin."""
        data = self.section.get("data", {})
        order, lowest = data.get("order", 4), int(data.get("through_origin", True))
        powers = np.vander(along / along.max(), order + 1, increasing=True)[:, lowest:]
        solution = np.linalg.lstsq(powers, load, rcond=None)[0]
        coefficients = np.zeros(order + 1)
        coefficients[lowest:] = solution / along.max() ** np.arange(lowest, order + 1)
        return np.polynomial.Polynomial(coefficients)

    def _end(self, direction, own, path):
        """The load at the end: the last of loads.csv."""
        loads = self.folder.data(f"{self.prefix}loads.csv")
        rows = loads[loads["direction"] == direction]
        end = float(rows["model_N"].iloc[-1])
        self.ledger.json((*path, "end_load_N"), end, "consistent", rel=1e-9)

    def _loads(self):
        """loads.csv: equal increments; strips along the yarns by the closed form."""
        ledger, file = self.ledger, f"{self.prefix}loads.csv"
        loads = self.folder.data(file)
        names = list(self.numbers["directions"])
        ledger.column(file, "direction", np.repeat(names, self.increments), "echoed")
        for direction in names:
            own = self.numbers["directions"][direction]
            mask = loads.index[loads["direction"] == direction].to_numpy()
            gauge, final = own["gauge_length_mm"], own["final_length_mm"]
            along = (final - gauge) * np.arange(1, len(mask) + 1) / len(mask)
            ledger.column(file, "elongation_mm", along, rel=1e-9, rows=mask)
            ledger.column(file, "engineering_strain", along / gauge, rel=1e-9, rows=mask)
            line = self.lines[direction]
            if line is None:
                ledger.claim_column(file, "polynomial_N", "consistent", rows=mask)
            else:
                ledger.column(file, "polynomial_N", line(along), rel=1e-6, abs=1e-6, rows=mask)
            model = loads["model_N"].to_numpy(float)[mask]
            closed = self._closed_form(direction, np.log1p(along / gauge))
            if closed is None:
                ledger.claim_column(file, "model_N", "consistent", rows=mask)
            else:
                ledger.column(file, "model_N", closed, rel=2e-3, abs=1e-3 * abs(closed).max(),
                              rows=mask)  # fmt: skip
            self._modelled(direction, along, model)

    def _closed_form(self, direction, strain):
        """Return the loads (n,) N of a homogeneous strip along a yarn.

        Its width contracts by nu12 of the strain along warp, or by nu21 = nu12 E2 / E1(0) of that
        along fill; the stress is the integral of the modulus.
        """
        audit, card = self.audit_of, self.audit_of.card
        if (
            direction == "bias"
            or audit.mesh_taken_out
            or "ratio" in card.form
            or (
                "crimp" in card.form or audit.folder.card_text.get("thickness_change") != "constant"
            )
        ):
            return None
        name, other = ("E1", "E2") if direction == "warp" else ("E2", "E1")
        places = np.linspace(0.0, 1.0, 2001)
        loads = []
        for end in strain:
            along = card.modulus(name, end * places)
            stress = float(np.trapezoid(along, end * places))
            across = card.nu12 * end
            if direction == "fill":
                across = card.nu12 * stress / float(card.modulus(other, 0.0))
            loads.append(self.width * card.thickness * stress * np.exp(-across))
        return np.array(loads)

    def _modelled(self, direction, along, model):
        """What residuals.csv compares with is the curve of loads.csv."""
        rows = self.audit_of.blocks[f"{self.test}: {direction}"]
        at = rows["elongation_mm"].to_numpy(float)
        between = np.interp(at, np.r_[0.0, along], np.r_[0.0, model])
        off = np.abs(between - rows["modelled"].to_numpy(float)).max()
        steps = np.abs(np.diff(np.r_[0.0, model], 2)).max() if len(model) > 1 else np.inf
        if off > 0.5 * steps + 1e-6 * np.abs(model).max():
            self.ledger.find(f"residuals.csv: {self.test}, {direction}", "is not of loads.csv")

    def _standard(self):
        """The table after EN ISO 1421: largest force of each specimen, mean, deviation, CV."""
        file, ledger = f"{self.prefix}en-iso-1421.csv", self.ledger
        if file not in self.folder.tables:
            if self.curves:
                ledger.find(file, "is missing")
            return
        table = self.folder.data(file)
        standard(ledger, self.folder, file, self.curves, self.width,
                 {d: own["gauge_length_mm"] for d, own in self.numbers["directions"].items()},
                 self.section)  # fmt: skip
        if self.folder.page is not None:
            page_of_standard(ledger, table, self.width, self.audit_of, self.test)

    def _words(self):
        """RMS errors in the sentences, and the table of misfits."""
        ledger, own = self.ledger, self.numbers["directions"]
        pattern = ", ".join(rf"{d} {NUM}" for d in own)
        numbers = [o["rms_N"] for o in own.values()]
        total = self.numbers["e_uniaxial_N"]
        before = f"{self.test}: " if self.audit_of.several else ""
        ledger.text(rf"{before}RMS errors in N: {pattern}, together {NUM}",
                    [*numbers, total], digits=[3] * len(own) + [4])  # fmt: skip
        ledger.text(
            rf"{before}RMS errors in N: {pattern}(?![\w.+-])(?![\d.]|, together)",
            numbers,
            needed=False,
        )
        scattered = ", ".join(rf"{d} {NUM}(?: \(specimens scatter by {NUM}\))?" for d in own)
        each = [v for o in own.values() for v in (o["rms_N"], o["scatter_N"])]
        ledger.text(rf"RMS error, N: {scattered}; sum {NUM}", [*each, total],
                    digits=[3] * len(each) + [4], source="terminal", needed=False)  # fmt: skip
        angle = float(self.section.get("bias_angle", 45.0))
        ledger.text(rf"{NUM}° bias", [angle], needed=False)
        if self.folder.page is None:
            return
        rows = []
        for direction, o in own.items():
            quality = self._quality(direction)
            rows.append([direction, o["rms_N"], o["scatter_N"], *quality, o["matched"],
                         o["end_load_N"]])  # fmt: skip
        header = ["strip", "RMS error, N", "scatter of specimens, N", "R² of polynomial",
                  "its RMSE, N", "points matched", "load at the end, N"]  # fmt: skip
        titles = [t.title for t in self.folder.page.tables]
        tests = [t for t in self.audit_of.result["tests"]
                 if self.audit_of.kind_of(t)[0] == "strips"]  # fmt: skip
        if "Misfit by strip" in titles:
            ledger.table("Misfit by strip", header, rows, number=tests.index(self.test), slack=1e-6)
        for direction, o in own.items():
            ledger.text(rf"{direction}.*: RMS error {NUM} N(?:, scatter {NUM} N)?",
                        [o["rms_N"], o["scatter_N"]], digits=3, needed=False)  # fmt: skip

    def _quality(self, direction):
        """Return R squared and RMSE of the load polynomial."""
        line = self.lines[direction]
        if line is None or self.published is not None or self.curves is None:
            return [None, None]
        along = np.concatenate([c[1] for c in self.curves[direction]])
        load = np.concatenate([c[2] for c in self.curves[direction]])
        off, about = load - line(along), load - load.mean()
        return [1.0 - float((off**2).sum() / (about**2).sum()), float(np.sqrt((off**2).mean()))]


def standard(ledger, folder, file, curves, width, gauges, section):
    """Compare a table after EN ISO 1421 with the measured curves."""
    table = folder.data(file)
    columns = ("max_force_N", "max_force_N_per_50mm", "max_force_kN_per_m",
               "elongation_at_max_force_percent")  # fmt: skip
    if curves is None:
        for direction, own in table.groupby("direction", sort=False):
            _statistics(ledger, file, own, columns, direction)
            values = own[~own["specimen"].isin(STATISTICS)]
            per_width = values["max_force_N"] / width
            for name, factor in (("max_force_N_per_50mm", PER_WIDTH), ("max_force_kN_per_m", 1.0)):
                ledger.column(file, name, factor * per_width.to_numpy(float), rel=1e-8,
                              rows=values.index.to_numpy())  # fmt: skip
        for column in columns:
            ledger.claim_column(file, column, "consistent")
    else:
        rows, names = [], []
        for direction in gauges:
            own = []
            for specimen, along, load in curves.get(direction, []):
                top = int(np.argmax(load))
                force = float(load[top])
                own.append([force, force * PER_WIDTH / width, force / width,
                            100 * float(along[top]) / gauges[direction]])  # fmt: skip
                names.append((direction, specimen if specimen is not None else direction))
            rows += own
            if len(own) > 1:
                mean, deviation = np.mean(own, axis=0), np.std(own, axis=0, ddof=1)
                rows += [mean, deviation, 100 * deviation / mean]
                names += [(direction, name) for name in STATISTICS]
        values = np.array(rows, dtype=float)
        for k, column in enumerate(columns):
            ledger.column(file, column, values[:, k], rel=1e-7)
        ledger.column(file, "direction", np.array([d for d, _ in names], object), "echoed")
        ledger.column(file, "specimen", np.array([str(n) for _, n in names], object), "echoed")
    ledger.column(file, "width_mm", width, "echoed", rel=1e-8)
    ledger.column(file, "gauge_length_mm", np.array([gauges[d] for d in table["direction"]]),
                  "echoed", rel=1e-8)  # fmt: skip
    if "rate" in section:
        ledger.claim_column(file, "rate_mm_per_min", "echoed")
    for name in table["specimen"].unique():
        ledger.text(rf"^{re.escape(str(name))}$", [], source=file, needed=False)
    for column in ("specimen", "direction"):
        ledger.claim_column(file, column, "echoed")


STATISTICS = ("mean", "standard deviation", "coefficient of variation, %")


def _statistics(ledger, file, own, columns, direction):
    values = own[~own["specimen"].isin(STATISTICS)][list(columns)].to_numpy(float)
    rows = own[own["specimen"].isin(STATISTICS)]
    if len(values) > 1 and len(rows) == 3:
        mean, deviation = values.mean(axis=0), values.std(axis=0, ddof=1)
        expected = np.array([mean, deviation, 100 * deviation / mean])
        if not np.allclose(rows[list(columns)].to_numpy(float), expected, rtol=1e-7):
            ledger.find(f"{file}: {direction}", "mean, deviation or variation are wrong")


def page_of_standard(ledger, table, width, audit, test):
    """The same table on the page, to four digits."""
    header = ["direction", "specimen", "largest force, N", "N/50 mm", "kN/m", "elongation at it, %"]
    rows = [
        [own["direction"], str(own["specimen"]), *(float(own[c]) for c in (
            "max_force_N", "max_force_N_per_50mm", "max_force_kN_per_m",
            "elongation_at_max_force_percent"))]
        for _, own in table.iterrows()
    ]  # fmt: skip
    tests = [t for t in audit.result["tests"] if audit.kind_of(t)[0] == "strips"]
    ledger.table("Report after EN ISO 1421", header, rows, number=tests.index(test))
    gauges = dict(zip(table["direction"], table["gauge_length_mm"], strict=True))
    said = ", ".join(rf"{d} ([\d.]+)" for d in gauges)
    ledger.text(rf"Width ([\d.]+) mm; gauge {said} mm; rate: (?:not given|([\d.]+) mm/min)",
                [width, *gauges.values(), None], digits=6, needed=True)  # fmt: skip
