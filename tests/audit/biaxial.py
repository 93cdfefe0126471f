"""Auditor of `bubblefit biaxial`, and of biaxial tests within a fit; docs/how-to/biaxial.md."""

import itertools
import re

import numpy as np

from . import measured
from .ledger import NUM

YARNS = ("warp", "fill")
#: Points of each line at which squares count; of the larger change: below, a yarn is unloaded.
SHARES = np.arange(1, 11) / 10
UNLOADED = 0.1
#: Of the range of the loads: how near loads are to those of the first row.
BACK = 0.01
NAMES = ("E_warp_kN_per_m", "E_fill_kN_per_m", "nu_warp", "nu_fill")
DIRECT = ("A_warp_kN_per_m", "A_fill_kN_per_m", "A_warp_fill_kN_per_m", "A_fill_warp_kN_per_m")
CONVENTION = (
    "nu_warp: contraction of the warp per strain of the fill when the fill is pulled (nu_xy beside "
    "E_x, x the warp); nu_fill: of the fill when the warp is pulled"
)
#: A change of strain that no instrument resolves: there is no stiffness of it.
NO_STRAIN = 1e-6


class Reading:
    """Loads (n, 2) kN/m, strains (n, 2) and ratios of one file, and its loadings."""

    def __init__(self, path):
        table = measured.table_of(path)
        self.name = path.rpartition("/")[2]
        columns = {}
        for name in table.columns:
            plain = name.lower()
            quantity = "strain" if re.match(r"(eps|strain)", plain) else None
            quantity = "load" if re.match(r"(n_|f_|force|load)", plain) else quantity
            yarn = re.search(r"_(w|f|warp|fill)\b", plain)
            if quantity and yarn:
                values = table[name].to_numpy(float)
                columns[quantity, yarn[1][0]] = values / 100 if "%" in name else values
        self.load = np.stack([columns["load", "w"], columns["load", "f"]], axis=1)
        self.strain = np.stack([columns["strain", "w"], columns["strain", "f"]], axis=1)
        self.ratio = table["ratio"].astype(str).to_numpy()
        self.phases = self._phases()

    def _phases(self):
        """Return (ratio, [(first row, last row) of each loading]) of rows of one ratio."""
        ends = np.flatnonzero(self.ratio[1:] != self.ratio[:-1]) + 1
        phases = []
        for start, stop in itertools.pairwise([0, *ends.tolist(), len(self.ratio)]):
            larger = self.load[start:stop].max(axis=1)
            phases.append((self.ratio[start], [
                (start + a, start + b) for a, b in _loadings(larger)
            ]))  # fmt: skip
        return phases


def _loadings(larger):
    """Return rows from each trough to the peak after it, where the load turns by a quarter."""
    least = 0.25 * float(np.ptp(larger))
    found, trough, peak, rising = [], 0, 0, True
    for k, value in enumerate(larger):
        if rising:
            if value > larger[peak]:
                peak = k
            if value < larger[peak] - least:
                found.append((trough, peak))
                rising, trough = False, k
        else:
            # A hold is no part of the loading after it.
            if value <= larger[trough]:
                trough = k
            if value > larger[trough] + least:
                rising, peak = True, k
    if rising and larger[peak] - larger[trough] > least:
        found.append((trough, peak))
    return found


class Line:
    """Changes of load and strain along the regression lines of a loading, over the larger load."""

    def __init__(self, ratio, load, strain):
        self.ratio = ratio
        larger = load.max(axis=1)
        share = larger - larger[0]
        about = share - share.mean()
        slopes = about @ np.column_stack([load, strain]) / (about @ about)
        self.load, self.strain = share.max() * slopes[:2], share.max() * slopes[2:]
        off = strain - strain.mean(axis=0) - np.outer(about, slopes[2:])
        self.residual = np.sqrt(np.mean(off**2, axis=0))
        self.unloaded = np.abs(self.load) < UNLOADED * np.abs(self.load).max()


