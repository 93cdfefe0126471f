"""Is the uncertainty that `bubblefit plan` predicts what refits of noisy data scatter by?

Usage: bench_plan.py [SETS] [REPETITIONS] [RANKED]. The example's bubble on 48 quads is there; ten
designs add one test each. For each, SETS (250 unless given) sets of noise on the computed values of
both tests are fitted by Gauss-Newton steps from the true law on, and the scatter of G12 (root of
the mean square along its strain) stands beside the predicted one. Then REPETITIONS (10) with other
laws and noise, RANKED (30) sets each: is the first in rank first by simulation?
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from bubblefit.errors import SolverFailure
from bubblefit.experiments.bubble.test import BubbleTest, KnownSolution
from bubblefit.experiments.kinds import Candidate, MakeSolver, Planning, Weighting
from bubblefit.experiments.registry import kinds
from bubblefit.inference.comparison import Comparison
from bubblefit.inference.linear import POINTS, PRIOR, Asked, information_of, summary
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.project.project import Project
from bubblefit.runs.plan import Present, present_tests
from bubblefit.runs.setup import prepare_fit
from known_solution import known_project

QUADS = 192  # of the whole disk
NOISE = {"bubble": 0.003, "strips": 4.0}  # mm, N: little, so that refits stay near
RANGE = (0.11, 0.11, 0.11)
STEPS = 2  # of Gauss-Newton, with the derivatives of the true law
#: Design: a candidate by its name, and how many specimens.
DESIGNS = (
    ("the same bubble again", 1), ("bubble to 450 kPa", 1),
    ("bubble, elliptic rim at 0 degrees", 1), ("bubble, elliptic rim at 45 degrees", 1),
    ("bubble, elliptic rim at 90 degrees", 1),
    ("warp strip", 3), ("fill strip", 3), ("strip at 30 degrees", 3), ("strip at 45 degrees", 3),
    ("strip at 45 degrees", 1),
)  # fmt: skip


def case(
    scale: Sequence[float], noise: Mapping[str, float]
) -> tuple[Present, MakeSolver, dict[str, Candidate]]:
    """The bubble with a law of moduli times `scale` (G12, E2, E1), and what could be added."""
    project: Project = known_project(QUADS)
    project = replace(project, law=project.law.model_copy(update={"strain_range": list(RANGE)}))
    (test,) = project.tests.values()
    assert isinstance(test, BubbleTest) and isinstance(test.data, KnownSolution)
    beta = test.data.beta * np.repeat(scale, 4)
    known = replace(test, data=replace(test.data, beta=beta), noise=noise["bubble"])
    project = replace(project, tests={test.name: known})
    setup = prepare_fit(project, [known])
    card = MaterialCard(HypoelasticLaw(beta, 0.24, np.array(RANGE)), 0.81, "known")
    present, make = present_tests(setup, card), setup.make_leading
    offered = {}
    for name, kind in kinds().items():
        if hasattr(kind, "candidates"):
            own = [t for t in setup.tests if t.test.kind == name]
            planning = Planning(known.place, own, present.precision, present.law, make, noise[name])
            offered |= {c.name: c for c in kind.candidates(planning)}
    return present, make, offered


@dataclass
class Simulated:
    """A comparison whose data are what the true law shows; slopes (m, unknowns) in its unit."""

    comparison: Comparison
    specimens: int
    exact: np.ndarray
    slopes: np.ndarray
    sigma: float

    @classmethod
    def of(cls, comparison: Comparison, specimens: int, present: Present) -> Simulated:
        unknowns, objective = present.problem.unknowns, comparison.objective
        history, slope = comparison.differentiate(present.law, unknowns.free, {}, warm=False)
        exact = objective.residual(history, {}) * objective.scale
        slopes = slope @ unknowns.to_coefficients * objective.scale[:, None]
        # Specimens that are alike but for their noise are one of less noise.
        return cls(comparison, specimens, exact, slopes, objective.least_noise / specimens**0.5)

    def residual(self, present: Present, y: np.ndarray) -> np.ndarray:
        """Model less exact data, (m,), at unknowns y of the law."""
        unknowns, objective = present.problem.unknowns, self.comparison.objective
        law = present.law.with_beta(unknowns.beta(y))
        history = self.comparison.run(law, unknowns.free, {}, warm=True)
        return objective.residual(history, {}) * objective.scale - self.exact


def scatter(
    tests: Sequence[Simulated], present: Present, asked: Asked, sets: int, seed: int
) -> tuple[float, int]:
    """Of G12 in refits, root of the mean square along its strain; and how many sets had no fit."""
    size = PRIOR * np.abs(present.point.unknowns)
    whole = sum(t.slopes.T @ t.slopes / t.sigma**2 for t in tests) + np.diag(size**-2)
    true, strain = present.point.unknowns, np.linspace(0.0, asked.ends[2], POINTS)
    exact = present.law.G12(strain)
    off, failed = [], 0
    for number in range(sets):
        noise = [
            t.sigma * np.random.default_rng([seed, number, k]).standard_normal(len(t.slopes))
            for k, t in enumerate(tests)
        ]
        y, residuals = true, [np.zeros(len(t.slopes)) for t in tests]
        try:
            for step in range(STEPS):
                if step:
                    residuals = [t.residual(present, y) for t in tests]
                downhill = (true - y) / size**2
                for t, r, own in zip(tests, residuals, noise, strict=True):
                    downhill = downhill + t.slopes.T @ (own - r) / t.sigma**2
                y = y + np.linalg.solve(whole, downhill)
        except SolverFailure:
            failed += 1
            continue
        law = present.law.with_beta(present.problem.unknowns.beta(y))
        off.append(law.G12(strain) / exact - 1.0)
    return float(np.sqrt(np.mean(np.square(off)))), failed


def designs(
    scale: Sequence[float], noise: Mapping[str, float], sets: int, seed: int
) -> list[tuple]:
    """Name, predicted and simulated figure of G12, and sets without a fit, of every design.

    seed : of the noise, which all designs share; 0: each its own.
    """
    present, make, offered = case(scale, noise)
    ends = np.minimum(present.reached, RANGE)
    asked = Asked(present.problem.unknowns, present.law, present.point.unknowns, ends)
    (own,) = present.problem.comparisons
    bubble = Simulated.of(own, 1, present)
    rows = []
    for place, (name, specimens) in enumerate(DESIGNS, start=1000):
        (added,) = offered[name].make().comparisons(make, Weighting())
        more, _ = information_of(added, present.law, present.problem.unknowns)
        predicted = summary(asked.sigma(present.information + specimens * more))["G12"]
        both = [bubble, Simulated.of(added, specimens, present)]
        simulated, failed = scatter(both, present, asked, sets, seed or place)
        rows.append((f"{name}, {specimens} specimens", predicted, simulated, failed))
    return rows


def main() -> None:
    sets, repetitions, ranked = (
        int(given) if given is not None else usual
        for given, usual in zip([*sys.argv[1:4], None, None, None], (250, 10, 30), strict=False)
    )
    print("design: 1 sigma of G12 predicted, simulated, ratio")
    rows = designs((1.0, 1.0, 1.0), NOISE, sets, 0)
    for name, predicted, simulated, failed in rows:
        lost = f"   {failed} sets without a fit" if failed else ""
        ratio = predicted / simulated
        print(f"{name:50s}{100 * predicted:7.2f} %{100 * simulated:7.2f} %{ratio:7.2f}{lost}")
    inside = sum(abs(p / s - 1) <= 0.2 for _, p, s, _ in rows)
    print(f"within 20 %: {inside} of {len(rows)}", flush=True)
    first = 0
    for number in range(1, repetitions + 1):
        random = np.random.default_rng([number, 14])
        scale = random.uniform(0.7, 1.4, 3)
        # Of one kind up to thirty times more than of the other: another design is best.
        noise = {name: value * 10 ** random.uniform(-0.75, 0.75) for name, value in NOISE.items()}
        rows = designs(scale, noise, ranked, number)
        by_plan, by_simulation = (min(rows, key=lambda row, k=k: row[k]) for k in (1, 2))
        first += by_plan[0] == by_simulation[0]
        print(
            f"law {number}, noise {noise['bubble']:.4f} mm, {noise['strips']:.2f} N: first "
            f"{by_plan[0]} ({100 * by_plan[1]:.2f} %), "
            f"by simulation {by_simulation[0]} ({100 * by_simulation[2]:.2f} %)",
            flush=True,
        )
    if repetitions:
        print(f"the first in rank is first by simulation: {first} of {repetitions}")


if __name__ == "__main__":
    main()
