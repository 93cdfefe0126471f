"""Prepare a fit from a project and its tests: law, bounds, unknowns, starts, problem, meshes."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..errors import InputError
from ..experiments.base import Masks, PreparedTest, Reach, Refinable, Test, Weighting
from ..experiments.registry import kind_named
from ..experiments.strains import STRAINS
from ..inference.comparison import Comparison, FunctionObjective, Nuisance
from ..inference.methods import FitOptions, method_named
from ..inference.problem import FitProblem
from ..inference.unknowns import (
    EstimatedStarts,
    LawBounds,
    RandomStarts,
    SobolStarts,
    Starts,
    Unknowns,
)
from ..materials.forms.base import (
    STRAIN_NAMES,
    Form,
    checked_offer,
    form_named,
    form_settings,
    of_strain,
)
from ..materials.forms.spline import Form as OwnForm
from ..materials.law import HypoelasticLaw
from ..materials.memory import QUANTITIES, Memory
from ..processes import one_blas_thread
from ..project.project import Project
from ..project.schema import UnknownSection
from ..solvers.base import DifferentiatingSolver, Solver, check_carries
from ..solvers.registry import solver_named, usable_solver
from ..solvers.run_cache import digest_of
from .starts import StartRecord, timed

#: Smallest modulus allowed anywhere on the strain range (MPa), unless the file says otherwise.
MARGIN_E, MARGIN_G = 5.0, 0.5
#: End of the strain range of moduli that do not depend on strain: nothing is held there.
UNBOUNDED_RANGE = 1.0
#: Shares of the strain range between the regions of a law, unless tests give them.
THIRDS = (1 / 3, 2 / 3)


def law_of(project: Project, reaches: Sequence[Reach]) -> HypoelasticLaw:
    """Return the law of a fit with coefficients of zero; reaches : of the data of each test.
    InputError : no such form, an unknown setting, no strain range that follows from the tests."""
    section = project.law
    path = project.path
    try:
        if project.form is None:
            checked_offer(section.form)
    except InputError as error:
        raise InputError(path, "law.form", error.problem) from None
    ends = _strain_range(project, reaches)
    try:
        own = project.form
        form = own.pieces(ends) if isinstance(own, OwnForm) else own
        form = form or form_named(section.form, _form_settings(project, reaches, ends), ends)
    except InputError as error:
        field = f"law.{error.field}" if error.field else "law.form"
        raise InputError(path, field, error.problem) from None
    change = project.fabric.thickness_change
    return HypoelasticLaw(
        np.zeros(form.size), section.nu12, np.array(ends), change, form, _memory(project)
    )


#: A law without memory; where the fit of one begins; its bounds, saturation per unit of strain.
FORGETS, REMEMBERS = (0.0, 1.0, 1.0, 0.0), (0.3, 1.4, 1.15, 1.0)
REMEMBERED = {
    "set": (0.0, 0.99),
    "unloading": (1.0, 1.99),
    "reloading": (1.0, 1.99),
    "saturation": (0.0, 1e3),
}


def _memory(project: Project) -> Memory | None:
    """Return the memory of [law.memory], what is fitted at its start."""
    if (section := project.law.memory) is None:
        return None
    said = [getattr(section, name) for name in STRAIN_NAMES]
    rows = [
        FORGETS
        if one is None
        else REMEMBERS
        if one == "fitted"
        else tuple(one.model_dump().values())
        for one in said
    ]
    try:
        return Memory.of([x for row in rows for x in row])
    except InputError as error:
        raise InputError(project.path, f"law.{error.field}", error.problem) from None


def _form_settings(
    project: Project, reaches: Sequence[Reach], ends: Sequence[float]
) -> dict[str, Any]:
    """Return the settings of the form; breaks from the tests' data if it needs and has none."""
    settings = dict(project.law.model_extra or {})
    if "breaks" in settings or "breaks" not in form_settings(project.law.form):
        return settings
    breaks = {}
    for i, name in enumerate(STRAINS):
        said = [pair for reach in reaches if (pair := reach.break_shares[i]) is not None]
        breaks[name] = [ends[i] * share for share in (said or [THIRDS])[0]]
    return {**settings, "breaks": breaks}


