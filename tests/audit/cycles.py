"""Auditor of `bubblefit cycles`, and of load histories within a fit; docs/how-to/cycles.md."""

import math
from itertools import pairwise

import numpy as np

from . import measured
from .ledger import NUM

#: Ends of the tangent stiffness, of a cycle's peak; peaks that differ by less are the same.
RANGE, SAME = (0.4, 0.9), 0.05
#: An unloading goes back by so much of the rise before it, a loading rises again by so much.
BACK, AGAIN, FLOOR = 0.7, 0.2, 0.01


def turns(load):
    """Return rows of valley, peak, valley, ... of loads (n,)."""
    found, far, rising = [], 0, False  # the first turn is a valley
    for k, value in enumerate(load):
        if (value > load[far]) if rising else (value < load[far]):
            far = k
            continue
        before = abs(load[far] - load[found[-1]]) if found else 0.0
        least = max(FLOOR * float(np.ptp(load)), (BACK if rising else AGAIN) * before)
        if abs(load[far] - value) > least:
            found.append(far)
            far, rising = k, not rising
    return [*found, far]


def passage(load, strain, level):
    """Return the strain at the first passage of a load, and the row before it; NaN if none."""
    above = load >= level
    change = np.flatnonzero(above[1:] != above[:-1])
    if not len(change):
        return math.nan, -1
    k = change[0]
    share = (level - load[k]) / (load[k + 1] - load[k])
    return float(strain[k] + share * (strain[k + 1] - strain[k])), int(k)


def slope(load, strain, peak):
    """Return the least squares slope of load over strain, 40 to 90 % of the peak."""
    keep = (load >= RANGE[0] * peak) & (load <= RANGE[1] * peak)
    if keep.sum() < 3:
        return math.nan
    return float(np.polyfit(strain[keep], load[keep], 1)[0])


def values_of(time, load, strain, reference):
    """Return the values of each cycle of a history, by the definitions of the table."""
    rows = turns(load)
    cycles = [
        (rows[k], rows[k + 1], rows[k + 2] if k + 2 < len(rows) else len(load) - 1)
        for k in range(0, len(rows) - 1, 2)
    ]
    strain, table = strain - zero_of(load, strain, reference), []
    for number, (start, peak, end) in enumerate(cycles, start=1):
        up, down = slice(start, peak + 1), slice(peak, end + 1)
        before, i = passage(load[up], strain[up], reference)
        top, force = float(strain[peak]), float(load[peak])
        way = np.r_[before, strain[up][i + 1 :]], np.r_[reference, load[up][i + 1 :]]
        work = float(np.trapezoid(way[1], way[0]))
        row = {
            "cycle": number, "peak_N": force, "reference_N": reference, "strain_before": before,
            "strain_at_peak": top, "EA_loading": slope(load[up], strain[up], force),
            "secant_loading": (force - reference) / (top - before), "work_J_per_m": work,
        }  # fmt: skip
        after = dict.fromkeys(
            ("permanent_strain", "EA_unloading", "secant_unloading", "loss_J_per_m"), math.nan
        )
        if 2 * number < len(rows) and end - peak >= 5:
            kept, j = passage(load[down], strain[down], reference)
            back = np.r_[load[down][: j + 1], reference], np.r_[strain[down][: j + 1], kept]
            after = {
                "permanent_strain": kept,
                "EA_unloading": slope(load[down], strain[down], force),
                "secant_unloading": (force - reference) / (top - kept),
                "loss_J_per_m": work + float(np.trapezoid(*back)),
            }
        row |= after
        row["loading_N_per_s"] = rate(time, load, up)
        row["unloading_N_per_s"] = rate(time, load, down)
        table.append(row)
    return table


def rate(time, load, rows):
    """Return the rate of load of a branch from 40 to 90 % of its peak or back, N/s."""
    if time is None:
        return math.nan
    top = load[rows].max()
    at = [passage(load[rows], time[rows], share * top)[0] for share in (0.4, 0.9)]
    return 0.5 * top / abs(at[1] - at[0])


def stable_of(table):
    """Return the first cycle that repeats the one before to the same peak, 0 if none."""
    for old, new in pairwise(table):
        alike = abs(new["peak_N"] / old["peak_N"] - 1) < SAME
        within = (
            abs(new["EA_loading"] - old["EA_loading"]) <= 0.05 * old["EA_loading"],
            abs(new["permanent_strain"] - old["permanent_strain"]) <= 0.02 * new["strain_at_peak"],
            abs(new["loss_J_per_m"] - old["loss_J_per_m"]) <= 0.03 * new["work_J_per_m"],
        )
        if alike and all(within):
            return new["cycle"]
    return 0


