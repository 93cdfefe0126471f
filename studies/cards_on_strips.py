"""Material cards on the strips of a project, side by side (Figs 5.10 to 5.12)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import SolverFailure
from ..experiments.tables import write_table
from ..materials.card import MaterialCard
from ..meshes.strain import middle_strain
from ..models.uniaxial import UniaxialModel
from ..projects.uniaxial import UniaxialProject
from ..reports import plot_loads
from ..solvers.base import History, Solver
from ..writing import replacing
from .results import STRAINS, beyond_card, strains_of
from .setup import project_solver
from .uniaxial_figures import draw_bias, load_panels
from .uniaxial_setup import strip_models

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class CardRun:
    """One card on one strip: its history, and how many of its increments are shown."""

    model: UniaxialModel
    history: History
    shown: int
    rms: float | None

    @property
    def elongation(self) -> Array:
        """mm of the gauge, at every increment."""
        return np.array(self.model.elongations)

    @property
    def whole(self) -> bool:
        """Whether nothing is left out."""
        return self.shown == len(self.model.elongations)


#: By (card, direction).
Runs = dict[tuple[str, str], "CardRun | SolverFailure"]


def run_cards(
    project: UniaxialProject,
    cards: dict[str, MaterialCard],
    within_range: bool,
    progress: Callable[[Solver, int], AbstractContextManager[None]],
) -> Runs:
    """Every card on every strip; a failed analysis is kept as its failure.

    within_range : show each curve only to where the card's valid range ends. progress : around
    each analysis, given the solver and the number of increments.
    """
    runs: Runs = {}
    solver = project_solver(project)
    for direction, model in strip_models(project).items():
        strip = project.strips[direction]
        u = np.array(model.elongations)
        for name, card in cards.items():
            own = replace(model, thickness=card.thickness)
            try:
                with progress(solver, len(u)):
                    history = solver.run(own, card.law)
            except SolverFailure as failure:
                runs[name, direction] = failure
                continue
            shown = _within(model, card, history) if within_range else len(u)
            rms = None
            if strip.polynomial is not None and shown:
                error = history.load[:shown] - strip.polynomial(u[:shown])
                rms = float(np.sqrt(np.mean(error**2)))
            runs[name, direction] = CardRun(own, history, shown, rms)
    return runs


def _within(model: UniaxialModel, card: MaterialCard, history: History) -> int:
    """Increments before a strain in the middle of a quad leaves the card's valid range."""
    for i, u in enumerate(history.displacement):
        strain = middle_strain(model.mesh, u, model.warp)
        reached = np.array([*strain[:, :2].max(axis=0), np.abs(strain[:, 2]).max()])
        if (reached > card.law.strain_range * (1 + 1e-6)).any():
            return i
    return len(history.load)


def cards_result(
    project: UniaxialProject, cards: dict[str, MaterialCard], runs: Runs
) -> dict[str, Any]:
    """result.json: RMS errors, end loads and strains, card by card and strip by strip."""
    found = []
    for name, card in cards.items():
        tests: dict[str, Any] = {}
        total: float | None = 0.0
        for direction in project.strips:
            run = runs[name, direction]
            if isinstance(run, SolverFailure):
                tests[direction], total = {"failed": run.reason}, None
                continue
            reached = strains_of(run.history)
            tests[direction] = {
                "rms_N": run.rms,
                "end_load_N": float(run.history.load[-1]),
                "shown_to_mm": float(run.elongation[run.shown - 1]) if run.shown else 0.0,
                "strain_reached": dict(zip(STRAINS, reached.tolist(), strict=True)),
                "warnings": [*run.history.remarks, *beyond_card(reached, card)],
            }
            # A sum of errors over parts of the curves could be compared with nothing.
            known = run.whole and run.rms is not None and total is not None
            total = total + run.rms if known else None  # type: ignore[operator]
        found.append({"card": name, "e_uniaxial_N": total, "tests": tests})
    return {"command": "simulate uniaxial", "solver": project.solver, "cards": found}


def write_cards(project: UniaxialProject, cards: Sequence[str], runs: Runs, folder: Path) -> None:
    """loads.csv, loads.png and the deformed bias strips."""
    ended = {key: run for key, run in runs.items() if isinstance(run, CardRun)}
    rows: list[list[object]] = [
        [name, direction, float(u), float(load)]
        for (name, direction), run in ended.items()
        for u, load in zip(run.elongation, run.history.load, strict=True)
    ]
    with replacing(folder / "loads.csv") as path:
        write_table(path, ["card", "direction", "elongation_mm", "load_N"], rows)
    drawn: dict[str, list[tuple[str, Array, Array]]] = {d: [] for d in project.strips}
    rms: dict[str, list[float]] = {d: [] for d in project.strips}
    for (name, direction), run in ended.items():
        if run.shown:
            part = slice(run.shown)
            drawn[direction].append((name, run.elongation[part], run.history.load[part]))
            rms[direction] += [] if run.rms is None else [run.rms]
    plot_loads(folder / "loads.png", load_panels(list(project.strips.values()), drawn, rms))
    for number, name in enumerate(cards, start=1):
        if (name, "bias") in ended:
            suffix = "" if len(cards) == 1 else f"-{number}"
            run = ended[name, "bias"]
            draw_bias(run.model, run.history, folder, "bias" + suffix)


def cards_lines(result: dict[str, Any]) -> list[str]:
    """The same for the terminal."""
    lines = []
    for card in result["cards"]:
        parts = []
        for direction, test in card["tests"].items():
            if "failed" in test:
                parts.append(f"{direction} failed")
            elif test["rms_N"] is None:
                parts.append(f"{direction} {test['end_load_N']:.4g} N at the end")
            else:
                parts.append(f"{direction} {test['rms_N']:.4g} N to {test['shown_to_mm']:.3g} mm")
        total = card["e_uniaxial_N"]
        words = "" if total is None else f"; e_uniaxial {total:.4g} N"
        lines.append(f"{card['card']}: RMS {', '.join(parts)}{words}")
        for direction, test in card["tests"].items():
            notes = [test["failed"]] if "failed" in test else test["warnings"]
            lines += [f"note: {card['card']}, {direction}: {w}" for w in notes]
    return lines