def _strain_range(project: Project, reaches: Sequence[Reach]) -> tuple[float, float, float]:
    given = project.law.strain_range
    if given is not None:
        return given[0], given[1], given[2]
    ends: list[float] = []
    for i, name in enumerate(STRAINS):
        known = [e for reach in reaches if (e := reach.strain[i]) is not None]
        if known:
            ends.append(max(known))
        elif not getattr(project.form, "of_strain", of_strain(project.law.form)):
            ends.append(UNBOUNDED_RANGE)
        else:
            problem = (
                f"this key is missing, and no test tells how far the {name} strain goes; give the "
                "ends [warp, fill, shear], such as [0.13, 0.13, 0.13]"
            )
            raise InputError(project.path, "law.strain_range", problem)
    return ends[0], ends[1], ends[2]


def bounds_of(project: Project, form: Form) -> LawBounds:
    """Return the bounds of the moduli or of their coefficients, MPa.
    InputError : no bounds, crossed ones, too few or too many, or some of both kinds."""
    path = project.path
    section = project.law.bounds
    margin = project.law.margin
    unit = project.scales.modulus
    if section is None:
        problem = "this section is missing; give [least, largest] of E1, E2 and G12"
        raise InputError(path, "law.bounds", problem)
    ranges = {name: getattr(section, name) for name in ("E1", "E2", "G12")}
    listed = {name: getattr(section, name) for name in ("lower", "upper")}
    of_moduli = any(v is not None for v in ranges.values())
    of_entries = any(v is not None for v in listed.values())
    if of_moduli == of_entries:
        expected = "give [least, largest] of E1, E2 and G12, or 'lower' and 'upper' coefficients"
        if of_moduli:
            expected = "expected either 'lower' and 'upper' or E1, E2, G12, got some of both"
        raise InputError(path, "law.bounds", expected)
    for name, value in (ranges if of_moduli else listed).items():
        if value is None:
            raise InputError(project.path, f"law.bounds.{name}", "this key is missing; add it")
    if of_moduli and margin is not None:
        problem = "the lower bounds of E1, E2 and G12 are the margins; leave this out"
        raise InputError(path, "law.margin", problem)
    if of_moduli:
        return LawBounds.of_moduli(
            {
                name: _ordered(project, f"law.bounds.{name}", pair, unit)
                for name, pair in ranges.items()
            }
        )
    for name, values in listed.items():
        if len(values) != len(form.free):
            problem = (
                f"expected {len(form.free)} coefficients of {form.name} moduli "
                f"({', '.join(form.labels[i] for i in form.free)}), got {len(values)}"
            )
            raise InputError(path, f"law.bounds.{name}", problem)
    lower, upper = listed.values()
    for i, (place, low, high) in enumerate(zip(form.free, lower, upper, strict=True)):
        if low > high:
            problem = (
                f"bounds of {form.labels[place]} are crossed: lower {low:g} is above upper "
                f"{high:g} {project.scales.modulus_unit}"
            )
            raise InputError(path, f"law.bounds.lower[{i}]", problem)
    e, g = (margin.E * unit, margin.G12 * unit) if margin else (MARGIN_E, MARGIN_G)
    margins = {"E1": e, "E2": e, "G12": g}
    return LawBounds(margins, None, np.array(lower) * unit, np.array(upper) * unit)


def _ordered(project: Project, key: str, pair: Sequence[float], unit: float) -> tuple[float, float]:
    low, high = pair
    if not low < high:
        problem = f"expected [least, largest], got [{low:g}, {high:g}]"
        raise InputError(project.path, key, problem)
    return low * unit, high * unit


#: Default bounds; those of the thickness in shares of the fabric's.
NU12, THICKNESS = (0.0, 0.6), (0.5, 1.5)
#: End of the nu12 of positive definite laws.
MOST_NU12 = 1.0
#: Also if incompressible: its load is moduli times thickness times a function of strain.
UNLOADED = "cycles to several peaks, unloaded to low loads, would tell it"
PRODUCT = "a membrane under load knows moduli times thickness only"


