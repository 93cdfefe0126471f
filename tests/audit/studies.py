"""Audit profile, bootstrap, plan, validate, compare, study mesh and study nu12."""

import json
import re

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq
from scipy.stats import chi2

from .common import (
    MISSING,
    N,
    along,
    audit_notes,
    beyond_range,
    claim_literal,
    echo,
    fit_folder,
    line,
    notes_of_fit,
    percent,
    rows_of_title,
)
from .laws import BLOCKS, DIRECTION, MODULI, MPA, POLYNOMIALS
from .simulations import audit_strip_loads
from .straight_strips import strip_load, strip_of, strip_points

LEVEL = 0.95
THRESHOLD = chi2.ppf(LEVEL, 1)


def end_of_profile(values, ratios):
    """Return where -2 log L passes the threshold: a monotone curve through its roots.

    values : (n,) MPa from the best on. ratios : (n,) -2 log L there.
    """
    roots = np.maximum.accumulate(np.sqrt(np.maximum(ratios, 0.0)))
    distance = np.abs(np.array(values) - values[0])
    kept = np.concatenate([[True], np.diff(roots) > 0])
    reach = PchipInterpolator(roots[kept], distance[kept])(np.sqrt(THRESHOLD))
    return values[0] + np.sign(values[-1] - values[0]) * float(reach)


def audit_profile(folder, ledger):
    result = folder.result
    echo(folder, ledger, "profile")
    ledger.json("level", LEVEL)
    ledger.json("threshold", THRESHOLD)
    card, fit = folder.other_card(result["card"]), fit_folder(folder)
    same = fit is not None and fit.result is not None and _tests(fit) == set(result["tests"])
    columns = {"modulus": [], "strain": [], "MPa": [], "minus_2_log_L": [], "by_sigma": []}
    for k, profile in enumerate(result["profiles"]):
        at = ("profiles", k)
        name, strain = profile["modulus"], profile["strain"]
        values, ratios = np.array(profile["curve_MPa"]), np.array(profile["curve_minus_2_log_L"])
        best = profile["MPa"]
        ledger.claim_json((*at, "strain"), "echoed")
        if not 0 <= strain <= card.ends[name] * (1 + 1e-9):
            ledger.find(f"profiles {k}", "the strain is beyond the card's range")
        if same:
            ledger.json((*at, "MPa"), float(card.modulus(name, strain)), rel=1e-6)
            table = fit.data("moduli.csv")
            for key, column in (("fit_lower_MPa", "lower_MPa"), ("fit_upper_MPa", "upper_MPa")):
                ledger.json((*at, key), along(table, name, column, strain), "consistent", rel=2e-3)
            sigma = along(table, name, "sigma_relative", strain) * best
            ledger.json((*at, "fit_sigma_MPa"), sigma, "consistent", rel=2e-3)
        else:
            ledger.claim_json((*at, "MPa"), "consistent")
            for key in ("fit_lower_MPa", "fit_upper_MPa", "fit_sigma_MPa"):
                ledger.claim_json((*at, key), "consistent")
        if not profile["fit_lower_MPa"] <= best * (1 + 1e-6):
            ledger.find(f"profiles {k}", "the fit's band lies above its value")
        if not profile["fit_upper_MPa"] >= best * (1 - 1e-6):
            ledger.find(f"profiles {k}", "the fit's band lies below its value")
        _audit_curve(ledger, at, profile, values, ratios)
        columns["modulus"] += [name] * len(values)
        columns["strain"] += [strain] * len(values)
        columns["MPa"] += values.tolist()
        columns["minus_2_log_L"] += ratios.tolist()
        columns["by_sigma"] += (((values - best) / profile["fit_sigma_MPa"]) ** 2).tolist()
        _audit_scale(ledger, profile, values, ratios)
        _profile_words(ledger, profile)
    for column, values in columns.items():
        ledger.column("profile.csv", column, values, rel=2e-8, abs=1e-12)
    least = 1 + sum(profile["analyses"] for profile in result["profiles"])
    if result["analyses"] < least:
        ledger.find("analyses", f"are {result['analyses']}; profiles and optimum took {least}")
    ledger.claim_json("analyses", "consistent")
    ledger.text(r"the threshold (1\.96) of the", [np.sqrt(THRESHOLD)], digits=3, needed=False)
    ledger.text(r"(?:-2 log L|1 sigma)|threshold of (\d+) %", [95], needed=False)
    audit_notes(folder, ledger)


def _tests(fit):
    return set(fit.result.get("tests", {}))


def _audit_curve(ledger, at, profile, values, ratios):
    best = profile["MPa"]
    place = f"profile of {profile['modulus']} at {profile['strain']:g}"
    if not (np.diff(values) > 0).all():
        ledger.find(place, "the moduli do not rise")
    middle = int(np.argmin(np.abs(values - best)))
    if abs(values[middle] / best - 1) > 1e-9 or ratios[middle] != 0:
        ledger.find(place, "the curve does not touch zero at the best")
    if ratios.min() < -0.5:
        ledger.find(place, "another value fits better than the best")
    ledger.claim_json((*at, "curve_MPa"), "consistent")
    ledger.claim_json((*at, "curve_minus_2_log_L"), "consistent")
    if len(values) - 1 > profile["analyses"]:
        ledger.find(place, f"{profile['analyses']} analyses for {len(values) - 1} values")
    ledger.claim_json((*at, "analyses"), "consistent")
    sides = {"lower": (values[middle::-1], ratios[middle::-1], "below"),
             "upper": (values[middle:], ratios[middle:], "above")}  # fmt: skip
    ends = {}
    for key, (side, own, word) in sides.items():
        closed = own[-1] >= THRESHOLD
        if closed != (word not in profile["not_closed"]):
            ledger.find(place, f"not_closed does not fit the curve {word}")
        ends[key] = end_of_profile(side, own) if closed else None
        ledger.json((*at, f"{key}_MPa"), ends[key])
    asymmetry = None
    if None not in ends.values():
        asymmetry = (ends["upper"] - best) / (best - ends["lower"])
    ledger.json((*at, "asymmetry"), asymmetry)


def _audit_scale(ledger, profile, values, ratios):
    """-2 log L is ((value - best)/sigma)^2 near the best, where no bound cuts the fit's band."""
    best, sigma = profile["MPa"], profile["fit_sigma_MPa"]
    band = np.array([best - profile["fit_lower_MPa"], profile["fit_upper_MPa"] - best])
    near = ((values - best) / sigma) ** 2
    asked = (near > 0.05) & (near < 1.5)
    if asked.any() and np.allclose(band, 1.96 * sigma, rtol=0.1):
        share = float(np.median(ratios[asked] / near[asked]))
        if not 0.6 < share < 1.67:
            place = f"profile of {profile['modulus']} at {profile['strain']:g}"
            ledger.find(place, f"-2 log L is {share:.3g} times what 1 sigma gives near the best")


