"""The optimum of a project's fit, found again from the card that the fit left: a few analyses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, SolverFailure
from ..experiments.kinds import FittableTest
from ..inference.assessment import Certainty
from ..inference.descent import descend
from ..inference.linear import Linear
from ..inference.noise import Noise
from ..inference.posterior import Posterior
from ..inference.problem import Evaluation, FitProblem
from ..inference.search import evaluate_law
from ..materials.card import MaterialCard
from ..materials.forms.base import COMPONENTS
from ..notes import Note, NoteKind
from ..project.project import Project
from .best import BestFit, best_fit, with_certainty
from .series import card_of, card_words, fitted_card
from .setup import SURROGATE, FitSetup, make_solver, prepare_fit
from .starts import StartRecord

Array = NDArray[np.float64]
#: Itself, its file, or its name; None for that of the project's fit.
Card = MaterialCard | Path | str | None

#: Analyses from the card to the optimum, at most, and the damping of the first of them.
MOST, DAMPING = 40, 1e-6
#: Change of a modulus on the way, relative, by which the card was not the optimum.
MOVED = 0.02


@dataclass(frozen=True, eq=False)
class Refound:
    """A fit's optimum, with its derivatives and how sure it is.

    Parameters
    ----------
    card : what the card is called. analyses : to find the optimum again. moved : largest relative
        change of each modulus from the card to the optimum, up to the strains reached.
    """

    setup: FitSetup
    problem: FitProblem
    best: BestFit
    card: str
    analyses: int
    moved: dict[str, float]
    notes: tuple[Note, ...] = ()

    @property
    def sure(self) -> Certainty:
        """As of the fit."""
        assert self.best.certainty is not None
        return self.best.certainty

    @property
    def posterior(self) -> Posterior:
        """Of the unknowns, from the noise alone."""
        assert self.sure.posterior is not None
        return self.sure.posterior

    @property
    def point(self) -> Evaluation:
        """The optimum."""
        return self.best.point

    @property
    def linear(self) -> Linear:
        """The fit there, as its certainty has it."""
        assert self.sure.rows is not None
        noise = replace(Noise.of(self.problem, self.point.residual), rows=self.sure.rows)
        return Linear.of(self.problem, self.point, noise, self.sure.second)


def refound(project: Project, card: Card, tests: str | Sequence[str] | None) -> Refound:
    """From a card to the optimum of the project's fit, by a solver that differentiates.

    Parameters
    ----------
    card : of a fit of these tests; the one that the project's fit left in its usual folder unless
        given. tests : as for `fit`.

    Raises
    ------
    InputError : in the project or its data; no card, or one of another form. SolverFailure : the
        tests cannot be run with it.
    """
    notes = []
    named = project.fit.solver
    if make_solver(project).external:
        said = f"run by {SURROGATE}, which leads {named}: that gives no derivatives"
        notes.append(Note(NoteKind.SOLVER, said))
        project = project.with_solver(SURROGATE, {})
    material = card_of(project, card if card is not None else fitted_card(project))
    setup = prepare_fit(project, cast(Sequence[FittableTest], project.chosen(tests, fitted=True)))
    problem = setup.problem()
    point = evaluate_law(problem, _unknowns(setup, problem, material), with_jacobian=True)
    if point is None:
        said = f"the tests cannot be run with the card: {problem.failure}"
        raise SolverFailure(said, problem.solver.name)
    tolerance, most = project.fit.tolerance, problem.analyses + MOST
    found, status = descend(problem, point, tolerance, most, norms=True, damping=DAMPING)
    y, coefficients = (tuple(v.tolist()) for v in (found.unknowns, found.coefficients))
    analyses = problem.analyses
    record = StartRecord(
        0, (project.fit.seed, 0), found.value, status, analyses, y, coefficients, 0.0
    )
    best = with_certainty(setup, problem, best_fit(problem, [record], tolerance))
    moved = _moved(material, best)
    far = [f"{name} by {100 * by:+.2g} %" for name, by in moved.items() if abs(by) > MOVED]
    if far:
        words = f"the optimum of these tests is not where the card is; moved {', '.join(far)}"
        notes.append(Note(NoteKind.NOT_THE_CARD, words))
    words = "of the fit" if card is None else card_words(card)
    return Refound(setup, problem, best, words, analyses + 1, moved, tuple(notes))


def _unknowns(setup: FitSetup, problem: FitProblem, card: MaterialCard) -> Array:
    """(count,) of the card's law, and of what else a card holds; raises InputError."""
    own, unknowns = card.law.form, problem.unknowns
    if own != setup.law.form:
        expected = (
            f"expected a card of this project's fit: its moduli are {setup.law.form.describe()}, "
            f"those of the card {own.describe()}"
        )
        raise InputError(setup.project.path, "--card", expected)
    y = unknowns.at(card.law.beta[list(unknowns.free)])
    known = {"nu12": card.law.nu12, "thickness": card.thickness}
    for place, shared in enumerate(unknowns.nuisance.shared, start=unknowns.size):
        if shared.name in known:
            y[place] = min(max(known[shared.name], shared.lower), shared.upper)
    return y


def _moved(card: MaterialCard, best: BestFit) -> dict[str, float]:
    moved = {}
    for name, component in COMPONENTS.items():
        end = min(float(best.valid[component]), float(card.law.strain_range[component]))
        strain = np.linspace(0.0, end, 21)
        change = best.law.modulus(name, strain) / card.law.modulus(name, strain) - 1.0
        moved[name] = float(change[np.abs(change).argmax()])
    return moved
