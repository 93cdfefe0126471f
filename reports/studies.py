"""Charts of fits and studies: optima, refinement, Poisson's ratio, weights, errors by name."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .charts import TITLES, Chart, Charts, Series, dots, line, spans_a_decade

#: What a perfect fit (zero) is drawn as on a logarithmic axis.
PERFECT = 1e-16
#: Percent; a smaller change is the solver's tolerance, and would only stretch the axis.
SMALLEST = 1e-5
#: Quantities at one load or place after the other.
SERIES = r"apex at |load at \d"
SIZES = {"elements": "mean edge, mm", "increments": "step, share of the load"}
#: Lines up to this number have colours of their own; of more, colours rise from first to last.
NAMED = 6
#: %, beyond which a modulus is drawn as unknown, at the end of the axis.
MOST = 100.0
#: Distance over which the dots of one name are spread; of the single folds beside them.
ASIDE, FURTHER = 0.3, 0.1
#: The weight where it is what the project says.
AS_WRITTEN = 1.0
#: Of the threshold of a profile, up to where its chart goes; points of the parabola in it.
ROOM, POINTS = 1.6, 81


@dataclass(frozen=True, eq=False)
class ConvergencePanel:
    """One model of a study of refinement; sizes, work and seconds are (levels,), coarse to fine.
    changes : by quantity, (levels - 1,) percent, from each level to the next finer one. work :
    element-increments. seconds : wall clock."""

    name: str
    sizes: Sequence[float]
    changes: Mapping[str, Sequence[float]]
    work: Sequence[float]
    seconds: Sequence[float]


@dataclass(frozen=True, eq=False)
class LawRow:
    """Errors of one form of the law: of the fit, cross-validated, and of every fold; or NaN."""

    name: str
    coefficients: int
    fitted: float
    validated: float = float("nan")
    folds: ArrayLike = ()


@dataclass(frozen=True, eq=False)
class ProfilePanel:
    """One modulus at one strain: MPa, -2 log L; ends None where the curve does not pass the line.
    sigma : MPa, one standard deviation; band : MPa, within the bounds."""

    title: str
    values: Sequence[float]
    ratios: Sequence[float]
    best: float
    sigma: float
    ends: tuple[float | None, float | None]
    band: tuple[float, float]


def optima_chart(objectives: ArrayLike, caption: str) -> Charts:
    """Return the optima (starts,), worst to best; starts without one (NaN) are counted."""
    values = np.atleast_1d(np.asarray(objectives, dtype=float))
    ended = np.maximum(np.sort(values[np.isfinite(values)])[::-1], PERFECT)
    failed = len(values) - len(ended)
    said = f"{len(values)} start{'s' if len(values) > 1 else ''}"
    said += f", {failed} without a result" if failed else ""
    if len(ended):
        said += f": best {ended[-1]:.3g}, median {np.median(ended):.3g}, worst {ended[0]:.3g}"
    series, log = [dots("", 1 + np.arange(len(ended)), ended)], spans_a_decade(ended)
    axes = "start, from worst to best", "objective"
    chart = Chart("", *axes, series, said, log_y=log, from_zero=not log)
    return Charts("optima", [chart], f"{caption}. {said[:1].upper()}{said[1:]}.")


def convergence_charts(models: Sequence[ConvergencePanel], what: str, caption: str) -> Charts:
    """Return the changes of each model under refinement, with slopes 1 and 2, and the cost."""
    charts = [_changes(model, SIZES[what]) for model in models]
    cost = [
        line(TITLES.get(m.name, m.name), m.work, m.seconds, colour=rank, marks=True)
        for rank, m in enumerate(models)
    ]
    across, alt = "elements × increments", "wall clock over elements times increments"
    charts.append(Chart("cost", across, "seconds", cost, alt, log_y=True, log_x=True))
    words = f"{caption}. Grey: what falls with the first and the second power of the size"
    return Charts("convergence", charts, f"{words}; changes below {SMALLEST:g} % are not drawn.")


def _changes(model: ConvergencePanel, size: str) -> Chart:
    sizes = np.asarray(model.sizes[:-1], dtype=float)
    loads = [name for name in model.changes if re.match(SERIES, name)]
    rising = dict(zip(loads, np.linspace(0.0, 1.0, max(2, len(loads))).tolist(), strict=False))
    changes = {name: np.asarray(own, dtype=float) for name, own in model.changes.items()}
    drawn = {name: np.where(own > SMALLEST, own, np.nan) for name, own in changes.items()}
    series: list[Series] = [
        line(name, sizes, change, colour=rank, rank=rising.get(name), marks=True)
        for rank, (name, change) in enumerate(drawn.items())
    ]
    seen = np.concatenate([c[np.isfinite(c)] for c in drawn.values()] or [np.zeros(0)])
    if len(seen):
        series += [
            line(f"order {p}", sizes, 1.6 * seen.max() * (sizes / sizes.max()) ** p,
                 colour=7, dashes=p, faint=True)
            for p in (1, 2)
        ]  # fmt: skip
    title = TITLES.get(model.name, model.name)
    extent = f"largest {seen.max():.3g} %, least {seen.min():.3g} %" if len(seen) else "none"
    label = "change to the next finer level, %"
    return Chart(title, size, label, series, f"{title}: {label}: {extent}", log_y=True, log_x=True)


def nu12_charts(
    models: Mapping[str, Mapping[str, tuple[ArrayLike, ArrayLike]]], base: float, response: str,
    caption: str,
) -> Charts:  # fmt: skip
    """Return responses over that at the base nu12, a chart a model: nu12 and ratio (n,)."""
    charts, label = [], f"{response} / that at nu12 = {base:g}"
    for name, lines in models.items():
        many = len(lines) > NAMED
        series = [
            line(own, x, y, colour=k, rank=k / (len(lines) - 1) if many else None, marks=True)
            for k, (own, (x, y)) in enumerate(lines.items())
        ]
        series.append(dots("", [base], [1.0], colour=3, shape="diamond"))
        title = TITLES.get(name, name)
        ratios = [np.asarray(y, dtype=float) for _, y in lines.values()]
        known = np.concatenate([y[np.isfinite(y)] for y in ratios] or [np.ones(1)])
        extent = f"{known.min():.4g} to {known.max():.4g}" if len(known) else "none known"
        alt = f"{title}: {label}: {extent}"
        charts.append(Chart(title, "nu12", label, series, alt, level=1.0))
    return Charts("nu12", charts, caption)


def profile_charts(panels: Sequence[ProfilePanel], threshold: float, caption: str) -> Charts:
    """Return charts of profile likelihoods: -2 log L over a modulus, its threshold and ends."""
    return Charts("profiles", [_profile(panel, threshold) for panel in panels], caption)


def _profile(panel: ProfilePanel, threshold: float) -> Chart:
    x = np.linspace(min(panel.values), max(panel.values), POINTS)
    parabola = ((x - panel.best) / panel.sigma) ** 2
    inside = np.where(parabola <= ROOM * threshold, parabola, np.nan)
    series: list[Series] = [
        line("profile", panel.values, panel.ratios, marks=True),
        line("by the 1 sigma of the fit", x, inside, colour=1, dashes=1),
    ]
    known = [end for end in panel.ends if end is not None]
    series += [line("ends", [end, end], [0.0, threshold], dashes=2) for end in known]
    low, high = ("not closed" if end is None else f"{end:.4g} MPa" for end in panel.ends)
    alt = f"{panel.title}: best {panel.best:.4g} MPa, lower end {low}, upper end {high}"
    return Chart(
        panel.title, "tangent modulus, MPa", "-2 log L", series, alt, from_zero=True,
        top=ROOM * threshold, level=threshold,
    )  # fmt: skip


def weights_charts(
    counted: str, counts: Sequence[float], errors: Mapping[str, Sequence[float]],
    moduli: Mapping[str, Mapping[float, Sequence[float]]],
    sigma: Mapping[str, Sequence[float] | None],
) -> list[Charts]:  # fmt: skip
    """Return errors of the tests, then moduli (MPa, with 1 sigma), over the weight of some."""
    across = f"weight of {counted}, times that of the project"
    drawn = [
        line(name, counts, 100 * np.asarray(values), colour=rank, marks=True)
        for rank, (name, values) in enumerate(errors.items())
    ]
    label = "relative RMS error, %"
    alt = f"{label} of {', '.join(errors)} over the weight of {counted}"
    first = Chart("Errors of the tests", across, label, drawn, alt, from_zero=True, log_x=True)
    others = []
    for name, by_strain in moduli.items():
        bars = sigma.get(name) or [0.0] * len(by_strain)
        series: list[Series] = []
        for rank, ((strain, moved), bar) in enumerate(zip(by_strain.items(), bars, strict=True)):
            own = float(np.interp(AS_WRITTEN, counts, moved))
            series.append(line(f"at {100 * strain:.3g} %", counts, moved, dashes=rank, marks=True))
            if bar:
                ends = [own * (1 - bar)], [own * (1 + bar)]
                series.append(dots("1 sigma", [AS_WRITTEN], [own], ends, colour=7))
        alt = f"{name} at {len(by_strain)} strains over the weight of {counted}"
        others.append(Chart(name, across, "MPa", series, alt, from_zero=True, log_x=True))
    return [
        Charts("errors", [first], "Errors of the tests over the weight."),
        Charts("moduli", others, "Moduli over the weight, with 1 sigma where it is as written."),
    ]


def held_out_charts(
    tests: Sequence[str], predicted: Mapping[str, Sequence[float]],
    fitted: Mapping[str, Sequence[float]], caption: str,
) -> Charts:  # fmt: skip
    """Return relative errors by law at each test: predicted, and by the fit to all of them."""
    errors = {f"{law}, predicted": 100 * np.asarray(own) for law, own in predicted.items()}
    errors |= {f"{law}, fitted": 100 * np.asarray(own) for law, own in fitted.items()}
    alt = f"errors at {', '.join(tests)}"
    chart = _named("left out", "relative RMS error, %", tests, errors, alt)
    return Charts("held out", [chart], caption)


def law_charts(rows: Sequence[LawRow], noise: float | None, label: str, caption: str) -> Charts:
    """Return errors of forms: of the fit, cross-validated, of every fold; noise, a line."""
    names = [_form(row) for row in rows]
    errors = {
        "error of the fit": np.array([row.fitted for row in rows]),
        "cross-validated error": np.array([row.validated for row in rows]),
    }
    alt = "; ".join(
        f"{name}: fit {row.fitted:.4g}, cross-validated {row.validated:.4g}"
        for name, row in zip(names, rows, strict=True)
    )
    folds = [np.asarray(row.folds, dtype=float).ravel() for row in rows]
    place = [1.0 + k + 0.5 * ASIDE + FURTHER for k in range(len(rows))]
    own = [
        dots("single folds", np.full(len(values), at), values, colour=1, hollow=True)
        for at, values in zip(place, folds, strict=True)
        if np.isfinite(values).any()
    ]
    across = "form of the moduli (number of coefficients)"
    chart = _named(across, label, names, errors, alt, noise, own)
    return Charts("laws", [chart], caption)


def _form(row: LawRow) -> str:
    lost = int(np.sum(~np.isfinite(np.asarray(row.folds, dtype=float))))
    text = f"{row.name} ({row.coefficients})"
    text += f", {lost} fold{'s' if lost > 1 else ''} without a result" if lost else ""
    return text if np.isfinite(row.fitted) else f"{text}, no fit"


def plan_charts(tests: Sequence[str], sigma: Mapping[str, Sequence[float]], caption: str) -> Charts:
    """Return 1 sigma, %, of each modulus with each test; from 100 % on unknown, a ring."""
    every = {name: np.asarray(own, dtype=float) for name, own in sigma.items()}
    known = {name: np.where(own < MOST, own, np.nan) for name, own in every.items()}
    aside = _aside(len(sigma))
    rings = [
        dots(f"{name}, not known", 1.0 + np.flatnonzero(~(own < MOST)) + by,
             np.full(int((~(own < MOST)).sum()), MOST), colour=rank, hollow=True)
        for rank, ((name, own), by) in enumerate(zip(every.items(), aside, strict=True))
        if not (own < MOST).all()
    ]  # fmt: skip
    words = f"{caption}. From {MOST:g} % on a modulus is not known: a ring."
    alt = f"1 sigma of {', '.join(sigma)} with {', '.join(tests)}"
    chart = _named("test", "1 σ, % of the modulus", tests, known, alt, more=rings)
    return Charts("plan", [chart], words)


def _aside(count: int) -> np.ndarray:
    return ASIDE * (np.linspace(-0.5, 0.5, count) if count > 1 else np.zeros(1))


def _named(
    across: str, up: str, names: Sequence[str], values: Mapping[str, np.ndarray], alt: str,
    level: float | None = None, more: Sequence[Series] = (),
) -> Chart:  # fmt: skip
    """Return a chart over names instead of numbers."""
    place = np.arange(len(names)) + 1.0
    pairs = zip(values.items(), _aside(len(values)), strict=True)
    series = [dots(k, place + by, own, colour=c) for c, ((k, own), by) in enumerate(pairs)]
    drawn = [np.array(s.y, dtype=float) for s in (*series, *more)]
    log = spans_a_decade(np.concatenate([*drawn, [np.nan if level is None else level]]))
    return Chart(
        "", across, up, [*series, *more], alt, log_y=log, from_zero=not log, level=level,
        x_names=tuple(names),
    )  # fmt: skip
