"""The best of a fit's starts, run again; its certainty; the optimum found again from its card."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..errors import InputError, SolverFailure
from ..experiments.base import Refinable
from ..experiments.strains import strains_of
from ..inference.assessment import Certainty, certainty
from ..inference.comparison import Blocks
from ..inference.descent import DescentSettings, descend
from ..inference.linear import (
    NOT_DEFINITE,
    POINTS,
    TOO_LITTLE,
    WORTHWHILE_CHANGE,
    FineMeshLimit,
    LinearisedFit,
    UncertaintyOrder,
    has_large_residual,
    is_definite,
    limit_of,
    moduli_sigmas,
    posteriors_of,
    relative_changes,
    residual_of,
    second_order_terms,
)
from ..inference.noise import Noise
from ..inference.posterior import Posterior
from ..inference.problem import Evaluation, FitProblem
from ..inference.search import evaluate_law
from ..materials.card import CardCertainty, certainty_of, words_of
from ..materials.forms.base import COMPONENTS, Array
from ..materials.law import HypoelasticLaw
from ..materials.memory import NAMES
from ..materials.positivity import is_positive
from ..notes import SOLVER, Note, NoteKind, Objection
from ..project.project import Project
from .card_bounds import check_within_bounds
from .setup import SURROGATE, FitSetup, make_solver, prepare_fit, with_shared
from .simulation import GivenCard, card_of, card_words
from .starts import StartRecord

MESH = NoteKind(
    "mesh error",
    weight=16,
    objection=Objection("the error of the mesh is large", "fit on a finer mesh (more elements)"),
)
TOO_LARGE = NoteKind(
    "mesh error too large",
    weight=21,
    objection=Objection(
        "the error of the mesh is too large to be taken out",
        "fit on a finer mesh (more elements)",
        unusable=True,
    ),
)
UNKNOWN = NoteKind("mesh error not known", weight=5)
TAKEN_OUT = NoteKind("mesh error taken out")
NOT_THE_CARD = NoteKind("not where the card is")
#: Rounding of an objective run again, relative to itself and to the share of the data's noise.
ROUNDING, UNTOLD = 1e-5, 1e-6
#: Least reached strain.
LEAST_STRAIN = 1e-6


@dataclass(frozen=True, eq=False)
class BestFit:
    """The best fit, run again.
    point : by the project's solver. differentiated : the same by the solver that differentiates, if
    it could. ranked : starts with a fit, best first. records : all, by number. reached : (3,)
    largest (eps1, eps2, gamma12) in all tests. certainty : None without derivatives."""

    point: Evaluation
    differentiated: Evaluation | None
    law: HypoelasticLaw
    ranked: Sequence[StartRecord]
    records: Sequence[StartRecord]
    reached: Array
    certainty: Certainty | None = None

    @property
    def valid(self) -> Array:
        """Return the ends (3,) of the strains for which the moduli are fitted, not held."""
        return np.minimum(self.reached, self.law.strain_range)


def best_fit(problem: FitProblem, records: Sequence[StartRecord], tolerance: float) -> BestFit:
    """Run the best of the starts again; another program gets a second try.
    tolerance : objectives below it are the same. SolverFailure : it does not run again, or gives
    another objective."""
    ranked = ranking(records)
    problem.reset()
    unknowns = np.array(ranked[0].unknowns)
    # The derivatives behind what the data could not determine are the surrogate's, if there is one.
    leading = problem.surrogate or problem
    point = problem.evaluate(unknowns, leading is problem, warm=False)
    if point is None and problem.solver.external:
        point = problem.evaluate(unknowns, leading is problem, warm=False)
    if point is None:
        said = f"the best fit does not run again: {problem.failure}"
        raise SolverFailure(f"{said}; its starts are kept, --resume goes on", problem.solver.name)
    record = ranked[0]
    assert record.objective is not None
    before = record.objective
    now = point.value
    untold = tolerance + UNTOLD * sum(noise_of(problem).values())
    if abs(now - before) > ROUNDING * max(now, before) + untold:
        raise SolverFailure(
            f"start {record.number} ended with an objective of {before:.6g}, and the same moduli "
            f"give {now:.6g} from the unloaded state: the fit hangs on the way it was reached; "
            "more increments usually help",
            problem.solver.name,
        )
    first = replace(record, objective=now)
    ranked = [_like(r, first) for r in ranked]
    again = [_like(r, first) for r in records]
    law = problem.unknowns.law(problem.law, unknowns)
    slopes = point if leading is problem else leading.evaluate(unknowns, True, warm=False)
    return BestFit(point, slopes, law, ranked, again, reached_by(point))


def reached_by(point: Evaluation) -> Array:
    """Return the largest (eps1, eps2, gamma12) of all analyses."""
    return np.maximum(np.max([strains_of(h) for h in point.histories], axis=0), LEAST_STRAIN)


def _like(record: StartRecord, first: StartRecord) -> StartRecord:
    """Return a record with the objective run again if its fit is that of the best start."""
    if record.number == first.number:
        return first
    return replace(record, objective=first.objective) if record.same_as == first.number else record


def ranking(records: Sequence[StartRecord]) -> list[StartRecord]:
    """Return the starts that ended with a fit, best first."""
    ended = [r for r in records if r.objective is not None]
    return sorted(ended, key=lambda r: (r.objective, r.number))


def noise_of(problem: FitProblem) -> dict[str, float]:
    """Return the share of noise (scatter or instrument) in the objective, by comparison."""
    return {
        c.name: Blocks(c.objective.sizes).value(c.objective.least_noise / c.objective.scale)
        for c in problem.comparisons
    }


#: Factor of the finer mesh.
FINER = 2.0
#: Values of `fit.mesh_error`.
TOLD, CORRECTED = "told", "taken out"
#: Largest relative change of a modulus by the mesh that is taken out. The step to finer meshes is
#: linear, and what it leaves out is of the order of its square: a tenth of the modulus at 0.3.
LARGEST_CORRECTION = 0.3
#: Relative error of a modulus that needs no note, whatever the noise; one that is rounding.
LEAST, NOTHING = 0.01, 1e-4


def limit_of_meshes(setup: FitSetup, problem: FitProblem, best: BestFit) -> FineMeshLimit | None:
    """Return the limit of the best fit on ever finer meshes; InputError, SolverFailure.
    None without derivatives, for another program (not run unasked), or without a finer model."""
    if best.differentiated is None or problem.solver.external:
        return None
    if not all(isinstance(test, Refinable) for test in setup.tests):
        return None
    make: Any = lambda test, w: test.finer(setup.make_solver, w, FINER)  # noqa: E731
    finer = [*with_shared(setup.each(make), problem.unknowns.nuisance.shared)]
    residual = residual_of(problem, finer, best.differentiated, best.law)
    return limit_of(problem, best.differentiated, residual, FINER)


def notes_of_mesh(sure: Certainty) -> list[Note]:
    """Return a note a modulus in which the mesh has a larger share than the noise, where most."""
    assert sure.mesh is not None
    notes = []
    for name, share in sure.of_mesh.items():
        beyond = share - np.maximum(sure.noise_sigma[name], LEAST)
        worst = int(beyond.argmax())
        if beyond[worst] > 0:
            by = _signed(sure.mesh[name][worst])
            at = f"at {100 * sure.strain[name][worst]:.3g} % of strain"
            words = f"on a fine mesh {name} would be {by} {at},"
            if sure.taken_out:
                words = f"the mesh moved {name} {at}: {by} is taken out, and what may be left is"
            noise = f"{100 * sure.noise_sigma[name][worst]:.2g} %"
            words += f" more than the noise makes uncertain ({noise}): more elements help"
            notes.append(Note(MESH, words))
    return notes


def _signed(share: float) -> str:
    return f"{100 * share:+.{0 if abs(share) >= 0.1 else 2}{'f' if abs(share) >= 0.1 else 'g'}} %"


TAKEN_OUT_IS = (
    "the error of the mesh is taken out of the moduli ({} at most): the card is the law of ever "
    "finer meshes, to first order; objective, residuals and what is drawn of the tests are those "
    "of the mesh of the fit"
)
TOO_LARGE_IS = (
    "the error of the mesh is not taken out of the moduli: to first order, and within the bounds, "
    "ever finer meshes would change {} at most, and beyond {:.0f} % a linear step is not valid; "
    "the bands reach there: more elements are needed"
)
NOT_TAKEN_OUT = "the error of the mesh is not known here and is not taken out of the moduli"


def with_certainty(setup: FitSetup, problem: FitProblem, best: BestFit) -> BestFit:
    """Return the best fit with its certainty, if its derivatives are known.
    Noise is the residual of finer models. With `mesh_error` taken out, and where the mesh moves
    anything, by no more than `LARGEST_CORRECTION`, the law is that of ever finer meshes; the
    analysis stays that of the fit."""
    slopes = best.differentiated
    if slopes is None:
        return best
    settings = setup.project.fit
    out = settings.mesh_error == CORRECTED
    limit = None
    law = best.law
    notes = list[Note]()
    try:
        limit = limit_of_meshes(setup, problem, best)
    except (InputError, SolverFailure) as error:
        words = f"the error of the mesh is not known: {str(error).splitlines()[0]}"
        notes.append(Note(UNKNOWN, words))
    if limit is None and out and "mesh_error" in settings.model_fields_set:
        notes.append(Note(UNKNOWN, NOT_TAKEN_OUT))
    moves = limit is not None and np.abs(limit.step) > NOTHING * np.abs(slopes.unknowns)
    out = out and bool(np.any(moves))
    too_large = False
    if limit is not None and out:
        too_large = not correction_is_valid(problem, slopes, best.valid, limit)
        out = not too_large
        law = law if too_large else problem.unknowns.law(law, slopes.unknowns + limit.step)
    sure = _certainty(problem.surrogate or problem, slopes, law, best.valid, limit, out)
    if sure.mesh is not None:
        most = {name: off[np.abs(off).argmax()] for name, off in sure.mesh.items()}
        by = ", ".join(f"{name} {_signed(off)}" for name, off in most.items())
        if too_large:
            notes.append(Note(TOO_LARGE, TOO_LARGE_IS.format(by, 100 * LARGEST_CORRECTION)))
        else:
            notes += notes_of_mesh(sure)
        if out and max(map(abs, most.values())) > LEAST:
            notes.append(Note(TAKEN_OUT, TAKEN_OUT_IS.format(by)))
    if sure.order is not None:
        notes += sure.order.notes
    told = (*sure.undetermined, *notes)
    return replace(best, law=law, certainty=replace(sure, undetermined=told))


def correction_is_valid(
    problem: FitProblem, best: Evaluation, valid: Array, limit: FineMeshLimit
) -> bool:
    """Return whether the step to ever finer meshes keeps the bounds and is small enough.

    Parameters
    ----------
    problem : FitProblem
    best : Evaluation
        From which the step goes.
    valid : (3,) array
        Ends of the strains at which the moduli are looked at.
    limit : FineMeshLimit
    """
    unknowns = problem.unknowns
    y = best.unknowns + limit.step
    if not (unknowns.keeps_bounds(y) and is_positive(unknowns.law(problem.law, y))):
        return False
    strains = {name: np.linspace(0.0, valid[c], POINTS) for name, c in COMPONENTS.items()}
    changes = relative_changes(unknowns, best.unknowns, limit.step, strains)
    return all(np.abs(change).max() <= LARGEST_CORRECTION for change in changes.values())


def _certainty(
    problem: FitProblem,
    best: Evaluation,
    law: HypoelasticLaw,
    reached: Array,
    limit: FineMeshLimit | None,
    out: bool = False,
) -> Certainty:
    """Return the certainty by first derivatives, by second if much is left and they differ."""
    left = best.residual if limit is None else limit.residual
    noise = Noise.from_residual(problem, left)
    if not has_large_residual(problem, left):
        return certainty(problem, best, law, reached, limit, taken_out=out, noise=noise)
    found = second_order_terms(problem, best, noise)
    change = {}
    used = False
    why = NOT_DEFINITE
    if is_definite(LinearisedFit.of(problem, best, noise), found):
        first, second = (
            moduli_sigmas(
                problem.unknowns,
                law,
                reached,
                posteriors_of(problem, best, noise, limit, order)[0].covariance,
            )[1]
            for order in (None, found)
        )
        for name, sigma in second.items():
            by = sigma / first[name] - 1.0
            change[name] = float(by[np.abs(by).argmax()])
        used = max(map(abs, change.values())) > WORTHWHILE_CHANGE
        why = "" if used else TOO_LITTLE
    order = UncertaintyOrder(used, why, change, found.directions, found.analyses)
    terms = found if used else None
    sure = certainty(problem, best, law, reached, limit, terms, out, noise)
    return replace(sure, order=order)


def card_certainty(
    problem: FitProblem, best: BestFit, law: HypoelasticLaw, tests: Sequence[str]
) -> CardCertainty | None:
    """Return the certainty of the card's law, from draws within the bounds of the fit, if known.
    With an error of the mesh not taken out, draws lie about the law of ever finer meshes."""
    if (sure := best.certainty) is None:
        return None
    known = sure.fine or sure.posterior
    values = sum(sum(c.objective.sizes) for c in problem.comparisons)
    words = words_of(tests, values, sure.fine is not None)
    bands = {name: np.array([m.strain, m.lower, m.upper]) for name, m in sure.moduli.items()}
    return certainty_of(law, known.law_draws @ known.unknowns.to_coefficients.T, words, bands)


#: A card, its file or its name; None for that of the project's fit.
Card = GivenCard | None
#: Limit of analyses from the card to the optimum, and damping of the first.
MOST, DAMPING = 40, 1e-6
#: Relative change of a modulus beyond which the card was not the optimum.
MOVED = 0.02


@dataclass(frozen=True, eq=False)
class CardOptimum:
    """A fit's optimum, found again from its card, with derivatives and certainty."""

    setup: FitSetup
    problem: FitProblem
    best: BestFit
    card: str
    analyses: int
    notes: tuple[Note, ...] = ()

    @property
    def sure(self) -> Certainty:
        assert self.best.certainty is not None
        return self.best.certainty

    @property
    def posterior(self) -> Posterior:
        """Return the posterior of the unknowns, from the noise alone."""
        return self.sure.posterior

    @property
    def point(self) -> Evaluation:
        return self.best.point

    @property
    def linear(self) -> LinearisedFit:
        """Return the linear fit there, with the noise of the certainty."""
        return LinearisedFit.of(self.problem, self.point, self.sure.noise, self.sure.second)


