"""Fit nu12 with the moduli to computed data of bubbles, strips and biaxial tests; 0.24 is right."""

from dataclasses import replace

import bubblefit as bf
import numpy as np
from bubblefit.experiments.base import Planning
from bubblefit.experiments.biaxial.prepared import PreparedBiaxial
from bubblefit.experiments.biaxial.prepared import candidates as biaxial_candidates
from bubblefit.experiments.bubble.prepared import PreparedBubble
from bubblefit.experiments.strips.prepared import candidates
from bubblefit.inference.assessment import certainty
from bubblefit.inference.methods.lm import LevenbergMarquardt
from bubblefit.inference.nuisance_fit import verdicts
from bubblefit.materials.biaxial_patch import biaxial_response
from bubblefit.project.schema import UnknownSection, UnknownsSection
from common import BENDING, EXAMPLES, known_project, known_setup, start_on

FROM, OF_LOAD, OF_STRAIN = 0.1, 0.01, 1e-4
STRIPS = ("warp strip", "fill strip", "strip at 45 degrees")
RATIOS = ("biaxial 1:1", "biaxial 2:1", "biaxial 1:2")
#: %, as the example has them: noise, and what the loading that is compared leaves of strain.
NOISE, KEPT = 0.01, np.array([0.02, 0.03])
#: By what is in the data: noise, of the first reading, too, strain kept.
DATA = {
    "noise, not of the first reading": (NOISE, 0.0, False),
    "noise": (NOISE, 0.0, True),
    "strain kept": (0.0, 1.0, True),
    "noise and strain kept": (NOISE, 1.0, True),
}


def free(project):
    unknowns = UnknownsSection(nu12=UnknownSection(bounds=[0.0, 0.6]))
    settings = project.fit.model_copy(update={"unknowns": unknowns})
    return known_setup(replace(project, fit=settings))


def bubble(sets=10, quads=800):
    """Fit SETS sets of noise on the known solution of QUADS, with strips and biaxial tests.

    Noise of 0.02 and of 0.05 mm, 1 % of the largest load on strips, 0.01 % on biaxial strains;
    and none. Printed: nu12, its scatter, sigma and correlation, and sigma of the moduli.
    """
    setup = free(known_project(quads))
    (test,) = setup.tests
    planning = Planning(test.test.place, [], {}, test.known, setup.make_solver)
    offered = {c.name: c for c in candidates(planning)}
    strips = tuple(offered[name].make() for name in STRIPS)
    biaxial = tuple(c.make() for c in biaxial_candidates(planning) if c.name in RATIOS)
    several = {
        "bubble": (test,),
        "bubble and strips": (test, *strips),
        "bubble and biaxial": (test, *biaxial),
        "bubble, strips and biaxial": (test, *strips, *biaxial),
    }
    for name, tests in several.items():
        for noise in (0.0, 0.02, 0.05):
            own = []
            for number in range(sets if noise else 1):
                random = np.random.default_rng([number, 12])
                own.append(replace(setup, tests=tuple(noisy(t, noise, random) for t in tests)))
            print(f"{name}, {noise:g} mm: {fitted(own, test.known, FROM, True)}", flush=True)


def noisy(test, noise, random):
    """Return the test with noise (mm) on its fields, or a share of it on its loads or strains."""
    if isinstance(test, PreparedBubble):
        fields = tuple(
            replace(f, displacement=f.displacement + noise * random.standard_normal((n, 3)))
            for f in test.fields
            for n in [len(f.points)]
        )
        return replace(test, test=replace(test.test, noise=max(noise, 1e-3)), fields=fields)
    if isinstance(test, PreparedBiaxial):
        (path,) = test.test.paths
        off = (noise > 0) * OF_STRAIN * random.standard_normal(path.strain.shape)
        paths = (replace(path, strain=path.strain + off),)
        return replace(test, test=replace(test.test, paths=paths, noise=OF_STRAIN))
    ((direction, strip),) = test.test.strips.items()
    (curve,) = strip.curves
    level = OF_LOAD * float(curve.load.max())
    load = curve.load + (noise > 0) * level * random.standard_normal(len(curve.load))
    done = replace(strip, curves=(replace(curve, load=load),))
    return replace(test, test=replace(test.test, strips={direction: done}, noise=level))


def fitted(setups, known, nu12, moduli):
    found, sigma, rho, of_moduli = [], [], [], []
    for setup in setups:
        problem = setup.problem()
        unknowns = problem.unknowns
        start = unknowns.at(known.beta[list(unknowns.free)])
        if nu12 is not None:
            start[unknowns.size] = nu12
        optimum = LevenbergMarquardt().minimise(problem, start, setup.options)
        if optimum is None:
            continue
        best = optimum.best
        law = unknowns.law(problem.law, best.unknowns)
        ends = law.strain_range
        if moduli:
            reached = [np.abs([h.strain_min, h.strain_max]).max(axis=0) for h in best.histories]
            ends = np.minimum(np.max(reached, 0), ends)
        sure = certainty(problem, best, law, ends)
        (verdict, *_) = verdicts(sure.posterior, ends)
        found.append(verdict.value)
        sigma.append(verdict.sigma)
        rho.append(verdict.correlation)
        of_moduli.append([float(np.median(s)) for s in sure.sigma.values()])
    spread = f" +- {np.std(found):.4f}" if len(found) > 1 else ""
    words = f"nu12 {np.mean(found):.4f}{spread}, sigma {np.median(sigma):.4f}"
    if not moduli:
        return words
    with_moduli = ", ".join(f"{n} {np.median([r[n] for r in rho]):+.2f}" for n in rho[0])
    free = ", ".join(f"{100 * v:.2g} %" for v in np.median(of_moduli, axis=0))
    return f"{words}, correlation {with_moduli}; median sigma of E1, E2, G12 {free}"


def biaxial(sets=10):
    """Fit SETS of the computed biaxial example with other noise, first reading and strain kept."""
    known = bf.read_project(BENDING, need_data=False).cards["uniaxial"].card.law
    setup = free(bf.read_project(EXAMPLES / "biaxial-computed" / "project.toml"))
    (prepared,) = setup.tests
    test, thickness = prepared.test, setup.project.fabric.thickness
    for words, (noise, kept, first) in DATA.items():
        own = []
        for number in range(sets if noise else 1):
            random, paths = np.random.default_rng([number, 16]), []
            for path in test.paths:
                strain = 100 * biaxial_response(known, path.load, thickness).elongation
                larger = path.load.max(axis=1)
                share = (larger - larger[0]) / (larger[-1] - larger[0])
                added = noise * random.standard_normal(strain.shape)
                added[0] *= first
                added += kept * KEPT * share[:, None]
                paths.append(replace(path, strain=0.01 * (strain + added)))
            data = replace(test.data, paths=tuple(paths))
            changed = replace(prepared, test=replace(test, data=data))
            own.append(replace(setup, tests=(changed,)))
        print(f"{words}: {fitted(own, known, None, False)}", flush=True)


if __name__ == "__main__":
    start_on(bubble, biaxial)
