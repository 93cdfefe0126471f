"""Check what a plan predicts and what a bootstrap costs."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from bubblefit.errors import SolverFailure
from bubblefit.experiments.base import Candidate, Planning, Weighting
from bubblefit.experiments.registry import kinds
from bubblefit.inference.comparison import Comparison
from bubblefit.inference.linear import PRIOR, information_of
from bubblefit.inference.reported import POINTS
from bubblefit.materials.card import MaterialCard
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.project.project import read_project
from bubblefit.runs import bootstrap as study
from bubblefit.runs.fit import fit
from bubblefit.runs.optimum import CardOptimum, find_optimum
from bubblefit.runs.plan import Query, precision_of
from common import EXAMPLES, SHARED, known_project, start_on

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


def case(scale, noise) -> tuple[CardOptimum, Callable, dict[str, Candidate]]:
    project = known_project(QUADS)
    project = replace(project, law=project.law.model_copy(update={"strain_range": list(RANGE)}))
    (test,) = project.tests.values()
    beta = test.data.beta * np.repeat(scale, 4)
    known = replace(test, data=replace(test.data, beta=beta), noise=noise["bubble"])
    project = replace(project, tests={test.name: known})
    card = MaterialCard(HypoelasticLaw(beta, 0.24, np.array(RANGE)), 0.81, "known")
    present = find_optimum(project, card, None)
    setup, make = present.setup, present.setup.make_leading
    offered = {}
    for name, kind in kinds().items():
        if hasattr(kind, "candidates"):
            own = [t for t in setup.tests if t.test.kind == name]
            law = present.best.law
            planning = Planning(known.place, own, precision_of(present), law, make, noise[name])
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
    def of(cls, comparison: Comparison, specimens: int, present: CardOptimum):
        unknowns, objective = present.problem.unknowns, comparison.objective
        law = present.best.law
        history, slope = comparison.differentiate(law, unknowns.free, {}, warm=False)
        exact = objective.residual(history, {}) * objective.scale
        slopes = slope @ unknowns.to_coefficients * objective.scale[:, None]
        # Specimens that are alike but for their noise are one of less noise.
        return cls(comparison, specimens, exact, slopes, objective.least_noise / specimens**0.5)

    def residual(self, present: CardOptimum, y):
        """Return model less exact data, (m,), at unknowns y of the law."""
        unknowns, objective = present.problem.unknowns, self.comparison.objective
        law = present.best.law.with_beta(unknowns.beta(y))
        history = self.comparison.run(law, unknowns.free, {}, warm=True)
        return objective.residual(history, {}) * objective.scale - self.exact


def scatter(tests: "list[Simulated]", present: CardOptimum, asked: Query, sets, seed):
    """Return the RMS scatter of G12 in refits along its strain, and how many sets had no fit."""
    size = PRIOR * np.abs(present.point.unknowns)
    whole = sum(t.slopes.T @ t.slopes / t.sigma**2 for t in tests) + np.diag(size**-2)
    true, strain = present.point.unknowns, np.linspace(0.0, asked.ends[2], POINTS)
    exact = present.best.law.G12(strain)
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
        law = present.best.law.with_beta(present.problem.unknowns.beta(y))
        off.append(law.G12(strain) / exact - 1.0)
    return float(np.sqrt(np.mean(np.square(off)))), failed


def designs(scale, noise, sets, seed):
    present, make, offered = case(scale, noise)
    ends = np.minimum(present.best.reached, RANGE)
    asked = Query(present.certainty.reported, present.best.law, ends)
    (own,) = present.problem.comparisons
    bubble = Simulated.of(own, 1, present)
    rows = []
    for place, (name, specimens) in enumerate(DESIGNS, start=1000):
        (added,) = offered[name].make().comparisons(make, Weighting())
        more, _ = information_of(added, present.best.law, present.problem.unknowns)
        predicted = asked.moduli(specimens * more)["G12"].rms_sigma
        both = [bubble, Simulated.of(added, specimens, present)]
        simulated, failed = scatter(both, present, asked, sets, seed or place)
        rows.append((f"{name}, {specimens} specimens", predicted, simulated, failed))
    return rows


def plan(sets=250, repetitions=10, ranked=30):
    """Compare the predicted uncertainty of ten designs with the scatter of refits of noisy data.

    The example's bubble on 48 quads and one more test; SETS of noise, fitted by Gauss-Newton steps.
    Then REPETITIONS with other laws and noise, RANKED sets each: is the first in rank first?
    """
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
        print(f"law {number}, noise {noise['bubble']:.4f} mm, {noise['strips']:.2f} N: first "
              f"{by_plan[0]} ({100 * by_plan[1]:.2f} %), by simulation "
              f"{by_simulation[0]} ({100 * by_simulation[2]:.2f} %)", flush=True)  # fmt: skip
    if repetitions:
        print(f"the first in rank is first by simulation: {first} of {repetitions}")


def bootstrap(samples=100, *, data=str(SHARED / "bubble"), elements=108):
    """Bootstrap the frames of the published test 1; print analyses and whether refits settle."""
    project = read_project(EXAMPLES / "bubble-valmex7318" / "test1-linear.toml", Path(data))
    (test,) = project.tests.values()
    project = replace(project, tests={test.name: replace(test, elements=elements)})
    found = fit(project, starts=1)
    print(f"fit: {found.objective:.4g} mm, {found.result['analyses']} analyses, 1 start")
    done = study.bootstrap(project, "frames", samples, found.card)
    each = [sample.analyses for sample in done.samples]
    print(f"{len(each)} samples: {done.analyses} analyses in all, {np.mean(each):.2f} a sample, "
          f"{max(each)} at most; {done.unfinished} used up theirs")  # fmt: skip
    for name, (own, of_fit) in done.sigma.items():
        print(f"  1 sigma of {name}: {100 * own:.3g} % (fit, by noise: {100 * of_fit:.3g} %)")
    study.MAX_ANALYSES *= 10
    study.REFIT = replace(study.REFIT, negligible_decrease=1e-9)
    few = max(2, samples // 10)
    settled = study.bootstrap(project, "frames", few, found.card)
    for name, moduli in settled.moduli.items():
        sigma = done.moduli[name].std(axis=0, ddof=1)
        off = np.abs(moduli - done.moduli[name][:few]) / sigma
        print(f"  {name} of {few} samples moves by {off.max():.2g} sigma at most when it settles")


if __name__ == "__main__":
    start_on(plan, bootstrap)
