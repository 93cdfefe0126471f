"""A quarter bubble of 45 quads with a known solution, for the tests of inference."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.experiments.bubble.objective import OFFSETS, FieldObjective
from bubblefit.experiments.bubble.targets import FieldTarget
from bubblefit.inference.comparison import Comparison
from bubblefit.inference.law_bounds import LawBounds
from bubblefit.inference.methods import FitOptions
from bubblefit.inference.methods.lm import LevenbergMarquardt
from bubblefit.inference.nuisance import Nuisance, NuisanceUnknowns
from bubblefit.inference.problem import FitProblem
from bubblefit.inference.unknowns import Unknowns
from bubblefit.materials.forms import polynomial as forms
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel, default_increments
from bubblefit.meshes.disk import disk_mesh
from bubblefit.solvers.base import SolverCheck
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..published_laws import TABLE_4_2

# Thesis Table 4.2, GPa: solution and bounds.
SOLUTION = TABLE_4_2
LOWER = [-1e-2, 0, -3e-1, 7e-3, -1e3, -1e1, -1e1, 5e-2, -1e3, 0, -70, 0.25]
UPPER = [0, 1, 0, 7e-2, 1e2, 1e2, 1, 0.5, 0, 7e2, 0, 1.5]
RANGE = [0.13, 0.13, 0.13]
PRESSURES = 1e-3 * np.array([22.0, 59.0, 97.0, 132.0, 186.0, 251.0, 300.0])
LAW = HypoelasticLaw(1e3 * np.array(SOLUTION), 0.24, RANGE)
MODEL = BubbleModel(
    disk_mesh(100.0, 192, "quarter"), 0.81, PRESSURES, default_increments(PRESSURES)
)
MARGINS = {"E1": 5.0, "E2": 5.0, "G12": 0.5}
ENTRIES = LawBounds(MARGINS, None, 1e3 * np.array(LOWER), 1e3 * np.array(UPPER))
CUBIC = Unknowns.of(forms.CUBIC, 0.24, RANGE, ENTRIES)
NUISANCE = (
    *(Nuisance(name, -20.0, 20.0, "mm") for name in OFFSETS),
    Nuisance("pressure_offset", -0.9e3 * PRESSURES[0], 50.0, "kPa", "pressure_offset", 1e-3),
)
EVERYTHING = replace(CUBIC, nuisance=NuisanceUnknowns({"bubble": NUISANCE}))
CONSTANT_BOUNDS = LawBounds(MARGINS, None, *np.array([[1.0, 50.0, 50.0], [100.0, 1000.0, 1500.0]]))
CONSTANT = Unknowns.of(forms.CONSTANT, 0.24, RANGE, CONSTANT_BOUNDS)
#: Moduli near those of a fit of constants to the fields of the cubics, MPa: G12, E2, E1.
NEAR = np.array([15.0, 190.0, 330.0])


@cache
def reference():
    return MembraneSolver(1e-10).run(MODEL, LAW)


def targets(fields=None, noise=0.0):
    fields = reference().displacement if fields is None else fields
    random = np.random.default_rng(12)
    return [
        FieldTarget(p, u + noise * random.standard_normal(u.shape))
        for p, u in zip(MODEL.pressures, fields, strict=True)
    ]


def problem(unknowns=CUBIC, noise=0.0, normalise="e", **other):
    objective = FieldObjective(targets(noise=noise), normalise)
    return single(MODEL, MembraneSolver(), LAW, objective, unknowns, **other)


def differentiated(fit, y, columns=None, floor=0.0):
    """Return the evaluation at y; its derivatives and those of e are checked by differences.

    floor: share of the largest derivative below which a column is compared with that share.
    """
    point = fit.evaluate(y, True)
    assert point.jacobian.shape == (len(point.residual), len(y))
    slope = fit.blocks.gradient(point.residual, point.jacobian)
    size = np.abs(point.jacobian).max()
    for k in range(len(y)) if columns is None else columns:
        step = 1e-4 * max(1.0, abs(y[k])) * np.eye(len(y))[k]
        ahead, behind = (fit.evaluate(y + s, False, warm=False) for s in (step, -step))
        column = (ahead.residual - behind.residual) / (2 * step[k])
        off = np.abs(point.jacobian[:, k] - column).max()
        assert off < 2e-5 * max(np.abs(column).max(), floor * size), k
        e_slope = (ahead.value - behind.value) / (2 * step[k])
        assert slope[k] == pytest.approx(e_slope, rel=1e-3, abs=1e-5 * np.abs(slope).max())
    return point


def single(model, solver, law, objective, unknowns, **other):
    nuisance = unknowns.nuisance.comparisons.get("bubble", ())
    comparison = Comparison("bubble", model, solver, objective, nuisance)
    return FitProblem((comparison,), law, unknowns, **other)


class Failing(MembraneSolver):
    """Ends badly, or returns NaN, whenever `when` says so."""

    def __init__(self, when, how="failure"):
        super().__init__()
        self.when, self.how, self.runs = when, how, 0

    def _analyse(self, *arguments):
        self.runs += 1
        if not self.when(self.runs):
            return super()._analyse(*arguments)
        if self.how == "failure":
            raise SolverFailure("on purpose")
        history, rates = super()._analyse(*arguments)
        return replace(history, displacement=history.displacement * np.nan), rates * np.nan


class Thicker:
    """Stands for another finite element program: 2 % thicker, rounded to `digits`, no slopes.

    Loads of strips are wavy, too. fails : numbers of the runs that do. unstable_from : the first
    whose equilibrium is not stable.
    """

    name, external, progress, identity = "thicker", True, None, "thicker"

    def __init__(self, digits=12, fails=(), unstable_from=1000):
        self.digits, self.fails, self.runs = digits, fails, 0
        self.unstable_from = unstable_from
        self.membrane = MembraneSolver(1e-10)

    def run(self, model, law, *unused):
        self.runs += 1
        if self.runs in self.fails:
            raise SolverFailure("on purpose", self.name)
        history = self.membrane.run(replace(model, thickness=1.02 * model.thickness), law)
        unstable = () if self.runs < self.unstable_from else ("300 kPa",)
        wave = 0.01 * np.sin(np.arange(len(history.load))) * hasattr(model, "elongations")
        return replace(
            history, load=(1 + wave) * history.load, unstable=unstable,
            displacement=np.round(history.displacement, self.digits),
        )  # fmt: skip

    def check(self):
        return SolverCheck(self.name, True, "1", True)


def levenberg_marquardt(fit, start, tolerance, most):
    options = FitOptions(tolerance=tolerance, max_analyses=most)
    return LevenbergMarquardt().minimise(fit, start, options)


def clean_fit(model, law, unknowns, shift=0.0, parameters=None):
    fields = MembraneSolver(1e-10).run(model.with_parameters(parameters or {}), law).displacement
    pairs = zip(model.pressures, fields, strict=True)
    data = [FieldTarget(p, u + shift) for p, u in pairs]
    return single(model, MembraneSolver(), law, FieldObjective(data), unknowns)


def noise_of(fit, each, random):
    """(m,) white noise of each comparison's data, as it stands in the residual."""
    sizes = {c.name: sum(c.objective.sizes) for c in fit.comparisons}
    drawn = [each[name] * random.standard_normal(size) for name, size in sizes.items()]
    return np.concatenate(drawn) / fit.scale


def follows(fit, point, noise):
    """Where a fit goes (unknowns,) that began at `point`, to first order.

    Its blocks are weighted so that the sum of their norms is least.
    """
    root = 1.0 / np.sqrt(fit.blocks.norms(point.residual)[fit.blocks.of])
    by_noise = root * noise.T
    return np.linalg.lstsq(root[:, None] * point.jacobian, by_noise.T, rcond=None)[0]


def scatter_of(fit, point, each, draws=4000):
    """Standard deviation of the unknowns (n,) over drawn noise: sure to 1.1 % with 4000 draws."""
    random = np.random.default_rng(11)
    noise = np.array([noise_of(fit, each, random) for _ in range(draws)])
    return np.std(follows(fit, point, noise.T), axis=1)
