"""Audit folders of bent cylinders and beams, from their curves and the measured readings."""

import re
from pathlib import Path

import numpy as np
import pandas as pd

from .common import N, audit_notes, beyond_range, claim_literal, line, percent
from .laws import DIRECTION, MODULI
from .simulations import cards_of

KILO = {"N": 1.0, "kN": 1e3, "kg": 9.80665, "g": 9.80665e-3, "mm": 1.0, "m": 1e3, "cm": 10.0}
ATMOSPHERE = 101.0  # kPa, where the project gives none
SECANT = (0.1, 0.35)


def stiffness_of(d, load, over):
    """Return the slope (N/mm) of the line through the frames up to `over` mm, at least three."""
    count = max(int(np.sum(d <= over * (1 + 1e-9))), 3)
    return np.polyfit(d[:count], load[:count], 1)[0] if len(d) > 1 else None


def knee_of(d, load, stiffness, over):
    """Return where the slope over `over` mm has fallen to half of the stiffness; None without.

    The slope is looked at in steps of `over` / 20, and interpolated between them.
    """
    if stiffness is None or not stiffness > 0 or d[-1] < 2 * over:
        return None
    steps = max(2, round(20 * (d[-1] / over - 1)) + 1)
    middle = np.linspace(0.5 * over, d[-1] - 0.5 * over, steps)
    ahead, behind = (np.interp(middle + s * 0.5 * over, d, load) for s in (1, -1))
    excess = (ahead - behind) / over - 0.5 * stiffness
    first = int(np.argmax(excess <= 0))
    if excess[first] > 0:
        return None
    place = middle[first]
    if first:
        share = excess[first - 1] / (excess[first - 1] - excess[first])
        place = middle[first - 1] + share * (middle[first] - middle[first - 1])
    return place, float(np.interp(place, d, load))


def limit_of(d, load):
    """Return the largest load if it falls by more than 0.5 % afterwards."""
    top = int(np.argmax(load))
    return (d[top], load[top]) if load[top:].min() < 0.995 * load[top] else None


def wrinkles_of(d, load, share):
    """Return the first frame with 1 % more of the surface wrinkled than when inflated."""
    if np.isnan(share).all():
        return None
    more = np.flatnonzero(share > share[0] + 0.01)
    return (d[more[0]], load[more[0]]) if len(more) else None


def straight_of(d, load, top):
    """Return R^2 of a line up to half of a load, and its largest error over its last load."""
    above = np.flatnonzero(load > 0.5 * top)
    count = int(above[0]) if len(above) else len(d)
    if count < 4:
        return None
    x, y = d[:count], load[:count]
    error = y - np.polyval(np.polyfit(x, y, 1), x)
    total = np.sum((y - y.mean()) ** 2)
    return {"r_squared": 1 - np.sum(error**2) / total,
            "largest_deviation": np.abs(error).max() / y[-1]}  # fmt: skip


def secant_of(d, load, reference):
    """Return the slope between 10 and 35 % of the load at a deflection; None where it falls."""
    top = np.interp(reference, d, load)
    rising = np.maximum.accumulate(load)
    low, high = (np.interp(share * top, rising, d) for share in SECANT)
    return (SECANT[1] - SECANT[0]) * top / (high - low) if top > 0 and high > low else None


def readings_of(folder, test):
    """Return measured (deflection mm, load N) of every repetition of a test; None if unread.

    Each up to its largest deflection, in the order of the deflection.
    """
    section = _section(folder, test)
    measured = {**folder.project.get("defaults", {}).get("cylinder", {}).get("measured", {}),
                **section.get("measured", {})}  # fmt: skip
    if {"preload", "zero"} & measured.keys():
        return None
    for own in ("load", "deflection"):
        if {"scale", "offset"} & set(measured.get(own, {})):
            return None
    curves = []
    for file in folder.provenance["data"]:
        if file["test"] != test or not str(file["file"]).endswith(".csv"):
            continue
        if not Path(file["file"]).exists():
            return None
        table = pd.read_csv(file["file"], comment="#")
        columns, units = file["columns"], file["units"]
        if not {columns["deflection"], columns["load"]} <= set(table):
            return None
        way = table[columns["deflection"]].to_numpy(float) * KILO[units["deflection"]]
        load = table[columns["load"]].to_numpy(float) * KILO[units["load"]]
        names = (
            table[columns["repetition"]] if "repetition" in columns else pd.Series([0] * len(way))
        )
        for name in names.unique():
            at = (names == name).to_numpy()
            x, y = way[at], load[at]
            last = int(np.argmax(x)) + 1
            order = np.argsort(x[:last], kind="stable")
            curves.append((x[:last][order], y[:last][order]))
        used = sum(len(x) for x, _ in curves) if len(curves) else 0
        if file["rows_used"] > used:
            return None
    return curves