def _profile_words(ledger, profile):
    name = rf"{profile['modulus']} at {N} % of strain"
    strain, best = 100 * profile["strain"], profile["MPa"]
    curve = profile["curve_MPa"]
    ends = []
    for key, word, last in (("lower", "below", curve[0]), ("upper", "above", curve[-1])):
        reason = profile["not_closed"].get(word)
        value = profile[f"{key}_MPa"] if reason is None else last
        before = {None: "", "bound": "the bound, "}.get(reason, "beyond ")
        ends.append((before, value, "," if reason == "bound" else ""))
    (low, lower, comma), (high, upper, stop) = ends
    asymmetry = profile["asymmetry"]
    skew = ""
    values = [strain, best, lower, upper, profile["fit_lower_MPa"], profile["fit_upper_MPa"]]
    digits = [4] * 6
    if asymmetry is not None and not 1 / 1.3 <= asymmetry <= 1.3:
        skew = rf"; asymmetric: {N} below, {N} above"
        values += [best - lower, upper - best]
        digits += [3, 3]
    pattern = (
        rf"{name}: {N} MPa, 95 % from {low}{N}{comma} to {high}{N}{stop} "
        rf"\(the fit's band {N} to {N}\){skew}"
    )

    def numbers(match):
        return values if np.isclose(float(match[1]), strain, rtol=1e-3, atol=1e-12) else None

    line(ledger, pattern, numbers, digits=digits)
    last = {"below": (curve[0], profile["curve_minus_2_log_L"][0]),
            "above": (curve[-1], profile["curve_minus_2_log_L"][-1])}  # fmt: skip
    for word in profile["not_closed"]:
        value, ratio = last[word]

        def not_closed(match, value=value, ratio=ratio):
            if match[1] and not np.isclose(float(match[1]), strain, rtol=1e-3, atol=1e-12):
                return None
            if abs(float(match[3]) - ratio) > 0.006 + 0.06 * abs(ratio):
                ledger.find(match[0], f"-2 log L is {ratio:.4g}")
            return [strain, value, None, THRESHOLD]

        line(ledger, rf"(?:{name}: )?not closed {word}: [^;]*?{N} MPa[^;]*; -2 log L is {N} of {N}",
             not_closed, digits=[4, 4, 2, 3])  # fmt: skip
    ledger.text(rf"^{name}$", [strain], source="result.json", needed=False)
    for text in ledger.texts:
        match = re.fullmatch(rf"(?:of )?{name}", text.text) or re.fullmatch(name, text.text)
        if match and np.isclose(float(match[1]), strain, rtol=1e-3, atol=1e-12):
            text.claim((0, len(text.text)), "consistent")
    ledger.text(
        rf"{name}: best {N} MPa, lower end (?:{N} MPa|not closed), "
        rf"upper end (?:{N} MPa|not closed)",
        lambda match: (
            [strain, best, profile["lower_MPa"], profile["upper_MPa"]]
            if np.isclose(float(match[1]), strain, rtol=1e-3, atol=1e-12)
            else None
        ),
        source="page",
        needed=False,
    )


def scale_of(project, name):
    """Return the geometric mean (MPa) of the bounds of a modulus in the project; None without."""
    bounds = project.get("law", {}).get("bounds", {}).get(name)
    unit = MPA[project.get("units", {}).get("modulus", "GPa")]
    return None if bounds is None else unit * float(np.sqrt(bounds[0] * bounds[1]))


def moduli_of_samples(card, project, unknowns, strains):
    """Return moduli (MPa), (samples, strains) by name, of the optimiser's unknowns.

    They are the moduli at the Chebyshev points of the law's strain range, over the geometric mean
    of their bounds. None for another form, or bounds of coefficients.
    """
    scales = {name: scale_of(project, name) for name in MODULI}
    ranges = project.get("law", {}).get("strain_range")
    if card.form not in POLYNOMIALS or None in scales.values() or ranges is None:
        return None
    count = POLYNOMIALS.index(card.form) + 1
    share = 0.5 * (1 - np.cos((2 * np.arange(count) + 1) * np.pi / (2 * count)))
    moduli = {}
    for block, name in enumerate(BLOCKS):
        end = ranges[("warp", "fill", "shear").index(DIRECTION[name])]
        values = unknowns[:, block * count : (block + 1) * count] * scales[name]
        fitted = [np.polyfit(end * share, own, count - 1) for own in values]
        moduli[name] = np.array([np.polyval(own, strains[name]) for own in fitted])
    return moduli


def audit_bootstrap(folder, ledger):
    result = folder.result
    echo(folder, ledger, "bootstrap")
    ledger.json("level", LEVEL)
    ledger.text(r"\((95) %\)", [95], needed=False)
    samples = json.loads((folder.path / "bootstrap-samples.json").read_text())["samples"]
    samples = samples[: result["samples"]]
    ledger.json("samples", len(samples), "consistent")
    stopped = sum(sample["status"] != "converged" for sample in samples)
    ledger.json("unfinished", stopped, "consistent")
    if result["analyses"] < sum(sample["analyses"] for sample in samples) + 1:
        ledger.find("analyses", "are fewer than those of the samples")
    ledger.claim_json("analyses", "consistent")
    groups = result["groups"]
    for sample in samples:
        for counts, units in zip(sample["counts"], groups.values(), strict=True):
            if len(counts) != len(units) or sum(counts) != len(units):
                ledger.find(
                    f"sample {sample['number']}", "does not draw as many units as there are"
                )
    card = folder.other_card(result["card"])
    table = folder.data("bootstrap.csv")
    strains = {name: table.loc[table["modulus"] == name, "strain"].to_numpy() for name in MODULI}
    unknowns = np.array([sample["unknowns"] for sample in samples])
    moduli = moduli_of_samples(card, folder.project, unknowns, strains)
    for name in MODULI:
        at = (table["modulus"] == name).to_numpy()
        end = result["up_to_strain"][DIRECTION[name]]
        ledger.column("bootstrap.csv", "strain", np.linspace(0, end, at.sum()), rows=at)
        own = table[at]
        best = own["MPa"].to_numpy()
        if moduli is None:
            for column in ("MPa", "lower_MPa", "upper_MPa", "median_MPa", "sigma_relative"):
                ledger.claim_column("bootstrap.csv", column, "consistent", rows=at)
        else:
            values = moduli[name]
            ends = np.quantile(values, [(1 - LEVEL) / 2, (1 + LEVEL) / 2], axis=0)
            expected = {
                "lower_MPa": ends[0],
                "upper_MPa": ends[1],
                "median_MPa": np.median(values, axis=0),
                "sigma_relative": values.std(axis=0, ddof=1) / best,
            }
            for column, numbers in expected.items():
                ledger.column("bootstrap.csv", column, numbers, rows=at, rel=1e-6, abs=1e-12)
            ledger.claim_column("bootstrap.csv", "MPa", "consistent", rows=at)
        fit = fit_folder(folder)
        for column in ("fit_MPa", "fit_lower_MPa", "fit_upper_MPa", "fit_sigma_relative"):
            if fit is not None and fit.result and _tests(fit) == set(result["tests"]):
                expected = along(fit.data("moduli.csv"), name, column.removeprefix("fit_"),
                                 strains[name])  # fmt: skip
                ledger.column("bootstrap.csv", column, expected, "consistent", rel=5e-3, rows=at)
            else:
                ledger.claim_column("bootstrap.csv", column, "consistent", rows=at)
        for low, high in (("lower_MPa", "upper_MPa"), ("fit_lower_MPa", "fit_upper_MPa")):
            if (own[low] > own[high] * (1 + 1e-9)).any():
                ledger.find(f"bootstrap.csv: {name}", f"{low} is above {high}")
        outside = (own["median_MPa"] < own["lower_MPa"]) | (own["median_MPa"] > own["upper_MPa"])
        if outside.any():
            ledger.find(f"bootstrap.csv: {name}", "the median is outside the percentiles")
        spread = float(np.sqrt(np.mean(own["sigma_relative"] ** 2)))
        of_fit = result["sigma_relative_of_fit"][name]
        if of_fit is None or of_fit >= 1:
            spread = None  # the data do not determine the modulus
        ledger.json(("sigma_relative", name), spread, abs=1e-12)
        _sigma_of_fit(folder, ledger, name, fit, card)
        ledger.claim_json(("up_to_strain", DIRECTION[name]), "consistent")
    _bootstrap_unknowns(folder, ledger, card, unknowns)
    drawn = ", ".join(rf"{re.escape(name)} \({len(units)}\)" for name, units in groups.items())
    expected = [result["samples"], *(None for _ in groups), result["analyses"]]
    numbered = re.sub(r"\\\((\d+)\\\)", r"\\((\1)\\)", drawn)
    line(ledger, rf"(\d+) samples of {result['over']}: {numbered}; (\d+) analyses", expected)
    ledger.text(numbered, [None] * len(groups), needed=False)
    pattern = ", ".join(f"{name} ([^ ]+ %|unknown) \\(fit ([^ )]+(?: %)?)\\)" for name in MODULI)

    def sigmas(match):
        values = []
        for name in MODULI:
            own, of_fit = result["sigma_relative"][name], result["sigma_relative_of_fit"][name]
            values += [_known(own), _known(of_fit)]
        return values

    line(ledger, f"1 sigma, root mean square along the strain: {pattern}", sigmas)
    ledger.text(rf"{N} samples used up their analyses", [result["unfinished"]], needed=False)
    ledger.text(r"(\d+) [a-z]+ only: so few drawn",
                lambda match: [min(map(len, groups.values()))], needed=False)  # fmt: skip
    ledger.text(r"(\d+) samples: the ends of the bands", [result["samples"]], needed=False)
    _bootstrap_charts(ledger, table, result)
    _named_parts(folder, ledger, [unit for units in groups.values() for unit in units])
    audit_notes(folder, ledger)