def shared_unknowns(project: Project) -> tuple[Nuisance, ...]:
    """Return the unknowns of [fit.unknowns]; a fit starts from the values of [law] and [fabric].
    InputError : bounds out of order, impossible, or not around the value to start from; a thickness
        without a prior, which no data could tell from the moduli."""
    asked = project.fit.unknowns
    shared = []
    if asked.nu12 is not None:
        start = project.law.nu12
        low, high = _bounds(project, "nu12", asked.nu12, NU12, start, 1.0)
        if not (low >= 0 and high < MOST_NU12):
            problem = f"expected numbers from 0 to below {MOST_NU12:g}, got [{low:g}, {high:g}]"
            raise InputError(project.path, "fit.unknowns.nu12.bounds", problem)
        prior = asked.nu12.prior
        shared.append(
            Nuisance(
                "nu12", low, high, "", prior=prior, start=start, law_parameter="nu12", shared=True
            )
        )
    if asked.thickness is not None:
        start = project.fabric.thickness
        length = project.scales.length
        usual = (THICKNESS[0] * start / length, THICKNESS[1] * start / length)
        low, high = _bounds(project, "thickness", asked.thickness, usual, start, length)
        if not low > 0:
            problem = f"expected thicknesses above 0, got {low / length:g}"
            raise InputError(project.path, "fit.unknowns.thickness.bounds", problem)
        if asked.thickness.prior is None:
            problem = f"this key is missing; {PRODUCT}: say how well its thickness is known before"
            raise InputError(project.path, "fit.unknowns.thickness.prior", problem)
        prior = asked.thickness.prior * length
        shared.append(
            Nuisance(
                "thickness",
                low,
                high,
                "mm",
                "thickness",
                1.0,
                prior,
                start=start,
                shared=True,
                hint=PRODUCT,
            )
        )
    memory = _memory(project)
    for name in STRAIN_NAMES if memory is not None else ():
        for quantity, (low, high) in REMEMBERED.items():
            if getattr(project.law.memory, name) == "fitted":
                own = f"{quantity}_{name}"
                start = REMEMBERS[QUANTITIES.index(quantity)]
                shared.append(
                    Nuisance(
                        own,
                        low,
                        high,
                        "",
                        start=start,
                        law_parameter=own,
                        shared=True,
                        hint=UNLOADED,
                    )
                )
    return tuple(shared)


def _bounds(
    project: Project,
    name: str,
    section: UnknownSection,
    usual: tuple[float, float],
    start: float,
    unit: float,
) -> tuple[float, float]:
    key = f"fit.unknowns.{name}.bounds"
    low, high = _ordered(project, key, section.bounds or usual, unit)
    if not low <= start <= high:
        problem = (
            f"expected bounds around {start / unit:g}, from which a fit starts, got "
            f"[{low / unit:g}, {high / unit:g}]"
        )
        raise InputError(project.path, key, problem)
    return low, high


def with_shared(
    comparisons: Iterable[Comparison], shared: Iterable[Nuisance]
) -> tuple[Comparison, ...]:
    """Return the comparisons with the shared unknowns before their own.
    A prior weighs as one value of a block whose norm is that of its noise."""
    several = tuple(comparisons)
    unknowns = tuple(shared)
    if not unknowns:
        return several
    own_noise = [
        (o.least_noise / np.median(o.scale), np.mean(o.sizes))
        for o in (c.objective for c in several)
    ]
    weight = float(np.median([float(noise / np.sqrt(size)) for noise, size in own_noise]))
    unknowns = tuple(n if n.prior is None else replace(n, weight=weight) for n in unknowns)
    own = [tuple(n for n in c.nuisance if not n.shared) for c in several]
    return tuple(replace(c, nuisance=(*unknowns, *n)) for c, n in zip(several, own, strict=True))


#: Solver that leads the fit if the project's gives no derivatives.
SURROGATE = "membrane"
#: Keys of [fit] that change no start; the solver counts by its identity.
UNCOUNTED = ("starts", "solver", "jobs", "trust", "mesh_error", "cache")


