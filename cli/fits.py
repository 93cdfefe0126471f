"""`bubblefit fit`, `bubble` and `uniaxial`: options of every fit, and the summary it prints."""

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
from . import options as given
from .terminal import WORSE, command, resumable, show, verbose, written_to

if TYPE_CHECKING:
    from ..project.project import Project
    from ..runs.estimate import Estimate
    from ..runs.result import Fit

#: Words for the modulus in the table of the terminal.
WORDS = {"E1": "along warp", "E2": "along fill", "G12": "in shear"}


#: PROJECT and the options of every fit; the command receives them by name.
fit_options = given.with_checks(
    given.PROJECT,
    given.TESTS,
    given.out_option(),
    given.DATA,
    click.option("--starts", type=click.IntRange(min=1), help="Random feasible starts."),
    click.option("--seed", type=click.IntRange(min=0), help="Seed of the starts."),
    click.option(
        "--starts-from",
        type=click.Choice(["random", "sobol", "estimate"]),
        help="Where starts begin: drawn, spread evenly, or one at the estimate.",
    ),
    given.JOBS,
    given.SCHEDULER,
    click.option("--method", metavar="NAME", help=f"Optimiser: {', '.join(method_names())}."),
    given.solver_choice,
    given.fail_above_option("Exit 1 when more than E is left of the objective."),
    given.TRUST,
    given.resume_option("Continue an interrupted fit."),
    given.OVERWRITE,
    given.AS_JSON,
    given.QUIET,
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
@given.with_options(given.PROJECT, given.TESTS, given.DATA)
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

    project = read_project(options["project"], given.data_folders(options["data"]))
    found = estimate(project, options["tests"] or None)
    lines = [*modulus_lines(found), *found.lines(), *note_lines(found.notes)]
    show(found.result, lines, options["as_json"])


def settings_given(project: Project, options: Mapping[str, Any]) -> Project:
    """Return the project with starts, optimiser and workers as the command line has them."""
    chosen = {name: options[name] for name in ("seed", "method", "jobs", "starts_from")}
    return project.with_fit(**chosen).with_scheduler(options["scheduler"])


def run_fit(options: dict[str, Any], kind: str | None = None) -> None:
    """Fit the chosen tests (of a kind) of a project, write the folder and print the summary."""
    from ..project.schema import usual_folder
    from ..runs.fit import fit
    from ..runs.starts import timed

    path: Path = options["project"]
    project = settings_given(given.read_with_solver(options), options)
    folder = given.held_folder(options["out"] or usual_folder(path))
    starts = options["starts"] or project.fit.starts
    for name in options["tests"]:
        if kind is not None and name in project.tests and project.tests[name].kind != kind:
            problem = f"{name!r} is no test of this command's kind; use `bubblefit fit`"
            raise InputError(path, "--test", problem)
    with resumable(folder), given.LiveLine("starts", given.quiet(options), starts) as progress:
        result = fit(
            project,
            options["tests"] or kind,
            starts=options["starts"],
            trust=options["trust"],
            out=folder,
            resume=options["resume"],
            overwrite=options["overwrite"],
            progress=progress,
            command_line=given.command_line(),
        )
    with timed(f"card, tables and figures in {folder}"):
        result.report(folder)
    fail_above = options["fail_above"]
    show(result.result, lines_of(result, folder, every=verbose()), options["as_json"])
    if fail_above is not None and result.objective > fail_above:
        said = f"{result.objective:.4g} is left of the objective, above {fail_above:g}"
        click.echo(f"bubblefit: --fail-above: {said}", err=True)
        sys.exit(WORSE)


def lines_of(fit: Fit, folder: Path, every: bool = False) -> list[str]:
    """Return the summary, moduli first, verdict and page last; with `every`, all notes."""
    from ..inference.reported import sigma_words_of

    shown = [one for one in fit.verdicts if one.shared or one.prior is None]
    lines = [f"{one.name}: {one.words}" for one in shown]
    for source, pinned in fit.result.get("pinned", {}).items():
        parts = ", ".join(
            "{} {} (at worst {})".format(name, *sigma_words_of(numbers))
            for name, numbers in pinned.items()
        )
        lines.append(f"1 sigma from {source}: {parts}")
    misfits = []
    for comparison, m in fit.misfits.items():
        times = f"{m.ratio:.2g} times the noise ({m.noise:.3g} {m.unit}, {m.noise_is})"
        beside = times if m.noise > 0 else "no noise to compare with"
        misfits.append(f"misfit of {comparison}: {m.rms:.3g} {m.unit} RMS, {beside}")
    predicted = [
        f"prediction of {comparison}: {rms:.3g} {one.units[comparison]} RMS (weight 0: not fitted)"
        for one in fit.predicted.values()
        for comparison, rms in one.rms.items()
    ]
    return [
        *modulus_lines(fit),
        *misfits,
        *predicted,
        *(
            f"{name}: {line}" if len(fit.findings) > 1 else line
            for name, findings in fit.findings.items()
            for line in findings.lines
        ),
        *lines,
        *start_lines(fit),
        *(note_lines(fit.notes) if every else warning_lines(fit.notes, folder)),
        fit.verdict.words,
        written_to(folder),
    ]


def modulus_lines(fit: Fit | Estimate) -> list[str]:
    """Return a table: each modulus at a few strains, in MPa and kN/m, with sigma and band."""
    from ..inference.reported import BOUND_WORDS, LEVEL
    from ..reports.html import percent
    from ..runs.result import answers

    sure = fit.best.certainty
    of = "noise alone" if sure is not None and sure.mesh is None else "noise and mesh"
    lines = [
        f"{fit.project.title}:",
        f"tangent moduli at logarithmic strains; 1 sigma and band: {of};",
        f"within the bounds of the fit; kN/m: times {fit.thickness:.4g} mm",
        f"{'':15}{'strain':>8}{'MPa':>10}{'1 sigma':>10}"
        f"{f'{percent(LEVEL)} band, MPa':>20}{'kN/m':>10}",
    ]
    before = ""
    for one in answers(fit.best, fit.thickness):
        name = f"{one.modulus}, {WORDS[one.modulus]}" if one.modulus != before else ""
        before = one.modulus
        lines.append(
            f"{name:15}{100 * one.strain:>6.3g} %{one.value_words:>10}{one.sigma_words:>10}"
            f"{one.band_words:>20}{one.per_width:>10.4g}{'  (end)' if one.end else ''}"
        )
    if any(any(one.marks) for one in answers(fit.best, fit.thickness)):
        lines.append(BOUND_WORDS)
    return lines


def start_lines(fit: Fit) -> list[str]:
    """Return the count of starts, the objective, the analyses and the time."""
    result = fit.result
    best = fit.best
    runs = result["external_runs"]
    cached = result["cached_runs"]
    kept = f", {cached} from the cache" if cached else ""
    external = f" ({runs} of {result['solver']}{kept})" if runs or cached else ""
    middle = float(np.median([r.objective for r in best.ranked if r.objective is not None]))
    lines = [
        f"{len(best.ranked)} of {len(best.records)} starts ended with a fit; "
        f"{result['objective_is']}: best {fit.objective:.3g}, median {middle:.3g}; "
        f"{result['analyses']} analyses{external}, {result['wall_s']:.0f} s"
    ]
    if fit.project.fit.starts_from == "estimate":
        lines.append(fit.agreement)
    return [*lines, f"coarse to fine: {fit.stages}"] if fit.stages else lines


def warning_lines(notes: Sequence[Note], folder: Path) -> list[str]:
    """Return all grave notes, how files were read, and where the others are."""
    grave = gravest_notes(notes)
    others = [note for note in notes if all(note is not printed for printed in grave)]
    read = [note for note in others if note.kind == READING]
    more = len(others) - len(read)
    where = f"{folder / NOTES} (or --verbose)"
    further = [f"{more} further note{'s' * (more > 1)}: {where}"] if more else []
    return [*note_lines(grave, "warning"), *note_lines(read), *further]