def _sigma_of_fit(folder, ledger, name, fit, card):
    """Compare the fit's 1 sigma with its moduli.csv, or a constant modulus with its coefficient."""
    if fit is not None and fit.result and _tests(fit) == set(folder.result["tests"]):
        own = fit.data("moduli.csv")
        own = own.loc[own["modulus"] == name, "sigma_relative"].to_numpy(float)
        ledger.json(("sigma_relative_of_fit", name), float(np.sqrt(np.mean(own**2))), "consistent",
                    rel=0.02)  # fmt: skip
    elif card.form == "constant":
        rows = folder.data("coefficients.csv").set_index("unknown")
        row = rows.loc[f"beta_{4 * BLOCKS.index(name) + 3}"]
        sigma = row["sigma_of_fit"] / row["value"]
        # Coefficients leave bounds aside, which make the sigmas of what is hardly known.
        if sigma < 0.2:
            place = ("sigma_relative_of_fit", name)
            ledger.json(place, sigma, "consistent", rel=0.05)
        else:
            ledger.claim_json(("sigma_relative_of_fit", name), "consistent")


def _bootstrap_charts(ledger, table, result):
    for name in MODULI:
        first = table[table["modulus"] == name].iloc[0]
        values = [first["fit_MPa"], first["lower_MPa"], first["upper_MPa"]]
        ledger.text(rf"{name}[^:;]*: at rest {N} MPa, samples {N} to {N} MPa", values,
                    source="page", needed=False)  # fmt: skip


def _bootstrap_unknowns(folder, ledger, card, unknowns):
    table = folder.data("coefficients.csv")
    labels = card.labels
    size = len(labels)
    if table["unknown"].tolist()[:size] != labels:
        ledger.find("coefficients.csv: unknown", f"are {table['unknown'].tolist()}")
    ends = folder.project.get("law", {}).get("strain_range")
    scales = [scale_of(folder.project, name) for name in BLOCKS]
    coefficients = None
    if card.form in POLYNOMIALS and ends is not None and None not in scales:
        count = size // 3
        share = 0.5 * (1 - np.cos((2 * np.arange(count) + 1) * np.pi / (2 * count)))
        blocks = []
        for block, name in enumerate(BLOCKS):
            end = ends[("warp", "fill", "shear").index(DIRECTION[name])]
            values = unknowns[:, block * count : (block + 1) * count] * scales[block]
            blocks.append([np.polyfit(end * share, own, count - 1) for own in values])
        coefficients = np.hstack([*map(np.array, blocks), unknowns[:, size:]])
    if coefficients is None:
        for column in table.columns[1:]:
            ledger.claim_column("coefficients.csv", column, "consistent")
    else:
        sigma = coefficients.std(axis=0, ddof=1)
        sigma = np.where(sigma > 1e-9 * np.abs(coefficients).max(axis=0), sigma, 0.0)
        ledger.column("coefficients.csv", "sigma", sigma, rel=1e-6)
        ledger.claim_column("coefficients.csv", "value", "consistent")
        ledger.claim_column("coefficients.csv", "sigma_of_fit", "consistent")
        moving = np.where(sigma > 0, sigma, np.inf)
        away = (coefficients - coefficients.mean(axis=0)) / moving
        correlation = away.T @ away / (len(coefficients) - 1)
        for k, name in enumerate(table["unknown"]):
            ledger.column("coefficients.csv", name, correlation[:, k], rel=1e-5, abs=1e-7)
    header = ["unknown", "value", "1 sigma", "of the fit", *table["unknown"]]
    rows = []
    for row in table.itertuples(index=False):
        name, value, sigma, of_fit, *correlations = row
        cells = [name, *(_cell(number) for number in (value, sigma, of_fit))]
        rows.append([*cells, *(f"{c:.2f}".replace("-0.00", "0.00") for c in correlations)])
    ledger.table("Unknowns over the samples", header, rows)
    rows_of_title(ledger, "Unknowns over the samples", len(rows))


def _cell(number):
    number = float(number)
    if not np.isfinite(number):
        return MISSING
    return int(number) if number.is_integer() and abs(number) < 1e4 else number


