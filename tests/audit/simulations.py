"""Audit `simulate test`, `uniaxial`, `bubble` and `deck`, and curves of strips."""

import itertools
import re

import numpy as np
import pandas as pd
from scipy.interpolate import CubicSpline

from .common import N, audit_notes, beyond_range
from .laws import DIRECTION, MODULI
from .straight_strips import (
    integral,
    lengths,
    mean_curve,
    strip_load,
    strip_points,
    strip_tests,
)


def cards_of(folder, names):
    """Return laws by the name that result.json gives them, of cards of the project and of files."""
    from .laws import Law

    project, found = folder.project, {}
    unit = project.get("units", {}).get("modulus", "GPa")
    fabric = project.get("fabric", {})
    for card in project.get("card", []):
        if card.get("name") in names and "beta" in card:
            found[card["name"]] = Law(
                card.get("form", "cubic"),
                card["beta"],
                unit=card.get("unit", unit),
                nu12=card.get("nu12", project.get("law", {}).get("nu12", 0.24)),
                thickness=card.get("thickness", fabric.get("thickness")),
                ends={name: np.inf for name in MODULI},
            )
            found[card["name"]].directions = []
            found[card["name"]].drawn = []
    places = [folder.base.glob(f"{depth}*.toml") for depth in ("", "*/", "*/*/")]
    for path in sorted({*itertools.chain(*places), *folder.path.glob("*/material.toml")}):
        law = _card_file(path)
        if law is not None:
            for name in (law.name, path.stem, path.parent.name, path.name):
                if name in names and name not in found:
                    found[name] = law
    return found


def _card_file(path):
    import tomllib

    from .laws import Law

    try:
        card = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError):
        return None
    if "beta" not in card or "thickness_mm" not in card:
        return None
    law = Law.of_card(card)
    law.name = card.get("name", "")
    law.directions = card.get("certainty", {}).get("directions", [])
    law.drawn = card.get("certainty", {}).get("laws", {}).get("beta", [])
    law.thickness_change = card.get("thickness_change", "constant")
    return law


def audit_strip_loads(folder, ledger, cards):
    """Recompute the loads of straight strips in every *loads.csv; check those of bias strips.

    cards : laws by name; None: of the folders beside the table (`compare`).
    """
    for file, table in folder.tables.items():
        if not file.endswith("loads.csv") or "direction" not in table:
            continue
        test = file.removesuffix("loads.csv").rstrip("-")
        sections = dict(strip_tests(folder.project))
        run = (folder.result or {}).get("tests")
        if isinstance(run, dict):
            sections = {name: own for name, own in sections.items() if name in run}
        section = sections.get(test) or next(
            (own for name, own in sections.items() if re.sub(r"\W+", "-", name) == test),
            next(iter(sections.values()), {}) if not test else {},
        )
        numbers = folder.data(file)
        laws = cards if cards is not None else cards_of(folder, set(numbers["card"]))
        for (card, direction), own in numbers.groupby(["card", "direction"], sort=False):
            at = np.flatnonzero((numbers["card"] == card) & (numbers["direction"] == direction))
            gauge, final, width = lengths(section, direction)
            count = len(own)
            u, load = own["elongation_mm"].to_numpy(), own["load_N"].to_numpy()
            if gauge is not None and final is not None and own["elongation_mm"].iloc[-1] > 0:
                equal = (final - gauge) * np.arange(1, count + 1) / count
                steps = np.isclose(u[-1], final - gauge, rtol=1e-9)
                if not steps or not np.allclose(u, equal, rtol=1e-9):
                    ledger.find(f"{file}: {card}, {direction}", "elongations are no equal steps")
                ledger.claim_column(file, "elongation_mm", "recomputed", rows=at)
            else:
                ledger.claim_column(file, "elongation_mm", "consistent", rows=at)
            if (np.diff(u) <= 0).any():
                ledger.find(f"{file}: {card}, {direction}", "the elongation does not rise")
            law = laws.get(card)
            if law is None or gauge is None or direction == "bias":
                ledger.claim_column(file, "load_N", "consistent", rows=at)
                if (np.diff(load) <= 0).any() and direction == "bias":
                    ledger.find(f"{file}: {card}, {direction}", "the load does not rise")
                if law is not None and gauge is not None:
                    _between_straight(ledger, f"{file}: {card}", law, u / gauge, load, width)
                continue
            if getattr(law, "thickness_change", "constant") != "constant":
                ledger.claim_column(file, "load_N", "consistent", rows=at)
                continue
            expected = [strip_load(law, direction, np.log1p(e / gauge), width) for e in u]
            ledger.column(file, "load_N", expected, rel=2e-5, rows=at)