def find_optimum(project: Project, card: Card, tests: str | Sequence[str] | None) -> CardOptimum:
    """Find the optimum of the project's fit from a card, by a solver that differentiates.
    card : by default that of the project's fit. InputError : in the project or its data; no card,
    or one of another form. SolverFailure : the tests cannot be run with it."""
    notes = []
    named = project.fit.solver
    if make_solver(project).external:
        said = f"run by {SURROGATE}, which leads {named}: that gives no derivatives"
        notes.append(Note(SOLVER, said))
        project = project.with_solver(SURROGATE, {})
    material = card_of(project, card)
    setup = prepare_fit(project, project.chosen(tests, fitted=True))
    problem = setup.problem()
    own = material.law.form
    unknowns = problem.unknowns
    if own != setup.law.form:
        expected = "expected a card of this project's fit: its moduli are "
        expected += f"{setup.law.form.describe()}, those of the card {own.describe()}"
        raise InputError(setup.project.path, "--card", expected)
    coefficients_of_card = material.law.beta[list(unknowns.free)]
    check_within_bounds(project, unknowns, coefficients_of_card)
    start = unknowns.at(coefficients_of_card)
    known = {"nu12": material.law.nu12, "thickness": material.thickness}
    if (memory := material.law.memory) is not None:
        known |= dict(zip(NAMES, memory.constants, strict=True))
    for place, shared in enumerate(unknowns.nuisance.shared, start=unknowns.size):
        if shared.name in known:
            start[place] = min(max(known[shared.name], shared.lower), shared.upper)
    point = evaluate_law(problem, start, with_jacobian=True)
    if point is None:
        said = f"the tests cannot be run with the card: {problem.failure}"
        raise SolverFailure(said, problem.solver.name)
    tolerance = project.fit.tolerance
    most = problem.analyses + MOST
    settings = DescentSettings(initial_damping=DAMPING)
    found, status = descend(problem, point, tolerance, most, norms=True, settings=settings)
    y, coefficients = (tuple(v.tolist()) for v in (found.unknowns, found.coefficients))
    analyses = problem.analyses
    record = StartRecord(
        0, (project.fit.seed, 0), found.value, status, analyses, y, coefficients, 0.0
    )
    best = with_certainty(setup, problem, best_fit(problem, [record], tolerance))
    far = []
    for name, component in COMPONENTS.items():
        end = min(float(best.valid[component]), float(material.law.strain_range[component]))
        strain = np.linspace(0.0, end, 21)
        change = best.law.modulus(name, strain) / material.law.modulus(name, strain) - 1.0
        by = float(change[np.abs(change).argmax()])
        far += [f"{name} by {100 * by:+.2g} %"] if abs(by) > MOVED else []
    if far:
        words = f"the optimum of these tests is not where the card is; moved {', '.join(far)}"
        notes.append(Note(NOT_THE_CARD, words))
    words = card_words(card)
    return CardOptimum(setup, problem, best, words, analyses + 1, tuple(notes))
