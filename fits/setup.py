"""From a project and its tests to a fit: what is prepared once, and what every process builds."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from ..content import digest_of
from ..errors import InputError
from ..experiments.fittable import FittableTest, Masks, PreparedTest, Weighting
from ..identification.comparison import Comparison
from ..identification.methods import FitOptions
from ..identification.problem import FitProblem
from ..identification.starts import ProposedStarts, RandomStarts, SobolStarts, Starts
from ..identification.unknowns import LawBounds, Unknowns
from ..materials.law import HypoelasticLaw
from ..sections import beside
from ..solvers.base import DifferentiatingSolver, Solver, check_carries
from ..solvers.registry import solver_named, usable_solver
from .earlier import KEY, proposals
from .law import bounds_of, law_of
from .project import Project
from .shared import shared_unknowns, with_shared

#: Leads the fit where the solver that counts gives no derivatives.
SURROGATE = "membrane"
#: Most analyses of one start, unless the file says otherwise.
MOST_ANALYSES = {"lm": 100, "slsqp": 500, "cobyla": 2000}
#: Where a project names its solver.
SOLVER_KEY = "fit.solver"
#: Of [fit], what changes no start: how many there are, and who runs them beside each other; the
#: solver is told by what it says of itself.
UNCOUNTED = ("starts", "solver", "jobs", "trust", "mesh_error", "cache", "earlier")


@dataclass(frozen=True, eq=False)
class FitSetup:
    """A fit ready to run, without anything of a solver: what worker processes are given.

    Parameters
    ----------
    law : everything but the coefficients. tests : with their data. counts : by name of a test, how
    many times the weight that the project gives it. starts : where they begin.
    """

    project: Project
    law: HypoelasticLaw
    bounds: LawBounds
    tests: tuple[PreparedTest, ...]
    counts: Mapping[str, float] = field(default_factory=dict)
    starts: Starts = field(default_factory=RandomStarts)

    @property
    def weightings(self) -> tuple[Weighting, ...]:
        """One a test: alone it has its own objective, among others its relative errors count."""
        several = len(self.tests) > 1
        weights = [t.test.weight * self.counts.get(t.test.name, 1.0) for t in self.tests]
        return tuple(Weighting(several, weight if several else 1.0) for weight in weights)

    @property
    def objective_is(self) -> str:
        """What the fit minimises, in words."""
        if len(self.tests) > 1:
            return "weighted sum of the tests' mean relative RMS errors"
        return self.tests[0].objective_is

    def problem(self, masks: Masks | None = None) -> FitProblem:
        """The fit, built anew; `masks`: which measured points it matches, by comparison."""
        comparisons = [
            comparison
            for test, weighting in zip(self.tests, self.weightings, strict=True)
            for comparison in test.comparisons(self.make_solver, weighting, masks)
        ]
        problem = self.problem_of(comparisons)
        if masks is not None and isinstance(self.starts, ProposedStarts):
            problem.starts = RandomStarts()  # nothing of the points left out may be in them
        return problem

    def problem_of(self, comparisons: Sequence[Comparison]) -> FitProblem:
        """The fit of comparisons of its tests, whatever the models: the law's unknowns and theirs,
        and what leads where the solver that counts gives no derivatives."""
        comparisons = with_shared(comparisons, shared_unknowns(self.project))
        law, ends = self.law, self.law.strain_range.tolist()
        unknowns = Unknowns.of(law.form, law.nu12, ends, self.bounds, comparisons)
        problem = FitProblem(tuple(comparisons), self.law, unknowns, starts=self.starts)
        if not isinstance(problem.solver, DifferentiatingSolver):
            problem.surrogate = problem.with_solvers([solver_named(SURROGATE) for _ in comparisons])
        return problem

    def make_solver(self, name: str | None = None) -> Solver:
        """A new solver as the project names it, or another by name, with the project's settings."""
        return make_solver(self.project, name)

    def make_leading(self, name: str | None = None) -> Solver:
        """As `make_solver` where that one gives derivatives, else what leads it."""
        solver = self.make_solver(name)
        return solver if isinstance(solver, DifferentiatingSolver) else self.make_solver(SURROGATE)

    def own(self, test: PreparedTest) -> tuple[Comparison, ...]:
        """The comparisons of one test with its own objective."""
        return test.comparisons(self.make_solver, Weighting())

    @property
    def options(self) -> FitOptions:
        """How each start is fitted."""
        fit = self.project.fit
        most = fit.max_analyses or MOST_ANALYSES[fit.method]
        return FitOptions(fit.method, fit.gradient, fit.constraints, fit.tolerance, most)


def prepare_fit(project: Project, tests: Sequence[FittableTest]) -> FitSetup:
    """Read or compute the data of the tests, and check everything that a fit needs.

    Raises
    ------
    InputError : in the project or its data. SolverFailure : the solver is not there, or a known
        solution cannot be run.
    """
    fit = project.fit
    options = project.options_of(fit.solver)
    # Once here, in one line, rather than as the failure of every analysis.
    solver = usable_solver(fit.solver, options, project.path, SOLVER_KEY, project.run_cache)
    shared_unknowns(project)  # says now what is wrong with them
    law = law_of(project, [test.reach for test in tests])
    try:
        check_carries(solver, law)
    except InputError as error:
        raise InputError(project.path, "law.form", error.problem) from None
    bounds = bounds_of(project, law.form)
    make = functools.partial(make_solver, project)
    ready = tuple(test.prepare(law, make) for test in tests)
    setup = FitSetup(project, law, bounds, ready)
    return replace(setup, starts=_starts(setup))


def _starts(setup: FitSetup) -> Starts:
    """Where the project says that starts begin."""
    project, fit = setup.project, setup.project.fit
    if fit.earlier is not None and fit.starts_from != "proposed":
        said = 'means something with starts_from = "proposed" only'
        raise InputError(project.path, KEY, said)
    if fit.starts_from != "proposed":
        return SobolStarts() if fit.starts_from == "sobol" else RandomStarts()
    if fit.earlier is None:
        said = "name the folder of an earlier fit of this project: what it evaluated proposes"
        raise InputError(project.path, KEY, said)
    problem, scales = setup.problem(), project.scales
    columns = [f"{label}_{scales.modulus_unit}" for label in problem.unknowns.labels]
    folder = beside(project.path.parent, fit.earlier)
    return proposals(folder, fingerprints(setup, problem), columns, scales.modulus)


def make_solver(project: Project, name: str | None = None) -> Solver:
    """A new solver: the project's own, or another by name, with the project's settings of it.

    Raises
    ------
    InputError : there is none of that name.
    """
    named = name or project.fit.solver
    return solver_named(named, project.run_cache, **project.options_of(named))


def fingerprints(setup: FitSetup, problem: FitProblem) -> dict[str, str]:
    """Digests of everything that a start's result depends on, by what they are of."""
    fit = setup.project.fit
    proposed = setup.starts if isinstance(setup.starts, ProposedStarts) else None
    own = {} if proposed is None else {
        "earlier evaluations": digest_of(proposed.coefficients, proposed.objectives)
    }  # fmt: skip
    return {
        **own,
        "law": digest_of(setup.law, setup.bounds, setup.project.fabric.thickness),
        "fit settings": digest_of(fit.model_dump(exclude=set(UNCOUNTED))),
        "tests": digest_of({t.test.name: dict(t.test.settings()) for t in setup.tests}),
        "data": digest_of([tuple(c.objective.data) for c in problem.comparisons]),
        "solver": digest_of(fit.solver, problem.solver.identity),
    }
