"""The example with a known solution, as the benchmarks take it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from bubblefit.experiments.bubble.test import BubbleTest, KnownSolution
from bubblefit.materials.law import HypoelasticLaw
from bubblefit.meshes.bubble_model import BubbleModel
from bubblefit.project.project import Project, read_project
from bubblefit.runs.setup import FitSetup, prepare_fit
from bubblefit.runs.starts import EvaluationRecord

EXAMPLE = Path(__file__).resolve().parent.parent / "examples" / "bubble-known-solution"


def known_project(elements: int | None = None, **fit: Any) -> Project:
    """The example's project; of another mesh, data and fit alike, and with other settings."""
    project = read_project(EXAMPLE / "project.toml").with_fit(**fit)
    if elements is None:
        return project
    (test,) = project.tests.values()
    assert isinstance(test, BubbleTest) and isinstance(test.data, KnownSolution)
    data = replace(test.data, elements=elements)
    changed: Mapping[str, Any] = {test.name: replace(test, elements=elements, data=data)}
    return replace(project, tests=changed)


def known_setup(project: Project) -> FitSetup:
    """The fit, its data computed."""
    return prepare_fit(project, project.chosen(None, fitted=True))  # type: ignore[arg-type]


def known_model_and_law() -> tuple[BubbleModel, HypoelasticLaw]:
    """The example's model and the law behind its data."""
    (prepared,) = known_setup(known_project()).tests
    assert prepared.known is not None
    return prepared.test.models()["bubble"], prepared.known


def objectives_of(solver: str, heard: list[float]) -> Callable[[EvaluationRecord], None]:
    """What a fit may tell of its evaluations; e of each run of the solver ends up in `heard`."""

    def hear(record: EvaluationRecord) -> None:
        if record.solver == solver:
            heard.append(np.inf if record.objective is None else record.objective)

    return hear