def compliance_of(e_warp, e_fill, nu_warp, nu_fill):
    """Return (2, 2): eps_w = n_w / E_w - nu_warp n_f / E_f, eps_f = n_f / E_f - nu_fill n_w / E_w.

    nu_warp is the contraction of the warp when the fill is pulled.
    """
    return np.array([[1 / e_warp, -nu_warp / e_fill], [-nu_fill / e_warp, 1 / e_fill]])


def constants_of(lines, minimise, reciprocal, unloaded, ratios):
    """Return E warp, E fill, nu_warp, nu_fill with the least squares, and the number of paths."""
    weight = np.sqrt((SHARES**2).sum())
    rows, right = [], []
    for line in lines:
        if ratios and line.ratio not in ratios:
            continue
        given, wanted = (line.load, line.strain) if minimise == "strain" else (
            line.strain, line.load)  # fmt: skip
        for yarn in (0, 1):
            if unloaded or not line.unloaded[yarn]:
                row = np.zeros(4)
                # Unknown 2 x 2 matrix: [0, 0], [1, 1], [0, 1], [1, 0].
                row[yarn], row[2 + yarn] = given[yarn], given[1 - yarn]
                rows.append(weight * row)
                right.append(weight * wanted[yarn])
    matrix = np.array(rows)
    if reciprocal:
        matrix = np.column_stack([matrix[:, :2], matrix[:, 2] + matrix[:, 3]])
    if np.linalg.matrix_rank(matrix) < matrix.shape[1]:
        return None
    c = np.linalg.lstsq(matrix, np.array(right), rcond=None)[0]
    square = np.array([[c[0], c[2]], [c[-1], c[1]]])
    if minimise == "load":
        square = np.linalg.inv(square)
    e_warp, e_fill = 1 / square[0, 0], 1 / square[1, 1]
    return (e_warp, e_fill, -square[0, 1] * e_fill, -square[1, 0] * e_warp), len(rows)


def squares_of(lines, constants, unloaded, ratios):
    """Return the sum of squares of strain (%^2) of the lines that count, and RMS by ratio (%)."""
    matrix, total, rms = compliance_of(*constants), 0.0, {}
    for line in lines:
        off = 100.0 * np.outer(SHARES, line.strain - matrix @ line.load)
        rms[line.ratio] = float(np.sqrt(np.mean(off**2)))
        if not ratios or line.ratio in ratios:
            counts = np.array([unloaded or not own for own in line.unloaded])
            total += float((off[:, counts] ** 2).sum())
    return total, rms


def words_of(minimise, reciprocal, unloaded, ratios):
    only = f", {' and '.join(ratios)} only" if ratios else ""
    return (
        f"least squares of {minimise}s, {'reciprocal' if reciprocal else 'free'}, "
        f"{'with' if unloaded else 'without'} unloaded yarns{only}"
    )


def audit_constants(folder, ledger):
    """Audit the folder of `bubblefit biaxial`."""
    for test, numbers in folder.result["tests"].items():
        several = len(folder.result["tests"]) > 1
        Constants(folder, ledger, test, numbers, f"{test}-" if several else "").audit()


