"""Preparation of a fit: data of the tests, least-squares problem, starts, and coarse meshes."""

import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any, Protocol, runtime_checkable

import numpy as np

from ..errors import InputError, Problems
from ..experiments.base import Masks, PreparedTest, Refinable, Test, Weighting
from ..experiments.cap import CapEstimate
from ..experiments.registry import kind_named
from ..inference.comparison import Comparison
from ..inference.methods import FitOptions, method_named
from ..inference.nuisance import Nuisance
from ..inference.objective import FunctionObjective
from ..inference.problem import FitProblem, Starts
from ..inference.search import EstimatedStarts, RandomStarts, SobolStarts
from ..inference.unknowns import LawBounds, Unknowns
from ..materials.law import HypoelasticLaw
from ..meshes.mesh import Mesh
from ..processes import one_blas_thread
from ..project.project import Project, naming_arguments
from ..solvers.base import DifferentiatingSolver, Solver, check_carries
from ..solvers.registry import SURROGATE, solver_named, usable_solver
from ..solvers.run_cache import digest_of
from .law_setup import bounds_of, law_of, shared_unknowns
from .progress import timed
from .starts import StartRecord

#: Keys of [fit] that do not change the result of a start. The solver does, and is compared by its
#: identity instead of its name.
UNCOUNTED = ("starts", "solver", "jobs", "trust", "mesh_error", "cache")
#: Factor of refinement of the coarse mesh: its edges are twice those of the full mesh.
COARSER = 0.5


