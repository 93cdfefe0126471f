"""Random errors of what is measured of a bubble's sheet beside its displacements.

The shape of the sheet before the test, the motion of its rim, the place and the yarns in the
camera's coordinates, and the frame from which displacements are counted are measured, too. Each of
these errors moves many residuals at once, so that bands by the scatter of the residuals alone are
too narrow. Draws of the errors show how much they move the residuals.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from ...errors import SolverFailure
from ...inference.comparison import Comparison
from ...inference.correlation import correlated_count_of
from ...materials.law import HypoelasticLaw
from ...meshes.bubble_model import TURN, BubbleModel
from ...solvers.base import Array, History
from .objective import MISALIGNMENTS, FieldObjective
from .registration import CameraRegistration
from .sheet import MeasuredSheet, with_sheet
from .test import BubbleTest


@dataclass(frozen=True)
class DrawCounts:
    """Numbers of random draws, and of places of a plane whose errors are independent."""

    runs: int = 16  # of shape and rim, each an analysis
    frames: int = 50  # of the noise of the frame from which displacements are counted
    places: int = 10  # the deviations of a clamp from its plane are smooth


DRAWS = DrawCounts()


@dataclass(frozen=True, eq=False)
class SheetErrors:
    """The errors of a test's measured sheet, registration and reference frame.

    Attributes
    ----------
    test : BubbleTest
    sheet : MeasuredSheet
    registration : CameraRegistration or None
    """

    test: BubbleTest
    sheet: MeasuredSheet
    registration: CameraRegistration | None

    def __call__(
        self,
        comparison: Comparison,
        law: HypoelasticLaw,
        nuisance: Mapping[str, float],
        history: History,
    ) -> Array:
        """Return the changes (m, k) of the residuals, see `SharedErrors`."""
        objective = comparison.objective
        random = np.random.default_rng(0)
        columns = [np.zeros((sum(objective.sizes), 0))]
        if isinstance(objective, FieldObjective):
            columns += self._registration_columns(objective, nuisance, history)
            if self.test.sheet.reference_frame is not None:
                columns.append(_reference_columns(objective, history, nuisance, random))
        draws = self._draws(comparison.model, random)
        of_draws = _changes_by(draws, comparison, law, nuisance, history)
        if len(of_draws) > 2:
            # The sum of squares of few draws is smaller than its mean more often than larger.
            columns.append(np.transpose(of_draws) / np.sqrt(len(of_draws) - 2))
        turned = self._turned(comparison.model)
        for change in _changes_by(turned, comparison, law, nuisance, history):
            columns.append(change[:, None])
        return np.column_stack(columns)

    def _draws(self, model: BubbleModel, random: np.random.Generator) -> Iterator[BubbleModel]:
        """Yield models of the sheet as other pictures of it would have shown it."""
        if self.sheet.surface is None and not self.sheet.rim:
            return
        for _ in range(DRAWS.runs):
            sheet = self.sheet.disturbed(random)
            yield with_sheet(model, self.test.sheet, self.test.outline, sheet)

    def _turned(self, model: BubbleModel) -> Iterator[BubbleModel]:
        """Yield the model with its yarns turned by the standard error of the warp's angle."""
        registration = self.registration
        if registration is None or registration.warp is None or TURN in self.test.registration:
            return
        angle = np.radians(registration.warp.error)
        yield model.with_parameters({TURN: float(angle)})

    def _registration_columns(
        self, objective: FieldObjective, nuisance: Mapping[str, float], history: History
    ) -> list[Array]:
        """Return the columns (m, 1) of tilts and shifts that are registered and not fitted."""
        if self.registration is None or not objective.positions:
            return []
        radius = self.test.outline.radius
        tilt = np.degrees(self.registration.flatness / radius * np.sqrt(2.0 / DRAWS.places))
        rim = self.registration.rim
        errors = {"tilt": float(tilt), "shift": 0.0 if rim is None else rim.error}
        columns = objective.nuisance_columns(MISALIGNMENTS, nuisance, history)
        return [
            errors[quantity] * columns[:, [k]]
            for k, (quantity, _) in enumerate(name.split("_") for name in MISALIGNMENTS)
            if errors[quantity] > 0 and quantity not in self.test.registration
        ]


def _changes_by(
    models: Iterable[BubbleModel],
    comparison: Comparison,
    law: HypoelasticLaw,
    nuisance: Mapping[str, float],
    history: History,
) -> list[Array]:
    """Return the changes (m,) of the residuals by models in place of the fit's own one.

    Parameters
    ----------
    history : History
        Run of that one, from which theirs start; a model whose run fails is left out.
    """
    residual = comparison.objective.residual(history, nuisance)
    changes = []
    for model in models:
        changed = replace(comparison, model=model, prolong=np.asarray)
        with suppress(SolverFailure):
            run = changed.run(law, (), nuisance, warm=False, coarse_run=history)
            changes.append(comparison.objective.residual(run, nuisance) - residual)
    return changes


def _reference_columns(
    objective: FieldObjective,
    history: History,
    nuisance: Mapping[str, float],
    random: np.random.Generator,
) -> Array:
    """Return the changes (m, draws) by noise of the frame from which all others are counted."""
    differences = objective.differences(history.displacement, nuisance)
    # Half of the mean square is noise of the frame itself, half that of the reference.
    level = np.sqrt(0.5 * np.mean(np.concatenate(differences) ** 2))
    count = correlated_count_of(objective, objective.residual(history, nuisance))
    numbers = [np.asarray(target.place_numbers) for target in objective.targets]
    places = 1 + max(int(of_target.max()) for of_target in numbers)
    noise = random.standard_normal((places, 3, DRAWS.frames))
    parts = [noise[of_target] for of_target in numbers]
    return level * np.sqrt(count / DRAWS.frames) * objective.columns_of(parts)
