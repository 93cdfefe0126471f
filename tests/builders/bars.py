"""A kind of test for tests: a homogeneous bar whose solver is a closed form with a known error."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from bubblefit.errors import InputError, SolverFailure
from bubblefit.experiments import registry
from bubblefit.experiments.base import BaseKind, BaseTest
from bubblefit.experiments.data_files import Output
from bubblefit.experiments.forward import CardRun, Simulation, Studied
from bubblefit.meshes.mesh import Mesh
from bubblefit.meshes.strip_models import strip_mesh
from bubblefit.project.schema import FitSection, LawSection
from bubblefit.solvers import registry as solvers
from bubblefit.solvers.base import History

LENGTH, WIDTH, STRETCH = 40.0, 20.0, 0.1


@dataclass(frozen=True, eq=False)
class BarModel:
    mesh: Mesh
    thickness: float
    increments: int


@dataclass(frozen=True)
class BarTest(BaseTest):
    name: str
    parts: tuple[str, ...] = ("warp",)
    elements: int = 4
    increments: int = 4
    thickness: float = 0.5
    kind: str = "bars"

    def models(
        self, thickness: float | None = None, refined: str = "elements", factor: float = 1.0
    ) -> Mapping[str, BarModel]:
        elements = round(self.elements * (factor if refined == "elements" else 1))
        if elements < 1:
            raise InputError(None, "elements", "expected 1 or more, got 0")
        steps = round(self.increments * (factor if refined == "increments" else 1))
        mesh = strip_mesh(WIDTH, LENGTH, elements, 2 * elements)
        thick = self.thickness if thickness is None else thickness
        return {part: BarModel(mesh, thick, steps) for part in self.parts}


class BarSolver:
    """End load of the closed form, with an error that is quadratic in the size of a quad.

    `fails`: elements across from which on it gives up. `seen`: models that it ran.
    """

    name, external, identity, progress = "bars", False, "bars 1", None

    def __init__(self, fails: int = 10**9, law_fails: Any = lambda law: False) -> None:
        self.fails, self.law_fails, self.seen = fails, law_fails, []

    def run(self, model: BarModel, law: Any, scratch: Any = None, timeout: Any = None) -> History:
        self.seen.append(model)
        across = len(np.unique(model.mesh.points[:, 0])) - 1
        if across >= self.fails or self.law_fails(law):
            raise SolverFailure("the bar breaks", self.name)
        strain = np.log1p(STRETCH * np.arange(1, model.increments + 1) / model.increments)
        load = float(law.modulus("E1", 0.0)) * strain * np.exp(-law.nu12 * strain)
        load = load * model.thickness * WIDTH * (1 + 0.01 / across**2)
        if self.progress is not None:
            self.progress(SimpleNamespace(time=float(model.increments)))
        return History(
            load, np.zeros((len(load), len(model.mesh.points), 3)), np.zeros(3),
            np.array([strain[-1], 0.0, 0.0]), iterations=len(load),
        )  # fmt: skip


def end_load(model: BarModel, history: History) -> dict[str, float]:
    return {"load at the end, N": float(history.load[-1])}


class BarKind(BaseKind):
    name, title, fitted, predicted = "bars", "bars that are pulled", False, None
    studied = Studied(
        steps=lambda model: range(model.increments), quantities=end_load, responses=end_load,
        response="load",
        curve=lambda model, history: (np.arange(1.0, model.increments + 1), history.load),
    )  # fmt: skip

    @property
    def report(self) -> Any:
        return self

    def simulate(
        self, test: BarTest, cards: Mapping[str, Any], runs: Mapping[tuple[str, str], CardRun],
        out: Output, within_range: bool = False,
    ) -> Simulation:  # fmt: skip
        numbers = {
            card: {part: _said(run) for (name, part), run in runs.items() if name == card}
            for card in cards
        }
        out.folder.mkdir(parents=True, exist_ok=True)
        out.path("bars.txt").write_text("bars")
        return Simulation({"cards": numbers}, [f"{name}: pulled" for name in cards])


def _said(run: CardRun) -> object:
    failed = isinstance(run.outcome, SolverFailure)
    return run.outcome.reason if failed else float(run.outcome.load[-1])


def known_bars(patch: Any, solver: BarSolver) -> BarSolver:
    """Make bars a kind of test, and this solver the one of that name."""
    known, reports = {**registry.kinds(), "bars": BarKind()}, registry.presenter_of
    patch.setattr("bubblefit.project.project.kinds", lambda: known)
    for module in ("runs.simulation", "project.project"):
        patch.setattr(f"bubblefit.{module}.kind_named", known.__getitem__)
    patch.setattr(
        "bubblefit.runs.simulation.presenter_of",
        lambda name: BarKind() if name == "bars" else reports(name),
    )
    patch.setitem(solvers.SOLVERS, "bars", lambda: solver)
    return solver


def project_of(*tests: BarTest, cards: Mapping[str, Any] | None = None) -> Any:
    from bubblefit.project.project import Project
    from bubblefit.project.sections import Written

    return Project(
        path=Path("bars.toml"),
        scales=None,
        fabric=SimpleNamespace(name="", lab="", thickness=0.5, thickness_change="constant"),
        tests={test.name: test for test in tests},
        law=LawSection(form="linear"), fit=FitSection(solver="bars"),
        cards={name: SimpleNamespace(card=card) for name, card in (cards or {}).items()},
        solver_options={},
        written=Written(
            "", {"fabric": {}, "units": {}}, {}, {}, [{"name": name} for name in cards or {}]
        ),
    )  # fmt: skip