@dataclass(frozen=True, eq=False)
class FitSetup:
    """A fit ready to run, without a solver, for worker processes.
    law : without coefficients. counts : factors of the tests' weights by name. predicted : tests of
    weight 0, which are not fitted."""

    project: Project
    law: HypoelasticLaw
    bounds: LawBounds
    tests: tuple[PreparedTest, ...]
    counts: Mapping[str, float] = field(default_factory=dict)
    starts: Starts = field(default_factory=RandomStarts)
    predicted: tuple[PreparedTest, ...] = ()

    @property
    def weightings(self) -> tuple[Weighting, ...]:
        """Return one a test: alone it has its own objective, among others relative errors count."""
        several = len(self.tests) > 1
        weights = [t.test.weight * self.counts.get(t.test.name, 1.0) for t in self.tests]
        return tuple(Weighting(several, weight if several else 1.0) for weight in weights)

    @property
    def objective_is(self) -> str:
        """Return the objective in words."""
        if len(self.tests) > 1:
            return "weighted sum of the tests' mean relative RMS errors"
        if self.tests[0].test.name in self.project.objectives:
            return "sum of the RMS of the residuals of a function of one's own"
        return self.tests[0].objective_is

    def problem(self, masks: Masks | None = None) -> FitProblem:
        """Return the fit, built anew; masks : measured points that it matches, by comparison."""
        make = self.make_solver
        problem = self.problem_of(self.each(lambda test, w: test.comparisons(make, w, masks)))
        if masks is not None and isinstance(self.starts, EstimatedStarts):
            problem.starts = RandomStarts()  # nothing of the points left out may be in them
        return problem

    def each(
        self, make: Callable[[PreparedTest, Weighting], Sequence[Comparison]]
    ) -> list[Comparison]:
        """Return the comparisons that a function makes of each test, with its objective."""
        pairs = zip(self.tests, self.weightings, strict=True)
        return [one for test, w in pairs for one in self.judged(test, make(test, w), w)]

    def judged(
        self, test: PreparedTest, comparisons: Sequence[Comparison], weighting: Weighting
    ) -> tuple[Comparison, ...]:
        """Return comparisons of a test with the objective that the project has for it, if any."""
        function = self.project.objectives.get(test.test.name)
        found = []
        if function is None:
            return tuple(comparisons)
        weight = weighting.weight / len(comparisons) if weighting.relative else 1.0
        for one in comparisons:
            if not hasattr(one.objective, "columns"):
                problem = (
                    f"expected no function: {test.test.kind} tests have an objective of their own"
                )
                raise InputError(test.test.name, "objective", problem)
            own = FunctionObjective(one.objective, function, weighting.relative, weight)
            more = float(np.median(one.objective.scale) / np.median(own.scale))
            priors = tuple(replace(n, weight=more * n.weight) for n in one.nuisance)
            found.append(replace(one, objective=own, nuisance=priors))
        return tuple(found)

    def problem_of(self, comparisons: Sequence[Comparison]) -> FitProblem:
        """Return the fit of comparisons of its tests, led by `SURROGATE` without derivatives."""
        comparisons = with_shared(comparisons, shared_unknowns(self.project))
        law = self.law
        ends = self.law.strain_range.tolist()
        unknowns = Unknowns.of(law.form, law.nu12, ends, self.bounds, comparisons)
        problem = FitProblem(tuple(comparisons), self.law, unknowns, starts=self.starts)
        if not isinstance(problem.solver, DifferentiatingSolver):
            pairs = [(c.solver, isinstance(c.solver, DifferentiatingSolver)) for c in comparisons]
            leading = [own if able else solver_named(SURROGATE) for own, able in pairs]
            problem.surrogate = problem.with_solvers(leading)
        return problem

    def make_solver(self, name: str | None = None) -> Solver:
        return make_solver(self.project, name)

    def make_leading(self, name: str | None = None) -> Solver:
        """Return `make_solver` if that gives derivatives, else the solver that leads it."""
        solver = self.make_solver(name)
        return solver if isinstance(solver, DifferentiatingSolver) else self.make_solver(SURROGATE)

    def own(self, test: PreparedTest) -> tuple[Comparison, ...]:
        """Return the comparisons of one test with its own objective."""
        return test.comparisons(self.make_solver, Weighting())

    @property
    def options(self) -> FitOptions:
        """Return how each start is fitted."""
        fit = self.project.fit
        most = fit.max_analyses or method_named(fit.method).max_analyses
        return FitOptions(fit.method, fit.gradient, fit.constraints, fit.tolerance, most)


#: Receives the words of a step of a command as it begins.
Saw = Callable[[str], object]