@dataclass(frozen=True, eq=False)
class FitSetup:
    """A fit ready to run: everything but the solver, so that it can be sent to worker processes.

    Attributes
    ----------
    project : Project
    law : HypoelasticLaw
        The form of the law; its coefficients are not set.
    bounds : LawBounds
    tests : tuple of PreparedTest
        The tests that are fitted, with their data.
    weight_factors : dict
        Factors by which weights of tests are multiplied, by name of the test.
    starts : Starts
    predicted : tuple of PreparedTest
        Tests of weight 0, which are not fitted.
    """

    project: Project
    law: HypoelasticLaw
    bounds: LawBounds
    tests: tuple[PreparedTest, ...]
    weight_factors: Mapping[str, float] = field(default_factory=dict)
    starts: Starts = field(default_factory=RandomStarts)
    predicted: tuple[PreparedTest, ...] = ()

    @property
    def test_names(self) -> list[str]:
        """Return the names of the tests that are fitted."""
        return [prepared.test.name for prepared in self.tests]

    @property
    def weightings(self) -> tuple[Weighting, ...]:
        """Return the weighting of each test: a single test in its own terms, several relatively."""
        if len(self.tests) == 1:
            return (Weighting(False, 1.0),)
        factors = self.weight_factors
        return tuple(
            Weighting(True, prepared.test.weight * factors.get(prepared.test.name, 1.0))
            for prepared in self.tests
        )

    @functools.cached_property
    def closed_forms(self) -> dict[str, CapEstimate]:
        """Return the closed-form estimate of each test that gives one, by name of the test."""
        estimates = {test.test.name: test.closed_form(self.law) for test in self.tests}
        return {name: estimate for name, estimate in estimates.items() if estimate is not None}

    @property
    def objective_is(self) -> str:
        """Return what the objective of the fit is, in words."""
        if len(self.tests) > 1:
            return "weighted sum of the tests' mean relative RMS errors"
        if self.tests[0].test.name in self.project.objectives:
            return "sum of the RMS of the residuals of a function of one's own"
        return self.tests[0].objective_is

    def problem(self, masks: Masks | None = None) -> FitProblem:
        """Return the least-squares problem of the fit, with a solver of its own.

        Parameters
        ----------
        masks : dict of (m,) bool arrays, optional
            By comparison, which measured points are fitted; by default all.
        """
        make = self.make_solver
        comparisons = self.all_comparisons(
            lambda test, weighting: test.comparisons(make, weighting, masks)
        )
        problem = self.problem_of(comparisons)
        if masks is not None and isinstance(self.starts, EstimatedStarts):
            problem.starts = RandomStarts()  # an estimate would use the points left out
        return problem

    def all_comparisons(
        self, make: Callable[[PreparedTest, Weighting], Sequence[Comparison]]
    ) -> list[Comparison]:
        """Return the comparisons that `make` gives of each test, with the project's objectives."""
        comparisons: list[Comparison] = []
        for test, weighting in zip(self.tests, self.weightings, strict=True):
            comparisons += self.with_objective(test, make(test, weighting), weighting)
        return comparisons

    def with_objective(
        self, test: PreparedTest, comparisons: Sequence[Comparison], weighting: Weighting
    ) -> tuple[Comparison, ...]:
        """Return the comparisons with their weights, and with the user's objective function if any.

        A function does not know the weights of the parts of its test.
        """
        function = self.project.objectives.get(test.test.name)
        if function is None:
            return tuple(replace(c, weight=weighting.weight * c.weight) for c in comparisons)
        weight = weighting.weight / len(comparisons) if weighting.relative else 1.0
        changed = []
        for comparison in comparisons:
            if comparison.objective.columns == 0:
                problem = (
                    f"expected no function: {test.test.kind} tests have an objective of their own"
                )
                raise InputError(test.test.name, "objective", problem)
            objective = FunctionObjective(
                comparison.objective, function, weighting.relative, weight
            )
            ratio = np.median(comparison.objective.scale) / np.median(objective.scale)
            nuisance = tuple(replace(n, weight=ratio * n.weight) for n in comparison.nuisance)
            weight_of_test = weighting.weight
            changed.append(
                replace(comparison, objective=objective, nuisance=nuisance, weight=weight_of_test)
            )
        return tuple(changed)

    def problem_of(self, comparisons: Sequence[Comparison]) -> FitProblem:
        """Return the problem of these comparisons, with a surrogate if the solver needs one."""
        comparisons = with_shared(comparisons, shared_unknowns(self.project))
        law = self.law
        ends = self.law.strain_range.tolist()
        unknowns = Unknowns.of(law.form, law.nu12, ends, self.bounds, comparisons)
        problem = FitProblem(tuple(comparisons), self.law, unknowns, starts=self.starts)
        if not problem.differentiates or any(c.surrogate for c in comparisons):
            problem.surrogate = problem.with_solvers(list(map(_leading, comparisons)))
        return problem

    def make_solver(self, name: str | None = None) -> Solver:
        """Return a solver, by default that of the project."""
        return make_solver(self.project, name)

    def make_leading(self, name: str | None = None) -> Solver:
        """Return the solver if it gives derivatives, or else its surrogate."""
        solver = self.make_solver(name)
        return solver if isinstance(solver, DifferentiatingSolver) else self.make_solver(SURROGATE)

    def comparisons_of(self, test: PreparedTest) -> tuple[Comparison, ...]:
        """Return the comparisons of one test, weighted as if it were the only one."""
        return test.comparisons(self.make_solver, Weighting())

    @property
    def options(self) -> FitOptions:
        """Return how each start is fitted."""
        fit = self.project.fit
        max_analyses = fit.max_analyses or method_named(fit.method).max_analyses
        return FitOptions(fit.method, fit.gradient, fit.constraints, fit.tolerance, max_analyses)


def _leading(comparison: Comparison) -> Solver:
    """Return what leads a comparison: its surrogate, or its solver if that gives derivatives."""
    if comparison.surrogate is not None:
        return comparison.surrogate
    solver = comparison.solver
    return solver if isinstance(solver, DifferentiatingSolver) else solver_named(SURROGATE)


