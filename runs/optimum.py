"""Recomputation of a fit's optimum from its material card, which must lie within the bounds."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..errors import InputError, SolverFailure
from ..inference.assessment import Certainty
from ..inference.descent import DescentSettings, descend
from ..inference.linear import LinearisedFit
from ..inference.nuisance_fit import fit_nuisance
from ..inference.posterior import Posterior
from ..inference.problem import Evaluation, FitProblem
from ..inference.unknowns import Unknowns
from ..materials.card import MaterialCard
from ..materials.forms.base import COMPONENTS, Array
from ..materials.law import HypoelasticLaw
from ..materials.memory import NAMES
from ..notes import SOLVER, Note, NoteKind, Verdict
from ..processes import cores, may_run_at_once
from ..project.project import Project
from ..solvers.registry import SURROGATE
from ..wording import distinct_numbers
from .certainty import with_certainty
from .check import judge
from .folder import Provenance
from .result import Fit
from .setup import FitSetup, make_solver, prepare_fit
from .simulation import GivenCard, card_of, card_words
from .starts import BestFit, StartRecord, best_fit

#: Relative excess over a bound that is allowed, as the numbers in cards are rounded.
ROUNDING = 1e-4


def check_within_bounds(project: Project, unknowns: Unknowns, coefficients: Array) -> None:
    """Check that a card's law lies within the bounds of the project's fit.

    Parameters
    ----------
    project : Project
    unknowns : Unknowns
        Those of the project's fit, with its bounds.
    coefficients : (size,) array, MPa
        The free coefficients of the card.

    Raises
    ------
    InputError
        A modulus is beyond a bound at some strain, or a coefficient is beyond its own.
    """
    bounds = unknowns.bounds
    for name, rows in unknowns.moduli.items():
        moduli = rows @ coefficients
        softest = int(np.argmin(moduli))
        stiffest = int(np.argmax(moduli))
        if moduli[softest] < bounds.smallest[name] * (1 - ROUNDING):
            quantity = _modulus_words(unknowns, name, softest, len(moduli))
            _refuse(project, quantity, moduli[softest], "below", bounds.smallest[name])
        if bounds.largest is not None and moduli[stiffest] > bounds.largest[name] * (1 + ROUNDING):
            quantity = _modulus_words(unknowns, name, stiffest, len(moduli))
            _refuse(project, quantity, moduli[stiffest], "above", bounds.largest[name])
    if bounds.lower is None or bounds.upper is None:
        return
    for label, coefficient, lower, upper in zip(
        unknowns.labels, coefficients.tolist(), bounds.lower, bounds.upper, strict=True
    ):
        tolerance = ROUNDING * max(abs(lower), abs(upper))
        if coefficient < lower - tolerance:
            _refuse(project, label, coefficient, "below", lower)
        if coefficient > upper + tolerance:
            _refuse(project, label, coefficient, "above", upper)


def _modulus_words(unknowns: Unknowns, name: str, row: int, row_count: int) -> str:
    """Return a modulus with the strain of a row of its grid, in words."""
    if name not in COMPONENTS:  # a constant of the form, which holds at any strain
        return name
    component = COMPONENTS[name]
    strains = unknowns.form.grid(component, unknowns.strain_range[component])
    strain = np.resize(strains, row_count)[row]  # a grid for each load ratio
    return f"{name} at {100 * strain:.4g} % of strain"


def _refuse(project: Project, quantity: str, value: float, side: str, bound: float) -> None:
    """Raise InputError for a card whose quantity is beyond a bound, both in MPa."""
    card_value, limit = distinct_numbers(value, bound, 4)
    problem = (
        f"expected a card within the bounds of this project; its {quantity} is {card_value} MPa, "
        f"{side} the bound of {limit} MPa: give the card of this project's fit, or move the bound"
    )
    raise InputError(project.path, "--card", problem)


NOT_THE_CARD = NoteKind("not where the card is")

#: A material card, the path of its file or its name; None for the card of the project's fit.
Card = GivenCard | None


@dataclass(frozen=True, eq=False)
class CardOptimum:
    """A fit's optimum, found again from its card, with derivatives and certainty.

    Attributes
    ----------
    setup : FitSetup
        The tests, law and solver of the fit.
    problem : FitProblem
        The least-squares problem of the fit.
    best : BestFit
        The optimum; its certainty is known.
    card : str
        Name of the card.
    analyses : int
        Number of analyses of the tests that finding the optimum took.
    notes : tuple of Note
        Notes on another solver, and on moduli that are not where the card has them.
    """

    setup: FitSetup
    problem: FitProblem
    best: BestFit
    card: str
    analyses: int
    notes: tuple[Note, ...] = ()

    @property
    def certainty(self) -> Certainty:
        """Return the certainty of the optimum, which is always known here."""
        assert self.best.certainty is not None
        return self.best.certainty

    @cached_property
    def fit_verdict(self) -> Verdict:
        """Return the verdict of the fit, as its own page states it."""
        record = Provenance(self.setup.project.path, None, None, (), {}, ())
        return Fit(self.setup, self.problem, self.best, 0.0, record, judge(self.setup)).verdict

    @property
    def posterior(self) -> Posterior:
        """Return the posterior of the unknowns that follows from the noise of the data alone."""
        return self.certainty.posterior

    @property
    def point(self) -> Evaluation:
        """Return the analysis of the tests at the optimum."""
        return self.best.point

    def run_again(self) -> tuple[FitProblem, Evaluation]:
        """Return another problem of the fit, and the optimum as it gives it, with derivatives.

        It is run from the unloaded state, not from an earlier solution.
        """
        problem = self.setup.problem()
        point = problem.evaluate(self.point.unknowns, with_jacobian=True, warm=False)
        assert point is not None  # it ran a moment ago
        return problem, point

    @property
    def linear(self) -> LinearisedFit:
        """Return the fit linearised at the optimum, with the noise that the certainty assumes."""
        return LinearisedFit.of(
            self.problem, self.point, self.certainty.noise, self.certainty.second
        )


def find_optimum(project: Project, card: Card, tests: str | Sequence[str] | None) -> CardOptimum:
    """Find the optimum of the project's fit from its card, with a solver that gives derivatives.

    Where the project's solver is another program, the surrogate that leads its fit is used.

    Parameters
    ----------
    project : Project
    card : MaterialCard, path, str or None
        The card where the descent begins; by default that of the project's fit.
    tests : str, sequence of str or None
        The tests that are fitted, as in `fit`.

    Raises
    ------
    InputError
        The project or its data have an error, there is no card, or its law is of another form.
    SolverFailure
        The tests cannot be run with the card.
    """
    notes = []
    if make_solver(project).external:
        words = f"run by {SURROGATE}, which leads {project.fit.solver}: that gives no derivatives"
        notes.append(Note(SOLVER, words))
        project = project.with_solver(SURROGATE, {})
    material = card_of(project, card)
    setup = prepare_fit(project, project.chosen(tests, fitted=True))
    problem = setup.problem()
    start = unknowns_of_card(setup, problem, material)
    with may_run_at_once(project.fit.jobs or cores()):
        record = descend_from(problem, start, project.fit.tolerance, project.fit.seed)
        best = with_certainty(setup, problem, best_fit(problem, [record], project.fit.tolerance))
    notes += notes_of_distance(best, material.law)
    return CardOptimum(setup, problem, best, card_words(card), record.analyses + 1, tuple(notes))


def unknowns_of_card(setup: FitSetup, problem: FitProblem, card: MaterialCard) -> Array:
    """Return the unknowns of a fit at the law of a card, nuisance parameters at their start values.

    Raises
    ------
    InputError
        The moduli of the card are of another form, or outside the bounds of the fit.
    """
    law = card.law
    unknowns = problem.unknowns
    if law.form != setup.law.form:
        expected = "expected a card of this project's fit: its moduli are "
        expected += f"{setup.law.form.describe()}, those of the card {law.form.describe()}"
        raise InputError(setup.project.path, "--card", expected)
    coefficients = law.beta[list(unknowns.free)]
    check_within_bounds(setup.project, unknowns, coefficients)
    start = unknowns.at(coefficients)
    constants = {"nu12": law.nu12, "thickness": card.thickness, **card.parameters}
    if law.memory is not None:
        constants |= dict(zip(NAMES, law.memory.constants, strict=True))
    for k, shared in enumerate(unknowns.nuisance.shared, start=unknowns.size):
        if shared.name in constants:
            start[k] = np.clip(constants[shared.name], shared.lower, shared.upper)
    return start


def descend_from(
    problem: FitProblem,
    start: Array,
    tolerance: float,
    seed: int,
    *,
    max_analyses: int = 40,
    initial_damping: float = 1e-6,
) -> StartRecord:
    """Descend from the law of a card to the nearest optimum.

    Parameters
    ----------
    problem : FitProblem
    start : (n,) array
        Unknowns of the optimiser at the card.
    tolerance : float
        Relative tolerance of the objective, at which the descent ends.
    seed : int
        Seed of the project's fit, which the record states; nothing is drawn here.
    max_analyses : int
        Largest number of analyses after that at the card.
    initial_damping : float
        First damping of the Levenberg-Marquardt steps; small, as the card should be at the optimum.

    Raises
    ------
    SolverFailure
        The tests cannot be run with the card.
    """
    point, _ = fit_nuisance(problem, start, with_jacobian=True)
    if point is None:
        message = f"the tests cannot be run with the card: {problem.failure}"
        raise SolverFailure(message, problem.solver.name)
    limit = problem.analyses + max_analyses
    settings = DescentSettings(initial_damping=initial_damping)
    end, status = descend(problem, point, tolerance, limit, norms=True, settings=settings)
    return StartRecord(
        number=0,
        seed=(seed, 0),
        objective=end.value,
        status=status,
        analyses=problem.analyses,
        unknowns=tuple(end.unknowns.tolist()),
        coefficients=tuple(end.coefficients.tolist()),
    )


def notes_of_distance(
    best: BestFit, law: HypoelasticLaw, *, tolerance: float = 0.02, strain_count: int = 21
) -> list[Note]:
    """Return a note if a modulus at the optimum differs from that of the card, else no note.

    Parameters
    ----------
    best : BestFit
        The optimum.
    law : HypoelasticLaw
        The law of the card.
    tolerance : float
        Largest relative change of a modulus that needs no note.
    strain_count : int
        Number of strains at which a modulus is compared, from 0 to the largest known to both.
    """
    changes = []
    for name, component in COMPONENTS.items() if law.form.size else ():
        end = min(best.valid[component], law.strain_range[component])
        strain = np.linspace(0.0, end, strain_count)
        change = best.law.modulus(name, strain) / law.modulus(name, strain) - 1.0
        largest = change[np.abs(change).argmax()]
        if abs(largest) > tolerance:
            changes.append(f"{name} by {100 * largest:+.2g} %")
    if not changes:
        return []
    words = f"the optimum of these tests is not where the card is; moved {', '.join(changes)}"
    return [Note(NOT_THE_CARD, words)]