def audit_plan(folder, ledger):
    result = folder.result
    echo(folder, ledger, "plan")
    rows = [result["now"], *result["candidates"]]
    of = re.match(r"1 sigma of (.*), root of the mean square", result["criterion"])[1]
    order = [_ranked(row, of) for row in result["candidates"]]
    if (np.diff(order) < 0).any():
        ledger.find("candidates", "are not in the order of the criterion")
    for k, row in enumerate(result["candidates"]):
        for name in MODULI:
            # What is hardly known is made of draws between bounds.
            if row["sigma"][name] > result["now"]["sigma"][name] * 1.1:
                ledger.find(f"candidates {k}", f"{name} is less certain with one more test")
    following = result["following"]
    if following is not None:
        first = result["candidates"][0]["sigma"]
        if any(following["sigma"][name] > first[name] * 1.1 for name in MODULI):
            ledger.find("following", "is less certain than the first alone")
        _plan_row(ledger, ("following",), following)
        _after_the_first(ledger, result)
        same = [row for row in result["candidates"] if row["test"] == following["test"]]
        if [row["specimens"] for row in same] != [following["specimens"]]:
            ledger.find("following", "is no candidate, or of another number of specimens")
    _plan_row(ledger, ("now",), result["now"])
    for k, row in enumerate(result["candidates"]):
        _plan_row(ledger, ("candidates", k), row)
    for name in MODULI:
        end = result["up_to_strain"][DIRECTION[name]]
        ledger.claim_json(("up_to_strain", DIRECTION[name]), "echoed")
        ledger.json(("strains", name), [0.0, 0.5 * end, end])
    columns = {
        "rank": list(range(len(rows))),
        "test": [row["test"] for row in rows],
        "kind": [row["kind"] for row in rows],
        "specimens": [row["specimens"] for row in rows],
        "noise": [row["noise"] for row in rows],
    }
    columns |= {f"sigma_{name}": [row["sigma"][name] for row in rows] for name in MODULI}
    for name in MODULI:
        for j, strain in enumerate(result["strains"][name]):
            columns[f"sigma_{name}_at_{strain:.4g}"] = [row["sigma_at"][name][j] for row in rows]
    for column, values in columns.items():
        ledger.column("plan.csv", column, values, "consistent", rel=1e-5)
    fit = fit_folder(folder)
    card = folder.other_card(result["card"])
    same = fit is not None and fit.result and _tests(fit) == set(result["tests"])
    if same and all(np.isclose(result["up_to_strain"][DIRECTION[n]], card.ends[n]) for n in MODULI):
        _plan_now(ledger, result, fit.data("moduli.csv"))
    _plan_words(ledger, result, rows)
    ends = dict(zip(DIRECTION.values(), folder.project.get("law", {}).get("strain_range", ()),
                    strict=False))  # fmt: skip
    beyond_range(ledger, ends)
    for row in rows:
        for words in (row["test"], row["noise"]):
            claim_literal(ledger, words) if words else None
    ledger.text(r"1 sigma of|From 100 % on", [], needed=False)
    audit_notes(folder, ledger)


def _ranked(row, of):
    """Return what a row is ranked by, with the digits shown."""
    worst = of == "the least certain modulus"
    return float(f"{max(row['sigma'].values()) if worst else row['sigma'][of]:.2g}")


#: Of the sum of what two tests tell, so much at least is told by both: what a test tells only
#: through other unknowns is not told twice.
TOGETHER = 0.7


def _after_the_first(ledger, result):
    """Of moduli that each test determines, inverse variances add, less those of now.

    Of the first test again never more: the inverse variance is concave in the information.
    """
    now, following, first = result["now"], result["following"], result["candidates"][0]
    again = first["test"] == following["test"]
    for candidate in result["candidates"]:
        if candidate["test"] != following["test"]:
            continue
        for name in MODULI:
            before, one, other, both = (
                row["sigma"][name] for row in (now, first, candidate, following)
            )
            place = f"following: sigma {name}"
            if both > other * 1.1:
                ledger.find(place, f"is {both:.4g}; {other:.4g} without the first test")
            constant = all(
                np.ptp(row["sigma_at"][name]) < 1e-6 * row["sigma"][name]
                for row in (now, first, candidate, following)
            )
            if not constant or max(one, other) > 0.3 * min(before, 1.0):
                continue
            share = both**-2 / (one**-2 + other**-2 - before**-2)
            if share < TOGETHER or (again and share > 1.02):
                ledger.find(place, f"is {both:.4g}: {share:.3g} of what both tests tell alone")


def _known(sigma):
    return percent(sigma) if sigma is not None and sigma < 1.0 else "unknown"


def _plan_row(ledger, at, row):
    """Check a row by itself: RMS along the strain within its values, what counts as unknown."""
    for name in MODULI:
        sigma, along_it = row["sigma"][name], row["sigma_at"][name]
        if not 0 < sigma <= 10 * (1 + 1e-9):
            ledger.find(f"{at}: sigma {name}", f"is {sigma:g}; the prior is 10")
        if np.ptp(along_it) < 1e-9 * max(along_it) and not np.isclose(sigma, along_it[0]):
            ledger.find(f"{at}: sigma {name}", "is not the RMS of equal values")
        ledger.claim_json((*at, "sigma", name), "consistent")
        ledger.claim_json((*at, "sigma_at", name), "consistent")
    # Or a band reaches from bound to bound, of which a plan's files say no more.
    if not {n for n in MODULI if row["sigma"][n] >= 1.0} <= set(row["unknown"]):
        ledger.find(f"{at}: unknown", f"is {row['unknown']}")
    if row["specimens"] < 1:
        ledger.find(f"{at}", "has no specimen")
    ledger.claim_json((*at, "specimens"), "echoed")


def _plan_now(ledger, result, table):
    """Compare the present uncertainty with that of the fit whose card it is."""
    for name in MODULI:
        own = table[table["modulus"] == name]
        sigma = float(np.sqrt(np.mean(own["sigma_relative"] ** 2)))
        now = result["now"]["sigma"][name]
        if max(sigma, now) < 1.0 and not np.isclose(now, sigma, rtol=0.02):
            ledger.find(
                f"result.json: now.sigma.{name}",
                f"is {now:.4g}; the fit's moduli.csv has {sigma:.4g}, RMS along the strain",
            )


def _plan_words(ledger, result, rows):
    ends = [100 * result["up_to_strain"][DIRECTION[name]] for name in MODULI]
    line(ledger, rf"1 sigma of the moduli up to strains of {N}, {N}, {N} % \(warp, fill, shear\)",
         ends, digits=3)  # fmt: skip
    for place, row in enumerate(rows):
        title = row["test"]
        if row["specimens"] != 1:
            title += f", {row['specimens']} specimens"
        sigmas = [row["sigma"][name] for name in MODULI]
        words = [
            "unknown" if name in row["unknown"] else percent(sigma)
            for name, sigma in zip(MODULI, sigmas, strict=True)
        ]
        mark = rf"{place}\. " if place else ""
        numbers = r"\s+".join(r"([\d.e-]+ %|unknown)" for _ in MODULI)
        noise = re.escape(row["noise"])
        spaced = re.escape(title).replace(r"\ ", r"\s+")
        ledger.text(rf"(?<![\w,]){mark}\s*{spaced}\s\s*{numbers}(?:\s+{noise})?", words,
                    needed=True)  # fmt: skip
        ledger.text(rf"{mark}{re.escape(title)}", [], needed=False)
    following = result["following"]
    if following is not None:
        pattern = ", ".join(rf"{name} ([\d.e-]+ %|unknown)" for name in MODULI)
        words = ["unknown" if n in following["unknown"] else percent(following["sigma"][n])
                 for n in MODULI]  # fmt: skip
        title = re.escape(following["test"])
        line(ledger, rf"after the first, {title}(?:, {following['specimens']} specimens)? "
             rf"would give {pattern}", words)  # fmt: skip


