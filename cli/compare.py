"""`bubblefit compare PROJECT.toml`: which form of the moduli do the strip tests support?"""

from __future__ import annotations

import functools
import json
from pathlib import Path
from typing import Any

import click
import numpy as np

from ..errors import InputError, OutputError
from ..identification.validation import FoldError, folds_of, validate
from ..projects.schema import FORMS
from ..projects.uniaxial import UniaxialProject, read_uniaxial
from ..runs.folder import RESULT
from ..studies.compare_results import FormResult, comparison, comparison_lines, write_comparison
from ..studies.fingerprint import fingerprint
from ..studies.results import best_fit, save_card
from ..studies.uniaxial_results import strip_results
from ..studies.uniaxial_setup import uniaxial_problem, uniaxial_setup
from ..writing import replacing
from .fitting import fit_options, run_study, study_options, with_options
from .options import default_folder

VALIDATION = "validation.json"
FEW_STARTS = 5


@click.command("compare")
@click.option(
    "--form",
    "forms",
    type=click.Choice(list(FORMS)),
    multiple=True,
    help="Form of the moduli; several [all].",
)
@click.option(
    "--folds", type=click.IntRange(min=2), default=5, show_default=True, help="Of the validation."
)
@study_options
def command(forms: tuple[str, ...], folds: int, **options: Any) -> None:
    """Fit every form of the moduli to the points of PROJECT.toml and cross-validate it.

    Constant, linear, quadratic, cubic and tri-linear moduli, each from a few starts [5]; the
    error at specimens (where they are known) or points that the fit was not given says whether
    more coefficients are worth it. Writes comparison.csv, laws.png, loads.png, report.html and
    result.json, and a folder for each form, into the output folder.
    """
    folder = options["out"] or default_folder(options["project"]).with_name(
        default_folder(options["project"]).name + "-compared"
    )
    if (folder / RESULT).exists() and not (options["overwrite"] or options["resume"]):
        raise OutputError(
            f"{folder}: already holds a result; use --overwrite, --resume or another --out"
        )
    options = {**options, "starts": options["starts"] or FEW_STARTS}
    chosen = list(dict.fromkeys(forms)) or list(FORMS)
    # All of them first: a mistake in the project shows before the first fit.
    projects = {form: _project(form, options) for form in chosen}
    found = []
    for form, project in projects.items():
        if not (options["quiet"] or options["as_json"]):
            click.echo(f"{form} moduli", err=True)
        found.append(_form(form, project, folds, {**options, "out": folder / form}))
    result = comparison(projects, found)
    write_comparison(projects, found, result, folder)
    # Last: where it is, the output is complete.
    with replacing(folder / RESULT) as path:
        path.write_text(json.dumps(result, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    lines = [*comparison_lines(result), f"written to {folder} (open report.html)"]
    click.echo(json.dumps(result, indent=1) if options["as_json"] else "\n".join(lines))


def _project(form: str, options: dict[str, Any]) -> UniaxialProject:
    project = read_uniaxial(options["project"], options["data"], moduli=form, match="points")
    if project.largest is None:
        problem = "comparing forms needs bounds on the moduli themselves: E1, E2, G12"
        raise InputError(project.path, "bounds", problem)
    return with_options(project, options)


def _form(form: str, project: UniaxialProject, folds: int, options: dict[str, Any]) -> FormResult:
    """One form: its starts, its best fit, and its error in every fold."""
    setup = uniaxial_setup(project)
    build = functools.partial(uniaxial_problem, project)
    mark = fingerprint(project, setup.problem)
    folder, records = run_study(project, setup.problem, build, mark, options)
    fit = best_fit(setup.problem, records)
    result = strip_results(project, setup, fit.best.histories)
    save_card(project, fit, folder, "compare", f"e_uniaxial {result['e_uniaxial_N']:.4g} N")
    kept = folder.path / VALIDATION
    known = _read(kept, f"{mark} {folds}") if options["resume"] else None
    errors = known if known is not None else _validated(project, fit.best.unknowns, folds)
    text = {
        "fingerprint": f"{mark} {folds}",
        "folds": [None if e.rms is None else dict(e.rms) for e in errors],
    }
    folder.write(VALIDATION, json.dumps(text, indent=1) + "\n")
    return FormResult(form, setup, fit, result, errors)


def _validated(project: UniaxialProject, start: np.ndarray, folds: int) -> list[FoldError]:
    whose = {d: s.specimen_of.tolist() for d, s in project.strips.items() if project.weights[d]}
    specimens = [len(set(w)) for w in whose.values() if len(set(w)) > 1]
    parts = folds_of(whose, min([folds, *specimens]), project.seed)
    return validate(
        functools.partial(uniaxial_problem, project), start, parts, fit_options(project)
    )


def _read(path: Path, fingerprint: str) -> list[FoldError] | None:
    """What an interrupted run has validated already; None when it is not of this study."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if content["fingerprint"] != fingerprint:
            return None
        return [FoldError(i, rms) for i, rms in enumerate(content["folds"])]
    except (OSError, ValueError, KeyError, TypeError):
        return None
