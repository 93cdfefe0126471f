"""The uncertainty of a fit from the noise of its data, and the correction of its mesh error."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..errors import InputError, SolverFailure
from ..experiments.base import PreparedTest, Refinable, Weighting
from ..inference import assessment
from ..inference.assessment import Certainty
from ..inference.comparison import Comparison
from ..inference.linear import (
    NOT_DEFINITE,
    TOO_LITTLE,
    WORTHWHILE_CHANGE,
    FineMeshLimit,
    LinearisedFit,
    SecondOrderTerms,
    UncertaintyOrder,
    has_large_residual,
    is_definite,
    limit_of,
    residual_of,
    second_order_terms,
)
from ..inference.noise import Noise
from ..inference.problem import Evaluation, FitProblem
from ..inference.reported import POINTS, moduli_sigmas, relative_changes
from ..inference.shear_valley import balanced_modulus, note_of_one_stiffness
from ..materials.admissibility import is_positive
from ..materials.card import CardCertainty, certainty_of, words_of
from ..materials.forms.base import COMPONENTS, Array
from ..materials.forms.symmetry import modulus_labels
from ..materials.law import HypoelasticLaw
from ..notes import Note, NoteKind, Objection
from .setup import FitSetup, with_shared
from .starts import BestFit

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

TAKEN_OUT_WORDS = (
    "the error of the mesh is taken out of the moduli ({} at most): the card is the law of ever "
    "finer meshes, to first order; objective, residuals and what is drawn of the tests are those "
    "of the mesh of the fit"
)
TOO_LARGE_WORDS = (
    "the error of the mesh is not taken out of the moduli: to first order, and within the bounds, "
    "ever finer meshes would change {} at most, and beyond {:.0f} % a linear step is not valid; "
    "the bands reach there: more elements are needed"
)
UNKNOWN_WORDS = "the error of the mesh is not known here and is not taken out of the moduli"

#: Values of the setting `fit.mesh_error`: the error is only reported, or the law corrected for it.
REPORTED = "told"
CORRECTED = "taken out"
#: Factor by which the finer mesh, from which the mesh error is estimated, divides the edges.
FINER = 2.0
#: Largest relative mesh error of a modulus that is corrected. The correction is linear and neglects
#: terms of the order of its square, about a tenth of the modulus at 0.3.
LARGEST_CORRECTION = 0.3
#: Relative error of a modulus that needs no note, whatever the noise.
NEGLIGIBLE_ERROR = 0.01
#: Relative correction of an unknown up to which it counts as rounding.
ROUNDING = 1e-4


def with_certainty(setup: FitSetup, problem: FitProblem, best: BestFit) -> BestFit:
    """Return the best fit with its uncertainty, and with its law corrected for the mesh error.

    Without derivatives the fit is returned as it is. The law is replaced by the limit of ever finer
    meshes if the project asks for that and the correction is valid (`correction_is_valid`); the
    analysis stays the one on the mesh of the fit.
    """
    point = best.with_derivatives
    if point is None:
        return best
    correction = mesh_correction(setup, problem, best, point)
    limit = correction.limit
    law = best.law
    if correction.is_taken_out and limit is not None:
        law = problem.unknowns.law(law, point.unknowns + limit.step)
    certainty = certainty_of_fit(
        problem.differentiating, point, law, best.valid, limit, correction.is_taken_out
    )
    notes = [
        *certainty.notes,
        *correction.notes,
        *notes_of_correction(certainty, correction),
    ]
    if certainty.order is not None:
        notes += certainty.order.notes
    return replace(best, law=law, certainty=replace(certainty, notes=tuple(notes)))


# The error of the mesh ----------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class MeshCorrection:
    """The estimated mesh error of a fit, and whether the law is corrected for it.

    Attributes
    ----------
    limit : FineMeshLimit or None
        The fit extrapolated to ever finer meshes; None if it is not known.
    is_taken_out : bool
        Whether the law is corrected to that limit.
    is_too_large : bool
        Whether a correction was wanted but is not valid (`correction_is_valid`).
    notes : sequence of Note
        Why the mesh error is not known.
    """

    limit: FineMeshLimit | None
    is_taken_out: bool = False
    is_too_large: bool = False
    notes: Sequence[Note] = ()


def mesh_correction(
    setup: FitSetup, problem: FitProblem, best: BestFit, point: Evaluation
) -> MeshCorrection:
    """Estimate the mesh error of a fit, and decide whether its law is corrected for it.

    Parameters
    ----------
    setup : FitSetup
    problem : FitProblem
    best : BestFit
    point : Evaluation
        The best fit, with derivatives.
    """
    settings = setup.project.fit
    is_requested = settings.mesh_error == CORRECTED
    limit = None
    notes = []
    try:
        limit = limit_of_meshes(setup, problem, best)
    except (InputError, SolverFailure) as error:
        words = f"the error of the mesh is not known: {str(error).splitlines()[0]}"
        notes.append(Note(UNKNOWN, words))
    if limit is None:
        if is_requested and "mesh_error" in settings.model_fields_set:
            notes.append(Note(UNKNOWN, UNKNOWN_WORDS))
        return MeshCorrection(None, notes=notes)
    has_effect = bool(np.any(np.abs(limit.step) > ROUNDING * np.abs(point.unknowns)))
    if not (is_requested and has_effect):
        return MeshCorrection(limit)
    is_valid = correction_is_valid(problem, point, best.valid, limit)
    return MeshCorrection(limit, is_taken_out=is_valid, is_too_large=not is_valid)


def limit_of_meshes(setup: FitSetup, problem: FitProblem, best: BestFit) -> FineMeshLimit | None:
    """Extrapolate the best fit to ever finer meshes, from one analysis on a finer mesh.

    It is None without derivatives, if another program solves (its runs take minutes and are not
    made unasked), or if a test has no finer model.

    Raises
    ------
    InputError, SolverFailure
        The finer mesh cannot be made or run.
    """
    if best.with_derivatives is None or problem.solver.external:
        return None
    if not all(isinstance(test, Refinable) for test in setup.tests):
        return None

    def finer(test: PreparedTest, weighting: Weighting) -> Sequence[Comparison]:
        assert isinstance(test, Refinable)
        return test.finer(setup.make_solver, weighting, FINER)

    comparisons = with_shared(setup.all_comparisons(finer), problem.unknowns.nuisance.shared)
    residual = residual_of(problem, list(comparisons), best.with_derivatives, best.law)
    return limit_of(problem, best.with_derivatives, residual, FINER)


def correction_is_valid(
    problem: FitProblem, best: Evaluation, valid: Array, limit: FineMeshLimit
) -> bool:
    """Return whether the law in the limit of fine meshes keeps its bounds and is close enough.

    Parameters
    ----------
    problem : FitProblem
    best : Evaluation
        The fit on its own mesh.
    valid : (3,) array
        Largest strains at which changes of the moduli are examined.
    limit : FineMeshLimit
        The step of the unknowns to the limit.
    """
    unknowns = problem.unknowns
    y = best.unknowns + limit.step
    if not (unknowns.keeps_bounds(y) and is_positive(unknowns.law(problem.law, y))):
        return False
    strains = {name: np.linspace(0.0, valid[c], POINTS) for name, c in COMPONENTS.items()}
    changes = relative_changes(unknowns, best.unknowns, limit.step, strains)
    return all(np.abs(change).max() <= LARGEST_CORRECTION for change in changes.values())


def notes_of_correction(certainty: Certainty, correction: MeshCorrection) -> list[Note]:
    """Return notes on the mesh error of the moduli, if it is known."""
    if certainty.mesh is None:
        return []
    labels = modulus_labels(certainty.posterior.unknowns.form)
    of_mesh = {label: certainty.mesh[name] for name, label in labels.items()}
    largest = {label: change[np.abs(change).argmax()] for label, change in of_mesh.items()}
    changes = ", ".join(f"{name} {_signed(change)}" for name, change in largest.items())
    if correction.is_too_large:
        words = TOO_LARGE_WORDS.format(changes, 100 * LARGEST_CORRECTION)
        return [Note(TOO_LARGE, words)]
    notes = notes_of_mesh(certainty)
    if correction.is_taken_out and max(map(abs, largest.values())) > NEGLIGIBLE_ERROR:
        notes.append(Note(TAKEN_OUT, TAKEN_OUT_WORDS.format(changes)))
    return notes


def notes_of_mesh(certainty: Certainty) -> list[Note]:
    """Return a note on each modulus whose mesh error exceeds its noise, at the worst strain."""
    assert certainty.mesh is not None
    notes = []
    for name, mesh_error in certainty.of_mesh.items():
        noise = certainty.noise_sigma[name]
        excess = mesh_error - np.maximum(noise, NEGLIGIBLE_ERROR)
        worst = int(excess.argmax())
        if excess[worst] <= 0:
            continue
        change = _signed(certainty.mesh[name][worst])
        strain = f"at {100 * certainty.strain[name][worst]:.3g} % of strain"
        words = f"on a fine mesh {name} would be {change} {strain},"
        if certainty.taken_out:
            words = (
                f"the mesh moved {name} {strain}: {change} is taken out, and what may be left is"
            )
        noise_words = f"{100 * noise[worst]:.2g} %"
        words += f" more than the noise makes uncertain ({noise_words}): more elements help"
        notes.append(Note(MESH, words))
    return notes


def _signed(share: float) -> str:
    """Return a relative change in percent with its sign."""
    return f"{100 * share:+.0f} %" if abs(share) >= 0.1 else f"{100 * share:+.2g} %"


# Derivatives of first or second order -------------------------------------------------------------


def certainty_of_fit(
    problem: FitProblem,
    best: Evaluation,
    law: HypoelasticLaw,
    reached: Array,
    limit: FineMeshLimit | None,
    is_taken_out: bool = False,
) -> Certainty:
    """Return the uncertainty of a fit, with second derivatives if these change it enough.

    Parameters
    ----------
    problem : FitProblem
        Problem whose solver gives derivatives.
    best : Evaluation
    law : HypoelasticLaw
        The law that is reported.
    reached : (3,) array
        Largest strains of the moduli.
    limit : FineMeshLimit or None
        The fit extrapolated to ever finer meshes.
    is_taken_out : bool
        Whether the law is corrected to that limit.
    """
    residual = best.residual if limit is None else limit.residual
    noise = Noise.from_residual(problem, residual).with_shared_errors(problem, best, residual)
    order: UncertaintyOrder | None = None
    terms: SecondOrderTerms | None = None
    if has_large_residual(problem, residual) and not problem.solver.external:
        second = second_order_terms(problem, best, noise)
        order = order_of(problem, best, law, reached, noise, second)
        terms = second if order.used else None
    certainty = assessment.certainty(
        problem,
        best,
        law,
        reached,
        limit=limit,
        second=terms,
        taken_out=is_taken_out,
        noise=noise,
    )
    certainty = replace(certainty, order=order)
    if not problem.is_exchangeable:
        return certainty
    note = note_of_one_stiffness(balanced_modulus(problem, best, noise, float(min(reached[:2]))))
    return replace(certainty, notes=(*certainty.notes, note))


def order_of(
    problem: FitProblem,
    best: Evaluation,
    law: HypoelasticLaw,
    reached: Array,
    noise: Noise,
    second: SecondOrderTerms,
) -> UncertaintyOrder:
    """Return whether second derivatives are used: if they change a standard deviation enough.

    Parameters
    ----------
    problem : FitProblem
    best : Evaluation
        The optimum, with its Jacobian.
    law : HypoelasticLaw
        Law of the optimum, whose moduli the standard deviations are relative to.
    reached : (3,) array
        Log strains (eps1, eps2, gamma12) up to which the moduli are compared.
    noise : Noise
    second : SecondOrderTerms
        Second derivatives of the residuals.

    Returns
    -------
    UncertaintyOrder
    """
    linear = LinearisedFit.of(problem, best, noise)
    if not is_definite(linear, second):
        return UncertaintyOrder(False, NOT_DEFINITE, {}, second.directions, second.analyses)
    sigmas = [
        moduli_sigmas(problem.unknowns, law, reached, fit.covariance)[1]
        for fit in (linear, LinearisedFit.of(problem, best, noise, second))
    ]
    changes = {}
    for name, sigma in sigmas[1].items():
        change = sigma / sigmas[0][name] - 1.0
        changes[name] = change[np.abs(change).argmax()]
    is_used = max(map(abs, changes.values())) > WORTHWHILE_CHANGE
    reason = "" if is_used else TOO_LITTLE
    return UncertaintyOrder(is_used, reason, changes, second.directions, second.analyses)


def card_certainty(
    problem: FitProblem, best: BestFit, law: HypoelasticLaw, tests: Sequence[str]
) -> CardCertainty | None:
    """Return the uncertainty of a card's law from random draws, or None without derivatives.

    If the mesh error is known but not corrected, draws scatter about the limit of fine meshes.
    """
    certainty = best.certainty
    if certainty is None:
        return None
    posterior = certainty.corrected or certainty.posterior
    value_count = sum(sum(c.objective.sizes) for c in problem.comparisons)
    words = words_of(tests, value_count, certainty.corrected is not None)
    bands = {name: np.array([m.strain, m.lower, m.upper]) for name, m in certainty.moduli.items()}
    draws = posterior.law_draws @ posterior.unknowns.to_coefficients.T
    return certainty_of(law, draws, words, bands)