class Constants:
    """Constants of one test, by every choice."""

    def __init__(self, folder, ledger, test, numbers, prefix):
        self.folder, self.ledger, self.test = folder, ledger, test
        self.numbers, self.prefix, self.path = numbers, prefix, ("tests", test)
        files = [row["file"] for row in folder.provenance["data"] if row["test"] == test]
        self.readings = [Reading(file) for file in files]
        self.evaluated = self._evaluated("last")
        self.lines = [line for *_, line in self.evaluated]

    def _evaluated(self, which):
        """Return reading, phase, rows and line of each ratio: its first phase, one loading."""
        found, seen = [], set()
        for reading in self.readings:
            for k, (ratio, loadings) in enumerate(reading.phases):
                if ratio in seen or not loadings:
                    continue
                seen.add(ratio)
                number = len(loadings) if which == "last" else which
                first, last = loadings[number - 1]
                rows = slice(first, last + 1)
                since = reading.strain[rows] - reading.strain[first]
                line = Line(ratio, reading.load[rows], since)
                found.append((reading, k, (first, last, number, len(loadings)), line))
        return found

    def audit(self):
        ledger, path, numbers = self.ledger, self.path, self.numbers
        ledger.json((*path, "convention"), CONVENTION)
        ledger.json((*path, "points_a_path"), len(SHARES), "echoed")
        self._constants()
        self._lines()
        self._kept()
        self._standard()
        spread = {}
        every = [c for c in numbers["constants"] if c["what"] in ("chosen", "")]
        for name, key in zip(("E warp", "E fill", "nu_warp", "nu_fill"), NAMES, strict=True):
            values = [own[key] for own in every]
            spread[name] = [min(values), max(values)]
        ledger.json((*path, "spread"), spread, "recomputed", rel=1e-12)
        self._notes(spread)
        if self.folder.page is not None:
            self._page(spread)
        self._terminal(spread)

    def _options(self, row):
        ratios = () if row["ratios"] == "all" else tuple(row["ratios"].split())
        return row["minimise"], row["reciprocal"], row["unloaded_yarns"], ratios

    def _constants(self):
        """Every choice: constants, their direct form (the inverse), paths, squares."""
        ledger, rows = self.ledger, self.numbers["constants"]
        ledger.json((*self.path, "options"), words_of(*self._options(rows[0])))
        expected = []
        for k, row in enumerate(rows):
            options, lines = self._options(row), self.lines
            if row["what"] in ("first cycle", "last cycle"):
                which = 1 if row["what"] == "first cycle" else "last"
                lines = [line for *_, line in self._evaluated(which)]
            constants, paths = constants_of(lines, *options)
            squares, _ = squares_of(lines, constants, *options[2:])
            own = dict(zip(NAMES, map(float, constants), strict=True))
            if constants[2] * constants[3] < 1:
                a = np.linalg.inv(compliance_of(*constants))
                own |= dict(zip(DIRECT, (a[0, 0], a[1, 1], a[0, 1], a[1, 0]), strict=True))
            own["paths"] = paths
            place = (*self.path, "constants", k)
            ledger.json(place, own, rel=1e-7)
            ledger.json((*place, "squares_percent2"), squares, rel=1e-6, abs=1e-20)
            expected.append({**row, **own})
            if options[1] and abs(own["nu_warp"] * own["E_warp_kN_per_m"]
                                  - own["nu_fill"] * own["E_fill_kN_per_m"]) > 1e-6 * abs(
                                      own["E_warp_kN_per_m"]):  # fmt: skip
                ledger.find(f"result.json: constants {k}", "is not reciprocal")
        self._choices(rows)
        file = f"{self.prefix}constants.csv"
        for name in (*NAMES, *DIRECT, "paths"):
            values = np.array([own.get(name, np.nan) for own in expected], dtype=float)
            ledger.column(file, name, values, rel=1e-7)
        squares = np.array([row["squares_percent2"] for row in rows])
        ledger.column(file, "squares_percent2", squares, "consistent", rel=1e-7)
        for name in ("what", "minimise", "reciprocal", "unloaded_yarns", "ratios"):
            texts = np.array([str(row[name]) for row in rows], object)
            ledger.column(file, name, texts, "echoed")

    def _choices(self, rows):
        """All choices stand there, each once: 2 x 2 x 2, and some ratios alone."""
        there = {line.ratio for line in self.lines}
        unloaded = (
            (False, True) if any(own for ln in self.lines for own in ln.unloaded) else (False,)
        )
        every = set(itertools.product(("strain", "load"), (True, False), unloaded, [()]))
        for ratios in (("1:1", "1:2"), ("1:1", "2:1"), ("1:1", "2:1", "1:2")):
            if set(ratios) < there:
                every.add(("strain", True, False, ratios))
        told = [self._options(row) for row in rows if row["what"] in ("chosen", "")]
        solved = {own for own in every if constants_of(self.lines, *own) is not None}
        if len(told) != len(set(told)) or set(told) | {told[0]} != solved | {told[0]}:
            self.ledger.find(
                "result.json: constants", f"are of the choices {sorted(map(str, told))}"
            )

    def _lines(self):
        """Regression lines of each ratio."""
        chosen = self.numbers["constants"][0]
        constants = [chosen[name] for name in NAMES]
        _, rms = squares_of(self.lines, constants, True, ())
        rows = []
        for reading, _, (first, last, number, count), line in self.evaluated:
            larger = reading.load[first : last + 1].max(axis=1)
            row = {
                "ratio": line.ratio, "file": reading.name, "cycle": number, "cycles": count,
                "readings": last + 1 - first, "from_kN_per_m": float(larger[0]),
                "to_kN_per_m": float(larger[-1]),
            }  # fmt: skip
            for k, yarn in enumerate(YARNS):
                row[f"{yarn}_load_change_kN_per_m"] = float(line.load[k])
                row[f"{yarn}_strain_change_percent"] = 100 * float(line.strain[k])
                row[f"{yarn}_rms_about_line_percent"] = 100 * float(line.residual[k])
            row["rms_of_constants_percent"] = rms[line.ratio]
            rows.append(row)
        self._table("lines", rows, 1e-12)

    def _table(self, name, rows, abs_):
        """Compare a list of rows in result.json with its CSV and with what is expected."""
        file = f"{self.prefix}{name}.csv"
        self.ledger.json((*self.path, name), rows, rel=1e-7, abs=abs_)
        for column in rows[0]:
            values = [row[column] for row in rows]
            if isinstance(values[0], str) and not _all_numbers(values):
                self.ledger.column(file, column, np.array(values, object), "echoed")
            else:
                numbers = [np.nan if v in (None, "") else float(v) for v in values]
                self.ledger.column(file, column, np.array(numbers), rel=1e-7, abs=abs_)

    def _kept(self):
        """Strain kept before the first loading of a phase and after its last, at equal loads."""
        rows = []
        for reading in self.readings:
            away = np.abs(reading.load - reading.load[0]).max(axis=1)
            least = BACK * float(np.ptp(reading.load.max(axis=1)))
            starts = [loads[0][0] for _, loads in reading.phases]
            for k, (ratio, loads) in enumerate(reading.phases):
                stop = starts[k + 1] if k + 1 < len(starts) else len(reading.load) - 1
                top = loads[-1][1]
                after = top + int(np.argmin(away[top : stop + 1]))
                row = {"file": reading.name, "phase": k + 1, "ratio": ratio, "cycles": len(loads)}
                for name, at in (("before", loads[0][0]), ("after", after)):
                    known = away[at] <= least
                    strain = 100 * (reading.strain[at] - reading.strain[0])
                    for yarn, value in zip(YARNS, strain, strict=True):
                        row[f"{yarn}_{name}_percent"] = float(value) if known else None
                for yarn, value in zip(YARNS, reading.load[0], strict=True):
                    row[f"{yarn}_load_kN_per_m"] = float(value)
                rows.append(row)
        self.kept = rows
        self._table("kept", rows, 1e-10)

    def _standard(self):
        """The table after EN 17117-1; Poisson's ratio of the yarn that is not pulled."""
        rows, evaluated = [], {
            (reading.name, k): (reading, spans, line) for reading, k, spans, line in self.evaluated
        }  # fmt: skip
        for own in self.kept:
            row = {"file": own["file"], "ratio": own["ratio"], "load_cycles": own["cycles"]}
            reading, spans, line = evaluated.get(
                (own["file"], own["phase"] - 1), (None, None, None)
            )
            row["cycle_evaluated"] = "" if line is None else str(spans[2])
            for k, yarn in enumerate(YARNS):
                for name in ("from", "to", "stiffness", "poisson", "strain_kept"):
                    row[_column(yarn, name)] = None
                row[_column(yarn, "strain_kept")] = own[f"{yarn}_after_percent"]
                if line is None:
                    continue
                row[_column(yarn, "from")] = float(reading.load[spans[0], k])
                row[_column(yarn, "to")] = float(reading.load[spans[1], k])
                if not line.unloaded[k] and line.strain[k] > NO_STRAIN:
                    row[_column(yarn, "stiffness")] = float(line.load[k] / line.strain[k])
                if line.unloaded[k] and line.strain[1 - k] > NO_STRAIN:
                    row[_column(yarn, "poisson")] = float(-line.strain[k] / line.strain[1 - k])
            rows.append(row)
        chosen = self.numbers["constants"][0]
        last = {"file": "", "ratio": "all", "cycle_evaluated": "",
                "load_cycles": sum(own["cycles"] for own in self.kept)}  # fmt: skip
        for yarn in YARNS:
            last |= dict.fromkeys(_column(yarn, n) for n in ("from", "to", "strain_kept"))
            last[_column(yarn, "stiffness")] = chosen[f"E_{yarn}_kN_per_m"]
            last[_column(yarn, "poisson")] = chosen[f"nu_{yarn}"]
        rows.append(last)
        self.standard = rows
        self._table("en-17117", rows, 1e-10)

    def _notes(self, spread):
        ledger = self.ledger
        for name, (low, high) in spread.items():
            wide = not low > 0 or high / low > 1.1
            seen = ledger.text(rf"{name} lies between {NUM} and {NUM} by what is evaluated",
                               [low, high], needed=False)  # fmt: skip
            if wide != seen:
                ledger.find(f"notes: {name}", f"from {low:.4g} to {high:.4g}")
        chosen = self.numbers["constants"][0]
        ledger.text(rf"nu_warp nu_fill is {NUM}:", [chosen["nu_warp"] * chosen["nu_fill"]],
                    digits=3, needed=False)  # fmt: skip

    def _page(self, spread):
        ledger, rows = self.ledger, self.numbers["constants"]
        chosen = rows[0]
        every = [own for own in rows if own["what"] in ("chosen", "")]
        ends = {own["what"]: own for own in rows}
        cells = []
        for name in (*NAMES, *DIRECT):
            values = [own[name] for own in every]
            unit = "kN/m" if name.endswith("_m") else "\u2013"
            label = name.removesuffix("_kN_per_m").replace("_", " ").replace("nu ", "nu_")
            of_cycles = [ends.get(f"{w} cycle", {}).get(name) for w in ("first", "last")]
            cells.append([label, unit, chosen[name], min(values), max(values), *of_cycles])
        header = ["constant", "unit", "value", "least of all choices", "largest",
                  "of first cycles", "of last cycles"]  # fmt: skip
        ledger.table("Constants per width", header, cells)
        header = [
            "file", "ratio", "load cycles", "cycle evaluated", "from, warp, kN/m", "fill, kN/m",
            "to, warp, kN/m", "fill, kN/m", "stiffness, warp, kN/m", "fill, kN/m",
            "Poisson's ratio nu_warp", "nu_fill", "strain kept, warp, %", "fill, %",
        ]  # fmt: skip
        names = [_column(yarn, n) for n in ("from", "to", "stiffness", "poisson", "strain_kept")
                 for yarn in YARNS]  # fmt: skip
        cells = [
            [own["file"], own["ratio"], int(own["load_cycles"]), own["cycle_evaluated"],
             *(np.nan if own[n] is None else own[n] for n in names)]
            for own in self.standard
        ]  # fmt: skip
        ledger.table("Report after EN 17117-1", header, cells, slack=1e-6)
        cells = [[words_of(*self._options(own)), own["paths"], *(own[n] for n in NAMES),
                  own["squares_percent2"]] for own in every]  # fmt: skip
        header = ["what", "paths", "E warp, kN/m", "E fill, kN/m", "nu_warp", "nu_fill",
                  "squares, %²"]  # fmt: skip
        ledger.table("Every choice", header, cells)
        ledger.text(
            rf"Evaluated: {words_of(*self._options(chosen))}, (\d+) strain paths; the ends are "
            rf"over (\d+) choices of what is evaluated\..*{re.escape(CONVENTION)}",
            [chosen["paths"], len(every)],
        )
        each = rf"E warp {NUM} kN/m \({NUM} to {NUM} by what is evaluated\), E fill {NUM} kN/m "
        each += rf"\({NUM} to {NUM} by what is evaluated\), nu_warp {NUM}, nu_fill {NUM}"
        values = [chosen[NAMES[0]], *spread["E warp"], chosen[NAMES[1]], *spread["E fill"]]
        ledger.text(each, [*values, chosen["nu_warp"], chosen["nu_fill"]],
                    digits=[4] * 6 + [3, 3], needed=False)  # fmt: skip

    def _terminal(self, spread):
        ledger, rows = self.ledger, self.numbers["constants"]
        if not self.folder.terminal:
            return
        chosen = rows[0]
        every = [own for own in rows if own["what"] in ("chosen", "")]
        ends = {own["what"]: own for own in rows}
        source = {"source": "terminal"}
        ledger.text(r"(\d+) strain paths of ratios", [chosen["paths"]], **source)
        ledger.text(
            rf"E warp {NUM} kN/m, E fill {NUM} kN/m, nu_warp {NUM}, nu_fill {NUM}; S = {NUM} %\^2 "
            rf"at (\d+) points a path",
            [*(chosen[n] for n in NAMES), chosen["squares_percent2"], len(SHARES)],
            digits=[4, 4, 3, 3, 4, 4], **source,
        )  # fmt: skip
        ledger.text(
            rf"A warp {NUM}, A fill {NUM}, A warp-fill {NUM}, A fill-warp {NUM} kN/m",
            [chosen[n] for n in DIRECT], needed=DIRECT[0] in chosen, **source,
        )  # fmt: skip
        ledger.text(r"over (\d+) choices of what is evaluated", [len(every)], **source)
        for name, span in spread.items():
            ledger.text(rf"^\s+{name} {NUM} to {NUM}$", span, **source)
        if "first cycle" in ends and "last cycle" in ends:
            values = [ends[w][n] for w in ("first cycle", "last cycle") for n in NAMES[:2]]
            pattern = rf"first cycles: E warp {NUM}, E fill {NUM} kN/m; last cycles: {NUM}, {NUM} "
            ledger.text(rf"{pattern}kN/m", values, **source)
        back = [own for own in self.kept if own["warp_after_percent"] is not None]
        if back:
            last = back[-1]
            ledger.text(
                rf"strain kept after {last['ratio']}, .*\({NUM} and {NUM} kN/m\): warp {NUM} %, "
                rf"fill {NUM} %",
                [last[f"{y}_{n}"] for n in ("load_kN_per_m", "after_percent") for y in YARNS],
                digits=3, **source,
            )  # fmt: skip