def _section(folder, test):
    return next((own for own in folder.project.get("cylinder", []) if own.get("name") == test), {})


def audit_bend(folder, ledger):
    result = folder.result
    ledger.claim_json("command", "echoed")
    curves = folder.data("load_deflection.csv")
    readings = {}
    for test in result["tests"]:
        readings[test] = readings_of(folder, test) if result["tests"][test]["repetitions"] else []
        _audit_test(folder, ledger, test, readings[test])
    rows = []
    for k, run in enumerate(result["runs"]):
        own = curves[(curves["test"] == run["test"]) & (curves["card"].astype(str) == run["card"])]
        own = own[own["wall"].astype(object).fillna("").astype(str) == run["wall"]]
        rows.append(_audit_run(folder, ledger, k, run, own, readings[run["test"]]))
    _audit_curves(folder, ledger, curves)
    _audit_table_of_runs(folder, ledger, result["runs"], rows)
    errors = [run["error"]["relative"] for run in result["runs"]
              if run.get("error") and run["predicted"]]  # fmt: skip
    ledger.json("worst_relative_error", max(errors, default=None), "consistent")
    ledger.claim_json("cached_runs", "echoed")
    if result["cached_runs"] > len(result["runs"]):
        ledger.find("cached_runs", "are more than there are runs")
    if "measured.csv" in folder.tables:
        _audit_measured(folder, ledger, readings)
    if folder.page is not None:
        _audit_page(folder, ledger, rows)
    _audit_words(folder, ledger, rows)
    laws = cards_of(folder, set(result["cards"]))
    ends = {}
    if len(laws) == 1:
        ends = {DIRECTION[name]: next(iter(laws.values())).ends[name] for name in MODULI}
    beyond_range(ledger, ends)
    _audit_solver_notes(ledger)
    titles = [(r, f"{r['test']} with {r['card']}") for r in result["runs"]]
    titles = [(r, f"{title}, {r['wall']}" if not r["predicted"] else title) for r, title in titles]
    audit_notes(folder, ledger, [f"{title}: {run['ended']}" for run, title in titles])


def _audit_test(folder, ledger, test, curves):
    at, own = ("tests", test), folder.result["tests"][test]
    section = {**folder.project.get("defaults", {}).get("cylinder", {}), **_section(folder, test)}
    units = folder.project.get("units", {})
    kpa = {"kPa": 1.0, "bar": 100.0, "MPa": 1e3, "Pa": 1e-3}[units.get("pressure", "kPa")]
    mm = {"mm": 1.0, "m": 1e3}[units.get("length", "mm")]
    lengths = ("diameter", "length", "seam_width", "element_size", "slope_over")
    given = {key: (f"{key}_mm", mm) for key in lengths} | {"pressure": ("pressure_kPa", kpa)}
    for key, (name, factor) in given.items():
        if isinstance(section.get(key), int | float):
            ledger.json((*at, name), factor * section[key], "echoed")
    if "places" in section and all(isinstance(p, int | float) for p in section["places"]):
        ledger.json((*at, "places_mm"), {f"{p:g} mm": mm * p for p in section["places"]}, "echoed")
    for name in own["places_mm"]:
        number, _, unit = name.partition(" ")
        factor = {"mm": 1.0, "m": 1e3, "diameters": own["diameter_mm"]}.get(unit)
        if factor is not None:
            ledger.json((*at, "places_mm", name), factor * float(number), "echoed", rel=1e-5)
    ledger.claim_json(at, "echoed")
    ledger.json((*at, "repetitions"), own["repetitions"] if curves is None else len(curves))
    if "slope_over" not in section:
        ledger.json((*at, "slope_over_mm"), 0.1 * own["diameter_mm"], "echoed")