def audit_nu12(folder, ledger):
    result = folder.result
    echo(folder, ledger, "study nu12")
    card = folder.other_card(result["card"])
    ledger.json("base_nu12", card.nu12, "echoed")
    columns = {"model": [], "response": [], "nu12": [], "value": [], "to_base": [], "to_mean": []}
    for model, part in result["models"].items():
        for response, own in part["responses"].items():
            at = ("models", model, "responses", response)
            value = np.array(own["value"], dtype=float)
            ledger.claim_json((*at, "nu12"), "echoed")
            base = value / np.array(own["to_base"], dtype=float)
            if np.nanmax(base) / np.nanmin(base) > 1 + 1e-9:
                ledger.find(f"{model}, {response}", "to_base is not over one and the same value")
            ledger.claim_json((*at, "value"), "consistent")
            ledger.claim_json((*at, "to_base"), "consistent")
            ledger.json((*at, "to_mean"), (value / np.nanmean(value)).tolist())
            same = np.isclose(own["nu12"], card.nu12)
            if same.any() and not np.allclose(np.array(own["to_base"], float)[same], 1.0):
                ledger.find(f"{model}, {response}", "the card's own nu12 is not at 1")
            columns["model"] += [model] * len(value)
            columns["response"] += [response] * len(value)
            for key in ("nu12", "value", "to_base", "to_mean"):
                columns[key] += own[key]
            spread = [100 * (min(own["to_base"]) - 1), 100 * (max(own["to_base"]) - 1)]
            ratios = r"\s+".join(r"(\d\.\d{4})" for _ in own["to_base"])
            words = [f"{v:.4f}" for v in own["to_base"]] + [f"{s:+.1f}" for s in spread]
            line(ledger, rf"{re.escape(f'{model}, {response}')}\s+{ratios}\s+{N} to {N} %", words)
            _chart_ratios(ledger, model, part)
    for column, values in columns.items():
        numbers = values if column in ("model", "response") else np.array(values, dtype=float)
        ledger.column("nu12.csv", column, numbers, "consistent", rel=1e-9)
    line(ledger, rf"relative to that at nu12 = {N}", [card.nu12], how="echoed", digits=6)
    first = next(iter(next(iter(result["models"].values()))["responses"].values()))
    shown = [f"{v:g}" for v in first["nu12"]]
    heads = r"\s+".join(re.escape(v) for v in shown)
    line(ledger, rf"({heads.replace('(', '')})\s+spread", [None], how="echoed")
    _nu12_of_strips(folder, ledger, card)
    ledger.text(rf"nu12 = {N}", lambda match: [match[1]] if any(
        np.isclose(float(match[1]), v, rtol=1e-5) for v in (card.nu12, *first["nu12"])) else [None],
        "echoed", needed=False)  # fmt: skip
    beyond_range(ledger, _ends(card))
    _claim_labels(ledger, result["models"])
    audit_notes(folder, ledger)


def _chart_ratios(ledger, model, part):
    ratios = [v for own in part["responses"].values() for v in own["to_base"] if v is not None]
    ledger.text(rf"/ that at nu12 = {N}: {N} to {N}", lambda match: [None, min(ratios), max(ratios)]
                if model.split(": ")[-1] in match.string or len(part) == 1 else None,
                source="page", needed=False)  # fmt: skip


def _ends(card):
    return {DIRECTION[name]: card.ends[name] for name in MODULI}


def _claim_labels(ledger, models):
    """Numbers within names of quantities (apex at 22 kPa) are those names."""
    for model in models.values():
        for name in (*model.get("responses", ()), *model.get("quantities", ())):
            ledger.text(re.escape(name), [], needed=False)


def _nu12_of_strips(folder, ledger, card):
    """Compute loads of straight strips: stress times thickness times the width that is left."""
    for model, part in folder.result["models"].items():
        found = strip_of(folder.project, model)
        if found is None:
            continue
        direction, gauge, final, width = found
        for own in part["responses"].values():
            for value, nu12 in zip(own["value"], own["nu12"], strict=True):
                expected = strip_load(card, direction, np.log(final / gauge), width, nu12)
                if value is not None and abs(value / expected - 1) > 1e-5:
                    ledger.find(
                        f"{model}, nu12 = {nu12:g}", f"load {value:.7g}, not {expected:.7g}"
                    )
            base = strip_load(card, direction, np.log(final / gauge), width, card.nu12)
            for value, ratio in zip(own["value"], own["to_base"], strict=True):
                if value is not None and abs(value / base / ratio - 1) > 1e-5:
                    ledger.find(f"{model}", f"to_base {ratio:.7g}, not {value / base:.7g}")


def observed_order(sizes, changes):
    """Return the order with which two successive changes fall; None without.

    sizes : (3,) coarse to fine. changes : (2,).
    """
    h, d = np.asarray(sizes, float), np.asarray(changes, float)
    if d[1] == 0 or not np.isfinite(d).all() or d[0] / d[1] <= 0:
        return None

    def excess(p):
        return np.log((h[0] ** p - h[1] ** p) / (h[1] ** p - h[2] ** p)) - np.log(d[0] / d[1])

    if excess(0.05) > 0 or excess(12.0) < 0:
        return None
    return brentq(excess, 0.05, 12.0, xtol=1e-12)


def audit_mesh(folder, ledger):
    result = folder.result
    echo(folder, ledger, "study mesh")
    card = folder.other_card(result["card"])
    rows = []
    for model, part in result["models"].items():
        levels = part["levels"]
        at = ("models", model)
        _levels(ledger, at, result["refined"], levels)
        good = [level for level in levels if level["values"] is not None]
        for name, found in part["quantities"].items():
            _quantity(ledger, (*at, "quantities", name), name, found, good)
        rms = part.get("rms_N")
        if rms is not None:
            _rms_of_levels(ledger, (*at, "rms_N"), rms, good)
        finest = good[-1]["values"] if good else {}
        for level in levels:
            start = {"model": model, "refined": result["refined"], **level}
            for name, value in (level["values"] or {}).items():
                end = finest.get(name, np.nan)
                rows.append({**start, "quantity": name, "value": value, "off_finest": value - end,
                             "off_finest_percent": 100 * (value - end) / end})  # fmt: skip
            place = good.index(level) if level in good else -1
            if rms is not None and 0 <= place < len(rms["to_next_finer"]):
                rows.append({**start, "quantity": "RMS of the load to the next finer level, N",
                             "value": rms["to_next_finer"][place]})  # fmt: skip
            if "failed" in level:
                rows.append({**start, "quantity": f"failed: {level['failed']}"})
        _mesh_words(ledger, model, part, good)
        _load_of_strip(folder, ledger, card, model, good, part.get("rms_N"))
    columns = (
        "model refined factor elements increments size seconds iterations quantity value "
        "off_finest off_finest_percent"
    )
    for column in columns.split():
        values = [row.get(column, np.nan) for row in rows]
        ledger.column("convergence.csv", column, values, "consistent", rel=1e-9, abs=1e-9)
    _claim_labels(ledger, result["models"])
    counts = {level["elements"] for part in result["models"].values() for level in part["levels"]}
    ledger.text(rf", {N} quads", lambda match: [int(match[1])] if int(match[1]) in counts else [-1],
                needed=False)  # fmt: skip
    ledger.text(rf"every change is below {N} %", [1e-5], "echoed", needed=False)
    ledger.text(rf"changes below {N} % are not drawn", [1e-5], "echoed", needed=False)
    _mesh_charts(ledger)
    beyond_range(ledger, _ends(card))
    audit_notes(folder, ledger)


def _levels(ledger, at, refined, levels):
    factors = [level["factor"] for level in levels]
    ratio = factors[1] / factors[0]
    for k, level in enumerate(levels):
        own = (*at, "levels", k)
        ledger.json((*own, "factor"), factors[0] * ratio**k, "recomputed")
        ledger.claim_json(own, "consistent")
        if k and refined == "elements" and not level["elements"] > levels[k - 1]["elements"]:
            ledger.find(f"{at}", "a finer level has no more quads")
        if k and refined == "elements":
            # The same area: sizes squared times quads.
            area = [one["size"] ** 2 * one["elements"] for one in (levels[k - 1], level)]
            if abs(area[1] / area[0] - 1) > 0.05:
                ledger.find(f"{at}: levels {k}", "size and number of quads do not fit each other")
        if refined == "increments":
            ledger.json((*own, "size"), 1.0 / level["increments"])


