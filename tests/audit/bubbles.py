"""Auditor of bubble tests within a fit."""

import re

import numpy as np

from . import registrations
from .laws import DIRECTION, MODULI, MPA, Law
from .ledger import NUM
from .measured import table_of

AXES = ("dx", "dy", "dz")
#: Points at each pressure below which the page has no maps of strain.
MIN_STRAIN_POINTS = 192
PRESSURE = {"kPa": 1.0, "MPa": 1000.0, "bar": 100.0, "Pa": 1e-3}


def objective(audit, test, section):
    """Return e: the sum of RMS errors over the largest measured value, by pressure and direction.

    Among several tests it is their mean. None where priors of the sheet are part of it.
    """
    if audit.names_of_unknowns():
        return None
    norms = _norms(audit.blocks[test], section.get("objective", "e") == "e" or audit.several)
    total = sum(value for own in norms.values() for value in own)
    return total / (3 * len(norms)) if audit.several else total


def _norms(rows, relative):
    """Return RMS errors of dx, dy, dz by pressure, over the largest measured value if relative."""
    norms = {}
    for frame, own in rows.groupby("frame", sort=False):
        for axis in AXES:
            block = own[own["quantity"] == axis]
            rms = float(np.sqrt(np.mean(block["difference"] ** 2)))
            largest = float(block["measured"].abs().max())
            norms.setdefault(frame, []).append(rms / largest if relative else rms)
    return norms


def audit(audit, test, section, numbers):
    """Audit numbers, tables and files of one bubble."""
    prefix = f"{test}-" if audit.several else ""
    Bubble(audit, test, section, numbers, prefix).audit()