def history_of(path):
    """Return time, load (N) and strain of a plain table; no time where it steps back."""
    table = measured.table_of(path)
    if table is None:
        return None
    load = measured.column(table, ("load", "force"), measured.FORCE)
    strain = measured.column(table, ("strain",), {"%": 0.01})
    time = clock_of(table)
    if time is None:
        time = measured.column(table, ("time",), {})
    if time is not None and (np.diff(time) < 0).any():
        time = None
    return None if load is None or strain is None else (time, load, strain)


def clock_of(table):
    """Return seconds of a column of stamps 23:59:59.5, None without one.

    Only a clock that goes back by more than half a day has passed midnight.
    """
    stamps = measured.text_column(table, ("time",))
    if stamps is None or not all(stamp.count(":") == 2 for stamp in stamps):
        return None
    parts = np.array([[float(part) for part in stamp.split(":")] for stamp in stamps])
    seconds = parts @ [3600.0, 60.0, 1.0]
    return seconds + 86400.0 * np.cumsum(np.diff(seconds, prepend=seconds[0]) < -43200.0)


def zero_of(load, strain, reference):
    """Return the strain at the first passage of the reference load."""
    start, peak = turns(load)[:2]
    return passage(load[start : peak + 1], strain[start : peak + 1], reference)[0]


def audit_cycles(folder, ledger):
    """Audit the tables of `bubblefit cycles`."""
    if folder.result is not None:
        return  # cycles.csv of a fit
    file, table = "cycles.csv", folder.data("cycles.csv")
    per_width = "EA_loading_N_per_mm" in table
    unit = "N_per_mm" if per_width else "N"
    for name, own in table.groupby("file", sort=False):
        rows = own.index.to_numpy()
        reference = float(own["reference_N"].iloc[0])
        history = history_of(folder.base / name)
        if history is None or per_width:
            _within(ledger, file, own, rows, unit)
            continue
        expected = values_of(*history, reference)
        ledger.claim_column(file, "reference_N", "echoed", rows=rows)
        stable = stable_of(expected)
        states = ["first", *["conditioned" if v["cycle"] == stable else "" for v in expected[1:]]]
        ledger.column(file, "state", np.array(states, object), rows=rows)
        plain = "cycle peak_N strain_before permanent_strain strain_at_peak work_J_per_m"
        plain = f"{plain} loss_J_per_m loading_N_per_s unloading_N_per_s".split()
        for column in plain:
            values = np.array([v[column] for v in expected], dtype=float)
            ledger.column(file, column, values, rel=1e-6, abs=1e-9, rows=rows)
        for column in ("EA_loading", "EA_unloading", "secant_loading", "secant_unloading"):
            values = np.array([v[column] for v in expected], dtype=float)
            ledger.column(file, f"{column}_{unit}", values, rel=1e-6, rows=rows)
        _ratios(ledger, file, own, rows, unit)
        _holds(folder, ledger, name, history, reference)
        _terminal(ledger, folder, name, expected, stable)
    for other in folder.tables:
        if other != file:
            for column in folder.tables[other]:
                ledger.claim_column(other, column, "consistent")
    if "loops.csv" in folder.tables:
        _slip_notes(folder.data("loops.csv"), table, ledger)
    for note in ("cycle",):
        ledger.text(rf"\b{note} (\d+)\b", lambda m: [m[1]], source="notes.csv", needed=False)


def _holds(folder, ledger, name, history, reference):
    """Holds of a file: between two readings, with the slope over the decades of time between."""
    file = "holds.csv"
    table = folder.data(file) if file in folder.tables else None
    rows = [] if table is None or "file" not in table else np.flatnonzero(table["file"] == name)
    time, load, strain = history
    if time is None:
        if len(rows):
            ledger.find(file, f"{name} has no times that only rise, and {len(rows)} holds")
        return
    strain = strain - zero_of(load, strain, reference)
    readings = {"strain": strain, "load_N": load}
    for row in rows:
        ends = []
        for end in ("before", "after"):
            away = sum(
                np.abs(values - table[f"{part}_{end}"][row]) / np.ptp(values)
                for part, values in readings.items()
            )
            ends.append(np.flatnonzero(away < 1e-7))
        first, last = min(
            ((i, j) for i in ends[0] for j in ends[1] if j > i),
            key=lambda pair: abs(time[pair[1]] - time[pair[0]] - table["duration_s"][row]),
            default=(0, 0),
        )
        if not last:
            ledger.find(f"{file}: row {row}", f"{name} has no readings as before and after")
            continue
        since = time[first : last + 1] - time[first]
        expected = {"duration_s": since[-1]}
        for part, values in readings.items():
            slope = np.polyfit(np.log10(since[1:]), values[first + 1 : last + 1], 1)[0]
            expected |= {
                f"{part}_before": values[first],
                f"{part}_after": values[last],
                f"{part}_after_over_before": values[last] / values[first],
                f"{part}_per_decade": slope,
            }
        for column, value in expected.items():
            ledger.column(file, column, np.array([value]), rel=1e-6, abs=1e-12, rows=[row])


