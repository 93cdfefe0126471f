"""Do the bands of a fit hold the truth? Fields of a known law with noise that neighbours share.

Usage: bench_coverage.py [FIELDS] [QUADS]. FIELDS (100 unless given) sets of displacements of the
example's law, computed on a mesh of 7200 quads, with 0.02 mm of noise that is alike over a facet
(a Gaussian of 2.5 mm, two points a facet), matched at the nodes of a disk of QUADS (432) quads,
whole, from the true law on. Printed: how often |fitted - true| <= 1.96 sigma at 61 strains of each
modulus up to 0.9 of what is reached, with sigma from noise and mesh, from noise that neighbours
share, and from noise taken for white.
"""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
from bubblefit.data.fields import DisplacementField
from bubblefit.experiments.bubble.prepared import PreparedBubble
from bubblefit.experiments.bubble.sources import KnownSolution
from bubblefit.experiments.bubble.test import BubbleTest
from bubblefit.fits.best import best_fit
from bubblefit.fits.budget import with_certainty
from bubblefit.fits.setup import FitSetup, prepare_fit
from bubblefit.fits.start import StartRecord
from bubblefit.identification.methods.lm import LevenbergMarquardt
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
        white = 1 / np.sqrt(sure.alike["bubble"])
        for name, strain in sure.strain.items():
            some = strain <= SHARE * strain[-1]
            off = np.abs(known.modulus(name, strain) / best.law.modulus(name, strain) - 1)[some]
            for what, sigma in (
                ("noise and mesh", sure.total[name]),
                ("noise", sure.sigma[name]),
                ("white noise", white * sure.sigma[name]),
            ):
                inside.setdefault(f"{what}, {name}", []).append(off <= 1.96 * sigma[some])
    for words, held in inside.items():
        print(f"{words:24s}{100 * np.mean(np.concatenate(held)):6.1f} % within 1.96 sigma")


if __name__ == "__main__":
    main()
