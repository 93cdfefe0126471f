"""What the commands that fit share: options, progress, words for the terminal, the exit code."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import InputError
from .arguments import (
    AS_JSON,
    DATA,
    JOBS,
    OVERWRITE,
    PROJECT,
    QUIET,
    TESTS,
    TRUST,
    Decorator,
    out_option,
    solver_choice,
    with_checks,
)
from .exits import WORSE, resumable
from .options import command_line, data_folders, read_with_solver
from .progress import StudyProgress

if TYPE_CHECKING:
    from ..fits.result import Fit


def fit_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """PROJECT and the options of every fit; the command gets them by name, errors are handled."""
    decorators: list[Decorator] = [
        PROJECT,
        TESTS,
        out_option(),
        DATA,
        click.option("--starts", type=click.IntRange(min=1), help="Random feasible starts."),
        click.option("--seed", type=click.IntRange(min=0), help="Seed of the starts."),
        JOBS,
        click.option("--method", metavar="NAME", help="Optimiser: lm, slsqp or cobyla."),
        solver_choice,
        click.option("--fail-above", type=float, metavar="E", help="Exit 1 when e is above E."),
        TRUST,
        click.option("--resume", is_flag=True, help="Go on with an interrupted fit."),
        OVERWRITE,
        AS_JSON,
        QUIET,
    ]
    return with_checks(command, decorators)


def run_fit(options: dict[str, Any], kind: str | None = None) -> None:
    """Read the project, fit the chosen tests (of a kind), write the folder, tell; exits as asked.

    Raises
    ------
    InputError, OutputError, NoFeasibleStart, SolverFailure : as `bubblefit.fit`.
    KeyboardInterrupt : after saying how to go on.
    """
    from ..fits.fit import fit
    from ..fits.store import usual_folder

    path: Path = options["project"]
    project = read_with_solver(path, options["solver_given"], data_folders(options["data"]))
    folder: Path = options["out"] or usual_folder(path)
    quiet = options["quiet"] or options["as_json"]
    starts = options["starts"] or project.fit.starts
    with resumable(folder), StudyProgress(starts, quiet) as progress:
        result = fit(
            project,
            _tests(options["tests"], kind, project.tests, path),
            starts=options["starts"],
            seed=options["seed"],
            method=options["method"],
            jobs=options["jobs"],
            trust=options["trust"],
            out=folder,
            resume=options["resume"],
            overwrite=options["overwrite"],
            progress=progress.saw,
            command_line=command_line(),
        )
    result.report(folder)
    tell(result, folder, options["fail_above"], options["as_json"])


def _tests(
    names: Sequence[str], kind: str | None, tests: Any, path: Path
) -> Sequence[str] | str | None:
    """The tests that a command fits: those named, else those of its kind, else all."""
    for name in names:
        if kind is not None and name in tests and tests[name].kind != kind:
            problem = f"{name!r} is no test of this command's kind; use `bubblefit fit`"
            raise InputError(path, "--test", problem)
    return names or kind


def tell(fit: Fit, folder: Path, fail_above: float | None, as_json: bool) -> None:
    """Print the outcome; exit 1 when the best fit is worse than asked for."""
    words = json.dumps(fit.result, indent=1) if as_json else "\n".join(lines_of(fit, folder))
    click.echo(words)
    if fail_above is not None and fit.objective > fail_above:
        said = f"e = {fit.objective:.4g} is above --fail-above {fail_above:g}"
        click.echo(f"bubblefit: {said}", err=True)
        sys.exit(WORSE)


def band_lines(fit: Fit) -> list[str]:
    """How far a modulus may be off, where that is most; nothing where it is not known."""
    from ..fits.page import sigma_words
    from ..identification.bands import LEVEL
    from ..reports import percent

    sure = fit.best.certainty
    if sure is None or not sure.band:
        return []
    parts = []
    for name, (lower, upper) in sure.band.items():
        own = fit.law.modulus(name, sure.strain[name])
        below, above = float((1 - lower / own).max()), float((upper / own - 1).max())
        parts.append(f"{name} -{sigma_words(below)} to +{sigma_words(above)}")
    return [f"{percent(LEVEL)} bands (noise and mesh), where they are widest: {', '.join(parts)}"]


def lines_of(fit: Fit, folder: Path) -> list[str]:
    """How good the fit is, what its tests say, what to know, where it is."""
    import numpy as np

    from ..fits.page import sigma_words
    from ..notes import lines as note_lines

    result, best = fit.result, fit.best
    runs, cached = result["external_runs"], result["cached_runs"]
    kept = f", {cached} from the cache" if cached else ""
    external = f" ({runs} of {result['solver']}{kept})" if runs or cached else ""
    middle = float(np.median([r.objective for r in best.ranked if r.objective is not None]))
    lines = [
        f"best {result['objective_is']}: {fit.objective:.3g} (median {middle:.3g} of "
        f"{len(best.ranked)} starts, {len(best.records)} asked), {result['analyses']} "
        f"analyses{external}, {result['wall_s']:.0f} s"
    ]
    if fit.stages:
        lines.append(f"coarse to fine: {fit.stages}")
    several = len(fit.findings) > 1
    for name, findings in fit.findings.items():
        lines += [f"{name}: {line}" if several else line for line in findings.lines]
    left = "; ".join(
        f"{name} {m.rms:.3g} {m.unit} (noise {m.noise:.3g} {m.unit}, {m.noise_is})"
        for name, m in fit.misfits.items()
    )
    lines.append(f"RMS residual beside the noise: {left}")
    lines += band_lines(fit)
    lines += [
        f"{verdict.name}: {verdict.words}"
        for verdict in fit.verdicts
        if verdict.shared or verdict.prior is None
    ]
    for source, sigmas in result.get("pinned", {}).items():
        parts = ", ".join(
            f"{name} {sigma_words(s['median'])} (at worst {sigma_words(s['largest'])})"
            for name, s in sigmas.items()
        )
        lines.append(f"1 sigma from {source}: {parts}")
    return [*lines, *note_lines(fit.notes), f"written to {folder} (open report.html)"]
