"""Can nu12 be identified? The example's data, a bubble alone, with strips, with a biaxial test.

Usage: bench_nu12.py [SETS] [QUADS]. SETS (10 unless given) sets of white noise of 0.02 and of 0.05
mm on the displacements of the known solution (800 quads as a quarter), of 1 % of the largest load
on strips along warp, fill and bias that the same law computes, of 0.01 % on the strains of biaxial
paths of 1:1, 2:1 and 1:2 up to the strains of the law; and none. Fits have nu12 free and begin at
0.1 with the moduli of the known law. Printed: nu12 found (0.24 is right), its scatter, the sigma
that a fit says (median), its correlation with the moduli in the middle of their strains, and that
of the moduli.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from bubblefit.experiments.biaxial.candidates import candidates as biaxial_candidates
from bubblefit.experiments.biaxial.prepared import PreparedBiaxial
from bubblefit.experiments.bubble.prepared import PreparedBubble
from bubblefit.experiments.kinds import Planning, PreparedTest
from bubblefit.experiments.strips.candidates import candidates
from bubblefit.experiments.strips.prepared import PreparedStrips
from bubblefit.inference.assessment import certainty, verdicts
from bubblefit.inference.methods.lm import LevenbergMarquardt
from bubblefit.project.schema import UnknownSection, UnknownsSection
from bubblefit.runs.setup import FitSetup
from known_solution import known_project, known_setup

RIGHT, FROM = 0.24, 0.1
OF_LOAD = 0.01
STRIPS = ("warp strip", "fill strip", "strip at 45 degrees")
#: Ratios of the biaxial test, and the share of noise of its strains.
RATIOS, OF_STRAIN = ("biaxial 1:1", "biaxial 2:1", "biaxial 1:2"), 1e-4


def setups(quads: int) -> dict[str, FitSetup]:
    """The bubble alone, and with strips and a biaxial test of the same law; nu12 free."""
    project = known_project(quads)
    free = UnknownsSection(nu12=UnknownSection(bounds=[0.0, 0.6]))
    project = replace(project, fit=project.fit.model_copy(update={"unknowns": free}))
    setup = known_setup(project)
    (bubble,) = setup.tests
    assert bubble.known is not None
    planning = Planning(bubble.test.place, [], {}, bubble.known, setup.make_solver)  # type: ignore[attr-defined]
    offered = {c.name: c for c in candidates(planning)}
    strips = tuple(offered[name].make() for name in STRIPS)
    biaxial = tuple(c.make() for c in biaxial_candidates(planning) if c.name in RATIOS)
    several = {
        "bubble": (bubble,),
        "bubble and strips": (bubble, *strips),
        "bubble and biaxial": (bubble, *biaxial),
        "bubble, strips and biaxial": (bubble, *strips, *biaxial),
    }
    return {name: replace(setup, tests=tests) for name, tests in several.items()}


def noisy(test: PreparedTest, noise: float, random: np.random.Generator) -> PreparedTest:
    """The test with noise (mm) on its fields, or 1 % of the largest load on its loads."""
    if isinstance(test, PreparedBubble):
        fields = tuple(
            replace(f, displacement=f.displacement + noise * random.standard_normal((n, 3)))
            for f in test.fields
            for n in [len(f.points)]
        )
        return replace(test, test=replace(test.test, noise=max(noise, 1e-3)), fields=fields)
    if isinstance(test, PreparedBiaxial):
        (path,) = test.test.data.paths
        off = (noise > 0) * OF_STRAIN * random.standard_normal(path.strain.shape)
        data = replace(test.test.data, paths=(replace(path, strain=path.strain + off),))
        return replace(test, test=replace(test.test, data=data, noise=OF_STRAIN))
    assert isinstance(test, PreparedStrips)
    ((direction, strip),) = test.test.strips.items()
    (curve,) = strip.curves
    level = OF_LOAD * float(curve.load.max())
    load = curve.load + (noise > 0) * level * random.standard_normal(len(curve.load))
    done = replace(strip, curves=(replace(curve, load=load),))
    return replace(test, test=replace(test.test, strips={direction: done}, noise=level))


def told(setup: FitSetup, noise: float, sets: int) -> str:
    """What fits to noisy data say."""
    found: list[float] = []
    sigma: list[float] = []
    rho: list[dict[str, float]] = []
    moduli: list[Sequence[float]] = []
    known = setup.tests[0].known
    assert known is not None
    for number in range(sets):
        random = np.random.default_rng([number, 12])
        one = replace(setup, tests=tuple(noisy(t, noise, random) for t in setup.tests))
        problem = one.problem()
        unknowns = problem.unknowns
        start = unknowns.at(known.beta[list(unknowns.free)])
        start[unknowns.size] = FROM
        optimum = LevenbergMarquardt().minimise(problem, start, one.options)
        if optimum is None:
            continue
        best = optimum.best
        law = unknowns.law(problem.law, best.unknowns)
        ends = np.max([np.abs([h.strain_min, h.strain_max]).max(axis=0) for h in best.histories], 0)
        ends = np.minimum(ends, law.strain_range)
        sure = certainty(problem, best, law, ends)
        assert sure.posterior is not None
        (nu12, *_) = verdicts(sure.posterior, ends)
        found.append(nu12.value)
        sigma.append(nu12.sigma)
        rho.append(nu12.correlation)
        moduli.append([float(np.median(s)) for s in sure.sigma.values()])
    spread = f" +- {np.std(found):.4f}" if len(found) > 1 else ""
    with_moduli = ", ".join(f"{n} {np.median([r[n] for r in rho]):+.2f}" for n in rho[0])
    free = ", ".join(f"{100 * v:.2g} %" for v in np.median(moduli, axis=0))
    return (
        f"nu12 {np.mean(found):.4f}{spread}, sigma {np.median(sigma):.4f}, correlation "
        f"{with_moduli}; median sigma of E1, E2, G12 {free}"
    )


def main() -> None:
    sets = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    quads = int(sys.argv[2]) if len(sys.argv) > 2 else 800
    for name, free in setups(quads).items():
        for noise in (0.0, 0.02, 0.05):
            print(f"{name}, {noise:g} mm: {told(free, noise, sets if noise else 1)}", flush=True)


if __name__ == "__main__":
    main()