def _slip_notes(loops, table, ledger):
    """Recompute the numbers of notes on slip from the readings of the loops.

    A note names no file in its text: of all files the one with that number counts.
    """

    def loop(name, number):
        own = loops[(loops["file"] == name) & (loops["cycle"] == number)]
        return own, own.loc[own["load_N"].idxmax()]

    def at_peaks(match):
        candidates = []
        for name in loops["file"].unique():
            if not {int(match[1]), int(match[3])} <= {*loops[loops["file"] == name]["cycle"]}:
                continue
            (_, new), (_, old) = loop(name, int(match[1])), loop(name, int(match[3]))
            lost = old["strain"] - new["strain"]
            candidates.append((abs(lost - float(match[2])), lost, new, old))
        _, lost, new, old = min(candidates, key=lambda row: row[0])
        moved = new["travel_mm"] - old["travel_mm"]
        return match[1], lost, match[3], moved

    ledger.text(
        rf"at the peak of cycle (\d+) {NUM} less strain than in cycle (\d+) at the same load"
        rf"(?:, the machine's travel {NUM} mm more)?", at_peaks, source="notes.csv", digits=2,
        needed=False,
    )  # fmt: skip

    def crossing(match):
        apart = []
        for name in loops["file"].unique():
            own, top = loop(name, int(match[1]))
            up, down = own[own["branch"] == "loading"], own[own["branch"] == "unloading"]
            levels = np.linspace(0.2, 0.95, 16) * top["load_N"]
            reference = table[table["file"] == name]["reference_N"].iloc[0]
            ends = [
                [passage(b["load_N"].to_numpy(), b["strain"].to_numpy(), level)[0]
                 for level in levels if level >= reference]
                for b in (down, up)
            ]  # fmt: skip
            apart.append(-np.nanmin(np.array(ends[0]) - ends[1]))
        return match[1], min(apart, key=lambda value: abs(value - float(match[2])))

    ledger.text(
        rf"the branches of cycle (\d+) cross: {NUM} less strain", crossing, source="notes.csv",
        digits=2, needed=False,
    )  # fmt: skip


def _ratios(ledger, file, own, rows, unit):
    ledger.column(file, "loss_ratio", (own["loss_J_per_m"] / own["work_J_per_m"]).to_numpy(),
                  rel=1e-7, rows=rows)  # fmt: skip
    columns = {
        "EA_loading_of_first": f"EA_loading_{unit}",
        "EA_unloading_of_first": f"EA_unloading_{unit}",
        "loss_of_first": "loss_J_per_m",
    }
    for ratio, column in columns.items():
        values = own[column].astype(float).to_numpy()
        ledger.column(file, ratio, values / values[0], rel=1e-7, rows=rows)


def _within(ledger, file, own, rows, unit):
    """Without the file: what the columns of a row say of each other."""
    force = (own["peak_N"] - own["reference_N"]).to_numpy(float)
    strain = (own["strain_at_peak"] - own["strain_before"]).to_numpy(float)
    secant = own[f"secant_loading_{unit}"].to_numpy(float)
    ratio = force / strain / secant
    if np.ptp(ratio) > 1e-6 * abs(ratio[0]) or (unit == "N" and abs(ratio[0] - 1) > 1e-6):
        ledger.find(f"{file}: secant_loading_{unit}", "is not load over strain")
    _ratios(ledger, file, own, rows, unit)
    for column in own:
        if column in ledger.folder.tables[file] and (ledger.columns[file, column][rows] == 0).any():
            ledger.claim_column(file, column, "consistent", rows=rows)