def _quantity(ledger, at, name, found, good):
    known = [level for level in good if name in level["values"]]
    sizes = [level["size"] for level in known]
    values = np.array([level["values"][name] for level in known])
    ledger.json((*at, "finest"), values[-1], "consistent")
    limit = None
    order = found["order"]
    if order is not None:
        expected = observed_order(sizes[-3:], np.diff(values)[-2:])
        ledger.json((*at, "order"), expected, rel=1e-5)
        ratio = (sizes[-2] / sizes[-1]) ** order - 1.0
        limit = values[-1] + (values[-1] - values[-2]) / ratio
    ledger.json((*at, "limit"), limit, rel=1e-7)
    previous = found["order_one_coarser"]
    if previous is not None:
        expected = observed_order(sizes[-4:-1], np.diff(values)[-3:-1])
        ledger.json((*at, "order_one_coarser"), expected, rel=1e-5)
    best = values[-1] if limit is None else limit
    own = [level["values"][name] for level in known if level["factor"] == 1]
    ledger.json((*at, "own_error"), own[0] / best - 1.0 if own else None, abs=1e-12)
    ledger.json((*at, "own_error_against"), "finest" if limit is None else "limit")
    remark = found["remark"]
    text = rf"\(order {N}\)"
    changes = np.diff(values)
    if len(values) > 2:
        slow = observed_order(sizes[-3:], changes[-2:])
        ledger.text(
            text, [slow] if slow else [None], digits=2, needed=False
        ) if slow and "so slowly" in remark else None
    if "still moves" in remark:
        ledger.text(rf"the order still moves \(from {N}\)", lambda match: [previous]
                    if np.isclose(float(match[1]), previous, rtol=0.06) else None,
                    digits=2, needed=False)  # fmt: skip


def _rms_of_levels(ledger, at, rms, good):
    ledger.claim_json((*at, "to_next_finer"), "consistent")
    if len(rms["to_next_finer"]) != len(good) - 1:
        ledger.find(f"{at}", "has not one change a step of refinement")
    ledger.claim_json((*at, "largest_load"), "consistent")
    ends = [v for name, v in good[-1]["values"].items() if name == "load at the end, N"]
    if ends and rms["largest_load"] < ends[0] * (1 - 1e-9):
        ledger.find(f"{at}.largest_load", "is less than the load at the end")
    if min(rms["to_next_finer"]) < 0:
        ledger.find(f"{at}", "an RMS is negative")
    if rms["order"] is not None:
        sizes = [level["size"] for level in good]
        order = observed_order(sizes[-3:], rms["to_next_finer"][-2:])
        ledger.json((*at, "order"), order, rel=1e-5)


def _mesh_words(ledger, model, part, good):
    heads = list(part["quantities"])[-2:]
    for level in part["levels"]:
        if level["values"] is None:
            continue
        numbers = [level["values"].get(head) for head in heads]
        cells = r"\s+".join(N if v is not None else "-" for v in numbers)
        own = r"\s+\(the project's own\)" if level["factor"] == 1 else ""
        values = [level["elements"], level["increments"], f"{level['seconds']:.2f}",
                  *(v for v in numbers if v is not None)]  # fmt: skip

        def expected(match, values=values):
            shown = [float(match[k + 1]) for k in range(len(values))]
            same = [int(shown[0]) == values[0], int(shown[1]) == values[1]]
            same += [np.isclose(a, float(b), rtol=1e-3) for a, b in
                     zip(shown[3:], values[3:], strict=True)]  # fmt: skip
            return values if all(same) else None

        ledger.text(rf"(\d+)\s+(\d+)\s+(\d+\.\d+)\s+{cells}{own}", expected, digits=7)
    for name, found in part["quantities"].items():
        pattern, values = rf"{re.escape(name)}: {N} on the finest", [found["finest"]]
        digits = [7]
        if found["order"] is not None:
            pattern += rf", order {N}, limit {N}"
            values += [f"{found['order']:.2f}", found["limit"]]
            digits += [7, 7]
        if found["own_error"] is not None:
            pattern += rf"; the project's own is {N} % off the {found['own_error_against']}"
            values += [f"{100 * found['own_error']:+.2g}"]
            digits += [2]

        def of_this(match, values=values, finest=found["finest"]):
            return values if np.isclose(float(match[1]), finest, rtol=1e-6) else None

        line(ledger, pattern, of_this, digits=digits)
    rms = part.get("rms_N")
    if rms is not None:
        changes = ", ".join(N for _ in rms["to_next_finer"])
        pattern, values = rf"RMS of the load to the next finer level: {changes} N", []
        values = [f"{c:.3g}" for c in rms["to_next_finer"]]
        if rms["order"] is not None:
            pattern += rf", order {N}"
            values.append(f"{rms['order']:.2f}")

        def of_rms(match, values=values):
            return values if match[1] == values[0] else None

        line(ledger, pattern, of_rms)


def _mesh_charts(ledger):
    """Charts show changes between levels: the largest is not below the least."""

    def check(match):
        if float(match[1]) < float(match[2]):
            ledger.find(match[0], "the largest is below the least")
        return [match[1], match[2]]

    ledger.text(rf"largest {N} %, least {N} %", check, source="page", needed=False)


def _load_of_strip(folder, ledger, card, model, good, rms):
    found = strip_of(folder.project, model)
    if found is None:
        return
    direction, gauge, final, width = found
    expected = strip_load(card, direction, np.log(final / gauge), width)
    if rms is not None and abs(rms["largest_load"] / expected - 1) > 1e-5:
        ledger.find(f"{model}: largest_load", f"{rms['largest_load']:.7g} N, not {expected:.7g}")
    for level in good:
        value = level["values"].get("load at the end, N")
        if value is not None and abs(value / expected - 1) > 1e-5:
            ledger.find(f"{model}: {level['elements']} quads", f"{value:.7g} N, not {expected:.7g}")


def audit_validate(folder, ledger):
    if "weights_of" in folder.result:
        audit_weights(folder, ledger)
        return
    result = folder.result
    echo(folder, ledger, "validate")
    rows = result["rows"]
    keys = ("law", "test", "compared", "unit", "foretold_rms", "fitted_rms", "foretold_relative",
            "fitted_relative", "foretold_words")  # fmt: skip
    for key in keys:
        values = [row[key] for row in rows]
        if key not in ("law", "test", "compared", "unit", "foretold_words"):
            values = np.array(values, dtype=float)
        ledger.column("validation.csv", key, values, "consistent")
    ledger.claim_json("rows", "consistent")
    means = {}
    for law in dict.fromkeys(row["law"] for row in rows):
        of_tests = {row["test"]: row["foretold_relative"] for row in rows if row["law"] == law}
        values = np.array(list(of_tests.values()), dtype=float)
        means[law] = float(np.mean(values))
        ledger.json(("mean_foretold", law), means[law])
    fits = folder.path.glob("*/result.json")
    least = sum(json.loads(fit.read_text())["analyses"] for fit in fits)
    if result["analyses"] < max(1, least):
        ledger.find("analyses", f"are {result['analyses']}; the fits took {least}")
    ledger.claim_json("analyses", "consistent")
    for law, mean in means.items():
        if np.isfinite(mean):
            line(ledger, rf"{re.escape(law)}: predicted {N} % on average", [100 * mean], digits=3)
    if len(means) > 1:
        best = min((law for law in means if np.isfinite(means[law])), key=means.get)
        line(ledger, r"predicts best: (\S+)", [best])
    for row in rows:
        name = r"\s+".join(re.escape(row[key]) for key in ("law", "test", "compared"))
        errors = [row["foretold_rms"], row["fitted_rms"]]
        ledger.text(rf"{name}\s+(\S+)\s+(\S+)\s+{re.escape(row['unit'])}(?!\S)", errors)
        _words_of_test(ledger, row, rows)
    _validate_relative(folder, ledger, rows)
    beyond_range(ledger, {})
    _named_parts(folder, ledger, [row["test"] for row in rows])
    audit_notes(folder, ledger)


