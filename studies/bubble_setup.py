"""From a project to a fit: model, targets, parameters."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CloughTocher2DInterpolator

from ..errors import InputError, SolverFailure
from ..experiments.fields import DisplacementField, read_fields
from ..experiments.surfaces import DisplacementSurface, fit_surface
from ..identification.objective import FieldObjective, FieldTarget
from ..identification.parameters import ModuliParameters
from ..identification.problem import FitProblem
from ..materials.law import HypoelasticLaw
from ..meshes.disk import disk_mesh
from ..meshes.location import sampling_matrix
from ..meshes.mesh import Mesh
from ..models.bubble import BubbleModel
from ..projects.bubble import BubbleProject
from ..projects.bubble_data import KnownSolution, PointFiles
from ..solvers.base import Solver
from .setup import law_of, lead, parameters_of, project_solver

Array = NDArray[np.float64]

#: Of the points on the disk, and of its radius covered: less is taken for a wrong unit.
LEAST_SHARE = 0.1


@dataclass(frozen=True, eq=False)
class BubbleSetup:
    """A fit ready to run, and what its report wants to know about the data.

    fields : what was measured (or computed), as read; known : the law behind computed data;
    surfaces : polynomials of them, for the match or the report; dropped : doubtful cells left
    out; outside : points beyond the rim of the model.
    """

    problem: FitProblem
    fields: tuple[DisplacementField, ...]
    known: HypoelasticLaw | None
    surfaces: tuple[DisplacementSurface, ...]
    dropped: int
    outside: int

    @property
    def model(self) -> BubbleModel:
        """The bubble's model."""
        model: BubbleModel = self.problem.experiments[0].model
        return model

    @property
    def objective(self) -> FieldObjective:
        """What the bubble should show."""
        objective: FieldObjective = self.problem.experiments[0].objective
        return objective


def bubble_model(project: BubbleProject) -> BubbleModel:
    """The model of a project."""
    mesh = disk_mesh(project.radius, project.elements, project.symmetry, project.generator)
    return BubbleModel(mesh, project.thickness, project.pressures, project.increments)


def bubble_parameters(project: BubbleProject) -> ModuliParameters:
    """The unknowns of a bubble fit, nuisance parameters included."""
    return parameters_of(
        project,
        displacement_offset=project.displacement_offset,
        pressure_offset=project.pressure_offset,
        least_pressure=min(project.increments),
    )


def bubble_setup(
    project: BubbleProject,
    fields: tuple[DisplacementField, ...] | None = None,
    weight: float = 1.0,
) -> BubbleSetup:
    """Read or compute the data, unless `fields` are given, and set up the fit.

    weight : of every block of the objective.

    Raises
    ------
    InputError : in the project or its data. SolverFailure : the known solution cannot be run.
    """
    solver = project_solver(project)
    model = bubble_model(project)
    law = law_of(project)
    known = None
    if isinstance(project.data, KnownSolution):
        known = law.with_beta(project.data.beta)
        fields = fields or _computed(project, project.data, model, known, solver)
    else:
        fields = fields or _measured(project, project.data)
    folded = tuple(_folded(f) for f in fields) if project.symmetry == "quarter" else fields
    surfaces = _surfaces(project, fields, known is not None)
    if project.match_by == "surfaces":
        nodes = model.mesh.points[:, :2]
        targets = [FieldTarget(s.pressure, s.evaluate(nodes)) for s in surfaces]
        outside = 0
    elif known is not None:
        targets = [FieldTarget(f.pressure, _at_nodes(f, model.mesh)) for f in folded]
        outside = 0
    else:
        targets, outside = _at_points(project, folded, model.mesh)
    try:
        objective = FieldObjective(targets, project.objective, weight)
    except InputError as error:
        raise InputError(project.path, error.field, error.problem) from None
    problem = FitProblem.single(model, solver, law, objective, bubble_parameters(project))
    lead(problem)
    dropped = sum(f.dropped for f in fields)
    return BubbleSetup(problem, fields, known, surfaces, dropped, outside)


def _surfaces(
    project: BubbleProject, fields: tuple[DisplacementField, ...], computed: bool
) -> tuple[DisplacementSurface, ...]:
    """Surfaces of every field; where they are only reported, too few points leave them out."""
    # A computed quarter is mirrored: the thesis' surfaces are those of the full disk.
    whole = [_mirrored(f) if computed else f for f in fields]
    if project.match_by == "points":
        count = min(len(f.points) for f in whole)
        if count < (project.match_degree + 1) ** 2:
            return ()
    try:
        return tuple(fit_surface(f, project.match_degree) for f in whole)
    except InputError as error:
        problem = f"{error.field}: {error.problem}"
        raise InputError(project.path, "match.degree", problem) from None