def _audit_run(folder, ledger, k, run, own, curves):
    """Recompute the numbers of a run from its curve; return what tables show."""
    at = ("runs", k)
    row = {"run": run, "at": at}
    if "load_N" not in run:
        if not run["ended"].startswith("failed") or len(own):
            ledger.find(f"runs {k}", f"has no numbers, but ended {run['ended']!r}")
        return row
    test = folder.result["tests"][run["test"]]
    d, load = own["deflection_mm"].to_numpy(), own["load_N"].to_numpy()
    pressure, volume = own["gauge_pressure_kPa"].to_numpy(), own["volume_mm3"].to_numpy()
    share = own["wrinkled_share"].to_numpy(float)
    over, reached = test["slope_over_mm"], d[-1]
    stiffness = stiffness_of(d, load, over)
    knee, limit = knee_of(d, load, stiffness, over), limit_of(d, load)
    wrinkles = wrinkles_of(d, load, share)
    ledger.json((*at, "reached_mm"), reached)
    ledger.json((*at, "stiffness_N_per_mm"), stiffness)
    for name, point in (("knee", knee), ("limit_point", limit), ("wrinkle_onset", wrinkles)):
        ledger.json((*at, name, "deflection_mm"), point and point[0])
        ledger.json((*at, name, "load_N"), point and point[1])
        if point is None:
            ledger.json((*at, name, "none_up_to_mm"), reached)
    loads = {}
    for name, place in test["places_mm"].items():
        inside = place <= reached * (1 + 1e-9)
        loads[name] = float(np.interp(place, d, load)) if inside else None
    ledger.json((*at, "load_N"), loads)
    sigma, spread = dict.fromkeys(loads), np.zeros(len(d))
    if "load_sigma_N" in own and own["load_sigma_N"].notna().any():
        spread = own["load_sigma_N"].to_numpy(float)
        sigma = {name: float(np.interp(place, d, spread)) if loads[name] is not None else None
                 for name, place in test["places_mm"].items()}  # fmt: skip
    ledger.json((*at, "load_sigma_N"), sigma)
    known = np.nan_to_num(spread)
    row |= {"over": over, "spread": spread}
    row["sigma_at"] = lambda place: float(np.interp(place, d, known))
    top = knee[1] if knee else load.max()
    straight = straight_of(d, load, top)
    if straight is None:
        ledger.json((*at, "straight_before_buckling"), None)
    else:
        ledger.json((*at, "straight_before_buckling"), straight, abs=1e-9)
    ledger.json((*at, "pressure_rise_kPa"), pressure[-1] - pressure[0], abs=1e-9)
    strains = run["inflation_strain"]
    ledger.claim_json((*at, "inflation_strain"), "consistent")
    for name in ("warp", "fill"):
        if strains["body"][name] > strains["with_seam_and_ends"][name] + 1e-9:
            ledger.find(f"runs {k}: inflation_strain", f"{name} of the body exceeds the whole")
    _inflation(folder, ledger, k, run, test)
    _gas(folder, ledger, k, pressure, volume, test)
    row |= {"stiffness": stiffness, "knee": knee, "limit": limit, "wrinkles": wrinkles,
            "loads": loads, "sigma": sigma, "reached": reached, "strains": strains["body"],
            "rise": pressure[-1] - pressure[0], "d": d, "load": load}  # fmt: skip
    row["error"] = _error(ledger, at, run, d, load, curves)
    row["against"] = _against(ledger, at, run, d, load, curves, test)
    ledger.claim_json((*at, "iterations"), "echoed")
    _ended(folder, ledger, k, run, test, reached)
    return row


def _inflation(folder, ledger, k, run, test):
    """A thin tube: its fill carries twice the stress of its warp."""
    law = cards_of(folder, {run["card"]}).get(run["card"])
    body = run["inflation_strain"]["body"]
    if law is None or test["symmetry"] == "beam":
        return
    softer = float(law.modulus("E2", 0.0)) < 1.5 * float(law.modulus("E1", 0.0))
    if softer and not body["fill"] > body["warp"]:
        ledger.find(f"runs {k}: inflation_strain", "the warp strains more than the fill of a tube")


def _gas(folder, ledger, k, pressure, volume, test):
    """The enclosed mass stays: absolute pressure times volume is constant."""
    ledger_place = f"runs {k}: gas"
    if not np.isclose(pressure[0], test["pressure_kPa"], rtol=1e-6):
        ledger.find(ledger_place, f"begins at {pressure[0]:.6g} kPa, not {test['pressure_kPa']:g}")
    amount = (pressure + ATMOSPHERE) * volume
    constant = np.ptp(pressure) < 1e-9
    if not constant and np.ptp(amount) > 1e-6 * amount[0]:
        ledger.find(ledger_place, "absolute pressure times volume is not constant")
    radius, length = 0.5 * test["diameter_mm"], test["length_mm"]
    if length and not 0.8 < volume[0] / (np.pi * radius**2 * length) < 2.0:
        ledger.find(ledger_place, f"a volume of {volume[0]:.4g} mm3 is not that of the tube")


def _error(ledger, at, run, d, load, curves):
    error = run["error"]
    if curves is None:
        if error:
            ledger.claim_json((*at, "error"), "consistent")
        return error
    way = np.concatenate([x for x, _ in curves]) if curves else np.empty(0)
    read = np.concatenate([y for _, y in curves]) if curves else np.empty(0)
    inside = (way >= d[0]) & (way <= d[-1])
    largest = np.abs(read[inside]).max(initial=0.0)
    if not largest > 0:
        ledger.json((*at, "error"), None)
        return None
    off = np.interp(way[inside], d, load) - read[inside]
    rms = np.sqrt(np.mean(off**2))
    expected = {"rms": rms, "mean": off.mean(), "relative": rms / largest,
                "compared": int(inside.sum()), "beyond": int(np.sum(way > d[-1]))}  # fmt: skip
    ledger.json((*at, "error"), expected)
    return expected


