"""Fits to several tests at once: strips alone, and strips with a quarter bubble of 48 quads."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from bubblefit.errors import SolverFailure
from bubblefit.experiments.bubble.objective import OFFSETS, FieldObjective, FieldTarget
from bubblefit.experiments.strips.prepared import LoadObjective
from bubblefit.inference.comparison import Comparison, Nuisance, NuisanceOf
from bubblefit.inference.problem import FitProblem
from bubblefit.inference.unknowns import LawBounds, Unknowns
from bubblefit.materials.forms import polynomial
from bubblefit.materials.forms.base import COMPONENTS
from bubblefit.materials.forms.spline import TriLinear
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip_models import UniaxialModel, bias_strip, straight_strip
from bubblefit.solvers.base import History, SolverCheck
from bubblefit.solvers.membrane.solver import MembraneSolver

from ...published_laws import TABLE_3_2

# The strains that the tests of table 3.2 reached (logarithmic).
RANGE = (0.153, 0.232, 0.883)
LAW = HypoelasticLaw(1e3 * np.array(TABLE_3_2), 0.24, RANGE)
BREAKS = np.array([[0.04, 0.1], [0.06, 0.15], [0.2, 0.5]])
TRILINEAR = HypoelasticLaw.trilinear(
    (800.0, 300.0, 600.0), (140.0, 110.0, 240.0), (20.0, 14.0, 60.0), BREAKS
)
CONSTANT = HypoelasticLaw.linear(500.0, 200.0, 20.0)
# MPa: least and largest E1, E2, G12 anywhere on the range.
LEAST = np.array([20.0, 20.0, 2.0])
LARGEST = np.array([2000.0, 1000.0, 600.0])
BOUNDS = LawBounds.of_moduli(dict(zip(COMPONENTS, zip(LEAST, LARGEST, strict=True), strict=True)))
CUBIC = Unknowns.of(polynomial.CUBIC, 0.24, RANGE, BOUNDS)
REGIONS = Unknowns.of(TriLinear.at(BREAKS), 0.24, RANGE, BOUNDS)
CONSTANTS = Unknowns.of(polynomial.CONSTANT, 0.24, RANGE, BOUNDS)
NUISANCE = (
    *(Nuisance(name, -20.0, 20.0, "mm") for name in OFFSETS),
    Nuisance("pressure_offset", -45.0, 50.0, "kPa", "pressure_offset", 1e-3),
)
SHIFTED = replace(
    CUBIC, nuisance=NuisanceOf({"bubble": NUISANCE, "warp": (), "fill": (), "bias": ()})
)
FORMS = {
    "cubic": (CUBIC, LAW),
    "trilinear": (REGIONS, replace(TRILINEAR, strain_range=RANGE)),
    "constant": (CONSTANTS, CONSTANT),
}
# Thesis Table 3.1, mm; ten increments and few quads.
STRIPS = {
    "warp": straight_strip("warp", 20.022, 23.329, 0.81, increments=10),
    "fill": straight_strip("fill", 22.780, 28.721, 0.81, increments=10),
    "bias": bias_strip(19.767, 30.734, 0.81, increments=10, across=4, along=6),
}
BUBBLE = BubbleModel(
    disk_mesh(100.0, 192, "quarter"), 0.81, [0.05, 0.12, 0.2], [0.02, 0.05, 0.12, 0.2]
)
TIGHT = 1e-10
#: Strips along the yarns first, then the bias strip, then all.
STAGES = {"warp": 0, "fill": 0, "bias": 1, "bubble": 2}


def measured(model: UniaxialModel, law: HypoelasticLaw, noise: float = 0.0, seed: int = 0) -> Any:
    """Loads that the law gives, at every increment."""
    load = MembraneSolver(TIGHT).run(model, law).load
    return load + noise * np.random.default_rng(seed).standard_normal(len(load))


def strip_tests(
    law: HypoelasticLaw, relative: bool = False, noise: float = 0.0, seed: int = 0
) -> tuple[Comparison, ...]:
    tests = []
    for k, (name, model) in enumerate(STRIPS.items()):
        load = measured(model, law, noise, 10 * seed + k)
        scale = float(load.max()) if relative else 1.0
        objective = LoadObjective(model.elongations, model.elongations, load, scale)
        tests.append(Comparison(name, model, MembraneSolver(), objective, must_be_stable=False))
    return tuple(tests)


def bubble_test(
    law: HypoelasticLaw, noise: float = 0.0, nuisance: tuple[Nuisance, ...] = ()
) -> Comparison:
    fields = MembraneSolver(TIGHT).run(BUBBLE, law).displacement
    fields = fields + noise * np.random.default_rng(3).standard_normal(fields.shape)
    targets = [FieldTarget(p, u) for p, u in zip(BUBBLE.pressures, fields, strict=True)]
    objective = FieldObjective(targets, weight=1 / 9)
    return Comparison("bubble", BUBBLE, MembraneSolver(), objective, nuisance)


def strips(unknowns: Unknowns = CUBIC, law: HypoelasticLaw = LAW, **how: Any) -> Any:
    return FitProblem(strip_tests(law, **how), law, unknowns)


def joint(unknowns: Unknowns = CUBIC, law: HypoelasticLaw = LAW, **how: Any) -> Any:
    """Of one stage, unless `stages` are told."""
    stages, noise = how.pop("stages", False), how.pop("bubble_noise", 0.0)
    bubble = bubble_test(law, noise, unknowns.nuisance.comparisons.get("bubble", ()))
    tests = (bubble, *strip_tests(law, True, **how))
    if stages:
        tests = tuple(replace(test, stage=STAGES[test.name]) for test in tests)
    return FitProblem(tests, law, unknowns)


def near(unknowns: Unknowns, law: HypoelasticLaw, factor: float = 1.03) -> Any:
    """Unknowns a little off the law, offsets on."""
    y = unknowns.at(law.beta[list(unknowns.free)] * factor)
    y[unknowns.size :] = [0.3, -0.2, 0.5, 1.5][: len(unknowns.nuisance_names)]
    return y


def gauge_strains(fit: FitProblem) -> np.ndarray:
    """Strains that the gauges reach, (3,): where a strip test can know the moduli."""
    warp, fill, bias = (STRIPS[d] for d in ("warp", "fill", "bias"))
    ends = [np.log(1 + m.elongations[-1] / m.gauge_length) for m in (warp, fill, bias)]
    return np.array([ends[0], ends[1], ends[2]])


def found_beta(found: Any) -> np.ndarray:
    return np.asarray(CUBIC.beta(found.best.unknowns))


class Thicker:
    """Stands for another finite element program: 2 % thicker and wavy in the load, no slopes."""

    name, external, progress, identity = "thicker", True, None, "thicker"

    def __init__(self, fails: Sequence[int] = ()):
        self.fails, self.runs = tuple(fails), 0
        self.membrane = MembraneSolver(TIGHT)

    def run(self, model: Any, law: HypoelasticLaw, *unused: object) -> History:
        self.runs += 1
        if self.runs in self.fails:
            raise SolverFailure("on purpose", self.name)
        history = self.membrane.run(replace(model, thickness=1.02 * model.thickness), law)
        if not isinstance(model, UniaxialModel):
            return history
        wave = 1.0 + 0.01 * np.sin(np.arange(len(history.load)))
        return replace(history, load=wave * history.load)

    def check(self) -> SolverCheck:
        return SolverCheck(self.name, True, "1", True)


def led(fit: FitProblem, fails: Sequence[int] = ()) -> FitProblem:
    """The same tests, measured and run by the other program."""
    tests = []
    for experiment in fit.comparisons:
        history, objective = Thicker().run(experiment.model, LAW), experiment.objective
        if isinstance(experiment.model, UniaxialModel):
            u = experiment.model.elongations
            objective = LoadObjective(u, u, history.load, float(history.load.max()))
        else:
            targets = [
                FieldTarget(p, u)
                for p, u in zip(BUBBLE.pressures, history.displacement, strict=True)
            ]
            objective = FieldObjective(targets, weight=1 / 9)
        tests.append(replace(experiment, solver=Thicker(fails), objective=objective))
    other = FitProblem(tuple(tests), LAW, fit.unknowns)
    other.surrogate = other.with_solvers([MembraneSolver() for _ in tests])
    return other


class Failing(MembraneSolver):
    """Ends badly at the runs named."""

    def __init__(self, runs: Sequence[int]):
        super().__init__()
        self.bad, self.runs = set(runs), 0

    def _analyse(self, *arguments: Any) -> Any:
        self.runs += 1
        if self.runs in self.bad:
            raise SolverFailure("on purpose")
        return super()._analyse(*arguments)
