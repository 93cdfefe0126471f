"""Commands that fit or estimate moduli: `bubblefit fit`, `bubble`, `uniaxial` and `estimate`."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from ..errors import InputError
from ..experiments.data_files import READING
from ..inference.methods import method_names
from ..notes import NOTES, Note, gravest_notes, note_lines
from . import options as common
from .solver_options import solver_choice
from .terminal import WORSE, command, resumable, show, verbose, written_to

if TYPE_CHECKING:
    from ..project.project import Project
    from ..runs.estimate import Estimate
    from ..runs.result import Fit

#: Directions of the moduli in the table that is printed.
DIRECTION_WORDS = {"E1": "along warp", "E2": "along fill", "G12": "in shear"}


#: PROJECT and the options of every fit; the command receives them by name.
fit_options = common.with_checks(
    common.PROJECT,
    common.TESTS,
    common.out_option(),
    common.DATA,
    click.option("--starts", type=click.IntRange(min=1), help="Random feasible starts."),
    click.option("--seed", type=click.IntRange(min=0), help="Seed of the starts."),
    click.option(
        "--starts-from",
        type=click.Choice(["random", "sobol", "estimate"]),
        help="Where starts begin: drawn, spread evenly, or one at the estimate.",
    ),
    common.JOBS,
    common.SCHEDULER,
    click.option("--method", metavar="NAME", help=f"Optimiser: {', '.join(method_names())}."),
    solver_choice,
    common.fail_above_option("Exit 1 when more than E is left of the objective."),
    common.TRUST,
    common.resume_option("Continue an interrupted fit."),
    common.OVERWRITE,
    common.AS_JSON,
    common.QUIET,
)


@command(
    "fit",
    "bubblefit fit project.toml",
    "bubblefit fit project.toml --test bubble --test strips --out out/both",
    "bubblefit fit project.toml --solver calculix --starts 1 --verbose",
)
@fit_options
def fit_command(**options: Any) -> None:
    """Fit the moduli of PROJECT.toml to all its tests together, or to those named.

    Writes result.json, material.toml, moduli.csv, residuals.csv, history.csv, figures, report.html
    and the files of each test into the output folder, and lists what each test determines.
    """
    run_fit(options)


@command(
    "bubble",
    "bubblefit bubble project.toml",
    "bubblefit bubble project.toml --starts 4 --jobs 2",
    "bubblefit bubble project.toml --data measured --resume",
)
@fit_options
def bubble_command(**options: Any) -> None:
    """Fit the moduli of PROJECT.toml to its bubble inflation tests only.

    Writes what `bubblefit fit` writes, with surfaces.csv, cuts, heights and bubble.pvd.
    """
    run_fit(options, "bubble")


@command(
    "uniaxial",
    "bubblefit uniaxial project.toml --starts 2",
    "bubblefit uniaxial project.toml --test warp-and-fill --fail-above 0.05",
)
@fit_options
def uniaxial_command(**options: Any) -> None:
    """Fit the moduli of PROJECT.toml to its strip tests only.

    Writes what `bubblefit fit` writes, with the load curves and the deformed bias strip.
    """
    run_fit(options, "strips")


@command(
    "estimate",
    "bubblefit estimate project.toml",
    "bubblefit estimate project.toml --test bubble --json",
)
@common.with_options(common.PROJECT, common.TESTS, common.DATA)
@click.option("--json", "as_json", is_flag=True, help="Print the estimate as JSON.")
def estimate_command(**options: Any) -> None:
    """Estimate the moduli of PROJECT.toml by virtual work, in less than a second.

    The measured shapes of a bubble are put into the equations of equilibrium, which are not solved:
    strains are measured, and the moduli are those with which internal and external virtual work
    agree best. Chi is one where only noise is left. `bubblefit check` maps where equilibrium is not
    satisfied. A start and a doubt, not a result: a fit also knows the sheet's first shape.
    """
    from ..project.project import read_project
    from ..runs.estimate import estimate

    project = read_project(options["project"], common.data_folders(options["data"]))
    estimated = estimate(project, options["tests"] or None)
    lines = [*modulus_lines(estimated), *estimated.lines(), *note_lines(estimated.notes)]
    show(estimated.result, lines, options["as_json"])


def with_fit_options(project: Project, options: Mapping[str, Any]) -> Project:
    """Return the project with the options of a fit: seed, optimiser, jobs, starts, scheduler."""
    chosen = {name: options[name] for name in ("seed", "method", "jobs", "starts_from")}
    return project.with_fit(**chosen).with_scheduler(options["scheduler"])


def run_fit(options: dict[str, Any], kind: str | None = None) -> None:
    """Fit the tests of a project, write the output folder and print the summary.

    Parameters
    ----------
    options : dict
        Values of `fit_options`.
    kind : str or None
        Kind of the tests that are fitted, unless --test names some; None for all tests.
    """
    from ..project.schema import usual_folder
    from ..runs.fit import fit
    from ..runs.progress import timed

    path: Path = options["project"]
    project = with_fit_options(common.read_with_solver(options), options)
    folder = common.reserved_folder(options["out"] or usual_folder(path))
    starts = options["starts"] or project.fit.starts
    for name in options["tests"]:
        if kind is not None and name in project.tests and project.tests[name].kind != kind:
            problem = f"{name!r} is no test of this command's kind; use `bubblefit fit`"
            raise InputError(path, "--test", problem)
    with resumable(folder), common.LiveLine("starts", common.quiet(options), starts) as progress:
        result = fit(
            project,
            options["tests"] or kind,
            starts=options["starts"],
            trust=options["trust"],
            out=folder,
            resume=options["resume"],
            overwrite=options["overwrite"],
            progress=progress,
            command_line=common.command_line(),
        )
    with timed(f"card, tables and figures in {folder}"):
        result.report(folder)
    fail_above = options["fail_above"]
    lines = lines_of(result, folder, all_notes=verbose())
    show(result.result, lines, options["as_json"])
    if fail_above is not None and result.objective > fail_above:
        excess = f"{result.objective:.4g} is left of the objective, above {fail_above:g}"
        click.echo(f"bubblefit: --fail-above: {excess}", err=True)
        sys.exit(WORSE)


def lines_of(fit: Fit, folder: Path, *, all_notes: bool = False) -> list[str]:
    """Return the printed summary of a fit: moduli first, verdict and page last.

    `all_notes` : whether notes that are not grave are printed, too.
    """
    notes = note_lines(fit.notes) if all_notes else warning_lines(fit.notes, folder)
    return [
        *(modulus_lines(fit) if fit.has_law else [f"{fit.project.title}:"]),
        *_misfit_lines(fit),
        *_finding_lines(fit),
        *_unknown_lines(fit),
        *start_lines(fit),
        *notes,
        *fit.verdict.lines,
        written_to(folder),
    ]


def _misfit_lines(fit: Fit) -> list[str]:
    """Return lines on the misfit of each comparison, and on the errors at tests of weight 0."""
    lines = []
    for comparison, misfit in fit.misfits.items():
        unit = misfit.unit
        relation = "no noise to compare with"
        if misfit.noise > 0:
            noise = f"{misfit.noise:.3g} {unit}, {misfit.noise_is}"
            relation = f"{misfit.ratio:.2g} times the noise ({noise})"
        lines.append(f"misfit of {comparison}: {misfit.rms:.3g} {unit} RMS, {relation}")
    for prediction in fit.predicted.values():
        for comparison, rms in prediction.rms.items():
            error = f"{rms:.3g} {prediction.units[comparison]} RMS"
            lines.append(f"prediction of {comparison}: {error} (weight 0: not fitted)")
    return lines


def _finding_lines(fit: Fit) -> list[str]:
    """Return the lines of each test's findings, with its name if there are several tests."""
    if len(fit.findings) == 1:
        return [line for findings in fit.findings.values() for line in findings.lines]
    return [f"{name}: {line}" for name, findings in fit.findings.items() for line in findings.lines]