def _against(ledger, at, run, d, load, curves, test):
    found = run.get("against_measured")
    if found is None or curves is None:
        if found is not None:
            ledger.claim_json((*at, "against_measured"), "consistent")
        return found
    every = [(d, load), *curves]
    reached = min(x[-1] for x, _ in every)
    places = {n: p for n, p in test["places_mm"].items() if p <= reached * (1 + 1e-9)}
    reference = max(places.values(), default=reached)
    own = (*at, "against_measured")
    ledger.json((*own, "reference_mm"), reference)
    quantities = []
    for x, y in every:
        secant = secant_of(x, y, reference)
        knee = knee_of(x, y, secant, test["slope_over_mm"])
        limit = limit_of(x, y)
        values = {"secant_stiffness_N_per_mm": secant, "secant_knee_N": knee and knee[1],
                  "limit_point_N": limit and limit[1]}  # fmt: skip
        values |= {f"load_at_{name.replace(' ', '_')}_N": np.interp(place, x, y)
                   for name, place in places.items()}  # fmt: skip
        quantities.append(values)
    names = [f"load_at_{name.replace(' ', '_')}_N" for name in test["places_mm"]]
    pairs = {}
    for name in ["secant_stiffness_N_per_mm", "secant_knee_N", "limit_point_N", *names]:
        values = [row.get(name) for row in quantities]
        pairs[name] = None
        if None not in values:
            pairs[name] = {"predicted": values[0], "measured": float(np.mean(values[1:]))}
        ledger.json((*own, name), pairs[name])
    return {"reference_mm": reference, **pairs}


def _ended(folder, ledger, k, run, test, reached):
    match = re.match(r"stopped at ([\d.]+) of ([\d.]+) mm: ", run["ended"])
    if match:
        if not np.isclose(float(match[1]), reached, rtol=1e-5) or float(match[2]) <= reached:
            ledger.find(f"runs {k}: ended", run["ended"])
    elif run["ended"] != "finished":
        ledger.find(f"runs {k}: ended", f"{run['ended']!r} beside numbers")
    claim_literal(ledger, run["ended"])
    deflection = _section(folder, run["test"]).get("deflection")
    if run["ended"] == "finished" and deflection and not np.isclose(deflection, reached):
        ledger.find(f"runs {k}: ended", f"finished at {reached:g} of {deflection:g} mm")


def _audit_curves(folder, ledger, curves):
    table = folder.tables["load_deflection.csv"]
    for (test, card, wall), own in curves.groupby(["test", "card", "wall"], dropna=False):
        name = f"load_deflection.csv: {test}, {card}, {wall}"
        d = own["deflection_mm"].to_numpy()
        if d[0] != 0 or (np.diff(d) <= 0).any():
            ledger.find(name, "deflections do not rise from 0")
        if np.ptp(np.diff(d)) > 1e-6 * d[-1] and own["load_N"].iloc[0] != 0:
            ledger.find(name, "the first load is not 0")
        share = own["wrinkled_share"].dropna()
        if len(share) and not share.between(0, 1).all():
            ledger.find(name, "a wrinkled share is not between 0 and 1")
    if folder.page_data is not None and any(run["predicted"] for run in folder.result["runs"]):
        _drawn_curves(folder, ledger, curves)
    for column in table:
        ledger.claim_column("load_deflection.csv", column, "consistent")


def _drawn_curves(folder, ledger, curves):
    """Compare the curves with what page.json draws of them."""
    drawn = []
    for section in (folder.page_data or {}).get("sections", ()):
        for part in section.get("parts", ()):
            for chart in part.get("charts") or ():
                drawn += [own for own in chart.get("series", ()) if own.get("y")]
    for (test, card, wall), own in curves.groupby(["test", "card", "wall"], dropna=False):
        d, load = own["deflection_mm"].to_numpy(), own["load_N"].to_numpy()
        named = [s for s in drawn if s.get("name") == str(card) and len(s["x"]) == len(d)]
        close = [s for s in named if np.allclose(s["x"], d, rtol=1e-4, atol=1e-6)
                 and np.allclose(np.array(s["y"], float), load, rtol=1e-4, atol=1e-3)]  # fmt: skip
        predicted = next((run["predicted"] for run in folder.result["runs"]
                          if (run["test"], run["card"]) == (test, str(card))
                          and run["wall"] == ("" if pd.isna(wall) else wall)), False)  # fmt: skip
        if predicted and drawn and not close:
            ledger.find(f"load_deflection.csv: {test}, {card}", "is not the curve that is drawn")


