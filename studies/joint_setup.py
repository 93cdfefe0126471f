"""From a joint project to a fit: the bubble first, then the strips."""

from __future__ import annotations

from dataclasses import dataclass, replace

from ..experiments.fields import DisplacementField
from ..identification.problem import FitProblem
from ..projects.joint import JointProject
from .bubble_setup import BubbleSetup, bubble_parameters, bubble_setup
from .setup import law_of, lead
from .uniaxial_setup import UniaxialSetup, lead_in, setup_of, strip_experiments

DIRECTIONS = 3  # blocks of a bubble at each pressure


@dataclass(frozen=True, eq=False)
class JointSetup:
    """A fit ready to run; `problem` of both, test 0 the bubble."""

    problem: FitProblem
    bubble: BubbleSetup
    uniaxial: UniaxialSetup


def joint_setup(
    project: JointProject, fields: tuple[DisplacementField, ...] | None = None
) -> JointSetup:
    """Read or compute the data, unless the bubble's `fields` are given, and set up the fit.

    e is the weighted sum of the mean relative RMS errors of the two data sets: a bubble's 21
    blocks do not outvote the three of the strips.

    Raises
    ------
    InputError : in the project or its data. SolverFailure : the known solution cannot be run.
    """
    count = DIRECTIONS * len(project.bubble.pressures)
    bubble = bubble_setup(project.bubble, fields, project.bubble_weight / count)
    strips = project.uniaxial
    matched = sum(weight for d, weight in strips.weights.items() if d in strips.strips)
    tests = strip_experiments(strips, project.uniaxial_weight / matched)
    experiments = (*bubble.problem.experiments, *tests)
    problem = FitProblem(
        experiments,
        law_of(project),
        replace(bubble_parameters(project.bubble), strip_nu12=project.nu12),
        lead_in=(*lead_in(tests, 1), tuple(range(1, len(experiments)))),
    )
    lead(problem)
    return JointSetup(problem, bubble, setup_of(strips, problem, tests))


def joint_problem(
    project: JointProject, fields: tuple[DisplacementField, ...] | None = None
) -> FitProblem:
    """Only the fit: what each worker process builds for itself, from data that are there."""
    return joint_setup(project, fields).problem
