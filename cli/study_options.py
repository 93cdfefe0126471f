"""What the studies of one material card share: their options, project and output folder."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from ..experiments.tables import write_table
from ..materials.card import MaterialCard
from ..projects.bend import BendProject
from ..projects.fit import FitProject
from ..solvers.base import History, Solver
from ..studies.results import UNSTABLE, beyond_card, strains_of
from ..studies.setup import project_solver
from ..writing import replacing
from .options import exits, result_folder, solver_choice, with_solver
from .study_kinds import StudyKind, study_kind


@dataclass(frozen=True, eq=False)
class Study:
    """A project, the card it is run with, and where the results go."""

    kind: StudyKind
    project: FitProject | BendProject
    card: MaterialCard
    card_path: str
    solver: Solver
    folder: Path

    def notes(self, history: History) -> list[str]:
        """What a reader of a run's values should know."""
        unstable = [UNSTABLE] if history.stable is False else []
        return [*history.remarks, *beyond_card(strains_of(history), self.card), *unstable]


def card_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """PROJECT, --card and the options of every study of a card; errors are handled."""
    path = click.Path(path_type=Path)
    decorators: list[Callable[..., Any]] = [
        click.argument("project", type=path),
        click.option(
            "--card", "card_path", required=True,
            help="The material card's file, or the name of a card of a bending project.",
        ),
        click.option("--case", "cases", multiple=True, help="A case of bending; several [all]."),
        click.option("--out", type=path, help="Output folder [out/NAME-STUDY]."),
        click.option("--data", type=path, help="Folder of the measured data."),
        solver_choice,
        click.option("--overwrite", is_flag=True, help="Replace what the output folder holds."),
        click.option("--json", "as_json", is_flag=True, help="Print result.json on stdout."),
    ]  # fmt: skip

    @functools.wraps(command)
    def opened(
        project: Path,
        card_path: str,
        cases: tuple[str, ...],
        out: Path | None,
        data: Path | None,
        solver_given: dict[str, Any],
        overwrite: bool,
        **kwargs: Any,
    ) -> Any:
        def open_study(name: str) -> Study:
            kind = study_kind(project)
            read, card = kind.pick(kind.read(project, data), cases, card_path)
            settings = with_solver(read, solver_given)
            folder = result_folder(project, name, out, overwrite)
            solver = project_solver(settings, kind.solver_key)
            return Study(kind, settings, card, card_path, solver, folder)

        return command(open_study, **kwargs)

    wrapped = exits(opened)
    for decorate in reversed(decorators):
        wrapped = decorate(wrapped)
    return wrapped


def finish(
    study: Study,
    table: str,
    header: Sequence[str],
    rows: Sequence[Sequence[object]],
    draw: Callable[[Path], Any],
    result: Mapping[str, Any],
    lines: Sequence[str],
    as_json: bool,
) -> None:
    """Write table, figure (same name, .png) and result.json, and tell."""
    with replacing(study.folder / f"{table}.csv") as path:
        write_table(path, header, rows)
    draw(study.folder / f"{table}.png")
    text = json.dumps(result, indent=1)
    # Last: where it is, the output is complete.
    with replacing(study.folder / "result.json") as path:
        path.write_text(text + "\n", encoding="utf-8")
    if as_json:
        click.echo(text)
        return
    for words in lines:
        click.echo(words)
    click.echo(f"written to {study.folder}")