def _cells(point, reached):
    return f"none up to {reached:g} mm" if point is None else f"{point[1]:.0f} N, {point[0]:.0f} mm"


def _audit_table_of_runs(folder, ledger, runs, rows):
    """Compare runs.csv with what was recomputed."""
    table = folder.tables["runs.csv"]
    for k, row in enumerate(rows):
        run = row["run"]
        values = {"test": run["test"], "card": run["card"], "wall": run["wall"],
                  "ended": run["ended"], "marks": "; ".join(run["marks"]),
                  "seconds": run["seconds"]}  # fmt: skip
        if "loads" in row:
            values["stiffness_N_per_mm"] = row["stiffness"]
            for name, key in (("knee", "knee"), ("limit", "limit"), ("wrinkles", "wrinkles")):
                point = row[key] or (None, None)
                values |= {f"{name}_mm": point[0], f"{name}_N": point[1]}
            for name, load in row["loads"].items():
                values[f"load_at_{name.replace(' ', '_')}_N"] = load
            if any(v is not None for v in row["sigma"].values()):
                for name, sigma in row["sigma"].items():
                    values[f"load_at_{name.replace(' ', '_')}_sigma_N"] = sigma
            error = row["error"] or {}
            values |= {"inflation_warp_strain": row["strains"]["warp"],
                       "inflation_fill_strain": row["strains"]["fill"],
                       "pressure_rise_kPa": row["rise"], "rms_N": error.get("rms"),
                       "rms_relative": error.get("relative"), "mean_error_N": error.get("mean"),
                       "compared": error.get("compared"), "reached_mm": row["reached"]}  # fmt: skip
            for name, pair in (row["against"] or {}).items():
                if name != "reference_mm":
                    key = re.sub(r"_N(_per_mm)?$", "_over_measured", name)
                    values[key] = pair and pair["predicted"] / pair["measured"]
        for column in table:
            if column == "notes":
                ledger.claim_column("runs.csv", column, "consistent", rows=[k])
                continue
            value = values.get(column)
            if isinstance(value, str):
                ledger.column("runs.csv", column, [value], "consistent", rows=[k])
            else:
                number = np.nan if value is None else float(value)
                ledger.column("runs.csv", column, [number], rel=1e-6, abs=1e-9, rows=[k])


def _audit_measured(folder, ledger, readings):
    """Mean and sample standard deviation of the repetitions, linear between readings."""
    table = folder.data("measured.csv")
    for test in table["test"].unique():
        at = (table["test"] == test).to_numpy()
        curves = readings.get(test)
        if not curves:
            for column in table:
                ledger.claim_column("measured.csv", column, "consistent", rows=at)
            continue
        grid = np.linspace(min(x[0] for x, _ in curves), max(x[-1] for x, _ in curves), at.sum())
        loads = []
        for x, y in curves:
            mean = pd.Series(y).groupby(x).mean()
            loads.append(np.interp(grid, mean.index, mean, left=np.nan, right=np.nan))
        frame = pd.DataFrame(loads)
        ledger.column("measured.csv", "deflection_mm", grid, rows=at, abs=1e-9)
        ledger.column("measured.csv", "mean_N", frame.mean().to_numpy(), rows=at, abs=1e-9)
        ledger.column("measured.csv", "standard_deviation_N", frame.std(ddof=1).to_numpy(),
                      rows=at, abs=1e-9)  # fmt: skip
        ledger.column("measured.csv", "repetitions", frame.count().to_numpy(), rows=at)


def _band(value, rows, row, key, form):
    """Return the cell of a band from one wall to the other and by the card, or None: unknown."""
    run = row["run"]
    others = [own for own in rows if not own["run"]["predicted"]]
    same = [o for o in others if all(o["run"][k] == run[k] for k in ("test", "card"))]
    other = same[0] if same else None
    place = row["over"] if key == "stiffness" else row[key][0]
    off = 1.959964 * row["sigma_at"](place) / (row["over"] if key == "stiffness" else 1.0)
    ends = [value - off, value + off]
    if other is not None and other.get(key) is not None:
        end = other[key] if key == "stiffness" else other[key][1]
        ends += [end - off, end + off]
    low, high = f"{min(ends):{form}}", f"{max(ends):{form}}"
    return "\u2013" if low == high else f"{low} to {high}"


