"""Fit one law to strips and bubbles of one fabric, form by form, and beside each of them alone.

One line a fit: `FORM, of what: strips X N (scatter Y), test K Z mm`. Any bubble in the folder is
taken (grid/testK_00.csv ...), at the pressures of grid_pressures.csv. Left out: each bubble as
predicted by the law of the strips and of the others, its sheet and registration fitted to it, and
at how many pressures the 95 % band of the law, from its card, holds the measured apex.
"""

import re
from collections.abc import Iterable

import numpy as np
import pandas as pd
from bench_valmex import DATA, FEW, JOINT, measured, moduli, project
from bubblefit.errors import BubblefitError
from bubblefit.experiments.base import Weighting
from bubblefit.inference.nuisance_fit import fit_nuisance, problem_at
from bubblefit.notes import Note
from bubblefit.runs.fit import fit
from bubblefit.runs.held_out import held_out
from bubblefit.runs.result import Fit
from bubblefit.runs.verdict import NOT_CONVERGED
from common import SHARED, known_setup, start_on

FORMS = ("spline", "spline-ratio", "spline-crimp", "load-ratio")
#: Increments of a strip: 100 change its load by less than 0.01 N.
INCREMENTS = 25
#: Laws that are drawn for a band.
DRAWN = 8


def main(
    *forms, data=DATA, parts=("joint", "left-out"), elements=112, modes=10, starts=1, analyses=80,
    unknowns="",
):  # fmt: skip
    """Print, for each form, misfits of strips and bubbles joint and alone, and bubbles left out."""
    folder = measured(data)
    known, scatter = tests_in(folder), scatter_of_strips()

    def made(form, tests, strips):
        law = JOINT.replace('"spline"', f'"{form}"')
        law = law if "spline" in form else re.sub(r"(?m)^knots.*\n(.*)$", "", law)
        names = {f"test {k}": k for k in tests}
        own = project(law, names, folder, FEW, elements, modes, starts, strips, unknowns)
        return own.with_fit(mesh_error="told", max_analyses=analyses)

    for form in forms or FORMS:
        if "joint" in parts:
            for of, tests, strips in [
                ("joint", known, INCREMENTS), ("bubbles", known, 0),
                ("strips alone", [], INCREMENTS), *((f"test {k} alone", [k], 0) for k in known),
            ]:  # fmt: skip
                try:
                    said = words(fit(made(form, tests, strips)), scatter)
                except BubblefitError as error:
                    said = str(error)
                print(f"{form}, {of}: {said}", flush=True)
        if "left-out" in parts and len(known) > 1:
            left_out(form, known, made, scatter)


def tests_in(folder):
    return sorted({re.match(r"test(.+)_\d+", f.name)[1] for f in (folder / "grid").glob("test*")})


def words(found: Fit, scatter: float) -> str:
    parts = []
    for name, findings in found.findings.items():
        numbers = findings.numbers
        if name == "strips":
            parts.append(f"strips {numbers['e_uniaxial_N']:.1f} N (scatter {scatter:.1f})")
        else:
            parts.append(f"{name} {numbers['mean_abs_mm']:.3f} mm")
    count, analyses = len(found.best.point.unknowns), found.result["analyses"]
    ended = unfinished(found.notes)
    return (f"{ended}{', '.join(parts)}; {moduli(found.law)}; {count} unknowns, BIC "
            f"{criterion(found):.0f}; {analyses} analyses")  # fmt: skip


def unfinished(notes: Iterable[Note]) -> str:
    """Return words that stand before the numbers of a fit that has not converged."""
    return "NOT CONVERGED: " if any(note.kind is NOT_CONVERGED for note in notes) else ""


def criterion(found: Fit) -> float:
    """Return Bayes' information criterion: each comparison by the RMS that is left of it, and as
    many values as it has independent ones (`values_that_err_as_one`)."""
    assert found.best.certainty is not None
    correlated_count = found.best.certainty.noise.correlated_count
    total, values = 0.0, 0.0
    for comparison, own in zip(found.problem.comparisons, rows_of(found), strict=True):
        count = len(own) / correlated_count[comparison.name]
        total += count * np.log(np.mean((own * np.median(comparison.objective.scale)) ** 2))
        values += count
    return float(total + len(found.best.point.unknowns) * np.log(values))


def rows_of(found: Fit) -> list[np.ndarray]:
    return [found.best.point.residual[found.problem.rows(k)]
            for k in range(len(found.problem.comparisons))]  # fmt: skip


def left_out(form, known, made, scatter):
    """Print how the law of the strips and of the other bubbles predicts each bubble."""
    setup = known_setup(made(form, known, 0))
    errors, inside = [], []
    for k, prepared in zip(known, setup.tests, strict=True):
        found = fit(made(form, [one for one in known if one != k], INCREMENTS))
        judged = held_out(prepared, found.card.law, setup.make_solver)
        errors.append(float(judged.numbers.get("mean_abs_mm", np.nan)))
        own = covered(prepared, found.card, setup.make_solver)
        inside += own
        ended = unfinished(judged.notes)
        print(f"{form}, without test {k}: {words(found, scatter)}; {ended}test {k} predicted "
              f"{errors[-1]:.3f} mm, its apex in the band at {sum(own)} of {len(own)} pressures",
              flush=True)  # fmt: skip
    print(f"{form}, left out: mean predicted {np.mean(errors):.3f} mm, apex in the band at "
          f"{100 * np.mean(inside):.0f} % of the pressures", flush=True)  # fmt: skip


def covered(prepared, card, make_solver):
    """Return, pressure by pressure, whether the band of the law's certainty holds the apex."""
    drawn = [] if card.certainty is None else card.certainty.laws(
        card.law, DRAWN, np.random.default_rng(1))  # fmt: skip
    off = np.array([apex_errors(prepared, law, make_solver) for law in [card.law, *drawn]])
    spread = np.nanstd(off[1:], axis=0, ddof=1) if len(drawn) else np.zeros(len(off[0]))
    noise = prepared.test.noise or 0.0
    return (np.abs(off[0]) <= 1.96 * np.hypot(spread, noise)).tolist()


def apex_errors(prepared, law, make_solver):
    """Return (pressures,) mm, model less measurement of dz at the point nearest to the centre."""
    (comparison,) = prepared.comparisons(make_solver, Weighting(relative=True))
    problem, y = problem_at(law, [comparison])
    point = fit_nuisance(problem, y)[0]
    if point is None:
        return np.full(len(FEW), np.nan)
    nuisance = problem.unknowns.nuisance_values(comparison.name, point.unknowns)
    objective, (history,) = comparison.objective, point.histories
    nearest = [np.hypot(*at[:, :2].T).argmin() for at in objective.positions[::3]]
    parts = objective.differences(history.displacement, nuisance)
    return np.array([own[n, 2] for own, n in zip(parts, nearest, strict=True)])


def scatter_of_strips():
    """Return the sum over the directions of the RMS distance of points from their polynomial, N."""
    file = SHARED / "uniaxial" / "valmex7318_load_gauge.csv"
    if not file.is_file():
        return float("nan")
    table, total = pd.read_csv(file, comment="#"), 0.0
    for _, own in table.groupby("series"):
        u, load = own.gauge_disp_mm.to_numpy(), own.load_N.to_numpy()
        terms = u[:, None] ** np.arange(1, 5)
        left = load - terms @ np.linalg.lstsq(terms, load, rcond=None)[0]
        total += float(np.sqrt(np.mean(left**2)))
    return total


if __name__ == "__main__":
    start_on(main)