def _between_straight(ledger, place, law, stretch, load, width):
    """A bias strip carries more than its shear alone and less than the stiffer yarn would."""
    strain = np.log1p(stretch)
    most = max(integral(law, name, strain[-1]) for name in ("E1", "E2")) * width * law.thickness
    if not 0 < load[-1] < most:
        ledger.find(f"{place}, bias", f"{load[-1]:.4g} N is no load of such a strip")


def _audit_error(ledger, place, numbers, error, largest):
    """The largest RMS error of a direction over the largest load that is compared with it."""
    ledger.claim_json(place, "consistent")
    rms = [own.get("rms_N") or 0.0 for own in numbers.get("directions", {}).values()]
    if (
        largest
        and rms
        and not max(rms) / max(largest) / 1.05
        <= error
        <= max(rms) / min(0.5 * load for load in largest)
    ):
        ledger.find(f"result.json: {place}", f"{error} is no error of {rms} N to {largest} N")


def audit_simulate(folder, ledger):
    result = folder.result
    ledger.claim_json("command", "echoed")
    if result["command"] not in ("simulate test", "simulate uniaxial", "simulate bubble"):
        ledger.find("command", result["command"])
    names = {name for test in result["tests"].values() for name in test["cards"]}
    laws = cards_of(folder, names)
    points = strip_points(folder)
    sections = dict(strip_tests(folder.project))
    for test, found in result["tests"].items():
        several = len(result["tests"]) > 1
        for number, (card, numbers) in enumerate(found["cards"].items(), start=1):
            at = ("tests", test, "cards", card)
            if "directions" in numbers:
                _strip_card(folder, ledger, at, numbers, test, card, several, points, sections)
            elif "apex_mm" in numbers:
                _bubble_card(folder, ledger, at, numbers, test, number, len(found["cards"]),
                             several)  # fmt: skip
        for card, error in found["errors"].items():
            _audit_error(ledger, ("tests", test, "errors", card), found["cards"][card], error,
                         [own["load"].max() for (name, _), own in points.items() if name == test]
                         )  # fmt: skip
        for key in set(found) - {"cards", "errors"}:
            only = next(iter(found["cards"].values()))
            if key in only:
                ledger.json(("tests", test, key), only[key], "consistent")
    first = next(iter(result["tests"].values()))
    for key in set(result) & set(first):
        ledger.json(key, first[key], "consistent")
    audit_strip_loads(folder, ledger, laws)
    ends = {}
    for law in laws.values():
        if len(laws) == 1:
            ends = {DIRECTION[name]: law.ends[name] for name in MODULI}

    def reached(text, direction):
        for test, found in result["tests"].items():
            for card, numbers in found["cards"].items():
                own = numbers.get("directions", {"": numbers})
                for part, values in own.items():
                    name = f"{test}, {card}" + (f", {part}" if part else "")
                    if text.startswith(f"{name}:") or text.removeprefix("note: ").startswith(
                        f"{name}:"
                    ):
                        return values["strain_reached"][direction]
        return None

    beyond_range(ledger, ends, reached)
    audit_notes(folder, ledger)