def _terminal(ledger, folder, name, expected, stable):
    if not folder.terminal:
        return
    source = {"source": "terminal"}
    ledger.text(rf"^{name}: reference load {NUM} N", [expected[0]["reference_N"]], **source)
    for v in expected:
        ledger.text(
            rf"cycle {v['cycle']}, to {NUM} N: permanent strain {NUM} %, stiffness loading {NUM}, "
            rf"unloading {NUM} kN, loss {NUM} J/m \({NUM} % of the work\)",
            [
                v["peak_N"], 100 * v["permanent_strain"], v["EA_loading"] / 1000,
                v["EA_unloading"] / 1000, v["loss_J_per_m"],
                100 * v["loss_J_per_m"] / v["work_J_per_m"],
            ],
            digits=[4, 3, 4, 4, 3, 2], **source,
        )  # fmt: skip
    last = expected[stable - 1 if stable else -1]
    ratio = last["EA_loading"] / expected[0]["EA_loading"]
    ledger.text(
        rf"first loading beside (?:conditioned \(cycle (\d+)\)|last cycle): stiffness 1 to {NUM}",
        [stable, ratio], digits=3, needed=False, **source,
    )  # fmt: skip


# Within a fit


def _branches(rows):
    """Yield loads of each branch of a history: of a cycle up to its peak, and from it on."""
    for _, own in rows.groupby("cycle", sort=False):
        top = int(np.argmax(own["measured"].to_numpy()))
        for part in (own.iloc[:top], own.iloc[top:]):
            if len(part):
                yield part


def objective(audit, test, section):
    """Return the root of the mean square error of each branch over the largest load, summed."""
    total, count = 0.0, 0
    for name, rows in audit.blocks.items():
        if name.partition(": ")[0] == test:
            squares = [float(np.mean(own["difference"] ** 2)) for own in _branches(rows)]
            total += math.sqrt(np.mean(squares)) / float(rows["measured"].max())
            count += 1
    return total / count if audit.several else total


def audit(audit, test, section, numbers):
    """Audit the histories of one test in a fit."""
    ledger, folder = audit.ledger, audit.folder
    prefix = f"{test}-" if audit.several else ""
    cells, shares = [], []
    for name, cycles in numbers["rms_N"].items():
        rows = audit.blocks[f"{test}: {name}"]
        mask = rows.index.to_numpy()
        for cycle, own in rows.groupby("cycle", sort=False):
            rms = float(np.sqrt(np.mean(own["difference"] ** 2)))
            path = ("tests", test, "rms_N", name, f"cycle {int(cycle)}")
            ledger.json(path, rms, rel=1e-6)
            cells.append([name, f"cycle {int(cycle)}", cycles[f"cycle {int(cycle)}"]])
        rms = float(np.sqrt(np.mean(rows["difference"] ** 2)))
        shares.append(100 * rms / float(rows["measured"].max()))
        for column in ("cycle", "strain", "measured"):
            ledger.claim_column("residuals.csv", column, "consistent", rows=mask)
        _against_file(audit, test, section, name, rows)
        each = ", ".join(rf"cycle (\d+) {NUM}" for _ in cycles)
        values = [v for k, own in cycles.items() for v in (k.removeprefix("cycle "), own)]
        ledger.text(rf"{name}: RMS error of load in N: {each}", values, digits=3, needed=False)
    same = folder.data(f"{prefix}cycles.csv")
    whole = audit.matched[audit.matched["test"] == test]
    for column in same:
        own = whole[column].to_numpy()
        ledger.column(f"{prefix}cycles.csv", column, own, "consistent", rel=1e-8, abs=1e-12)
    if folder.page is not None:
        ledger.table("Misfit of the load cycles", ["specimen", "", "RMS error, N"], cells)
    ledger.text(rf"RMS error of load {NUM} % of the largest", [max(shares)], digits=2)
    ledger.text(r"\bcycle (\d+)\b", lambda m: [m[1]], needed=False)


def _against_file(audit, test, section, name, rows):
    """Measured loads are the file's, from the reference load on."""
    files = {r["name"]: r["file"] for r in audit.folder.provenance["data"] if r["test"] == test}
    stem = name.split()[-1]
    path = next((own for key, own in files.items() if key.rpartition(".")[0] == stem), None)
    history = history_of(path) if path else None
    if history is None or "reference_load" not in section:
        return
    _, load, strain = history
    reference = section["reference_load"]
    expected = values_of(None, load, strain, reference)
    if len(expected) != rows["cycle"].nunique():
        audit.ledger.find(f"residuals.csv: {name}", f"the file has {len(expected)} cycles")
    top = max(v["peak_N"] for v in expected) - reference
    if abs(float(rows["measured"].max()) - top) > 0.02 * top:
        audit.ledger.find(f"residuals.csv: {name}", f"the file's largest load is {top:.5g} N")


COMMANDS = {"cycles.csv": audit_cycles}