def _unknown_lines(fit: Fit) -> list[str]:
    """Return lines on the unknowns other than moduli, and on what each test alone determines."""
    from ..inference.reported import sigma_words_of

    verdicts = [verdict for verdict in fit.verdicts if verdict.shared or verdict.prior is None]
    lines = [f"{verdict.name}: {verdict.words}" for verdict in verdicts]
    for source, pinned in fit.result.get("pinned", {}).items():
        sigmas = []
        for name, numbers in pinned.items():
            sigma, worst = sigma_words_of(numbers)
            sigmas.append(f"{name} {sigma} (at worst {worst})")
        lines.append(f"1 sigma from {source}: {', '.join(sigmas)}")
    return lines


def modulus_lines(fit: Fit | Estimate) -> list[str]:
    """Return a table: each modulus at a few strains, in MPa and kN/m, with sigma and band."""
    from ..inference.reported import BOUND_WORDS, LEVEL
    from ..materials.forms.symmetry import modulus_labels
    from ..reports.html import percent
    from ..runs.verdict import answers

    certainty = fit.best.certainty
    is_of_noise = certainty is not None and certainty.mesh is None
    source = "noise alone" if is_of_noise else "noise and mesh"
    lines = [
        f"{fit.project.title}:",
        f"tangent moduli at logarithmic strains; 1 sigma and band: {source};",
        f"within the bounds of the fit; kN/m: times {fit.thickness:.4g} mm",
        f"{'':15}{'strain':>8}{'MPa':>10}{'1 sigma':>10}"
        f"{f'{percent(LEVEL)} band, MPa':>20}{'kN/m':>10}",
    ]
    modulus = ""
    rows = answers(fit.best, fit.thickness)
    labels = modulus_labels(fit.law.form)
    for row in rows:
        label = labels[row.modulus]
        name = ""
        if row.modulus != modulus:
            name = f"{label}, {DIRECTION_WORDS[label]}" if label in DIRECTION_WORDS else label
        modulus = row.modulus
        lines.append(
            f"{name:15}{100 * row.strain:>6.3g} %{row.value_words:>10}{row.sigma_words:>10}"
            f"{row.band_words:>20}{row.per_width:>10.4g}{'  (end)' if row.end else ''}"
        )
    if any(any(row.marks) for row in rows):
        lines.append(BOUND_WORDS)
    return lines