def with_shared(
    comparisons: Iterable[Comparison], shared: Iterable[Nuisance]
) -> tuple[Comparison, ...]:
    """Return the comparisons with the unknowns that all tests share before their own unknowns.

    A prior weighs as one independent value of a block whose norm is that of its noise.
    """
    comparisons = tuple(comparisons)
    shared = tuple(shared)
    if not shared:
        return comparisons
    # What one independent value adds to the norm of a block of noise, the root of its size times
    # its residual; values that err together are one.
    weights = [
        o.correlated_count * o.least_noise / np.median(o.scale) / np.sqrt(np.mean(o.sizes))
        for o in (comparison.objective for comparison in comparisons)
    ]
    weight = np.median(weights)
    shared = tuple(n if n.prior is None else replace(n, weight=weight) for n in shared)
    changed = []
    names = {n.name for n in shared}
    for comparison in comparisons:
        nuisance = [n for n in comparison.nuisance if n.name not in names]
        changed.append(replace(comparison, nuisance=(*shared, *nuisance)))
    return tuple(changed)


#: Receives the words of a step of a command as it begins.
OnStep = Callable[[str], object]


def prepare_fit(
    project: Project, tests: Sequence[Test], on_step: OnStep = lambda words: None
) -> FitSetup:
    """Read or compute the data of the tests, and check all that a fit needs.

    A test of weight 0 is not fitted, but predicted with the fitted law.

    Parameters
    ----------
    project : Project
    tests : sequence of Test
    on_step : callable
        Receives words as the data of each test are read.

    Raises
    ------
    InputError
        The project or its data have an error, or no test has a weight above 0.
    SolverFailure
        The solver is not there, or a known solution cannot be run.
    """
    fitted = tests_with_weight(project, tests)
    with naming_arguments():
        fit = project.fit
        options = project.options_of(fit.solver)
        # A solver that cannot be used is told here once, not by the failure of every analysis.
        solver = usable_solver(fit.solver, options, project.path, "fit.solver", project.run_cache)
        problems = Problems()
        with problems.collected():  # before data are read
            shared_unknowns(project)
        with problems.collected():
            law, bounds = _law_and_bounds(project, solver, fitted)
        problems.raise_if_any()
        prepared = []
        for test in tests:
            with problems.collected():
                prepared.append(prepare_test(project, test, law, on_step))
        problems.raise_if_any()
        starts = SobolStarts() if fit.starts_from == "sobol" else RandomStarts()
        matched = tuple(p for p in prepared if p.test.weight > 0)
        predicted = tuple(p for p in prepared if not p.test.weight > 0)
        return FitSetup(project, law, bounds, matched, starts=starts, predicted=predicted)


def _law_and_bounds(
    project: Project, solver: Solver, tests: Sequence[Test]
) -> tuple[HypoelasticLaw, LawBounds]:
    """Return the law of a fit, without coefficients, and its bounds; raise InputError."""
    law = law_of(project, [test.reach for test in tests])
    try:
        check_carries(solver, law)
    except InputError as error:
        raise InputError(project.path, "law.form", error.problem) from None
    closed_path = project.law.closed_path
    work = np.inf if closed_path is None else closed_path / 100
    return law, replace(bounds_of(project, law.form), work=work)


def tests_with_weight(project: Project, tests: Sequence[Test]) -> list[Test]:
    """Return the tests of a weight above 0; raise InputError if none, or an invalid weight."""
    for test in tests:
        if not 0 <= test.weight < np.inf:
            problem = f"expected 0 or more, got {test.weight:g}"
            raise InputError(project.path, f"{test.name}: weight", problem)
    fitted = [test for test in tests if test.weight > 0]
    if not fitted:
        names = ", ".join(test.name for test in tests)
        problem = f"is 0 for every test chosen ({names}): nothing would be fitted"
        raise InputError(project.path, "weight", f"{problem}; give one of them a weight above 0")
    return fitted


def prepare_test(
    project: Project, test: Test, law: HypoelasticLaw, on_step: OnStep
) -> PreparedTest:
    """Read or compute the data of one test; raises InputError, SolverFailure."""
    on_step(f"reading {test.name}")
    make = functools.partial(make_solver, project)
    with one_blas_thread(), timed(f"{test.name}, its data read and registered"):
        return kind_named(test.kind).prepare(test, law, make)