def _audit_page(folder, ledger, rows):
    result, ended = folder.result, [row for row in rows if "loads" in row]
    walls = bool(result["walls"])
    opening = []
    for row in rows:
        run = row["run"]
        if not run["predicted"]:
            continue
        if "loads" not in row:
            opening.append([run["test"], run["card"], *[None] * 8])
            continue
        stiffness = row["stiffness"]
        cells = [run["test"], run["card"], f"{stiffness:.3g}",
                 _band(stiffness, rows, row, "stiffness", ".3g")]  # fmt: skip
        for key in ("knee", "limit"):
            point = row[key]
            if point is None:
                cells += [_cells(None, row["reached"]), "\u2013", "\u2013"]
            else:
                cells += [f"{point[1]:.0f}", _band(point[1], rows, row, key, ".0f"),
                          f"{point[0]:.0f}"]  # fmt: skip
        opening.append(cells)
    if len({str(cells[7]) for cells in opening}) == 1 and opening[0][9] == "\u2013":
        reached = next(row["reached"] for row in ended)
        ledger.text(rf"Limit points: none up to {N} mm", [reached], source="page")
        opening = [[*cells[:7], *["\u2013"] * 3] for cells in opening]
    header = ["test", "card", "stiffness, N/mm", "its band"]
    for name in ("knee", "limit point"):
        header += [f"load at the {name}, N", "its band", "deflection there, mm"]
    ledger.table("Stiffness, knee and limit point", *_with_values(header, opening))
    places = list(dict.fromkeys(p for t in result["tests"].values() for p in t["places_mm"]))
    cells = _runs_cells(rows, places, walls)
    ledger.table("Runs", *_with_values(_runs_header(places, walls), cells))
    _audit_errors(ledger, ended, places, walls)
    tests = result["tests"].values()
    ledger.fact("tests", len(result["tests"]))
    ledger.fact("cards", len(result["cards"]))
    ledger.fact("seconds of all runs", sum(run["seconds"] for run in result["runs"]))
    for label, key in (("length, mm", "length_mm"), ("span, mm", None),
                       ("element size, mm", "element_size_mm"),
                       ("seam width, mm", "seam_width_mm")):  # fmt: skip
        values = {t["supports"]["span"] if key is None else t[key] for t in tests}
        if len(values) == 1 and any(own == label for _, _, own, _ in folder.page.facts):
            value = values.pop()
            ledger.fact(label, int(value) if float(value).is_integer() else value)
    notes = [(run, note) for run in result["runs"] for note in run.get("warnings", ())]
    head = ["test", "card", *(["wall"] if walls else []), "kind", "note"]
    if any(table.title == "Notes" for table in folder.page.tables):
        cells = []
        for run, note in notes:
            kind = next((n["kind"] for n in result["notes"] if n["note"] == note), "")
            cells.append([run["test"], run["card"], *([run["wall"]] if walls else []), kind, note])
        ledger.table("Notes", head, cells)
    over = {t["slope_over_mm"] for t in tests}
    if len(over) == 1:
        ledger.text(rf"[Tt]o {N} mm of deflection|slope over {N} mm",
                    lambda match: [next(iter(over)) if group else None for group in match.groups()],
                    digits=6, source="page", needed=False)  # fmt: skip
    ledger.text(r"between (\d+) and (\d+) % of each curve's load", [10, 35], source="page",
                needed=False)  # fmt: skip
    for row in ended:
        where = f"the beam at {row['reached']:g} mm, for ParaView"
        claim_literal(ledger, where)
    for test in result["tests"]:
        claim_literal(ledger, f"{test}: the bent beam")
        claim_literal(ledger, f"{test}: the gas while bending")
        claim_literal(ledger, f"{test}: ")
        claim_literal(ledger, test)
    usual = {"span": "supports.span", "length": "length_mm", "seam width": "seam_width_mm"}
    first = next(iter(tests))
    for name in usual:
        value = first["supports"]["span"] if name == "span" else first[usual[name]]
        ledger.text(rf"the usual {name} \({N} mm\)", [value], source="page", needed=False)
    ledger.text(rf"the usual diameter of the supports \({N} mm\)", [first["supports"]["diameter"]],
                source="page", needed=False)  # fmt: skip


def _with_values(header, rows):
    """Return header and rows without the columns that hold only dashes."""
    columns = [k for k in range(len(header)) if any(row[k] != "\u2013" for row in rows)]
    return [header[k] for k in columns], [[row[k] for k in columns] for row in rows]


def _runs_header(places, walls):
    return ["test", "card", *(["wall"] if walls else []), "stiffness, N/mm", "knee",
            "limit point", "wrinkles from", *(f"load at {p}, N" for p in places),
            "inflation strain, %", "pressure, kPa", "ended", "marked", "notes", "s"]  # fmt: skip


def _load_cell(load, sigma):
    if load is None:
        return "-"
    return f"{load:.0f}" if sigma is None else f"{load:.0f} \u00b1 {sigma:.2g}"