def _column(yarn, name):
    endings = {"from": "from_kN_per_m", "to": "to_kN_per_m", "stiffness": "stiffness_kN_per_m",
               "poisson": "poisson", "strain_kept": "strain_kept_percent"}  # fmt: skip
    return f"{yarn}_{endings[name]}"


def _all_numbers(values):
    return all(v in ("", None) or re.fullmatch(r"[\d.]+", str(v)) for v in values)


# Within a fit


def objective(audit, test, section):
    """Return the sum over ratios and yarns of RMS errors over the ratio's largest strain."""
    total, count = 0.0, 0
    for name, rows in audit.blocks.items():
        if name.partition(": ")[0] != test:
            continue
        largest = float(rows["measured"].abs().max())
        for _, own in rows.groupby("quantity", sort=False):
            total += float(np.sqrt(np.mean(own["difference"] ** 2))) / largest
            count += 1
    return total / count if audit.several else total


def audit(audit, test, section, numbers):
    """Audit the ratios of a biaxial test that was fitted."""
    ledger, folder = audit.ledger, audit.folder
    prefix = f"{test}-" if audit.several else ""
    rows = [r for r in folder.provenance["data"] if r["test"] == test]
    readings = {row["name"]: Reading(row["file"]) for row in rows}
    evaluated = {}
    for reading in readings.values():
        for ratio, loadings in reading.phases:
            if loadings:
                evaluated.setdefault(ratio, (reading, *loadings[-1], len(loadings)))
    cells, paths = [], folder.data(f"{prefix}paths.csv")
    for ratio, own in numbers["ratios"].items():
        path = ("tests", test, "ratios", ratio)
        block = audit.blocks[f"{test}: {ratio}"]
        reading, first, last, count = evaluated[ratio]
        load = reading.load[first : last + 1]
        strain = 100 * (reading.strain[first : last + 1] - reading.strain[first])
        kept = 100 * (reading.strain[first] - reading.strain[0])
        errors = {}
        for k, yarn in enumerate(YARNS):
            part = block[block["quantity"] == f"{yarn}_strain"]
            mask = part.index.to_numpy()
            ledger.column("residuals.csv", "measured", strain[1:, k], rel=1e-7, abs=1e-8, rows=mask)
            for j, other in enumerate(YARNS):
                ledger.column("residuals.csv", f"{other}_load_kN_per_m", load[1:, j], rel=1e-7,
                              rows=mask)  # fmt: skip
            # Strains count from the first reading, which is no residual.
            errors[f"rms_{yarn}_percent"] = float(np.sqrt(np.mean(part["difference"] ** 2)))
            mine = paths["ratio"].to_numpy() == ratio
            for column, values in (("load_kN_per_m", load[:, k]), ("strain_percent", strain[:, k])):
                ledger.column(f"{prefix}paths.csv", f"{yarn}_{column}", values, rel=1e-7, abs=1e-8,
                              rows=mine)  # fmt: skip
            modelled = np.r_[0.0, part["modelled"].to_numpy(float)]
            ledger.column(f"{prefix}paths.csv", f"{yarn}_model_percent", modelled, "consistent",
                          rel=1e-7, abs=1e-8, rows=mine)  # fmt: skip
        # Strains in per cent: of an exact fit differences are rounding.
        ledger.json(path, errors, rel=1e-6, abs=1e-13)
        counts = {"matched": len(load) - 1, "cycle": count, "cycles": count}
        ledger.json(path, counts)
        ends = {f"end_load_{y}_kN_per_m": float(load[-1, k]) for k, y in enumerate(YARNS)}
        ends |= {f"residual_{y}_percent": float(kept[k]) for k, y in enumerate(YARNS)}
        ledger.json(path, ends, rel=1e-7, abs=1e-9)
        larger = load.max(axis=1)
        rms = [own[f"rms_{yarn}_percent"] for yarn in YARNS]
        span = [float(larger[0]), float(larger[-1])]
        cells.append([ratio, *rms, f"{count} of {count}", len(load) - 1, *span, *map(float, kept)])
    header = "ratio|RMS error warp, %|RMS error fill, %|cycle|points matched|from load, kN/m|"
    header = f"{header}to load, kN/m|strain kept before it, warp, %|fill, %".split("|")
    ledger.table("Misfit by ratio", header, cells, slack=1e-6)
    each = ", ".join(rf"{ratio} {NUM} / {NUM}" for ratio in numbers["ratios"])
    values = [own[f"rms_{y}_percent"] for own in numbers["ratios"].values() for y in YARNS]
    ledger.text(rf"RMS errors of strain along warp / fill in %: {each}", values, digits=3)
