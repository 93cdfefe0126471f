"""What nu12 of the computed biaxial example hangs on: noise, the first reading, the strain kept.

Usage: bench_biaxial_nu12.py [SETS]. The example's test computed anew SETS times (10 unless given)
with other noise, fitted with nu12 free from the known law on; 0.24 is right. Printed: the mean of
nu12, its scatter, the sigma that a fit says (median).
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import bubblefit as bf
import numpy as np
from bubblefit.inference.assessment import certainty, verdicts
from bubblefit.inference.methods.lm import LevenbergMarquardt
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.materials.responses import biaxial_response
from bubblefit.project.schema import UnknownSection, UnknownsSection
from bubblefit.readers.biaxial import BiaxialPath
from bubblefit.runs.setup import FitSetup, prepare_fit

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
#: %, as the example has them: noise, and what the loading that is compared leaves of strain.
NOISE, KEPT = 0.01, np.array([0.02, 0.03])
#: By what is in the data: noise, of the first reading, too, strain kept.
DATA = {
    "noise, not of the first reading": (NOISE, 0.0, False),
    "noise": (NOISE, 0.0, True),
    "strain kept": (0.0, 1.0, True),
    "noise and strain kept": (NOISE, 1.0, True),
}


def setup() -> tuple[FitSetup, HypoelasticLaw]:
    """The example with nu12 free, and the law behind it."""
    cards = bf.read_project(EXAMPLES / "bend-valmex7318" / "project.toml", need_data=False).cards
    project = bf.read_project(EXAMPLES / "biaxial-computed" / "project.toml")
    free = UnknownsSection(nu12=UnknownSection(bounds=[0.0, 0.6]))
    project = replace(project, fit=project.fit.model_copy(update={"unknowns": free}))
    known = cards["uniaxial"].card.law
    made = prepare_fit(project, project.chosen(None, fitted=True))
    return made, known


def computed(
    path: BiaxialPath, law: HypoelasticLaw, thickness: float, noise: float, kept: float,
    first: bool, random: np.random.Generator,
) -> BiaxialPath:  # fmt: skip
    """The path with strains as the law gives them, and what is added to them."""
    strain = 100 * biaxial_response(law, path.load, thickness).elongation
    larger = path.load.max(axis=1)
    share = (larger - larger[0]) / (larger[-1] - larger[0])
    added = noise * random.standard_normal(strain.shape)
    added[0] *= first
    return replace(path, strain=0.01 * (strain + kept * KEPT * share[:, None] + added))


def told(made: FitSetup, law: HypoelasticLaw, data: tuple[float, float, bool], sets: int) -> str:
    """What fits say of nu12."""
    found, sigma = [], []
    (prepared,) = made.tests
    for number in range(sets):
        random, test = np.random.default_rng([number, 16]), prepared.test
        paths = tuple(
            computed(path, law, made.project.fabric.thickness, *data, random)
            for path in test.data.paths  # type: ignore[attr-defined]
        )
        own = replace(test, data=replace(test.data, paths=paths))  # type: ignore[attr-defined, type-var]
        one = replace(made, tests=(replace(prepared, test=own),))  # type: ignore[type-var]
        problem = one.problem()
        start = problem.unknowns.at(law.beta[list(problem.unknowns.free)])
        optimum = LevenbergMarquardt().minimise(problem, start, one.options)
        assert optimum is not None
        best = optimum.best
        fitted = problem.unknowns.law(problem.law, best.unknowns)
        sure = certainty(problem, best, fitted, fitted.strain_range)
        assert sure.posterior is not None
        (nu12, *_) = verdicts(sure.posterior, fitted.strain_range)
        found.append(nu12.value)
        sigma.append(nu12.sigma)
    spread = f" +- {np.std(found):.4f}" if len(found) > 1 else ""
    return f"nu12 {np.mean(found):.4f}{spread}, sigma {np.median(sigma):.4f}"


def main() -> None:
    sets = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    made, law = setup()
    for words, data in DATA.items():
        print(f"{words}: {told(made, law, data, sets if data[0] else 1)}", flush=True)


if __name__ == "__main__":
    main()