def _words_of_test(ledger, row, rows):
    """Words such as "RMS errors in N: warp 72.61, fill 15.95" repeat the errors beside them."""
    words = row["foretold_words"]
    same = [r for r in rows if r["law"] == row["law"] and r["test"] == row["test"]]
    match = re.fullmatch(r"RMS errors in (\S+): (.*)", words)
    if match is None:
        return
    parts = {r["compared"].split(": ")[-1]: r for r in same}
    for part in match[2].split(", "):
        name, _, number = part.rpartition(" ")
        if name not in parts:
            ledger.find(f"foretold_words: {words}", f"names {name}, which is not compared")
        elif number != f"{parts[name]['foretold_rms']:.4g}":
            ledger.find(f"foretold_words: {words}", f"{name}: {parts[name]['foretold_rms']:.6g}")
        elif match[1] != parts[name]["unit"]:
            ledger.find(f"foretold_words: {words}", "has another unit")
    ledger.text(re.escape(words), [], needed=False)
    for text in ledger.texts:
        for found in re.finditer(re.escape(words), text.text):
            text.claim(found.span(), "consistent")


def _validate_relative(folder, ledger, rows):
    """Relative errors: RMS over the largest measured value, mean over the parts of a test."""
    largest = largest_loads(folder)
    for row in rows:
        for kind in ("foretold", "fitted"):
            relative, own = row[f"{kind}_relative"], []
            for other in rows:
                if (other["law"], other["test"]) == (row["law"], row["test"]):
                    most = largest.get((other["test"], other["compared"]))
                    if most is None or other[f"{kind}_rms"] is None:
                        own = None
                        break
                    own.append(other[f"{kind}_rms"] / most)
            if own and relative is not None and abs(np.mean(own) / relative - 1) > 1e-6:
                ledger.find(
                    f"validation: {row['test']}, {row['compared']}",
                    f"{kind}_relative is {relative:.7g}, not {np.mean(own):.7g}",
                )


def largest_loads(folder):
    """Return the largest measured load (N) by (test or its part, comparison), of strips.

    Of points up to the final length of the gauge; those of one specimen where one is left out.
    """
    most = {}
    for (test, direction), points in strip_points(folder).items():
        compared = f"{test}: {direction}"
        most[test, compared] = points["load"].max()
        for specimen, own in points.groupby("specimen"):
            most[f"{test}: {direction}, specimen {specimen}", compared] = own["load"].max()
    return most


def _named_parts(folder, ledger, names):
    """Check pressures in names of frames against the project, and claim names of parts."""
    kpa = {"kPa": 1.0, "MPa": 1e3, "bar": 100.0, "Pa": 1e-3}
    unit = kpa[folder.project.get("units", {}).get("pressure", "kPa")]
    known = [
        unit * p for test in folder.project.get("bubble", []) for p in test.get("pressures", [])
    ]
    for name in dict.fromkeys(names):
        match = re.search(rf"{N} kPa$", name)
        if match and known and not np.isclose(float(match[1]), known, rtol=1e-3).any():
            ledger.find(name, f"is none of the pressures {known} kPa")
        claim_literal(ledger, name)


def audit_weights(folder, ledger):
    result = folder.result
    rows = result["rows"]
    table = folder.data("weights.csv")
    places = [0.0, 0.5, 1.0]
    columns = {"weight_times": [row["weight_times"] for row in rows]}
    for name in rows[0]["relative"]:
        columns[f"relative {name}"] = [row["relative"][name] for row in rows]
    for column in table:
        match = re.fullmatch(r"rms (.*), (\S+)", column)
        if match:
            columns[column] = [row["rms"][match[1]] for row in rows]
    for name in ("G12", "E2", "E1"):
        for k, place in enumerate(places):
            strain = result["strain"][name][k]
            columns[f"{name}_MPa at {strain:.4g}"] = [row["moduli_MPa"][name][k] for row in rows]
            ledger.json(("strain", name, k), place * result["strain"][name][2], "recomputed")
    columns["analyses"] = [row["analyses"] for row in rows]
    if set(columns) != set(table):
        ledger.find("weights.csv", f"has the columns {sorted(set(table) ^ set(columns))} beside")
    for column, values in columns.items():
        ledger.column("weights.csv", column, values, "consistent")
    ledger.claim_json("rows", "consistent")
    _moduli_of_weights(folder, ledger, rows)
    weights = [row["weight_times"] for row in rows]
    usual = 2.0 ** (np.arange(-4, 5) / 2)
    if not all(np.isclose(usual, weight).any() for weight in weights) or np.any(
        np.diff(weights) <= 0
    ):
        ledger.find("rows: weight_times", f"are {weights}")
    before = next(row for row in rows if row["weight_times"] == 1)["moduli_MPa"]
    fit = _beside(folder, "fit")
    for name in MODULI:
        changes = [np.array(row["moduli_MPa"][name]) / before[name] - 1 for row in rows]
        low, high = np.min(changes), np.max(changes)
        ledger.json(("change", name), [low, high], abs=2e-9)
        sigma = result["sigma_relative"][name]
        if fit is not None and sigma is not None:
            own = along(fit.data("moduli.csv"), name, "sigma_relative", result["strain"][name])
            ledger.json(("sigma_relative", name), list(own), "consistent", rel=1e-3)
            card = fit.card.modulus(name, result["strain"][name])
            if not np.allclose(card, before[name], rtol=1e-6):
                ledger.find(f"rows: {name}", "is not the fit's where the weight is the project's")
        else:
            ledger.claim_json(("sigma_relative", name), "consistent")
        pattern, values = rf"{name} changes by {N} to {N} %", [f"{100 * low:+.2g}",
                                                               f"{100 * high:+.2g}"]  # fmt: skip
        if sigma is not None:
            pattern += rf" \(1 sigma there: {N} % at most\)"
            values.append(f"{100 * max(sigma):.2g}")

        def signed(match, values=values):
            for text, value in zip(match.groups(), values, strict=True):
                if abs(float(text) - float(value)) > 1e-6 + 0.06 * abs(float(value)) * (
                    text != value
                ):
                    ledger.find(match[0], f"{text} is printed for {value}")
            return [None] * len(values)

        line(ledger, pattern, signed)
        _claim_all(ledger, pattern)
    shown = [*(f"relative {name}" for name in rows[0]["relative"])]
    shown += [f"{name}_MPa at {result['strain'][name][1]:.4g}" for name in MODULI]
    for row_number, weight in enumerate(weights):
        values = [columns[column][row_number] for column in shown]
        cells = r"\s+".join(r"([\d.e+-]+)" for _ in values)
        ledger.text(rf"(?<![\d.]){re.escape(f'{weight:.3g}')}\s+{cells}(?!\S)", values,
                    needed=False)  # fmt: skip
    printed = [f"{name}_MPa at {100 * result['strain'][name][1]:.3g} %" for name in MODULI]
    for text in ledger.texts:
        for column in (*shown, *printed):
            at = text.text.find(column)
            if at >= 0:
                text.claim((at, at + len(column)), "consistent")
    audit_notes(folder, ledger)
    ledger.text(r"at (\d+) strains over the weight", [len(places)], source="page", needed=False)
    if fit is not None:
        notes_of_fit(folder, ledger, fit)