def start_lines(fit: Fit) -> list[str]:
    """Return the count of starts, the objective, the analyses and the time."""
    result = fit.result
    best = fit.best
    runs = result["external_runs"]
    cached = result["cached_runs"]
    from_cache = f", {cached} from the cache" if cached else ""
    external = f" ({runs} of {result['solver']}{from_cache})" if runs or cached else ""
    middle = np.median([r.objective for r in best.ranked if r.objective is not None])
    lines = [
        f"{len(best.ranked)} of {len(best.records)} starts ended with a fit; "
        f"{result['objective_is']}: best {fit.objective:.3g}, median {middle:.3g}; "
        f"{result['analyses']} analyses{external}, {result['wall_s']:.0f} s"
    ]
    if fit.project.fit.starts_from == "estimate":
        lines.append(fit.agreement)
    return [*lines, f"coarse to fine: {fit.stages}"] if fit.stages else lines


def warning_lines(notes: Sequence[Note], folder: Path) -> list[str]:
    """Return the grave notes, those on how files were read, and the number of all others."""
    grave = gravest_notes(notes)
    further = [note for note in notes if all(note is not printed for printed in grave)]
    of_reading = [note for note in further if note.kind == READING]
    lines = [*note_lines(grave, "warning"), *note_lines(of_reading)]
    unnamed = len(further) - len(of_reading)
    if unnamed:
        words = f"{unnamed} further note{'s' * (unnamed > 1)}"
        lines.append(f"{words}: {folder / NOTES} (or --verbose)")
    return lines
