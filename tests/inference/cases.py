"""Builders for tests of inference: a quarter bubble with a known solution, bubbles, strips."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from bubblefit.errors import SolverFailure
from bubblefit.experiments.bubble.objective import OFFSETS, FieldObjective
from bubblefit.experiments.bubble.targets import FieldTarget
from bubblefit.experiments.strips.load_objective import LoadObjective
from bubblefit.inference.comparison import Comparison
from bubblefit.inference.methods import FitOptions
from bubblefit.inference.methods.lm import LevenbergMarquardt
from bubblefit.inference.nuisance import Nuisance, NuisanceUnknowns
from bubblefit.inference.problem import FitProblem
from bubblefit.inference.unknowns import LawBounds, Unknowns
from bubblefit.materials.forms import polynomial as forms
from bubblefit.materials.forms.base import form_named
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel, default_increments
from bubblefit.meshes.disk import disk_mesh
from bubblefit.meshes.strip_models import straight_strip
from bubblefit.solvers.base import SolverCheck
from bubblefit.solvers.membrane.solver import MembraneSolver

from ..builders.laws import TABLE_4_2

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


def bubble_problem(unknowns=CUBIC, noise=0.0, normalise="e", **other):
    objective = FieldObjective(targets(noise=noise), normalise)
    return one_comparison_problem(MODEL, MembraneSolver(), LAW, objective, unknowns, **other)


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


def one_comparison_problem(model, solver, law, objective, unknowns, **other):
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


def fitted_by_lm(fit, start, tolerance, most):
    options = FitOptions(tolerance=tolerance, max_analyses=most)
    return LevenbergMarquardt().minimise(fit, start, options)


def clean_fit(model, law, unknowns, shift=0.0, parameters=None):
    fields = MembraneSolver(1e-10).run(model.with_parameters(parameters or {}), law).displacement
    pairs = zip(model.pressures, fields, strict=True)
    data = [FieldTarget(p, u + shift) for p, u in pairs]
    return one_comparison_problem(model, MembraneSolver(), law, FieldObjective(data), unknowns)


def noise_of(fit, each, random):
    """(m,) white noise of each comparison's data, as it stands in the residual."""
    sizes = {c.name: sum(c.objective.sizes) for c in fit.comparisons}
    drawn = [each[name] * random.standard_normal(size) for name, size in sizes.items()]
    return np.concatenate(drawn) / fit.scale


def follows(fit, point, noise):
    """Where a fit goes (unknowns,) that began at `point`, to first order.

    Its blocks are weighted so that the sum of their norms is least.
    """
    root = 1.0 / np.sqrt(fit.blocks.norms(point.residual)[fit.blocks.block_of])
    by_noise = root * noise.T
    return np.linalg.lstsq(root[:, None] * point.jacobian, by_noise.T, rcond=None)[0]


def scatter_of(fit, point, each, draws=4000):
    """Standard deviation of the unknowns (n,) over drawn noise: sure to 1.1 % with 4000 draws."""
    random = np.random.default_rng(11)
    noise = np.array([noise_of(fit, each, random) for _ in range(draws)])
    return np.std(follows(fit, point, noise.T), axis=1)


NODES = MODEL.mesh.points[:, :2]


def correlated_noise_root(length):
    """A root of the correlation of neighbours, (places, places)."""
    distance = np.hypot(*(NODES[:, None] - NODES).T)
    return np.linalg.cholesky(np.exp(-((distance / length) ** 2)) + 1e-9 * np.eye(len(NODES)))


TIGHT = 1e-11
PRESSURE = Nuisance("pressure_offset", -18.0, 50.0, "kPa", "pressure_offset", 1e-3)
SHIFTS = tuple(Nuisance(f"offset_{axis}", -20.0, 20.0, "mm") for axis in "xyz")
BUBBLE_OF_100_MM = BubbleModel(disk_mesh(100.0, 96, "quarter"), 0.81, [0.05, 0.12, 0.2])
BUBBLE_OF_80_MM = BubbleModel(disk_mesh(80.0, 96, "quarter"), 0.81, [0.06, 0.15])


def noisy_bubble_comparison(name, model, *nuisance, **other):
    fields = MembraneSolver(TIGHT).run(model, LAW).displacement
    fields = fields + 0.02 * np.random.default_rng(5).standard_normal(fields.shape)
    return Comparison(
        name, model, MembraneSolver(TIGHT), fields_objective(model, fields), nuisance, **other
    )


def fields_objective(model, fields):
    return FieldObjective([FieldTarget(p, u) for p, u in zip(model.pressures, fields, strict=True)])


def cubic_problem_of(*comparisons):
    unknowns = Unknowns.of(CUBIC.form, 0.24, RANGE, CUBIC.bounds, comparisons)
    return FitProblem(comparisons, LAW, unknowns)


def two_bubbles():
    """The nuisance of the first: what the objective knows on both sides of what the solver does."""
    first = noisy_bubble_comparison("bubble 1", BUBBLE_OF_100_MM, SHIFTS[2], PRESSURE, SHIFTS[0])
    return cubic_problem_of(first, noisy_bubble_comparison("bubble 2", BUBBLE_OF_80_MM, PRESSURE))


NU12 = Nuisance("nu12", 0.0, 0.5, "", start=0.3, law_parameter="nu12", shared=True)
THICKNESS = Nuisance(
    "thickness", 0.6, 1.0, "mm", "thickness", prior=0.02, weight=1e-3, start=0.8, shared=True,
    hint="only the product",
)  # fmt: skip
SHIFT = Nuisance("offset_z", -20.0, 20.0, "mm")
BUBBLE = BubbleModel(disk_mesh(100.0, 32, "quarter"), 0.8, [0.05, 0.12, 0.2])
STRIP = straight_strip("fill", 22.78, 27.0, 0.8, increments=5)


def bubble_and_strip(*shared, law=LAW):
    solver = MembraneSolver(TIGHT)
    bubble = fields_objective(BUBBLE, solver.run(BUBBLE, law).displacement)
    loads = solver.run(STRIP, law).load
    pulled = LoadObjective(STRIP.elongations, STRIP.elongations, loads, 1000.0, least_noise=2.0)
    own = (SHIFT, *shared, PRESSURE)  # what is shared need not come first
    comparisons = (
        Comparison("bubble", BUBBLE, MembraneSolver(TIGHT), bubble, own),
        Comparison("strip", STRIP, MembraneSolver(TIGHT), pulled, tuple(reversed(shared)),
                   contracts=True),
    )  # fmt: skip
    unknowns = Unknowns.of(CUBIC.form, 0.24, RANGE, CUBIC.bounds, comparisons)
    return FitProblem(comparisons, law, unknowns)


def first_start(starts, number, seed=1, unknowns=CUBIC):
    return next(iter(starts.candidates(unknowns, seed, number)))


SPLINE = form_named("spline", {"knots": {"warp": 5, "fill": 4, "shear": 6}}, RANGE)
RANGES = {"E1": (20.0, 2000.0), "E2": (20.0, 1000.0), "G12": (0.5, 200.0)}


def unknowns_of_form(name, **options):
    form = form_named(name, options, RANGE)
    return Unknowns.of(form, 0.24, RANGE, LawBounds.of_moduli(RANGES))
