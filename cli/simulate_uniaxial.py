"""`bubblefit simulate uniaxial`: material cards on the three strips (Figs 5.10 to 5.12)."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, OutputError, SolverFailure
from ..experiments.tables import write_table
from ..materials.card import MaterialCard, read_card
from ..meshes.strain import middle_strain
from ..models.uniaxial import UniaxialModel
from ..projects.uniaxial import UniaxialProject, read_uniaxial
from ..reports import plot_loads
from ..solvers.base import History
from ..studies.results import STRAINS, beyond_card, strains_of
from ..studies.setup import project_solver
from ..studies.uniaxial_figures import draw_bias, load_panels
from ..studies.uniaxial_setup import strip_models
from ..writing import replacing
from .options import default_folder, exits, solver_choice, with_solver
from .progress import run_progress

Array = NDArray[np.float64]


@click.command("uniaxial")
@click.argument("project", type=click.Path(path_type=Path))
@click.option(
    "--card",
    "cards",
    type=click.Path(path_type=Path),
    multiple=True,
    required=True,
    help="A material card; several are drawn in one figure.",
)
@click.option("--out", type=click.Path(path_type=Path), help="Output folder [out/NAME-simulated].")
@click.option("--data", type=click.Path(path_type=Path), help="Folder of the measured data.")
@solver_choice
@click.option(
    "--within-range", is_flag=True, help="End each curve where the card's valid range ends."
)
@click.option("--overwrite", is_flag=True, help="Replace what the output folder holds.")
@click.option("--json", "as_json", is_flag=True, help="Print result.json on stdout.")
@exits
def simulate_uniaxial(
    project: Path,
    cards: tuple[Path, ...],
    out: Path | None,
    data: Path | None,
    solver_given: dict[str, Any],
    within_range: bool,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Pull the strips of PROJECT.toml with the materials of one or several cards.

    Measured curves are drawn beside them where they are there. A card whose analysis fails on a
    strip is left out there, and named; when nothing ends well the exit code is 4.
    """
    settings = with_solver(read_uniaxial(project, data, need_data=False), solver_given)
    named = _named(cards)
    folder = out or default_folder(project).with_name(default_folder(project).name + "-simulated")
    if (folder / "result.json").exists() and not overwrite:
        raise OutputError(f"{folder}: already holds a result; use --overwrite or another --out")
    runs = _run(settings, named, within_range, as_json)
    failures = [run for run in runs.values() if isinstance(run, SolverFailure)]
    if len(failures) == len(runs):
        raise failures[0]
    result = _result(settings, named, runs)
    _write(settings, list(named), runs, folder)
    # Last: where it is, the output is complete.
    with replacing(folder / "result.json") as path:
        path.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    if as_json:
        click.echo(json.dumps(result, indent=1))
        return
    for words in _lines(result):
        click.echo(words)
    click.echo(f"written to {folder}")


@dataclass(frozen=True, eq=False)
class CardRun:
    """One card on one strip: its history, and how many of its increments are shown."""

    history: History
    shown: int
    elongation: Array
    rms: float | None

    @property
    def whole(self) -> bool:
        """Whether nothing is left out."""
        return self.shown == len(self.elongation)


#: By (card, direction).
Runs = dict[tuple[str, str], "CardRun | SolverFailure"]


def _named(cards: Sequence[Path]) -> dict[str, MaterialCard]:
    """Cards by a name each: the card's own, else its file's, told apart where they agree."""
    named: dict[str, MaterialCard] = {}
    for path in cards:
        card = read_card(path)
        name = card.name or path.stem
        if name in named:
            name = f"{name} ({path})"
        if name in named:
            raise InputError(path, "--card", "is given twice")
        named[name] = card
    return named


def _run(
    project: UniaxialProject, cards: dict[str, MaterialCard], within_range: bool, quiet: bool
) -> Runs:
    runs: Runs = {}
    for direction, model in strip_models(project).items():
        solver, strip = project_solver(project), project.strips[direction]
        u = np.array(model.elongations)
        for name, card in cards.items():
            own = replace(model, thickness=card.thickness)
            try:
                with run_progress(solver, len(u), quiet):
                    history = solver.run(own, card.law)
            except SolverFailure as failure:
                runs[name, direction] = failure
                continue
            shown = _within(model, card, history) if within_range else len(u)
            rms = None
            if strip.polynomial is not None and shown:
                error = history.load[:shown] - strip.polynomial(u[:shown])
                rms = float(np.sqrt(np.mean(error**2)))
            runs[name, direction] = CardRun(history, shown, u, rms)
    return runs


def _within(model: UniaxialModel, card: MaterialCard, history: History) -> int:
    """Increments before a strain in the middle of a quad leaves the card's valid range."""
    for i, u in enumerate(history.displacement):
        strain = middle_strain(model.mesh, u, model.warp)
        reached = np.array([*strain[:, :2].max(axis=0), np.abs(strain[:, 2]).max()])
        if (reached > card.law.strain_range * (1 + 1e-6)).any():
            return i
    return len(history.load)


def _result(project: UniaxialProject, cards: dict[str, MaterialCard], runs: Runs) -> dict[str, Any]:
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


def _write(project: UniaxialProject, cards: Sequence[str], runs: Runs, folder: Path) -> None:
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
            model = strip_models(project)["bias"]
            draw_bias(model, ended[name, "bias"].history, folder, "bias" + suffix)


def _lines(result: dict[str, Any]) -> list[str]:
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
