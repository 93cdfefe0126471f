"""Describe what a fit of a bubble seeks beside the law: nuisance unknowns, errors of the sheet.

Nuisance unknowns are offsets, the shape of the sheet, and the misalignment of the registration.

Where they are measured and not fitted, the shape of the sheet before the test, the motion of its
rim, the place and the yarns in the camera's coordinates, and the frame from which displacements are
counted have random errors. Each of these moves many residuals at once, so that bands by the scatter
of the residuals alone are too narrow; `SheetErrors` tells how much they move the residuals.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
import scipy

from ...errors import SolverFailure
from ...inference.comparison import Comparison, ErrorColumns
from ...inference.noise import correlated_count_of
from ...inference.nuisance import Nuisance, prior_weight
from ...materials.law import HypoelasticLaw
from ...meshes.bubble_model import TURN, BubbleModel
from ...solvers.base import Array, History
from . import BubbleTest
from .objective import MISALIGNMENTS, OFFSETS, FieldObjective
from .reading_objective import HEIGHT_SCALE, ReadingObjective
from .registration import CameraRegistration
from .sheet import MAX_SIGMAS, MeasuredSheet, sheet_nuisance


@dataclass(frozen=True)
class NuisanceBounds:
    """Bounds of the offsets and of the turn of the yarns that are fitted beside the law."""

    displacement: float = 20.0  # mm, largest offset of displacements in either sense
    pressure: float = 50.0  # kPa, largest offset of the pressure
    pressure_share: float = -0.9  # smallest offset over the lowest pressure, which stays positive
    turn: float = 30.0  # degrees, in either sense; further turns come near to swapped moduli


BOUNDS = NuisanceBounds()


def bubble_nuisance(
    test: BubbleTest,
    model: BubbleModel,
    objective: FieldObjective,
    estimates: Mapping[str, float],
) -> tuple[Nuisance, ...]:
    """Return all unknowns of a bubble test that a fit finds beside the law.

    Parameters
    ----------
    test : BubbleTest
    model : BubbleModel
        The model with the measured shape of the sheet and its unknown modes.
    objective : FieldObjective
    estimates : mapping of str to float
        Values at which the unknowns of the registration start, by name.

    Returns
    -------
    tuple of Nuisance
    """
    nuisance: list[Nuisance] = []
    if test.displacement_offset:
        largest = BOUNDS.displacement
        nuisance += [Nuisance(name, -largest, largest, "mm") for name in OFFSETS]
    nuisance += _pressure_nuisance(test)
    nuisance += sheet_nuisance(test.sheet, model, objective.scale)
    nuisance += registration_nuisance(test, objective, estimates)
    return tuple(nuisance)


def _pressure_nuisance(test: BubbleTest) -> list[Nuisance]:
    """Return the unknown offset of the pressure, where the test has one."""
    if not test.pressure_offset:
        return []
    name = "pressure_offset"
    lowest = BOUNDS.pressure_share * 1e3 * min(test.increments)
    return [
        Nuisance(
            name,
            lowest,
            BOUNDS.pressure,
            "kPa",
            model_parameter=name,
            scale=1e-3,
        )
    ]


def reading_nuisance(
    test: BubbleTest, model: BubbleModel, objective: ReadingObjective
) -> tuple[Nuisance, ...]:
    """Return the unknowns of a bubble without a camera beside the law.

    They are offsets of the pressure and of each gauge, a scale of all heights, and the shape of the
    sheet. Priors are weighed against the noise of the readings.

    Parameters
    ----------
    test : BubbleTest
    model : BubbleModel
        The model with the unknown modes of the sheet.
    objective : ReadingObjective
    """
    weight = prior_weight(objective.least_noise, objective.scale, correlated=1)
    nuisance = _pressure_nuisance(test)
    for unknown in sheet_nuisance(test.sheet, model, objective.scale):
        nuisance.append(replace(unknown, weight=weight))
    prior = test.height_offset
    if prior is not None:
        ends = -MAX_SIGMAS * prior, MAX_SIGMAS * prior
        nuisance += [
            Nuisance(name, *ends, "mm", prior=prior, weight=weight)
            for name in objective.height_offsets
        ]
    if test.height_scale is not None:
        prior = 100.0 * test.height_scale
        ends = -MAX_SIGMAS * prior, MAX_SIGMAS * prior
        nuisance.append(Nuisance(HEIGHT_SCALE, *ends, "%", prior=prior, weight=weight))
    return tuple(nuisance)


def registration_nuisance(
    test: BubbleTest, objective: FieldObjective, estimates: Mapping[str, float]
) -> list[Nuisance]:
    """Return the unknowns of the registration: the turn of the yarns, and `MISALIGNMENTS`.

    The turn is a parameter of the model, the others move the data.

    Parameters
    ----------
    test : BubbleTest
    objective : FieldObjective
    estimates : mapping of str to float
        Value at which each unknown starts, by its name, if it lies within the bounds: degrees of
        turn and tilt, mm of shift.

    Notes
    -----
    Priors are weighed against the noise: the field's symmetry determines the unknowns far better.
    """
    nuisance = list[Nuisance]()
    weight = prior_weight(objective.least_noise, objective.scale)
    for quantity, prior in test.registration.items():
        is_turn = quantity == TURN
        largest = min(MAX_SIGMAS * prior, BOUNDS.turn) if is_turn else MAX_SIGMAS * prior
        # "turn", "tilt" and "shift" are the beginnings of the unknowns' names.
        for name in (TURN, *MISALIGNMENTS):
            if not name.startswith(quantity):
                continue
            estimate = estimates.get(name, np.inf)
            unknown = Nuisance(
                name,
                -largest,
                largest,
                "mm" if quantity == "shift" else "deg",
                model_parameter=TURN if is_turn else None,
                scale=float(np.pi / 180) if is_turn else 1.0,
                prior=prior,
                weight=weight,
                begin=estimate if abs(estimate) < largest else None,
            )
            nuisance.append(unknown)
    return nuisance


#: Number of places of a plane whose errors are independent: a clamp's deviations are smooth.
PLANE_PLACES = 10
#: Modes of a rim's motion of which all together have less than this share of the largest are noise
#: of rounding.
NEGLIGIBLE_MODE = 1e-6


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
    ) -> ErrorColumns:
        """Return the changes of the residuals, see `SharedErrors`."""
        objective = comparison.objective
        fitted = replace(comparison, model=comparison.model_at(nuisance), nuisance=())
        columns = [np.zeros((sum(objective.sizes), 0))]
        parts = []
        if isinstance(objective, FieldObjective):
            columns += self._registration_columns(objective, nuisance, history)
            if self.test.sheet.reference_frame is not None:
                parts.append(_reference_errors(objective, history, nuisance))
            parts += self._rim_columns(fitted, objective, law, nuisance, history)
        columns.append(self._surface_columns(fitted, law, nuisance))
        by_turn = _changes_by(self._turned(fitted.model), fitted, law, nuisance, history)
        columns += [change[:, None] for change in by_turn]
        independent = ErrorColumns.independent(np.column_stack(columns))
        return ErrorColumns.joined([independent, *parts])

    def _surface_columns(
        self, comparison: Comparison, law: HypoelasticLaw, nuisance: Mapping[str, float]
    ) -> Array:
        """Return the changes (m, terms) by the surface's coefficients; the model has no unknowns.

        Coefficients are combined so that their errors are independent.
        """
        surface = self.sheet.surface
        model = comparison.model
        if surface is None:
            return np.zeros((sum(comparison.objective.sizes), 0))
        heights = surface.rms[0] * surface.errors_at(model.mesh.points[:, :2])
        heights -= heights[model.mesh.node_sets["rim"]].mean(axis=0)
        modes = {f"height {k}": mode for k, mode in enumerate(heights.T)}
        unknowns = tuple(Nuisance(name, -1.0, 1.0, "", name) for name in modes)
        uneven = replace(comparison, model=replace(model, modes=modes), nuisance=unknowns)
        values = {**nuisance, **dict.fromkeys(modes, 0.0)}
        return uneven.differentiate(law, (), values, warm=False)[1]

    def _rim_columns(
        self,
        comparison: Comparison,
        objective: FieldObjective,
        law: HypoelasticLaw,
        nuisance: Mapping[str, float],
        history: History,
    ) -> list[ErrorColumns]:
        """Return the errors of the rim's motion in each frame, which the frame's noise makes.

        A frame's residual is taken to depend on the rim in this frame alone.
        """
        if not self.sheet.rim:
            return []
        model = comparison.model
        rim = model.mesh.points[model.mesh.node_sets["rim"], :2]
        shapes, sizes, _ = np.linalg.svd(self.sheet.rim[-1].errors_at(rim), full_matrices=False)
        shapes = shapes[:, sizes > NEGLIGIBLE_MODE * sizes[0]]
        step = float(self.sheet.rim[-1].rms.mean())
        models = [_with_rim(model, step * shape, axis) for axis in range(3) for shape in shapes.T]
        by_mode = _changes_by(models, comparison, law, nuisance, history)
        if len(by_mode) < len(models):
            return []
        slopes = np.transpose(by_mode) / step
        parts = []
        first = 0
        for k, target in enumerate(objective.targets):
            motion = self.sheet.rim[k if target.frame is None else target.frame]
            size = len(target.displacement)
            rows = slice(first, first + 3 * size)
            first = rows.stop
            modes, amplitudes, terms = np.linalg.svd(
                shapes.T @ motion.errors_at(rim), full_matrices=False
            )
            by_axis = np.split(slopes[rows], 3, axis=1)
            changes = np.hstack(
                [
                    rms * part @ (modes * amplitudes)
                    for rms, part in zip(motion.rms, by_axis, strict=True)
                ]
            )
            sources = np.zeros((size, len(terms)))
            if self.test.match_by == "points" and target.positions is not None:
                sources = motion.errors_at(target.positions) @ terms.T
            errors = ErrorColumns(
                scipy.sparse.csc_array(changes),
                scipy.sparse.block_diag([sources] * 3, format="csc"),
            )
            parts.append(errors.at_rows(rows, len(slopes)))
        return parts

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
        tilt = np.degrees(self.registration.flatness / radius * np.sqrt(2.0 / PLANE_PLACES))
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


def _with_rim(model: BubbleModel, shape: Array, axis: int) -> BubbleModel:
    """Return a model whose rim moves further by a shape (rim nodes,), mm, along an axis."""
    share = np.interp(model.increments, [0.0, model.pressures[0]], [0.0, 1.0])
    assert model.rim_motion is not None
    motion = model.rim_motion.copy()
    motion[:, :, axis] += np.outer(share, shape)
    return replace(model, rim_motion=motion)


def _reference_errors(
    objective: FieldObjective, history: History, nuisance: Mapping[str, float]
) -> ErrorColumns:
    """Return the errors of each place by noise of the frame from which others are counted."""
    differences = objective.differences(history.displacement, nuisance)
    # Half of the mean square is noise of the frame itself, half that of the reference.
    level = np.sqrt(0.5 * np.mean(np.concatenate(differences) ** 2))
    count = correlated_count_of(objective, objective.residual(history, nuisance))
    numbers = [np.asarray(target.place_numbers) for target in objective.targets]
    places = 1 + max(int(of_target.max()) for of_target in numbers)
    columns = np.concatenate(
        [axis * places + of_target for of_target in numbers for axis in range(3)]
    )
    sizes = level * np.sqrt(count) / objective.scale
    rows = np.arange(len(columns))
    shape = (len(columns), 3 * places)
    return ErrorColumns.independent(scipy.sparse.csc_array((sizes, (rows, columns)), shape=shape))
