"""What a study can run: for each kind of project its models, refinements and quantities.

Another kind of problem is another entry of `KINDS`.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ..errors import InputError
from ..materials.card import MaterialCard, read_card
from ..models.bubble import BubbleModel
from ..projects.bend import BendProject, read_bend
from ..projects.bubble import BubbleProject, read_project
from ..projects.fit import FitProject
from ..projects.uniaxial import UniaxialProject, read_uniaxial
from ..solvers.base import History
from ..studies.bend_convergence import deflection_curve, loads, quantities, refined_cylinder
from ..studies.bend_setup import KEY, chosen
from ..studies.bubble_setup import bubble_model
from ..studies.poisson import PUBLISHED_SPREAD
from ..studies.refinement import Curve, Level, edge_length
from ..studies.uniaxial_setup import strip_models

What = Literal["elements", "increments"]
Values = Mapping[str, float]


def _no_cases(project: FitProject, cases: Sequence[str], card: str) -> tuple[Any, MaterialCard]:
    if cases:
        raise InputError(project.path, "--case", "only a project of bending has cases")
    return project, read_card(Path(card))


@dataclass(frozen=True)
class StudyKind:
    """How a kind of project is studied.

    read : the project, with the folder of its data, which need not be there; solver_key : where
    its file names the solver. pick : the project with the chosen cases only, and a card by its
    file, or by its name where the project has cards. models : by name, with elements (edges) or
    increments divided by a factor, and the card's thickness; steps : the load levels of a model.
    quantities : of interest in a mesh study; curve : along which levels are compared, (x, y).
    responses : of a study of nu12; response : what they are; published : within which part of the
    base they stayed in the thesis, where it says.
    """

    read: Callable[[Path, Path | None], Any]
    models: Callable[[Any, What, float, float], Mapping[str, Any]]
    steps: Callable[[Any], Any]
    quantities: Callable[[Any, History], Values]
    responses: Callable[[Any, History], Values]
    response: str
    published: float | None = None
    curve: Callable[[Any, History], Curve] | None = None
    pick: Callable[[Any, Sequence[str], str], tuple[Any, MaterialCard]] = _no_cases
    solver_key: str = "fit.solver"


def study_kind(path: Path) -> StudyKind:
    """The kind of the project in a file; what is wrong with the file is left to its reader.

    Raises
    ------
    InputError : a kind that no study runs.
    """
    try:
        section = tomllib.loads(path.read_text(encoding="utf-8")).get("project")
    except (OSError, ValueError, RecursionError):
        section = None
    kind = section.get("kind") if isinstance(section, dict) else None
    if not isinstance(kind, str) or kind in KINDS:
        return KINDS.get(str(kind), KINDS["bubble"])
    known = " or ".join(repr(k) for k in KINDS)
    raise InputError(path, "project.kind", f"a study runs {known}, got {kind!r}")


def levels(
    kind: StudyKind, project: Any, what: What, factor: float, thickness: float
) -> dict[str, Level]:
    """One refinement of every model of a project, with the thickness (mm) of a card.

    Raises
    ------
    InputError : a mesh or increments that cannot be had.
    """
    try:
        models = kind.models(project, what, factor, thickness)
    except InputError as error:
        if error.path is not None:
            raise
        field = f"refinement by {factor:g} (--levels, --coarser, --factor), {error.field}"
        raise InputError(project.path, field, error.problem) from None
    found = {}
    for name, model in models.items():
        steps = len(kind.steps(model))
        size = edge_length(model.mesh) if what == "elements" else 1.0 / steps
        found[name] = Level(factor, model, steps, size)
    return found


def _bubble_models(
    project: BubbleProject, what: What, factor: float, thickness: float
) -> dict[str, Any]:
    project = replace(project, thickness=thickness)
    if what == "elements":
        return {"bubble": _refined_bubble(project, factor)}
    if factor != int(factor):
        problem = "the bubble's steps are divided, never joined: use --coarser 0"
        raise InputError(None, "increments", problem)
    ends = np.array([0.0, *project.increments])
    parts = [np.linspace(a, b, int(factor) + 1)[1:] for a, b in pairwise(ends)]
    steps = tuple(float(p) for part in parts for p in part)
    return {"bubble": bubble_model(replace(project, increments=steps))}


def _refined_bubble(project: BubbleProject, factor: float) -> BubbleModel:
    """From the count that the project's mesh has, not the one asked for: so that finer meshes
    divide its quads, as far as there is such a mesh."""
    own = bubble_model(project)
    if factor == 1:
        return own
    whole = len(own.mesh.quads) * (4 if project.symmetry == "quarter" else 1)
    return bubble_model(replace(project, elements=round(whole * factor**2)))


def _bubble_quantities(model: Any, history: History) -> dict[str, float]:
    apex = int(model.mesh.node_sets["apex"][0])
    heights = zip(1e3 * history.load, history.displacement[:, apex, 2], strict=True)
    in_plane = np.linalg.norm(history.displacement[-1, :, :2], axis=1).max()
    last = f"largest in-plane displacement at {1e3 * history.load[-1]:.4g} kPa, mm"
    return {**{f"apex at {p:.4g} kPa, mm": float(z) for p, z in heights}, last: float(in_plane)}


def _bubble_responses(model: Any, history: History) -> dict[str, float]:
    largest = np.linalg.norm(history.displacement, axis=2).max(axis=1)
    return {f"{p:.4g} kPa": float(u) for p, u in zip(1e3 * history.load, largest, strict=True)}


def _strip_models(
    project: UniaxialProject, what: What, factor: float, thickness: float
) -> Mapping[str, Any]:
    project = replace(project, thickness=thickness)
    if what == "elements":
        return strip_models(project, refinement=factor)
    return strip_models(replace(project, increments=max(1, round(project.increments * factor))))


def _end_load(model: Any, history: History) -> dict[str, float]:
    return {"load at the end, N": float(history.load[-1])}


def _load_curve(model: Any, history: History) -> Curve:
    return np.array(model.elongations), history.load


def _cylinders(project: BendProject, what: What, factor: float, thickness: float) -> dict[str, Any]:
    return {case.name: refined_cylinder(case, thickness, what, factor) for case in project.cases}


def _case_and_card(
    project: BendProject, cases: Sequence[str], card: str
) -> tuple[BendProject, MaterialCard]:
    picked = chosen(project, cases, [card])
    (found,) = picked.cards.values()
    return picked, found.card


KINDS: dict[str, StudyKind] = {
    "bubble": StudyKind(
        read=lambda path, data: read_project(path, data, need_data=False),
        models=_bubble_models,
        steps=lambda model: model.increments,
        quantities=_bubble_quantities,
        responses=_bubble_responses,
        response="largest displacement",
        published=PUBLISHED_SPREAD,
    ),
    "uniaxial": StudyKind(
        read=lambda path, data: read_uniaxial(path, data, need_data=False),
        models=_strip_models,
        steps=lambda model: model.elongations,
        quantities=_end_load,
        responses=_end_load,
        response="load",
        curve=_load_curve,
    ),
    "bend": StudyKind(
        read=lambda path, data: read_bend(path, data, need_data=False),
        models=_cylinders,
        steps=lambda model: (*model.inflation, *model.increments),
        quantities=quantities,
        responses=loads,
        response="load",
        curve=deflection_curve,
        pick=_case_and_card,
        solver_key=KEY,
    ),
}