def _runs_cells(rows, places, walls):
    cells = []
    for row in rows:
        run = row["run"]
        head = [run["test"], run["card"], *([run["wall"]] if walls else [])]
        tail = [run["ended"], ", ".join(run["marks"]) or "\u2013", None, None]
        if "loads" in row:
            tail[2] = len(run["warnings"])
            tail[3] = round(run["seconds"], 1)
            tail[3] = int(tail[3]) if float(tail[3]).is_integer() else tail[3]
            loads = [_load_cell(row["loads"].get(p), row["sigma"].get(p)) for p in places]
            loads = ["\u2013" if row["loads"].get(p) is None else text
                     for p, text in zip(places, loads, strict=True)]  # fmt: skip
            strain = f"{100 * max(row['strains'].values()):.2g}"
            wrinkles = "\u2013" if row["wrinkles"] is None else f"{row['wrinkles'][0]:.0f} mm"
            middle = [f"{row['stiffness']:.2f}", _cells(row["knee"], row["reached"]),
                      _cells(row["limit"], row["reached"]), wrinkles, *loads, strain,
                      f"{row['rise']:+.2f}"]  # fmt: skip
        else:
            middle = ["\u2013"] * (6 + len(places))
        cells.append([*head, *middle, *tail])
    return cells


def _audit_errors(ledger, rows, places, walls):
    own = [row for row in rows if row["error"]]
    head = ["test", "card", *(["wall"] if walls else [])]

    def names(row):
        run = row["run"]
        return [run["test"], run["card"], *([run["wall"]] if walls else [])]

    if own:
        cells = []
        for row in own:
            error = row["error"]
            cells.append([*names(row), error["rms"], percent(error["relative"]),
                          f"{error['mean']:+.1f}", error["compared"], error["beyond"]])  # fmt: skip
        ledger.table("Against measured loads", [*head, "RMS, N", "of the largest load", "mean, N",
                                                "readings", "beyond"], cells)  # fmt: skip
    beside = [row for row in rows if row["against"]]
    if beside:
        header = list(head)
        labels = {"secant_stiffness_N_per_mm": "secant stiffness, N/mm",
                  "secant_knee_N": "secant knee, N", "limit_point_N": "limit point, N"}  # fmt: skip
        labels |= {f"load_at_{p.replace(' ', '_')}_N": f"load at {p}, N" for p in places}
        for label in labels.values():
            header += [label, "of it"]
        cells = []
        for row in beside:
            line_of = names(row)
            for key in labels:
                pair = row["against"].get(key)
                line_of += ["\u2013", "\u2013"] if pair is None else [
                    f"{pair['measured']:.4g}", f"{pair['predicted'] / pair['measured']:.3f}"
                ]  # fmt: skip
            cells.append(line_of)
        ledger.table("Measured quantities", header, cells)


def _audit_words(folder, ledger, rows):
    """Compare the sentence above the page and the table on the terminal."""
    result = folder.result
    finished = sum(run["ended"] == "finished" for run in result["runs"])
    noted = sum(bool(run.get("warnings")) for run in result["runs"])
    ledger.text(r"(\d+) of (\d+) runs finished", [finished, len(result["runs"])], needed=False)
    ledger.text(r"(\d+) ha(?:ve|s) notes", [noted], needed=False)
    worst = result["worst_relative_error"]
    if worst is not None:
        ledger.text(r"Largest error against measured values: ([\d.]+ %)", [percent(worst)],
                    needed=False)  # fmt: skip
    for row in rows:
        if "loads" not in row:
            continue
        run = row["run"]
        sentence = rf"{run['test']}, {run['card']}: stiffness {row['stiffness']:.3g}"
        for name, key in (("knee", "knee"), ("limit point", "limit")):
            point = row[key]
            sentence_of = (
                rf"{name} none up to {row['reached']:g} mm" if point is None
                else rf"{name} at {point[1]:.0f}{_in_words(row, rows, key)} N and {point[0]:.0f} mm"
            )  # fmt: skip
            if run["predicted"]:
                band = _band(row["stiffness"], rows, row, "stiffness", ".3g")
                band = "" if band == "\u2013" else rf" \({re.escape(band)}\)"
                _claim_pattern(ledger, rf"{re.escape(sentence)}{band} N/mm[^;]*?{sentence_of}")
        if folder.terminal:
            _terminal_row(ledger, row, result)
    _audit_charts(ledger, rows)
    _audit_spread(folder, ledger, rows)
    for text in (f"{run['test']} with {run['card']}" for run in result["runs"]):
        claim_literal(ledger, text)


def _in_words(row, rows, key):
    band = _band(row[key][1], rows, row, key, ".0f")
    return "" if band == "\u2013" else rf" \({re.escape(band)}\)"


