"""`bubblefit validate PROJECT.toml`: does a fit foretell the test that it was not given?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import InputError
from .ending import tell, written_to
from .examples import examples
from .exits import resumable
from .fitting import fit_options, settings_given
from .options import command_line, data_folders, folder_beside, read_with_solver, result_folder
from .progress import FitsProgress

if TYPE_CHECKING:
    from ..project.project import Project


@click.command(
    "validate",
    epilog=examples(
        "bubblefit validate project.toml --form cubic --form spline:6",
        "bubblefit validate project.toml --leave frames",
        "bubblefit validate project.toml --weights strips",
        "bubblefit validate project.toml --card out/project/material.toml",
    ),
)
@click.option(
    "--form",
    "forms",
    multiple=True,
    metavar="NAME",
    help="Of the moduli; several.  [the project's]",
)
@click.option(
    "--card", "cards", multiple=True, metavar="CARD", help="Judge it instead of a fit; several."
)
@click.option(
    "--leave",
    metavar="SORT",
    help="Left out in turn: tests, frames, specimens, directions or ratios.  [tests]",
)
@click.option(
    "--weights",
    metavar="KIND",
    help="Instead: moduli and errors over the weight of a kind of test (strips), or of one test.",
)
@fit_options
def command(
    forms: tuple[str, ...],
    cards: tuple[str, ...],
    leave: str | None,
    weights: str | None,
    **options: Any,
) -> None:
    """Leave each test of PROJECT.toml out of the fit in turn, and judge the fit there.

    With --leave single frames of bubbles, specimens or directions of strips, or ratios of biaxial
    tests instead; with --card cards at the tests, without a fit. Writes validation.csv and
    result.json, and a folder for each fit, into the output folder. With --weights moduli and errors
    over the weight of a kind of test: weights.csv, weights.png, result.json.
    """
    from ..notes import lines as note_lines
    from ..project.project import chosen_cards
    from ..runs.validation import STARTS, TESTS, judge_cards, validate

    path: Path = options["project"]
    _one_of(path, {"--card": cards, "--leave": leave, "--weights": weights})
    if weights is not None:
        _weights(weights, forms, options)
        return
    folder: Path = options["out"] or folder_beside(path, "validated")
    project = _project(options)
    tests, starts = options["tests"] or None, options["starts"] or STARTS
    quiet = options["quiet"] or options["as_json"]
    if cards:
        folder = result_folder(path, "validated", options["out"], options["overwrite"])
        validation = judge_cards(project, chosen_cards(project, cards), tests)
    else:
        with resumable(folder), FitsProgress(starts, quiet) as progress:
            validation = validate(
                project, tests, forms, leave=leave or TESTS, starts=starts, out=folder,
                resume=options["resume"], overwrite=options["overwrite"], progress=progress.saw,
                command_line=command_line(),
            )  # fmt: skip
    validation.write(folder)
    lines = [*validation.lines(), *note_lines(validation.notes), written_to(folder)]
    tell(validation.result, lines, options["as_json"])


def _project(options: Mapping[str, Any]) -> Project:
    data = data_folders(options["data"])
    project = read_with_solver(options["project"], options["solver_given"], data)
    trusted = [*project.fit.trust, *options["trust"]]
    return settings_given(project, options).with_fit(trust=trusted)


def _one_of(path: Path, given: Mapping[str, object]) -> None:
    """Complain where two of the options are given that exclude each other."""
    several = [name for name, value in given.items() if value]
    if len(several) > 1:
        raise InputError(path, ", ".join(several), "give one of them")


def _weights(counted: str, forms: Sequence[str], options: Mapping[str, Any]) -> None:
    """The study of the weight of a kind of test."""
    from ..notes import lines as note_lines
    from ..runs.weights import STARTS, weight_study

    path = options["project"]
    _one_of(path, {"--form": forms, "--weights": counted})
    folder: Path = options["out"] or folder_beside(path, "weights")
    starts = options["starts"] or STARTS
    quiet = options["quiet"] or options["as_json"]
    with resumable(folder), FitsProgress(starts, quiet) as progress:
        study = weight_study(
            _project(options), counted, options["tests"] or None, starts=starts, out=folder,
            resume=options["resume"], overwrite=options["overwrite"], progress=progress.saw,
            command_line=command_line(),
        )  # fmt: skip
    study.write(folder)
    lines = [*study.lines(), *note_lines(study.notes), written_to(folder)]
    tell(study.result, lines, options["as_json"])
