"""Decks of one's own: the runs of a fit beside other optimisers, and bands of two constants."""

import os
import tempfile
import warnings
from pathlib import Path

import bubblefit as bf
import numpy as np
import scipy.optimize
from bubblefit.experiments.deck.solvers import ANY_LAW
from bubblefit.solvers.calculix.solver import CalculixSolver
from bubblefit.storage.writing import cache_folder

from common import start_on  # isort: skip
from builders.computed_decks import DECKS, ComputedDeck
from builders.rubber_bulge import TRUE, bulge_heights, bulge_project

#: Step of SciPy's differences, for results of six digits, as a share of a value.
STEP = 1e-3


def largest_error(values, truth):
    return max(abs(values[name] / number - 1) for name, number in truth.items())


def by_bubblefit(project, truth, method):
    """Return the largest error of a constant, and the runs, none of which is in a cache."""
    with tempfile.TemporaryDirectory() as folder:
        os.environ["BUBBLEFIT_RUNS"] = folder
        fit = bf.fit(project, method=method, jobs=1)
    values = dict(zip(truth, fit.best.point.unknowns, strict=True))
    return largest_error(values, truth), int(fit.starts()["external_runs"].sum())


def by_scipy(project, truth):
    """Fit by SciPy's least_squares with forward differences, from the middle of the bounds."""
    model = project.tests["deck"].model
    measured = np.concatenate([c.load for c in project.tests["deck"].matched.values()])
    lower, upper = np.array(list(model.bounds.values())).T
    start = np.sqrt(lower * upper) * 1.1
    solver = CalculixSolver()
    loads = []

    def residual(values):
        changes = {name: v - model.values[name] for name, v in zip(truth, values, strict=True)}
        load = solver.run(model.with_parameters(changes).deck(ANY_LAW), ANY_LAW).load
        loads.append(load)
        return load / measured - 1

    solution = scipy.optimize.least_squares(
        residual, start, bounds=(lower, upper), diff_step=STEP, x_scale=start
    )
    return largest_error(dict(zip(truth, solution.x, strict=True)), truth), len(loads)


def runs():
    """Count runs until the constants of CalculiX' test decks are found (sh .ci/decks)."""
    warnings.simplefilter("ignore")
    for name, settings in DECKS.items():
        deck = ComputedDeck(cache_folder() / "calculix" / "decks" / f"{name}.inp", *settings)
        truth = deck.truth()
        with tempfile.TemporaryDirectory() as folder:
            project = deck.project(Path(folder))
            ways = {
                "lm": by_bubblefit(project, truth, "lm"),
                "cobyla": by_bubblefit(project, truth, "cobyla"),
                "least_squares": by_scipy(project, truth),
            }
            for way, (error, count) in ways.items():
                print(f"{name}, {way}: {count} runs, off by {error:.1e}", flush=True)


def bands(sets=20):
    """Fit SETS noisy data sets of a rubber bulge, and count the bands that hold the truth."""
    warnings.simplefilter("ignore")
    held = dict.fromkeys(TRUE, 0)
    with tempfile.TemporaryDirectory() as folder:
        heights = bulge_heights(Path(folder))
        for seed in range(sets):
            fit = bf.fit(bulge_project(Path(folder), heights, seed), jobs=1)
            for name, numbers in fit.parameters.items():
                low, high = numbers["band"]
                held[name] += low <= TRUE[name] <= high
    print(f"of {sets} bands of 95 % hold the truth: {held}")


if __name__ == "__main__":
    start_on(runs, bands)