def _audit_spread(folder, ledger, rows):
    """Check what is said of the spread by the cards, and of a braid's angle."""
    own = [row for row in rows if "loads" in row and np.nanmax(row["spread"]) > 0]
    shares = [float(np.nanmax(row["spread"]) / row["load"].max()) for row in own]
    if shares:
        ledger.text(
            r"off by up to ([\d.]+ %) of the largest \(one standard", [percent(max(shares))]
        )
    laws = cards_of(folder, set(folder.result["cards"]))
    counts = {min(4, len(law.directions)) for law in laws.values() if law.directions}

    def directions(match):
        return [int(match[1]) if int(match[1]) in counts else -1]

    ledger.text(r"(\d+) of its least certain directions", directions, needed=False)
    # A card with laws that the fit has drawn gives ten of them, whatever its directions.
    has_draws = any(law.drawn for law in laws.values())

    def draws(match):
        return [int(match[1]) if has_draws and match[1] == "10" else -1]

    ledger.text(r"(\d+) laws drawn", draws, needed=False)
    ledger.text(r"(\d+) % by (?:what )?the card", [95], needed=False)
    angles = [s["wall"]["angle"] for s in folder.project.get("cylinder", [])
              if isinstance(s.get("wall"), dict) and "angle" in s["wall"]]  # fmt: skip

    def braid(match):
        near = [a for a in angles if np.isclose(a, float(match[1]), atol=0.06)]
        return [near[0] if near else -1, np.degrees(np.arctan(np.sqrt(2)))]

    ledger.text(rf"braid's {N} degrees are near {N}", braid, digits=3, needed=False)
    changes = []

    def change(match):
        changes.append(float(match[3]))
        places = {p for t in folder.result["tests"].values() for p in t["places_mm"].values()}
        return [match[1], float(match[2]) if float(match[2]) in places else -1, None]

    words = rf"half a degree (less|more) changes the load at {N} mm by {N} %"
    ledger.text(words, change, digits=6, needed=False)
    _claim_pattern(ledger, words)
    if changes and np.prod(np.sign(changes[:2])) > 0:
        ledger.find("braid", f"less and more of the angle change the load alike: {changes[:2]}")


def _audit_charts(ledger, rows):
    """Compare descriptions of the charts of loads."""
    for test in dict.fromkeys(row["run"]["test"] for row in rows):
        own = [r for r in rows if r["run"]["test"] == test and "loads" in r]
        predicted = [row for row in own if row["run"]["predicted"]]
        if not predicted:
            continue
        largest = max(row["load"].max() for row in predicted)
        pattern = rf"{re.escape(test)}: load over deflection, up to {N} N"
        values, digits = [largest], [4]
        for row in predicted:
            if row["error"]:
                pattern += rf"; {re.escape(row['run']['card'])}: RMS error {N} N"
                values.append(row["error"]["rms"])
                digits.append(3)
        ledger.text(pattern, values, digits=digits, source="page", needed=False)


def _terminal_row(ledger, row, result):
    run = row["run"]
    head = r"\s+".join(re.escape(own) for own in (run["test"], run["card"], run["wall"]) if own)
    cells = [f"{row['stiffness']:.2f}", _cells(row["knee"], row["reached"]),
             _cells(row["limit"], row["reached"])]  # fmt: skip
    places = list(dict.fromkeys(p for t in result["tests"].values() for p in t["places_mm"]))
    for place in places:
        load = row["loads"].get(place)
        text = _load_cell(load, row["sigma"].get(place))
        cells.append(text if load is None else f"{text} N")
    if row["error"]:
        cells.append(f"{100 * row['error']['relative']:.1f} %")
    pattern = r"\s+".join([head, *map(re.escape, cells)])
    if not _claim_pattern(ledger, pattern, "terminal"):
        ledger.find("terminal", f"has no line of {run['test']}, {run['card']} as {cells}")
    heads = r"\s+".join(re.escape(place) for place in places)
    _claim_pattern(ledger, heads, "terminal")


def _claim_pattern(ledger, pattern, source=None):
    found = False
    for text in ledger.texts:
        if source is None or text.source == source:
            for match in re.finditer(pattern, text.text.replace("\u00a0", " ")):
                text.claim(match.span(), "consistent")
                found = True
    return found


def _audit_solver_notes(ledger):
    """Remarks of the solver: small, and shares of a whole."""

    def small(match):
        if not 0 <= float(match[1]) < 5:
            ledger.find(match[0], "is no small penetration")
        return [None]

    ledger.text(rf"rigid bodies penetrate {N} mm at most", small, needed=False)
    _claim_pattern(ledger, rf"rigid bodies penetrate {N} mm at most")

    def share(match):
        if not 0 <= float(match[2]) <= 100 or not 0 < float(match[1]) < 1:
            ledger.find(match[0], "is no share")
        return [None, None]

    words = rf"stiffness is left to wrinkles \({N} of the taut fabric's\) carries {N} %"
    line(ledger, words, share, needed=False)
    _claim_pattern(ledger, words)


COMMANDS = {"predict": audit_bend}
