"""Do the bands of a fit hold the truth? Fields of a known law with noise that neighbours share.

Usage: bench_coverage.py [FIELDS] [QUADS]. FIELDS (100 unless given) sets of displacements of the
example's law, computed on a mesh of 7200 quads, with 0.02 mm of noise that is alike over a facet
(a Gaussian of 2.5 mm, two points a facet), matched at the nodes of a disk of QUADS (432) quads,
whole, from the true law on. Printed, at the strains of each modulus up to 0.9 of what is reached:
how often the truth lies in the band that the fit reports (95 %: noise, and the mesh's error as a
bias), in that of the law from which the mesh's error is taken out, and within 1.96 sigma of noise
alone; and how wide the second is beside what the moduli without the mesh's error scatter by.
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
from bubblefit.experiments.bubble.prepared import PreparedBubble
from bubblefit.experiments.bubble.test import BubbleTest, KnownSolution
from bubblefit.inference.methods.lm import LevenbergMarquardt
from bubblefit.inference.posterior import bands_of
from bubblefit.readers.fields import DisplacementField
from bubblefit.runs.best import best_fit, with_certainty
from bubblefit.runs.setup import FitSetup, prepare_fit
from bubblefit.runs.starts import StartRecord
from known_solution import known_project

FINE, NOISE, FACET = 7200, 0.02, 2.5
SHARE = 0.9


def setup_of(quads: int) -> FitSetup:
    """The fit, its data without noise."""
    project = known_project()
    (test,) = project.tests.values()
    assert isinstance(test, BubbleTest) and isinstance(test.data, KnownSolution)
    data = replace(test.data, elements=FINE)
    case = replace(test, elements=quads, symmetry="quarter", data=data, noise=1e-3)
    changed = replace(project, tests={test.name: case})
    return prepare_fit(changed, changed.chosen(None, fitted=True))  # type: ignore[arg-type]


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    quads = int(sys.argv[2]) if len(sys.argv) > 2 else 432
    setup = setup_of(quads)
    (prepared,) = setup.tests
    assert isinstance(prepared, PreparedBubble) and prepared.known is not None
    (comparison,) = setup.problem().comparisons
    exact, known = comparison.objective.targets, prepared.known  # type: ignore[attr-defined]
    nodes = comparison.model.mesh.points[:, :2]
    distance = np.hypot(*(nodes[:, None] - nodes).T)
    root = np.linalg.cholesky(np.exp(-((distance / FACET) ** 2)) + 1e-9 * np.eye(len(nodes)))
    inside: dict[str, list[np.ndarray]] = {}
    moduli: dict[str, list[np.ndarray]] = {}
    widths: dict[str, list[np.ndarray]] = {}
    for number in range(count):
        random = np.random.default_rng([number, 7])
        fields = tuple(
            DisplacementField(
                target.pressure,
                nodes,
                target.displacement + NOISE * root @ random.standard_normal((len(nodes), 3)),
            )
            for target in exact
        )
        one = replace(setup, tests=(replace(prepared, fields=fields),))
        problem = one.problem()
        start = problem.unknowns.at(known.beta[list(problem.unknowns.free)])
        optimum = LevenbergMarquardt().minimise(problem, start, one.options)
        if optimum is None:
            print(f"field {number}: no fit")
            continue
        y, b = (tuple(v.tolist()) for v in (optimum.best.unknowns, optimum.coefficients))
        record = StartRecord(number, (0, 0), optimum.value, optimum.status, 0, y, b, 0.0)
        best = with_certainty(one, problem, best_fit(problem, [record], 1e-7))
        sure = best.certainty
        assert sure is not None and sure.mesh is not None
        assert sure.fine is not None
        out = best.law.with_beta(problem.unknowns.beta(sure.fine.best))
        without = bands_of(sure.fine, out, sure.strain)
        for name, strain in sure.strain.items():
            some = strain <= SHARE * strain[-1]
            true, own = known.modulus(name, strain), best.law.modulus(name, strain)
            noise = 1.96 * sure.sigma[name] * own
            for what, (lower, upper) in (
                ("as reported", sure.band[name]),
                ("mesh's error taken out", without[name]),
                ("noise alone, 1.96 sigma", (own - noise, own + noise)),
            ):
                held = (lower <= true) & (true <= upper)
                inside.setdefault(f"{what}, {name}", []).append(held[some])
            moduli.setdefault(name, []).append(out.modulus(name, strain)[some] / true[some])
            ends = without[name][:, some] / true[some]
            widths.setdefault(name, []).append((ends[1] - ends[0]) / (2 * 1.96))
    for words, held in inside.items():
        print(f"{words:30s}{100 * np.mean(np.concatenate(held)):6.1f} % of the truth inside")
    for name, own in moduli.items():
        least = min(map(len, own))  # what is reached differs a little from field to field
        wide, off = (np.array([one[:least] for one in of]) for of in (widths[name], own))
        ratio = wide.mean(axis=0) / off.std(axis=0)
        print(f"width of the band over scatter, {name}: {np.median(ratio):.2f} (median)")


if __name__ == "__main__":
    main()