def _strip_card(folder, ledger, at, numbers, test, card, several, points, sections):
    prefix = f"{re.sub(r'[^A-Za-z0-9]+', '-', test)}-" if several else ""
    file = f"{prefix}loads.csv"
    if file not in folder.tables:
        ledger.find(file, "is missing")
        return
    table = folder.data(file)
    errors, said, values = [], [], []
    for direction, own in numbers["directions"].items():
        if "failed" in own:
            said.append(f"{direction} failed")
            errors.append(None)
            continue
        place = (*at, "directions", direction)
        rows = table[(table["card"].astype(str) == card) & (table["direction"] == direction)]
        u, load = rows["elongation_mm"].to_numpy(), rows["load_N"].to_numpy()
        ledger.json((*place, "end_load_N"), load[-1], "consistent")
        shown = own["shown_to_mm"]
        ledger.claim_json((*place, "shown_to_mm"), "consistent")
        inside = u <= shown * (1 + 1e-9)
        if not np.isclose(u[inside][-1] if inside.any() else 0.0, shown):
            ledger.find(f"{place}", "shown_to_mm is no elongation of the curve")
        ledger.claim_json((*place, "strain_reached"), "consistent")
        gauge, _, _ = lengths(sections.get(test, {}), direction)
        if gauge is not None and direction in ("warp", "fill"):
            strain = float(np.log1p(u[-1] / gauge))
            ledger.json((*place, "strain_reached", direction), strain, rel=2e-3)
        measured = points.get((test, direction))
        rms = own["rms_N"]
        if measured is not None and rms is not None:
            whole = _all_points(folder, test, direction)
            if sections[test].get("match", "polynomial") == "points":
                elongation, load_there = whole.iloc[:, -2], whole.iloc[:, -1]
                reach = elongation.max() if not np.isfinite(shown) else shown
                near = (elongation <= reach * (1 + 1e-9)).to_numpy()
                drawn = CubicSpline([0.0, *u], [0.0, *load])(elongation[near])
                expected = float(np.sqrt(np.mean((drawn - load_there[near]) ** 2)))
            else:
                order = sections[test]["data"].get("order", 4)
                curve = mean_curve(whole, order)
                expected = float(np.sqrt(np.mean((load[inside] - curve(u[inside])) ** 2)))
            ledger.json((*place, "rms_N"), expected, rel=1e-4, abs=1e-3)
        else:
            ledger.claim_json((*place, "rms_N"), "consistent")
        errors.append(rms if inside.all() else None)
        if rms is None:
            said.append(rf"{direction} {N} N at the end")
            values.append(load[-1])
        else:
            said.append(rf"{direction} {N} N to {N} mm")
            values += [rms, f"{shown:.3g}"]
    known = [error for error in errors if error is not None]
    total = sum(known) if len(known) == len(errors) else None
    ledger.json((*at, "e_uniaxial_N"), total)
    pattern = rf"{re.escape(card)}: (?:RMS )?{', '.join(said)}"
    if total is not None:
        pattern += rf"; sum {N} N"
        values.append(total)

    def of_test(match):
        named = f"{test}: " in match.string or not several
        return values if named else None

    if folder.terminal:
        ledger.text(pattern, of_test, source="terminal")


def _all_points(folder, test, direction):
    section = dict(strip_tests(folder.project))[test]
    tables = [pd.read_csv(folder.project_path.parent / f, comment="#")
              for f in section["data"]["files"]]  # fmt: skip
    table = pd.concat(tables).rename(columns=lambda column: column.partition(" ")[0])
    return table[table["direction"] == direction]