def bubble_problem(
    project: BubbleProject, fields: tuple[DisplacementField, ...] | None = None
) -> FitProblem:
    """Only the fit: what each worker process builds for itself, from data that are there."""
    return bubble_setup(project, fields).problem


def _computed(
    project: BubbleProject,
    data: KnownSolution,
    model: BubbleModel,
    known: HypoelasticLaw,
    solver: Solver,
) -> tuple[DisplacementField, ...]:
    """Displacements of the known solution by the solver that fits, on the data's own mesh."""
    if data.symmetry == "quarter" and project.symmetry == "full":
        problem = "data of a quarter cannot be matched by a full model; use the same symmetry"
        raise InputError(project.path, "data.known_solution.symmetry", problem)
    same = (data.elements, data.symmetry, data.increments) == (
        project.elements,
        project.symmetry,
        project.increments,
    )
    source = model
    if not same:
        mesh = disk_mesh(project.radius, data.elements, data.symmetry, project.generator)
        source = BubbleModel(mesh, project.thickness, project.pressures, data.increments)
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
        DisplacementField(p, source.mesh.points[:, :2], u, 0)
        for p, u in zip(project.pressures, history.displacement, strict=True)
    )


def _measured(project: BubbleProject, data: PointFiles) -> tuple[DisplacementField, ...]:
    return read_fields(
        data.files,
        project.pressures,
        columns=data.columns,
        flag_column=data.flag_column,
        comment=data.comment,
        length_scale=data.length_scale,
    )


def _folded(field: DisplacementField) -> DisplacementField:
    """A full field folded onto the quarter x, y >= 0."""
    sign = np.where(field.points < 0, -1.0, 1.0)
    moved = field.displacement.copy()
    moved[:, :2] *= sign
    return replace(field, points=np.abs(field.points), displacement=moved)


def _mirrored(field: DisplacementField) -> DisplacementField:
    """A quarter's field mirrored to the full disk: surfaces are fitted to full fields."""
    if (field.points < -1e-9).any():
        return field
    points, moved = [], []
    for sx, sy in ((1, 1), (-1, 1), (-1, -1), (1, -1)):
        points.append(field.points * (sx, sy))
        moved.append(field.displacement * (sx, sy, 1))
    xy, u = np.concatenate(points), np.concatenate(moved)
    _, once = np.unique(np.round(xy, 6), axis=0, return_index=True)
    return replace(field, points=xy[once], displacement=u[once])


def _at_nodes(field: DisplacementField, mesh: Mesh) -> Array:
    """Computed displacements at the model's nodes; exact when the meshes are the same."""
    nodes = mesh.points[:, :2]
    if nodes.shape == field.points.shape and np.allclose(nodes, field.points, atol=1e-9):
        return field.displacement
    # C1 interpolation: the data mesh is curved between its nodes, linear would cut corners.
    mirrored = _mirrored(field)
    between = CloughTocher2DInterpolator(mirrored.points, mirrored.displacement)(nodes)
    # Chords of the data's rim can leave a rim node of ours outside: it does not move anyway.
    outside = ~np.isfinite(between).all(axis=1)
    between[outside] = 0.0
    between[mesh.node_sets["rim"]] = 0.0
    return np.asarray(between)


def _check_scale(
    project: BubbleProject, field: DisplacementField, inside: NDArray[np.bool_]
) -> None:
    """Metres taken for millimetres, or the other way round, show in where the points lie."""
    reach = float(np.abs(field.points).max())
    if inside.mean() < LEAST_SHARE:
        found = f"{int(inside.sum())} of {len(inside)} points lie on the disk of radius"
    elif reach < LEAST_SHARE * project.radius:
        found = f"all points lie within {reach:.3g} mm of the centre of a disk of radius"
    else:
        return
    at = f"data at {field.pressure * 1e3:g} kPa"
    problem = f"{found} {project.radius:g} mm: are the length unit and the columns x and y right?"
    raise InputError(project.path, at, problem)


def _at_points(
    project: BubbleProject, fields: tuple[DisplacementField, ...], mesh: Mesh
) -> tuple[list[FieldTarget], int]:
    targets, outside = [], 0
    for field in fields:
        sample, inside = sampling_matrix(mesh, field.points)
        outside += int((~inside).sum())
        _check_scale(project, field, inside)
        targets.append(FieldTarget(field.pressure, field.displacement[inside], sample))
    return targets, outside
