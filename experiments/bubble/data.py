"""From a bubble test to what a fit needs of it: its data read or computed, surfaces, the sheet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...errors import InputError, SolverFailure
from ...materials.forms.base import form_named
from ...materials.law import HypoelasticLaw
from ...readers.fields import DisplacementField, read_fields
from ...readers.surfaces import DisplacementSurface, fit_surface
from ...solvers.base import Solver
from ..kinds import MakeSolver
from .objective import mirrored
from .point_files import PointFiles
from .prepared import PreparedBubble
from .registration import Registration, register_fields
from .sheet import measured_sheet
from .test import BubbleTest, KnownSolution


@dataclass(frozen=True, eq=False)
class KnownData:
    """fields : computed, one a pressure. law : behind them.

    by_this_model : whether they are of the mesh, the increments and the solver of the fit.
    """

    fields: tuple[DisplacementField, ...]
    law: HypoelasticLaw
    by_this_model: bool


def known_data(
    test: BubbleTest, data: KnownSolution, law: HypoelasticLaw, make_solver: MakeSolver
) -> KnownData:
    """The known solution of a test; `law` : as the fit has it, without its coefficients.

    Raises
    ------
    InputError : in the section. SolverFailure : the known solution cannot be run.
    """
    known, solver = _known_law(test, data, law), _solver(test, data, make_solver)
    fields = _computed(test, data, known, solver)
    own = data.solver is None or solver.identity == make_solver().identity
    return KnownData(fields, known, own and _same_steps_and_mesh(test, data))


def _solver(test: BubbleTest, data: KnownSolution, make_solver: MakeSolver) -> Solver:
    """Who computes the data: the solver that fits unless another is named."""
    if data.solver is None:
        return make_solver()
    try:
        return make_solver(data.solver)
    except InputError as error:
        field = "data.known_solution.solver"
        raise test.place.error(field, error.problem) from None


def _same_steps_and_mesh(test: BubbleTest, data: KnownSolution) -> bool:
    """Whether the data are of the increments and the mesh that the fit has, whole or folded."""
    if len(data.increments) != len(test.increments):
        return False
    if not np.allclose(data.increments, test.increments, rtol=1e-9, atol=0.0):
        return False
    own, other = (test.model(elements=n).mesh for n in (test.elements, data.elements))
    return own.points.shape == other.points.shape and np.allclose(own.points, other.points)


def _known_law(test: BubbleTest, data: KnownSolution, law: HypoelasticLaw) -> HypoelasticLaw:
    field = "data.known_solution"
    try:
        form = form_named(data.form, {}, law.strain_range.tolist())
        return HypoelasticLaw(data.beta, law.nu12, law.strain_range, law.thickness_change, form)
    except InputError as error:
        raise test.place.error(f"{field}.{error.field}", error.problem) from None


def _computed(
    test: BubbleTest, data: KnownSolution, known: HypoelasticLaw, solver: Solver
) -> tuple[DisplacementField, ...]:
    """Displacements of the known solution by a solver, on the data's own mesh."""
    if data.symmetry == "quarter" and test.symmetry == "full":
        problem = "data of a quarter cannot be matched by a full model; use the same symmetry"
        raise test.place.error("data.known_solution.symmetry", problem)
    source = test.model(elements=data.elements, symmetry=data.symmetry, increments=data.increments)
    try:
        history = solver.run(source, known)
    except SolverFailure as failure:
        raise SolverFailure(
            f"the known solution cannot be run: {failure.reason}",
            failure.solver,
            failure.exit_number,
            failure.log_tail,
            failure.scratch,
        ) from None
    return tuple(
        DisplacementField(p, source.mesh.points[:, :2], u)
        for p, u in zip(test.pressures, np.asarray(history.displacement), strict=True)
    )


def prepare(test: BubbleTest, law: HypoelasticLaw, make_solver: MakeSolver) -> PreparedBubble:
    """Read or compute the data of a test.

    Raises
    ------
    InputError : in the data. SolverFailure : the known solution cannot be run.
    """
    if isinstance(test.data, KnownSolution):
        known = known_data(test, test.data, law, make_solver)
        surfaces = _surfaces(test, known.fields, computed=True)
        prepared = PreparedBubble(
            test, known.fields, surfaces, known.law, by_this_model=known.by_this_model
        )
    else:
        fields, registration = _measured(test, test.data)
        surfaces = _surfaces(test, fields, computed=False)
        prepared = PreparedBubble(test, fields, surfaces, None, registration)
    try:
        sheet = measured_sheet(test.sheet, test.outline, prepared.matched)
    except InputError as error:
        raise test.place.error(error.field, error.problem) from None
    return replace(prepared, sheet=sheet)


def _surfaces(
    test: BubbleTest, fields: Sequence[DisplacementField], computed: bool
) -> tuple[DisplacementSurface, ...]:
    """Surfaces of every field; where they are only reported, too few points leave them out."""
    # A computed quarter is mirrored: surfaces are fitted to the full disk.
    whole = [mirrored(f) if computed else f for f in fields]
    if test.match_by == "points":
        count = min(len(f.points) for f in whole)
        if count < (test.match_degree + 1) ** 2:
            return ()
    try:
        return tuple(fit_surface(f, test.match_degree) for f in whole)
    except InputError as error:
        problem = f"{error.field}: {error.problem}"
        raise test.place.error("match.degree", problem) from None


def _measured(
    test: BubbleTest, data: PointFiles
) -> tuple[tuple[DisplacementField, ...], Registration | None]:
    try:
        frames = None if data.recorded is None else data.recorded.frames
        fields = read_fields(
            data.files, test.pressures, options=data.options, format=data.format, frames=frames
        )
    except InputError as error:
        if error.path is not None:
            raise
        raise test.place.error(f"data.points.{error.field}", error.problem) from None
    if data.registration is None:
        return fields, None
    try:
        return register_fields(fields, test.outline, data.registration)
    except InputError as error:
        field = f"data.points.registration.{error.field}".rstrip(".")
        raise test.place.error(field, error.problem) from None
