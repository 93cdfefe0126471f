"""From a uniaxial project to a fit: models, load curves, parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..identification.experiment import Experiment
from ..identification.loads import LoadObjective
from ..identification.problem import FitProblem
from ..models.uniaxial import UniaxialModel, bias_strip, refined_quads, straight_strip
from ..projects.uniaxial import UniaxialProject
from ..projects.uniaxial_data import StripData
from .setup import law_of, lead, parameters_of, project_solvers

Array = NDArray[np.float64]

#: Of the largest load: the least noise to reckon with where no scatter is known. The thesis'
#: load cell is of accuracy class 0.5 %.
LOAD_CELL = 0.005


@dataclass(frozen=True, eq=False)
class UniaxialSetup:
    """A fit ready to run. objectives, models and strips in the order of the tests of the fit."""

    problem: FitProblem
    strips: tuple[StripData, ...]
    objectives: tuple[LoadObjective, ...]
    models: tuple[UniaxialModel, ...]


def strip_models(project: UniaxialProject, refinement: float = 1.0) -> dict[str, UniaxialModel]:
    """The models of a project, by direction.

    refinement : what the thesis' counts of quads across and along are multiplied with.

    Raises
    ------
    InputError : lengths that do not make a strip.
    """
    return {d: _model(project, strip, refinement) for d, strip in project.strips.items()}


def _model(project: UniaxialProject, strip: StripData, refinement: float) -> UniaxialModel:
    lengths = strip.gauge_length, strip.final_length, project.thickness, project.width
    if strip.direction == "bias":
        return bias_strip(
            *lengths,
            project.grip_distance,
            project.bias_angle,
            project.increments,
            **refined_quads("bias", refinement),
        )
    return straight_strip(
        "warp" if strip.direction == "warp" else "fill",
        *lengths,
        project.increments,
        **refined_quads("straight", refinement),
    )


def strip_experiments(
    project: UniaxialProject,
    weight: float = 1.0,
    kept: Mapping[str, NDArray[np.bool_]] | None = None,
) -> tuple[Experiment, ...]:
    """The tests of a project, each with a solver of its own.

    weight : of all of them, beside the project's own. kept : which of the measured points to
    match, by direction; all unless given.
    """
    models, tests = strip_models(project), []
    solvers = project_solvers(project, len(project.strips))
    for solver, (direction, strip) in zip(solvers, project.strips.items(), strict=True):
        own = weight * project.weights[direction]
        if own == 0:
            continue
        model = models[direction]
        if project.match_by == "points":
            elongation, load = strip.points
            if kept is not None:
                elongation, load = elongation[kept[direction]], load[kept[direction]]
        else:
            assert strip.polynomial is not None
            elongation = np.array(model.elongations)
            load = strip.polynomial(elongation)
        largest = float(np.abs(load).max(initial=0.0))
        noise = LOAD_CELL * largest if strip.scatter is None else strip.scatter
        scale = 1.0 if project.objective == "N" else largest
        if not scale > 0:
            raise InputError(project.path, f"uniaxial, {direction}", "the measured load is zero")
        objective = LoadObjective(model.elongations, elongation, load, scale, own, noise)
        tests.append(Experiment(direction, model, solver, objective, False))
    return tuple(tests)


def lead_in(tests: Sequence[Experiment], first: int = 0) -> tuple[tuple[int, ...], ...]:
    """The strips along the yarns, by their numbers from `first`, where there is a bias strip too.

    They are homogeneous and hardly ever fail; a bias strip can at its first increment.
    """
    straight = tuple(first + k for k, e in enumerate(tests) if e.name != "bias")
    return (straight,) if 0 < len(straight) < len(tests) else ()


def uniaxial_setup(project: UniaxialProject) -> UniaxialSetup:
    """Set up the fit.

    Raises
    ------
    InputError : in the project or its data. SolverFailure : no such solver here.
    """
    problem = uniaxial_problem(project)
    return setup_of(project, problem, problem.experiments)


def setup_of(
    project: UniaxialProject, problem: FitProblem, tests: Sequence[Experiment]
) -> UniaxialSetup:
    """The strips among the tests of a problem."""
    return UniaxialSetup(
        problem,
        tuple(project.strips[e.name] for e in tests),
        tuple(e.objective for e in tests),
        tuple(e.model for e in tests),
    )


def uniaxial_problem(
    project: UniaxialProject, kept: Mapping[str, NDArray[np.bool_]] | None = None
) -> FitProblem:
    """Only the fit: what each worker process builds for itself."""
    tests = strip_experiments(project, kept=kept)
    parameters = parameters_of(project, strip_nu12=project.nu12)
    problem = FitProblem(tests, law_of(project), parameters, lead_in=lead_in(tests))
    lead(problem)
    return problem