def _bubble_card(folder, ledger, at, numbers, test, number, count, several):
    """Compare apexes with the displacements of the nodes; check supports and the rise."""
    suffix = "" if count == 1 else f"-{number}"
    prefix = f"{re.sub(r'[^A-Za-z0-9]+', '-', test)}-" if several else ""
    file = f"{prefix}displacement{suffix}.csv"
    section = next((own for own in folder.project.get("bubble", [])
                    if own.get("name", "bubble") == test or not several), {})  # fmt: skip
    radius = section.get("radius")
    scale = {"kPa": 1.0, "MPa": 1e3, "bar": 100.0, "Pa": 1e-3}
    unit = scale[folder.project.get("units", {}).get("pressure", "kPa")]
    if "pressures" in section:
        expected = [unit * p for p in section["pressures"]]
        ledger.json((*at, "pressure_kPa"), expected, "echoed")
    else:
        ledger.claim_json((*at, "pressure_kPa"), "consistent")
    table = folder.data(file)
    heights = []
    count = len(numbers["pressure_kPa"])
    ledger.text(r"heights at (\d+) pressures", [count], source="page", needed=False)
    size = len(table) // len(numbers["pressure_kPa"])
    for k, pressure in enumerate(numbers["pressure_kPa"]):
        own = table.iloc[k * size : (k + 1) * size]
        if not np.allclose(own["pressure_kPa"], pressure, rtol=1e-6):
            ledger.find(f"{file}: pressure_kPa", f"is not {pressure:g}")
        for axis in ("x_mm", "y_mm"):
            if not np.array_equal(own[axis], table[axis].iloc[:size]):
                ledger.find(f"{file}: {axis}", f"differs at {pressure:g} kPa")
        centre = np.hypot(own["x_mm"], own["y_mm"]).idxmin()
        heights.append(own.loc[centre, "dz_mm"])
        rim = own[np.hypot(own["x_mm"], own["y_mm"]) > own["x_mm"].max() * (1 - 1e-6)]
        if np.abs(rim[["dx_mm", "dy_mm", "dz_mm"]]).to_numpy().max() > 1e-6:
            ledger.find(file, "the rim moves")
        for axis, displacement in (("x_mm", "dx_mm"), ("y_mm", "dy_mm")):
            on_axis = own[np.abs(own[axis]) < 1e-9]
            if section.get("symmetry") == "quarter" and on_axis[displacement].abs().max() > 1e-6:
                ledger.find(file, f"{displacement} is not 0 on the axis of symmetry")
    ledger.json((*at, "apex_mm"), heights, rel=1e-6)
    if (np.diff(heights) <= 0).any():
        ledger.find(file, "the apex does not rise with the pressure")
    for column in table:
        ledger.claim_column(file, column, "consistent")
    ledger.column(file, "node", np.tile(np.arange(len(own)), len(heights)))
    ledger.claim_json((*at, "strain_reached"), "consistent")
    if radius:
        # A spherical cap: log strain about (2/3) (h/R)^2 at the apex.
        cap = 2.0 / 3.0 * (heights[-1] / radius) ** 2
        for direction in ("warp", "fill"):
            strain = numbers["strain_reached"][direction]
            if not 0.4 * cap < strain < 2.5 * cap:
                ledger.find(f"{at}.strain_reached", f"{direction} {strain:.3g} at a rise that has "
                            f"about {cap:.3g}")  # fmt: skip
    for pressure, height in zip(numbers["pressure_kPa"], heights, strict=True):

        def of_this(match, pressure=pressure, height=height):
            near = abs(float(match[1]) - pressure) < 0.06 and abs(float(match[2]) - height) < 6e-4
            return [None, None] if near else None

        ledger.text(rf"{N} kPa\s+apex\s+{N} mm", of_this, source="terminal",
                    needed=bool(folder.terminal))  # fmt: skip
        for text in ledger.texts:
            for match in re.finditer(rf"{N} kPa\s+apex\s+{N} mm", text.text):
                if of_this(match):
                    text.claim(match.span(), "consistent")


def audit_simulated_decks(folder, ledger):
    """Recompute the errors of what is compared of decks, from the files with both."""
    ledger.claim_json("command", "echoed")
    several = len(folder.result["tests"]) > 1
    for test, found in folder.result["tests"].items():
        prefix = f"{re.sub(r'[^A-Za-z0-9]+', '-', test)}-" if several else ""
        file = f"{prefix}compared.csv"
        table = folder.data(file)
        ledger.column(file, "difference", table["modelled"] - table["measured"], rel=1e-6, abs=1e-8)
        for column in ("x", "y", "z", "time", "measured", "modelled"):
            if column in table:
                ledger.claim_column(file, column, "consistent")
        for card, rows in table.groupby(table["card"].astype(str)):
            at = ("tests", test, "cards", card)
            relative = {}
            for part, of_part in rows.groupby("part"):
                rms = float(np.sqrt(np.mean(of_part["difference"] ** 2)))
                relative[part] = rms / of_part["measured"].abs().max()
                ledger.json((*at, part), {"rms": rms, "relative": relative[part]}, rel=1e-5)
                ledger.text(
                    rf"{re.escape(card)}: .*RMS error of {re.escape(part)} {N} \({N} % of the",
                    [rms, 100 * relative[part]],
                    digits=[3, 2],
                    source="terminal",
                    needed=bool(folder.terminal),
                )
            ledger.claim_json((*at, "parameters"), "echoed")
            for name, value in found["cards"][card]["parameters"].items():
                ledger.text(
                    rf"{re.escape(card)}: .*\b{name} {N}",
                    [value],
                    source="terminal",
                    needed=bool(folder.terminal),
                )
            ledger.json(("tests", test, "errors", card), max(relative.values()), rel=1e-5)
            for words in (f"{re.escape(card)} is off by {N} %", f"errors of at most {N} %"):
                ledger.text(words, [100 * max(relative.values())], digits=2, needed=False)
        if not several:
            ledger.json("cards", found["cards"], "consistent")
    audit_notes(folder, ledger)


COMMANDS = {
    "simulate deck": audit_simulated_decks,
    "simulate test": audit_simulate,
    "simulate uniaxial": audit_simulate,
    "simulate bubble": audit_simulate,
}