def make_solver(project: Project, name: str | None = None, **options: Any) -> Solver:
    """Return a solver, by default the project's, with its options in the project and `options`."""
    name = name or project.fit.solver
    return solver_named(name, project.run_cache, **{**project.options_of(name), **options})


def fingerprints(setup: FitSetup, problem: FitProblem) -> dict[str, str]:
    """Return digests of everything on which the result of a start depends, by its part."""
    fit = setup.project.fit
    return {
        "law": digest_of(setup.law, setup.bounds, setup.project.fabric.thickness),
        "fit settings": digest_of(fit.model_dump(exclude=set(UNCOUNTED))),
        "tests": digest_of({t.test.name: dict(t.test.settings()) for t in setup.tests}),
        "data": digest_of([(tuple(c.objective.data), _mark(c.model)) for c in problem.comparisons]),
        "solver": digest_of(fit.solver, problem.solver.identity),
    }


def _mark(model: object) -> str:
    """Return the digest of a model, which may hold what was measured; "" where it has none."""
    with suppress(TypeError):
        return digest_of(model)
    return ""


# Coarse meshes ----------------------------------------------------------------------------------


@runtime_checkable
class MeshedModel(Protocol):
    """A model with a mesh of quadrilaterals; models of bars have none."""

    @property
    def mesh(self) -> Mesh: ...


def quad_count(comparison: Comparison) -> int:
    """Return the number of quadrilaterals of a comparison's model; 0 without a mesh."""
    model = comparison.model
    return len(model.mesh.quads) if isinstance(model, MeshedModel) else 0


def coarse_problem(setup: FitSetup) -> FitProblem | None:
    """Return the fit on coarse meshes by a differentiating solver; None if no test has any."""
    make = setup.make_leading
    comparisons: list[Comparison] = []
    has_coarse = False
    for test, weighting in zip(setup.tests, setup.weightings, strict=True):
        full = test.comparisons(make, weighting)
        coarse = coarse_comparisons(setup, test, weighting, full)
        has_coarse = has_coarse or coarse is not None
        comparisons += setup.with_objective(test, coarse or full, weighting)
    return setup.problem_of(comparisons) if has_coarse else None


def coarse_comparisons(
    setup: FitSetup, test: PreparedTest, weighting: Weighting, full: Sequence[Comparison]
) -> Sequence[Comparison] | None:
    """Return the comparisons of a test on a coarser mesh; None if there is no coarser mesh."""
    if not isinstance(test, Refinable):
        return None
    with suppress(InputError):  # the mesh is as coarse as it can be
        coarse = test.finer(setup.make_leading, weighting, COARSER)
        if any(quad_count(a) < quad_count(b) for a, b in zip(coarse, full, strict=True)):
            return coarse
    return None


def coarse_to_fine(setup: FitSetup, records: Sequence[StartRecord]) -> dict[str, Any] | None:
    """Return what ran on which mesh, as it is written to `result.json`.

    Returns
    -------
    dict or None
        None if all starts ran on the full mesh. Else `quads`, the numbers of quadrilaterals of the
        "coarse" and "full" mesh by comparison; `starts`, the number of starts; `distinct`, the
        number of starts with a fit of their own on the full mesh; and `coarse_analyses` and
        `full_analyses`, the numbers of analyses of all starts on either mesh.
    """
    coarse = coarse_problem(setup) if any(r.coarse_analyses for r in records) else None
    if coarse is None:
        return None
    quads = {}
    for coarse_comparison, full in zip(
        coarse.comparisons, setup.problem().comparisons, strict=True
    ):
        if isinstance(full.model, MeshedModel):
            quads[full.name] = {
                "coarse": quad_count(coarse_comparison),
                "full": quad_count(full),
            }
    coarse_analyses = sum(record.coarse_analyses for record in records)
    return {
        "quads": quads,
        "starts": len(records),
        "distinct": sum(record.same_as is None for record in records),
        "coarse_analyses": coarse_analyses,
        "full_analyses": sum(record.analyses for record in records) - coarse_analyses,
    }