def _moduli_of_weights(folder, ledger, rows):
    """Moduli at each weight are those of the unknowns that its fit found."""
    fit, record = _beside(folder, "fit"), folder._json("weights-runs.json")
    if fit is None or record is None:
        return
    strains = folder.result["strain"]
    size = len(fit.card.labels)
    at = {row["weight_times"]: k for k, row in enumerate(rows)}
    for run in record["runs"]:
        unknowns = np.array([run["unknowns"][:size]], dtype=float)
        moduli = moduli_of_samples(fit.card, folder.project, unknowns, strains)
        if run["count"] not in at:
            ledger.find("weights-runs.json", f"has a weight that is no row: {run['count']}")
            continue
        for name in moduli or ():
            place = ("rows", at[run["count"]], "moduli_MPa", name)
            ledger.json(place, list(moduli[name][0]), rel=1e-6)


def _claim_all(ledger, pattern):
    for text in ledger.texts:
        for match in re.finditer(re.sub(" +", r"\\s+", pattern), text.text):
            text.claim(match.span(), "consistent")


def _beside(folder, name):
    from .folders import Folder

    path = folder.path / name
    return Folder(path, base=folder.base) if (path / "result.json").exists() else None


def audit_compare(folder, ledger):
    result = folder.result
    echo(folder, ledger, "compare")
    run = json.loads((folder.path / "run.json").read_text())["parts"]
    ledger.json("fold_starts", int(run.get("fold starts", result["fold_starts"])), "echoed")
    ledger.json("as_good_within", 0.05, "echoed")
    units = result["units"]
    columns = {"moduli": [], "coefficients": [], "fitted": [], "cross_validated": []}
    for k, form in enumerate(result["forms"]):
        at = ("forms", k)
        own = _beside(folder, form["form"].replace(":", "-"))
        for key in set(form) - {"form"}:
            ledger.claim_json((*at, key), "consistent")
        if own is not None:
            _form_of_fit(ledger, at, form, own)
        folds = np.array(form["folds"], dtype=float)
        ledger.json((*at, "cross_validated"), float(np.mean(folds)))
        by_part = _parts_of_folds(folder, form)
        for name in form["cross_validated_by_part"]:
            expected = by_part.get(name)
            if expected is None:
                ledger.claim_json((*at, "cross_validated_by_part", name), "consistent")
            else:
                ledger.json((*at, "cross_validated_by_part", name), expected)
        ledger.json((*at, "objective"), min(v for v in form["starts_objective"] if v is not None),
                    "consistent", rel=1e-6)  # fmt: skip
        if form["fitted"] > form["objective"] * (1 + 1e-9):
            ledger.find(f"{form['form']}: fitted", "is more than the whole objective")
        columns["moduli"].append(form["form"])
        columns["coefficients"].append(form["coefficients"])
        columns["fitted"].append(form["fitted"])
        columns["cross_validated"].append(form["cross_validated"])
        for name, unit in units.items():
            columns.setdefault(f"rms {name}, {unit}", []).append(form["rms"][name])
        for name, unit in units.items():
            left = form["cross_validated_by_part"][name]
            columns.setdefault(f"left out {name}, {unit}", []).append(left)
        _compare_line(ledger, form)
        ledger.text(rf"{re.escape(form['form'])} \((\d+)\)[^;]*?: fit {N}, cross-validated {N}",
                    [form["coefficients"], form["fitted"], form["cross_validated"]],
                    source="page", needed=False)  # fmt: skip
    for name, unit in units.items():
        errors = ", ".join(rf"{re.escape(form['form'])} {N} {unit}" for form in result["forms"])
        values = [form["rms"][name] for form in result["forms"]]
        title = rf"{re.escape(name.rpartition(': ')[2])}: RMS error {errors}"
        ledger.text(title, values, digits=3, source="page", needed=False)
    for column, values in columns.items():
        texts = column == "moduli"
        ledger.column("comparison.csv", column, values if texts else np.array(values, float),
                      "consistent")  # fmt: skip
    ledger.json("noise", sum(result["noise_by_part"].values()))
    ledger.claim_json("noise_by_part", "consistent")
    line(ledger, rf"the data's own noise: {N}", [result["noise"]])
    whole = [form for form in result["forms"] if form["cross_validated"] is not None]
    if whole:
        best = min(whole, key=lambda form: form["cross_validated"])
        limit = (1 + result["as_good_within"]) * best["cross_validated"]
        good = [form for form in whole if form["cross_validated"] <= limit]
        simplest = min(good, key=lambda form: form["coefficients"])
        ledger.json("least_cross_validated", best["form"])
        ledger.json("simplest_as_good", simplest["form"])
        line(ledger, r"least at specimens left out: (\S+); simplest within (\d+) % of it: (\S+)",
             [best["form"], round(100 * result["as_good_within"]), simplest["form"]])  # fmt: skip
    ledger.json("analyses", sum(form["analyses"] for form in result["forms"]), "consistent")
    audit_strip_loads(folder, ledger, None)
    audit_notes(folder, ledger)
    _notes_of_forms(folder, ledger)


def _compare_line(ledger, form):
    values = [form["coefficients"], form["fitted"]]
    pattern = rf"(?<!\S){re.escape(form['form'])}\s+(\d+)\s+{N}\s+"
    if form["cross_validated"] is None:
        pattern += "a fold failed"
    else:
        pattern += N
        values.append(form["cross_validated"])
    line(ledger, pattern, values)


def _form_of_fit(ledger, at, form, own):
    """Compare a form with the folder of its fit."""
    result = own.result
    ledger.json((*at, "objective"), result["objective"], "consistent")
    ledger.json((*at, "coefficients"), len(own.card.labels))
    if set(form["rms"]) == set(result["misfit"]):  # all that is fitted is compared
        ledger.json((*at, "fitted"), result["objective"], "consistent", rel=1e-9)


def _parts_of_folds(folder, form):
    """Return the mean RMS by comparison over the folds of validation.json."""
    file = folder.path / form["form"].replace(":", "-") / "validation.json"
    if not file.exists():
        return {}
    folds = json.loads(file.read_text())["folds"]
    names = {name for fold in folds for name in fold["rms"]}
    return {name: float(np.mean([fold["rms"].get(name, np.nan) for fold in folds]))
            for name in names}  # fmt: skip


def _notes_of_forms(folder, ledger):
    """Notes of the forms are those of the folders of their fits, named by the form."""
    for form in folder.result["forms"]:
        own = _beside(folder, form["form"].replace(":", "-"))
        if own is not None:
            notes_of_fit(folder, ledger, own, form["form"])


COMMANDS = {
    "profile": audit_profile,
    "bootstrap": audit_bootstrap,
    "plan": audit_plan,
    "validate": audit_validate,
    "compare": audit_compare,
    "study mesh": audit_mesh,
    "study nu12": audit_nu12,
}