class Bubble:
    def __init__(self, audit, test, section, numbers, prefix):
        self.fit, self.test, self.section, self.numbers = audit, test, section, numbers
        self.prefix, self.ledger, self.folder = prefix, audit.ledger, audit.folder
        self.path = ("tests", test)
        self.rows = audit.blocks[test]
        self.frames = self.rows.groupby("frame", sort=False)

    def audit(self):
        self._residuals()
        self._numbers()
        self._errors()
        self._surfaces()
        self._sheet()
        if self.numbers.get("registration"):
            registrations.audit(self)
        if self.folder.page is not None:
            self._page()

    def _residuals(self):
        """Frames count from 1, each at a pressure of the project; unit mm."""
        ledger, rows, file = self.ledger, self.rows, "residuals.csv"
        mask = rows.index.to_numpy()
        numbers = rows["frame"].to_numpy(int)
        last = int(numbers.max())
        if sorted(set(numbers)) != list(range(1, last + 1)):
            ledger.find(f"{file}: frame", f"{self.test} has not the frames 1 to {last}")
        ledger.claim_column(file, "frame", "consistent", rows=mask)
        if set(rows["unit"]) != {"mm"} or set(rows["quantity"]) != set(AXES):
            ledger.find(f"{file}: {self.test}", "is not of dx, dy, dz in mm")
        pressures = self.section.get("pressures")
        unit = self.folder.project.get("units", {}).get("pressure", "kPa")
        self.pressures = [float(own["pressure_kPa"].iloc[0]) for _, own in self.frames]
        sheet = self.section.get("sheet", {})
        if pressures is not None and len(pressures) == last and not sheet.get("from_pressure"):
            kilo = np.array(pressures, dtype=float) * PRESSURE[unit]
            ledger.column(file, "pressure_kPa", kilo[numbers - 1], "echoed", rel=1e-8, rows=mask)
        else:
            ledger.claim_column(file, "pressure_kPa", "consistent", rows=mask)
            if not all(own["pressure_kPa"].nunique() == 1 for _, own in self.frames):
                ledger.find(f"{file}: pressure_kPa", "differs within a frame")
        radius = self.section.get("radius")
        length = {"mm": 1.0, "m": 1000.0}[self.folder.project.get("units", {}).get("length", "mm")]
        for column in ("x_mm", "y_mm", "measured"):
            ledger.claim_column(file, column, "consistent", rows=mask)
        if radius is not None:
            far = float(np.hypot(rows["x_mm"], rows["y_mm"]).max())
            if not 0.3 * radius * length < far < 1.02 * radius * length:
                ledger.find(f"{file}: {self.test}", f"places reach {far:.4g} mm")
        for frame, own in self.frames:
            parts = [own[own["quantity"] == axis][["x_mm", "y_mm"]].to_numpy() for axis in AXES]
            if not all(np.array_equal(parts[0], part) for part in parts[1:]):
                ledger.find(f"{file}: {self.test}, frame {frame}", "dx, dy, dz have other places")
        self._symmetric()
        self._of_files()

    def _of_files(self):
        """Measured values are the files' own, where these are plain tables of the test's axes."""
        points = self.section.get("data", {}).get("points", {})
        files, names = points.get("files"), points.get("columns", {})
        plain = points.get("length_unit", "mm") == "mm" and not (
            {"registration", "filter", "pressure"} & set(points) or "sheet" in self.section
        )
        if not files or not plain or len(files) != len(self.pressures):
            return
        for name, (frame, own) in zip(files, self.frames, strict=True):
            table = table_of(self.folder.project_path.parent / name)
            keys = [names.get(key, key) for key in ("x", "y", *AXES)]
            if table is None or not set(keys) <= set(table.columns):
                return
            seen = {tuple(np.round(row[:2], 6)): row[2:] for row in table[keys].to_numpy(float)}
            for k, axis in enumerate(AXES):
                part = own[own["quantity"] == axis]
                for x, y, value in part[["x_mm", "y_mm", "measured"]].to_numpy(float):
                    row = seen.get((round(x, 6), round(y, 6)))
                    if row is None or abs(row[k] - value) > 1e-6 * max(1.0, abs(value)):
                        place = f"residuals.csv: {self.test}, frame {frame}, {axis}"
                        self.ledger.find(place, f"{name} has no {value} at {x}, {y}")
                        break

    def _symmetric(self):
        """A quarter has no displacement across its planes: dx at x = 0, dy at y = 0."""
        if self.section.get("symmetry", "full") != "quarter":
            return
        for axis, place in (("dx", "x_mm"), ("dy", "y_mm")):
            own = self.rows[(self.rows["quantity"] == axis) & (self.rows[place] == 0.0)]
            if len(own) and own["modelled"].abs().max() > 1e-6:
                self.ledger.find(f"residuals.csv: {axis}", f"is not zero at {place} = 0")

    def _numbers(self):
        ledger, numbers, path = self.ledger, self.numbers, self.path
        by_place = self.rows.groupby("quantity", sort=False)["difference"].apply(
            lambda own: np.abs(own.to_numpy())
        )
        mean = float(sum(by_place[axis] for axis in AXES).mean())
        self.mean = mean
        ledger.json((*path, "mean_abs_mm"), mean, rel=1e-6)
        places = [len(own) // 3 for _, own in self.frames]
        ledger.json((*path, "data", "places"), places)
        data = numbers["data"]
        ledger.json((*path, "data", "matched_by"), _match(self.section))
        dropped = data["dropped"]
        ledger.claim_json((*path, "data", "dropped"), "consistent")
        ledger.json((*path, "data", "doubtful_dropped"), sum(dropped.values()), "recomputed")
        record = [r for r in (self.folder.provenance or {}).get("data", [])
                  if r["test"] == self.test]  # fmt: skip
        total = sum(sum(r["rows_dropped"].values()) for r in record)
        if record and sum(dropped.values()) != total:
            ledger.find(f"result.json: tests.{self.test}.data.dropped", f"provenance has {total}")
        ledger.claim_json((*path, "data", "outside_dropped"), "consistent")
        if "outlying_dropped" in data:
            ledger.claim_json((*path, "data", "outlying_dropped"), "consistent")
        if not record and data["outside_dropped"]:
            ledger.find(f"result.json: tests.{self.test}.data.outside_dropped", "of computed data")
        nuisance, unknowns = numbers["nuisance"], self.fit.result.get("unknowns", {})
        offset = nuisance["displacement_offset_mm"]
        if offset is not None:
            for k, axis in enumerate("xyz"):
                value = self._unknown(unknowns, f"offset_{axis}")
                ledger.json((*path, "nuisance", "displacement_offset_mm", k), value, "consistent")
        if nuisance["pressure_offset_kPa"] is not None:
            value = self._unknown(unknowns, "pressure_offset")
            ledger.json((*path, "nuisance", "pressure_offset_kPa"), value, "consistent")

    def _unknown(self, unknowns, name):
        """Return the value of an unknown, which is named with its test among several."""
        return next(own["value"] for key, own in unknowns.items() if key.endswith(name))

    def _errors(self):
        """The largest error of the moduli against the known law, over the strains reached."""
        known = self.section.get("data", {}).get("known_solution")
        if "moduli_error" not in self.numbers:
            if known:
                self.ledger.find(f"result.json: tests.{self.test}", "has no moduli_error")
            return
        ledger, card = self.ledger, self.fit.card
        reached = self.fit.result["strain_reached"]
        law = self._known(known)
        self.largest = {}
        for name in MODULI:
            end = reached[DIRECTION[name]]
            ledger.json((*self.path, "moduli_error_range", name), [0.0, end], "consistent")
            if law is None:
                self.largest[name] = self.numbers["moduli_error"][name]
                ledger.claim_json((*self.path, "moduli_error", name), "consistent")
                continue
            strain = np.linspace(0.0, end, 61)
            error = np.abs(card.modulus(name, strain) / law.modulus(name, strain) - 1.0).max()
            self.largest[name] = float(error)
            ledger.json((*self.path, "moduli_error", name), float(error), rel=1e-3, abs=1e-12)

    def _known(self, known):
        project = self.folder.project
        unit = project.get("units", {}).get("modulus", "GPa")
        ranges = known.get("strain_range", project.get("law", {}).get("strain_range"))
        ends = dict(zip(MODULI, ranges or [np.inf] * 3, strict=True))
        if "card" in known or "beta" not in known:
            return None
        return Law(known.get("form", "cubic"), known["beta"], unit=unit, nu12=0.24,
                   thickness=1.0, ends=ends)  # fmt: skip

    def _surfaces(self):
        """surfaces.csv: polynomials through the matched points, in Eq. 4.4's order."""
        file, ledger = f"{self.prefix}surfaces.csv", self.ledger
        if file not in self.folder.tables:
            return
        table = self.folder.data(file)
        degree = int(table["degree"].iloc[0])
        match = self.section.get("match", {})
        ledger.column(file, "degree", match.get("degree", 4), "echoed")
        columns = [f"C{k}" for k in range((degree + 1) ** 2)]
        for column in (*columns, "scale_mm"):
            ledger.claim_column(file, column, "consistent")
        count = len(table) // 3
        since = self.section.get("sheet", {}).get("from_pressure")
        unit = PRESSURE[self.folder.project.get("units", {}).get("pressure", "kPa")]
        recorded = [unit * p for p in self.section["pressures"]] if since else self.pressures
        pressures = np.repeat([own / 1000.0 for own in recorded], 3)
        ledger.column(file, "direction", np.tile(list("xyz"), count), "echoed")
        if len(pressures) == len(table):
            ledger.column(file, "pressure_MPa", pressures, "consistent", rel=1e-8)
        else:
            ledger.claim_column(file, "pressure_MPa", "consistent")
        told = self.numbers["surface_r_squared"]
        r_squared = table["R2"].to_numpy(float)
        ledger.json((*self.path, "surface_r_squared"), r_squared.reshape(-1, 3).tolist(),
                    "consistent", rel=1e-9)  # fmt: skip
        ledger.claim_column(file, "R2", "consistent")
        if (
            _match(self.section) == "points"
            and len(pressures) == len(table)
            and not since
            and (not self.numbers["data"]["outside_dropped"] and not self.numbers["sheet"]["used"])
        ):
            for k, (_, own) in enumerate(self.frames):
                self._surface(file, table.iloc[3 * k : 3 * k + 3], own, degree, columns)
        rows = [[p, *(f"{r:.5f}" for r in own)] for p, own in zip(recorded, told, strict=False)]
        if self.folder.page is not None and len(rows) == len(told):
            title = f"R² of polynomial surfaces of degree {degree}"
            ledger.table(title, ["pressure, kPa", "x", "y", "z"], rows, number=self._number())
            ledger.text(r"R² of polynomial surfaces of degree (\d+)", [degree])

    def _surface(self, file, rows, own, degree, columns):
        """One pressure: R squared of the polynomials, and that none fits better."""
        first = own[own["quantity"] == "dx"]
        x, y = first["x_mm"].to_numpy(float), first["y_mm"].to_numpy(float)
        values = [own[own["quantity"] == axis]["measured"].to_numpy(float) for axis in AXES]
        if self.section.get("symmetry", "full") == "quarter":
            x, y, values = _mirrored(x, y, values)
        powers = np.stack([y**i * x**j for i in range(degree, -1, -1)
                           for j in range(degree, -1, -1)], axis=1)  # fmt: skip
        length = np.linalg.norm(powers, axis=0)
        length[length == 0] = 1.0
        at = rows.index.to_numpy()
        for k, value in enumerate(values):
            fitted = powers @ rows[columns].iloc[k].to_numpy(float)
            best = np.linalg.lstsq(powers / length, value, rcond=1e-12)[0]
            about = float(((value - value.mean()) ** 2).sum())
            left = float(((value - fitted) ** 2).sum())
            least = float(((value - powers / length @ best) ** 2).sum())
            expected = np.array([1.0 - left / about])
            self.ledger.column(file, "R2", expected, rel=1e-6, rows=at[[k]])
            if left > least * 1.01 + 1e-12 * about:
                self.ledger.find(f"{file}: row {at[k] + 1}", "another polynomial fits better")

    def _sheet(self):
        """Numbers of the sheet: its surface, modes, slack, rim."""
        ledger, sheet = self.ledger, self.numbers["sheet"]
        path = (*self.path, "sheet")
        unknowns = self.fit.result.get("unknowns", {})
        file = f"{self.prefix}reference_surface.csv"
        if file in self.folder.tables:
            heights = self.folder.numbers(file, "z0_mm")
            ends = {"least": float(heights.min()), "largest": float(heights.max())}
            ledger.json((*path, "surface_mm"), ends, "recomputed", rel=1e-5, abs=1e-6)
            for column in self.folder.tables[file]:
                ledger.claim_column(file, column, "consistent")
        elif not sheet["used"]:
            ledger.json((*path, "surface_mm"), {"least": 0.0, "largest": 0.0})
        else:
            ledger.claim_json((*path, "surface_mm"), "consistent")
        for key in ("modes_mm", "metric_percent"):
            for name, value in sheet[key].items():
                ledger.json((*path, key, name), self._unknown(unknowns, name), "consistent",
                            rel=1e-9)  # fmt: skip
                del value
        file = f"{self.prefix}constant_field.csv"
        taken = sheet["constant_field_rms_mm"]
        if file in self.folder.tables:
            for name, value in (taken or {}).items():
                rms = float(np.sqrt(np.mean(self.folder.numbers(file, f"{name}_mm") ** 2)))
                ledger.json((*path, "constant_field_rms_mm", name), rms, "recomputed", rel=1e-4)
                del value
            for column in self.folder.tables[file]:
                ledger.claim_column(file, column, "consistent")
        for key in ("measured_rms_mm", "slack_percent", "rim_motion_mm", "from_pressure_kPa"):
            if sheet[key] is not None:
                ledger.claim_json((*path, key), "consistent")
        since = self.section.get("sheet", {}).get("from_pressure")
        if sheet["from_pressure_kPa"] is not None and since is not None:
            unit = self.folder.project.get("units", {}).get("pressure", "kPa")
            ledger.json((*path, "from_pressure_kPa"), since * PRESSURE[unit], "echoed")

    def _number(self):
        tests = [t for t in self.fit.result["tests"] if self.fit.kind_of(t)[0] == "bubble"]
        return tests.index(self.test)

    def _page(self):
        ledger, rows = self.ledger, self.rows
        of = "over the largest measured value"
        relative = self.section.get("objective", "e") == "e"
        norms = _norms(rows, relative)
        cells = [[p, *own] for p, own in zip(self.pressures, norms.values(), strict=True)]
        # Of a fit without noise the misfit is rounding, of nine digits of the table.
        slack = 1e-6
        ledger.table("Misfit by pressure", ["pressure, kPa", "x", "y", "z"], cells,
                     "recomputed", number=self._number(), slack=slack)  # fmt: skip
        del of
        ledger.text(rf"mean \|dx\| ?\+ ?\|dy\| ?\+ ?\|dz\|(?: =|:)? {NUM} mm",
                    self._mean_abs, digits=3)  # fmt: skip
        heading = self.test if self.fit.several else None
        ledger.fact("mean |dx| + |dy| + |dz|, mm", self.numbers["mean_abs_mm"], heading=heading)
        self._facts(heading)
        if "moduli_error" in self.numbers:
            self._page_of_errors()
        last = f"{self.pressures[-1]:.4g}"
        count = len(self.pressures)
        ledger.text(r"rises modelled and \w+ at (\d+) pressures", [count])
        for axis in AXES:
            own = rows[rows["quantity"] == axis]["difference"]
            rms = float(np.sqrt(np.mean(own**2)))
            ledger.text(rf"modelled less \w+ {axis} over the \w+ height, {NUM} mm RMS", [rms],
                        digits=2)  # fmt: skip
            ledger.text(rf"^{axis}: RMS {NUM} mm", [rms], digits=2, needed=False)
        ledger.text(rf"^d[xyz], [^,]*, mm, {NUM} kPa", [last], needed=False)
        ledger.text(rf"^\w+ strain, [^,]*, %, {NUM} kPa", [last], needed=False)
        ledger.text(rf"^pressure {NUM} kPa(?:, residual, length)?", [last], needed=False)
        fewest = min((own["quantity"] == "dx").sum() for _, own in self.frames)
        words = r"it takes (\d+) points at each pressure, and there are (\d+)"
        ledger.text(
            rf"{re.escape(self.test)}: no maps of \w+ strain: {words}",
            [MIN_STRAIN_POINTS, int(fewest)],
            needed=False,
        )
        top = float(rows[(rows["quantity"] == "dz")]["modelled"].abs().max())
        counted = self.section.get("sheet", {}).get("from_pressure") is not None

        def height(match):
            off = float(match[1]) - top  # what is counted from a pressure is not all of the height
            used = 2.0 * bool(self.numbers["sheet"]["used"])
            if not -0.03 * top - used < off < (np.inf if counted else 0.03 * top + used):
                ledger.find("page: bubble", f"{match[0]!r}; residuals.csv has {top:.4g} mm")
            return [match[1]]

        ledger.text(rf"the inflated bubble of {self.test}, {NUM} mm high at the end", height)

    def _facts(self, heading):
        """Points left out, offsets and the sheet, on the page and on the terminal."""
        ledger, data, nuisance = self.ledger, self.numbers["data"], self.numbers["nuisance"]
        dropped = data["doubtful_dropped"], data["outside_dropped"]
        if any(dropped):
            pattern = r"(\d+) doubtful, (\d+) beyond the rim"
            ledger.fact("points left out", (pattern, *dropped), heading=heading)
        shift, pressure = nuisance["displacement_offset_mm"], nuisance["pressure_offset_kPa"]
        if shift is not None:
            told = ", ".join(f"{value:.3f}" for value in shift)
            ledger.fact("displacement offset, mm", told, heading=heading)
        if pressure is not None:
            ledger.fact("pressure offset, kPa", f"{pressure:.3f}", heading=heading)
        for name, own in self.fit.result.get("unknowns", {}).items():
            ledger.text(rf"\b{name} {NUM} {own['unit']}(?=,|$)", [f"{own['value']:.3f}"],
                        source="terminal", needed=False)  # fmt: skip
        words = self._sheet_words()
        ledger.fact("sheet", words, heading=heading)
        ledger.text(rf"sheet: {re.escape(words)}", [], source="terminal", needed=False)

    def _sheet_words(self):
        """Return what the fit used of the sheet, each with its size."""
        sheet, words = self.numbers["sheet"], []
        if sheet["measured_rms_mm"] is not None:
            words.append(f"measured surface (followed to {sheet['measured_rms_mm']:.2g} mm RMS)")
        if sheet["modes_mm"]:
            words.append(f"{len(sheet['modes_mm'])} modes of the surface")
        if words:
            low, high = sheet["surface_mm"]["least"], sheet["surface_mm"]["largest"]
            words.append(f"z0 from {low:.2f} to {high:.2f} mm")
        if sheet["slack_percent"] is not None:
            warp, fill = sheet["slack_percent"]
            words.append(f"slack {warp:.3f} % in warp, {fill:.3f} % in fill")
        if metric := sheet["metric_percent"]:
            means = ", ".join(
                f"{own:.3f} % in {name.split('_')[1]}"
                for name, own in metric.items()
                if name.endswith("_1")
            )
            words.append(f"metric of {len(metric)} unknowns: {means} at the centre")
        if sheet["rim_motion_mm"] is not None:
            words.append(f"rim as measured, up to {sheet['rim_motion_mm']:.2f} mm")
        if sheet["constant_field_rms_mm"] is not None:
            taken = ", ".join(
                f"{name} {size:.2f} mm RMS" for name, size in sheet["constant_field_rms_mm"].items()
            )
            words.append(f"constant field taken out: {taken}")
        if sheet["from_pressure_kPa"] is not None:
            words.append(f"displacements counted from {sheet['from_pressure_kPa']:.4g} kPa")
        return "; ".join(words) or "flat and taut, its rim fixed"

    def _mean_abs(self, match):
        """The mean error: four digits in the card, three elsewhere."""
        digits = len(match[1].partition("e")[0].replace(".", "").lstrip("0"))
        expected = self.numbers["mean_abs_mm"]
        return [f"{expected:.4g}" if digits > 3 else f"{expected:.3g}"]

    def _page_of_errors(self):
        ledger, errors = self.ledger, self.numbers["moduli_error"]
        reached = self.fit.result["strain_reached"]

        def percent(value):
            return f"{100 * value:.0f} %" if value >= 0.995 else f"{100 * value:.2g} %"

        rows = [[name, percent(error), 0.0, 100 * reached[DIRECTION[name]]]
                for name, error in errors.items()]  # fmt: skip
        header = ["modulus", "largest error", "from strain, %", "to strain, %"]
        if not self.fit.several:
            ledger.table("Errors of the moduli", header, rows)
        each = ", ".join(rf"{name} {NUM} % \(up to {NUM} %\)" for name in errors)
        values = [v for name, e in errors.items()
                  for v in (100 * e, 100 * reached[DIRECTION[name]])]  # fmt: skip
        ledger.text(rf"largest error of the moduli over the strain reached: {each}", values,
                    digits=[2, 3] * len(errors), needed=False)  # fmt: skip
        told = [f"{100 * e:.2g}" for e in errors.values()]

        def chart(match):
            if match[1] not in told and not self._near(match[1]):
                ledger.find("page: errors of the moduli", f"{match[0]!r} beside {told}")
            return [match[1]]

        ledger.text(rf"^best: at most {NUM} %", chart, needed=False)

    def _near(self, text):
        """Whether an error is one of those over the valid strains, which charts show."""
        for name in MODULI:
            strain = np.linspace(0.0, self.fit.card.ends[name], 121)
            law = self._known(self.section["data"]["known_solution"])
            error = np.abs(self.fit.card.modulus(name, strain) / law.modulus(name, strain) - 1)
            if abs(float(text) - 100 * error.max()) < 0.06 * float(text):
                return True
        return False


def _mirrored(x, y, values):
    """Return places and dx, dy, dz of the whole disk, from those of a quarter."""
    signs = [(1, 1), (-1, 1), (-1, -1), (1, -1)]
    places = np.concatenate([np.stack([a * x, b * y], axis=1) for a, b in signs])
    moved = [np.concatenate([(a, b, 1)[k] * values[k] for a, b in signs]) for k in range(3)]
    _, once = np.unique(np.round(places, 6) + 0.0, axis=0, return_index=True)
    return *places[once].T, [own[once] for own in moved]


def _match(section):
    match = section.get("match", {})
    return match.get("by", "points") if isinstance(match, dict) else match


__all__ = ["MPA", "audit", "objective"]