def prepare_fit(project: Project, tests: Sequence[Test], saw: Saw = lambda words: None) -> FitSetup:
    """Read or compute the data of the tests, and check all that a fit needs.
    A test of weight 0 is left out of the fit, and predicted with its law.
    InputError : in the project or its data; no test has a weight above 0. SolverFailure : the
        solver is not there, or a known solution cannot be run."""
    for test in tests:
        if not 0 <= test.weight < np.inf:
            problem = f"expected 0 or more, got {test.weight:g}"
            raise InputError(project.path, f"{test.name}: weight", problem)
    fitted = [test for test in tests if test.weight > 0]
    if not fitted:
        names = ", ".join(test.name for test in tests)
        problem = f"is 0 for every test chosen ({names}): nothing would be fitted"
        raise InputError(project.path, "weight", f"{problem}; give one of them a weight above 0")
    with project.naming_arguments():
        fit = project.fit
        options = project.options_of(fit.solver)
        # Once here, in one line, rather than as the failure of every analysis.
        solver = usable_solver(fit.solver, options, project.path, "fit.solver", project.run_cache)
        shared_unknowns(project)  # says now what is wrong with them
        law = law_of(project, [test.reach for test in fitted])
        try:
            check_carries(solver, law)
        except InputError as error:
            raise InputError(project.path, "law.form", error.problem) from None
        most = np.inf if project.law.closed_path is None else project.law.closed_path / 100
        bounds = replace(bounds_of(project, law.form), work=most)
        make = functools.partial(make_solver, project)
        ready = []
        for test in tests:
            saw(f"reading {test.name}")
            with one_blas_thread(), timed(f"{test.name}, its data read and registered"):
                ready.append(kind_named(test.kind).prepare(test, law, make))
        starts: Starts = SobolStarts() if fit.starts_from == "sobol" else RandomStarts()
        matched = tuple(prepared for prepared in ready if prepared.test.weight > 0)
        predicted = tuple(prepared for prepared in ready if not prepared.test.weight > 0)
        return FitSetup(project, law, bounds, matched, starts=starts, predicted=predicted)


def make_solver(project: Project, name: str | None = None, **more: Any) -> Solver:
    named = name or project.fit.solver
    return solver_named(named, project.run_cache, **{**project.options_of(named), **more})


def fingerprints(setup: FitSetup, problem: FitProblem) -> dict[str, str]:
    """Return digests of all that a start's result depends on, by part."""
    fit = setup.project.fit
    return {
        "law": digest_of(setup.law, setup.bounds, setup.project.fabric.thickness),
        "fit settings": digest_of(fit.model_dump(exclude=set(UNCOUNTED))),
        "tests": digest_of({t.test.name: dict(t.test.settings()) for t in setup.tests}),
        "data": digest_of([tuple(c.objective.data) for c in problem.comparisons]),
        "solver": digest_of(fit.solver, problem.solver.identity),
    }


#: Edge of the full mesh over that of the coarse one.
COARSER = 0.5


def coarse_problem(setup: FitSetup) -> FitProblem | None:
    """Return the fit on coarse meshes, run by the solver that leads; None if no test has any."""
    make = setup.make_leading
    coarse = []

    def comparisons(test: PreparedTest, weighting: Weighting) -> Sequence[Comparison]:
        full = test.comparisons(make, weighting)
        if isinstance(test, Refinable):
            with suppress(InputError):  # the mesh is as coarse as it can be
                own = test.finer(make, weighting, COARSER)
                if any(_quads(few) < _quads(many) for few, many in zip(own, full, strict=True)):
                    coarse.append(test)
                    return own
        return full

    every = setup.each(comparisons)
    return setup.problem_of(every) if coarse else None


def _quads(comparison: Comparison) -> int:
    return len(comparison.model.mesh.quads) if hasattr(comparison.model, "mesh") else 0


def coarse_to_fine(setup: FitSetup, records: Sequence[StartRecord]) -> dict[str, Any] | None:
    """Return the starts and analyses on each mesh; None if all starts ran on the full one.
    quads : of the coarse and the full mesh by comparison, if meshed. starts : on the coarse mesh.
    distinct : optima fitted on the full mesh."""
    coarse = coarse_problem(setup) if any(r.coarse_analyses for r in records) else None
    if coarse is None:
        return None
    pairs = zip(coarse.comparisons, setup.problem().comparisons, strict=True)
    before = sum(record.coarse_analyses for record in records)
    return {
        "quads": {
            own.name: {"coarse": len(other.model.mesh.quads), "full": len(own.model.mesh.quads)}
            for other, own in pairs
            if hasattr(own.model, "mesh")
        },
        "starts": len(records),
        "distinct": sum(record.same_as is None for record in records),
        "coarse_analyses": before,
        "full_analyses": sum(record.analyses for record in records) - before,
    }
