"""Commands of studies: profile, bootstrap, plan, compare, validate, `study mesh`, `study nu12`.

Each reads the project and calls one function of `runs` by `run_study`, which prints the result."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import InputError
from . import options as common
from .fits import fit_options, with_fit_options
from .solver_options import solver_choice
from .terminal import Decorator, command, group, resumable, show, written_to

if TYPE_CHECKING:
    from ..project.project import Project
    from ..runs.refinement import Refined


def run_study(
    study: Callable[..., Any],
    name: str,
    project: Project,
    options: Mapping[str, Any],
    progress: common.LiveLine,
    **settings: Any,
) -> None:
    """Run a study, write its output folder, and print its lines, or result.json with --json.

    Parameters
    ----------
    study : callable
        Function of `runs` that does the study and returns its result.
    name : str
        Name of the study, which ends the name of the usual output folder.
    project : Project
        The project.
    options : mapping
        Values of the options that all studies have.
    progress : LiveLine
        Display of progress.
    **settings
        Further arguments of `study`.
    """
    folder = common.folder_of(options, name)
    resume = {key: options[key] for key in ("resume",) if key in options}
    with resumable(folder) if resume else nullcontext(), progress:
        result = study(
            project,
            tests=options["tests"] or None,
            out=folder,
            overwrite=options["overwrite"],
            progress=progress,
            **resume,
            **settings,
        )
    show(result.result, [*result.lines(), written_to(folder)], options["as_json"])


def run_fits(
    study: Callable[..., Any],
    name: str,
    options: Mapping[str, Any],
    usual_starts: int,
    **settings: Any,
) -> None:
    """Run a study that consists of several fits.

    Parameters
    ----------
    study, name, **settings
        Arguments of `run_study`.
    options : mapping
        Values of the options, which include those of a fit.
    usual_starts : int
        Number of starts of each fit, unless --starts gives it.
    """
    project = with_fit_options(common.read_with_solver(options), options)
    starts = options["starts"] or usual_starts
    progress = common.LiveLine("starts", common.quiet(options), starts)
    settings |= {"starts": starts, "trust": options["trust"], "command_line": common.command_line()}
    run_study(study, name, project, options, progress, **settings)


# Commands that begin from the optimum of one fit: profile, bootstrap and plan


def study_options(
    name: str, *specific: Decorator, refits: bool = True, resumes: bool = False
) -> Decorator:
    """Return a decorator that adds PROJECT and the options of a study to a command.

    Parameters
    ----------
    name : str
        Name of the study, which ends the name of the usual output folder.
    *specific : decorator
        Options of this study alone.
    refits : bool
        Whether the study fits again and so has the options --jobs and --scheduler.
    resumes : bool
        Whether the study has the option --resume.
    """
    options: list[Decorator] = [
        common.PROJECT,
        *specific,
        common.TESTS,
        common.out_option(f"out/NAME-{name}"),
    ]
    options += [common.DATA, solver_choice]
    if refits:
        options += [common.JOBS, common.SCHEDULER]
    if resumes:
        options.append(common.resume_option("Continue the study in the output folder."))
    return common.with_options(*options, common.OVERWRITE, common.AS_JSON, common.QUIET)


def _strains_by_modulus(
    moduli: Sequence[str], usual_strains: Sequence[float]
) -> dict[str, list[float]]:
    """Return the strains of each --modulus NAME or NAME=STRAINS, the usual ones without any."""
    strains_of: dict[str, list[float]] = {}
    for text in moduli:
        name, equals, strains = text.partition("=")
        if name in strains_of and not (usual_strains or (equals and strains_of[name])):
            raise InputError(None, "--modulus", f"{name} is given twice, once without strains")
        chosen_strains = common.numbers(strains, "--modulus") if equals else usual_strains
        strains_of.setdefault(name, []).extend(chosen_strains)
    return strains_of


@command(
    "profile",
    "bubblefit profile fabric.toml",
    "bubblefit profile fabric.toml --modulus G12=0.02,0.05 --modulus E1=0",
    "bubblefit profile fabric.toml --modulus G12 --strain 0.05 --card other/material.toml",
    "bubblefit profile deck.toml --parameter C10",
)
@study_options(
    "profile",
    click.option(
        "--modulus",
        "moduli",
        multiple=True,
        metavar="NAME[=STRAINS]",
        help="E1, E2 or G12, and at which strains; several [all, at half the strain reached].",
    ),
    click.option(
        "--parameter",
        "parameters",
        multiple=True,
        metavar="NAME",
        help="A parameter of a deck, or another unknown beside the moduli; several [all of decks].",
    ),
    click.option(
        "--strain", metavar="STRAINS", help="Of every --modulus that has none of its own."
    ),
    common.CARD_OF_FIT,
)
def profile_command(
    moduli: tuple[str, ...],
    parameters: tuple[str, ...],
    strain: str | None,
    **options: Any,
) -> None:
    """Compute profile-likelihood intervals (95 %) of moduli and of parameters of decks.

    Holds a modulus or a parameter of the fit of PROJECT.toml away from its optimum, fits everything
    else again, and continues until the data contradict or a bound is reached. Writes profile.csv,
    profile.png, report.html and result.json.
    """
    from ..runs.profile import profile

    project = common.read_to_refit(options)
    usual_strains = [] if strain is None else common.numbers(strain, "--strain")
    if usual_strains and not moduli:
        raise InputError(None, "--strain", "goes with --modulus NAME")
    strains_of = _strains_by_modulus(moduli, usual_strains)
    progress = common.LiveLine("sides", common.quiet(options))
    settings = {"moduli": strains_of or None, "card": options["card"], "parameters": parameters}
    run_study(profile, "profile", project, options, progress, **settings)


@command(
    "bootstrap",
    "bubblefit bootstrap fabric.toml --over frames",
    "bubblefit bootstrap fabric.toml --over specimens --samples 400 --jobs 4",
    "bubblefit bootstrap fabric.toml --over tests --resume",
)
@study_options(
    "bootstrap",
    click.option(
        "--over",
        required=True,
        metavar="SORT",
        help="What is drawn: frames, specimens, tests, directions or ratios.",
    ),
    click.option(
        "--samples",
        type=click.IntRange(min=2),
        default=100,
        show_default=True,
        help="Number of draws.",
    ),
    click.option("--seed", type=click.IntRange(min=0), help="Of the draws [the project's]."),
    common.CARD_OF_FIT,
    resumes=True,
)
def bootstrap_command(over: str, samples: int, **options: Any) -> None:
    """Compute percentile bands of the moduli by a bootstrap of the data.

    Draws frames, specimens or tests of PROJECT.toml with replacement and fits each draw from the
    optimum of the fit. Writes percentile bands of the moduli beside those of the fit:
    bootstrap.csv, coefficients.csv, bootstrap.png, report.html and result.json.
    """
    from ..runs.bootstrap import bootstrap

    settings = {"over": over, "samples": samples, "card": options["card"], "seed": options["seed"]}
    progress = common.LiveLine("samples", common.quiet(options))
    run_study(bootstrap, "bootstrap", common.read_to_refit(options), options, progress, **settings)


@command(
    "plan",
    "bubblefit plan fabric.toml",
    "bubblefit plan fabric.toml --card out/fabric/material.toml --rank G12",
    "bubblefit plan fabric.toml --specimens 5 --noise strips=20 --strain 0.1,0.1,0.05",
)
@study_options(
    "plan",
    click.option(
        "--card", help="The present optimum: a card's file or name [that of the project's fit]."
    ),
    click.option(
        "--strain",
        metavar="WARP,FILL,SHEAR",
        help="Strains up to which moduli are wanted [the card's valid range].",
    ),
    click.option(
        "--rank",
        metavar="NAME",
        default="worst",
        show_default=True,
        help="By E1, E2, G12, or the least certain of them.",
    ),
    click.option(
        "--specimens",
        type=click.IntRange(min=1),
        help="Of every candidate [1 bubble, 3 strips].",
    ),
    click.option(
        "--noise",
        "noises",
        multiple=True,
        metavar="KIND=VALUE",
        help="Of measured values, mm or N [that of the project's own test]; several.",
    ),
    refits=False,
)
def plan_command(strain: str | None, noises: tuple[str, ...], **options: Any) -> None:
    """Rank tests that could be made next by the predicted uncertainty of the moduli.

    Predicts one standard deviation of E1, E2 and G12 for each candidate beside the tests of
    PROJECT.toml, from derivatives at the fit's card. Writes plan.csv, report.html and result.json.
    """
    from ..runs.plan import plan

    settings = {name: options[name] for name in ("card", "rank", "specimens")}
    settings["strain"] = None if strain is None else common.numbers(strain, "--strain")
    settings["noise"] = dict(map(_noise, noises))
    progress = common.LiveLine("tests", common.quiet(options))
    run_study(plan, "plan", common.read_with_solver(options), options, progress, **settings)


def _noise(text: str) -> tuple[str, float]:
    """Return the kind of test and the noise, mm or N, that a value of --noise gives."""
    kind, _, value = text.partition("=")
    try:
        return kind, float(value)
    except ValueError:
        problem = f"expected KIND=VALUE, such as strips=20, got {text!r}"
        raise InputError(None, "--noise", problem) from None


@command(
    "compare",
    "bubblefit compare project.toml",
    "bubblefit compare project.toml --form cubic --form spline:6 --folds 4",
)
@click.option(
    "--form",
    "forms",
    multiple=True,
    metavar="NAME",
    help="Form of the moduli, spline:8 with its number of knots; several [all whose settings "
    "the project has].",
)
@click.option(
    "--folds", type=click.IntRange(min=2), default=5, show_default=True, help="Of the validation."
)
@click.option(
    "--fold-starts",
    type=click.IntRange(min=1),
    default=1,
    show_default=True,
    help="Of each fold: the first at the fit to all points, the others random.",
)
@fit_options
def compare_command(**options: Any) -> None:
    """Fit every form of the moduli to the tests of PROJECT.toml and cross-validate it.

    Each form from a few starts [5]; the error at specimens that were left out of the fit shows
    whether more coefficients pay. Writes comparison.csv, figures, report.html and result.json, and
    a folder for each form, into the output folder.
    """
    from ..runs.compare import STARTS, compare

    settings = {name: options[name] for name in ("forms", "folds", "fold_starts")}
    run_fits(compare, "compared", options, STARTS, **settings)


@command(
    "validate",
    "bubblefit validate project.toml --form cubic --form spline:6",
    "bubblefit validate project.toml --leave frames",
    "bubblefit validate project.toml --weights strips",
    "bubblefit validate project.toml --card out/project/material.toml",
)
@click.option(
    "--form", "forms", multiple=True, metavar="NAME", help="Of the moduli; several [the project's]."
)
@click.option(
    "--card", "cards", multiple=True, metavar="CARD", help="Judge it instead of a fit; several."
)
@click.option(
    "--leave",
    metavar="SORT",
    help="Left out in turn: tests, frames, specimens, directions, ratios or cycles.  [tests]",
)
@click.option(
    "--weights",
    "counted",
    metavar="KIND",
    help="Instead: moduli and errors over the weight of a kind of test (strips), or of one test.",
)
@fit_options
def validate_command(leave: str | None, counted: str | None, **options: Any) -> None:
    """Leave each test of PROJECT.toml out of the fit in turn, and judge the fit there.

    With --leave single frames of bubbles, specimens or directions of strips, ratios of biaxial
    tests, or cycles that others reach instead; with --card cards at the tests, without a fit.
    Writes validation.csv and result.json, and a folder for each fit, into the output folder. With
    --weights moduli and errors over the weight of a kind of test: weights.csv, weights.png,
    result.json.
    """
    from ..runs import validation, weight_study

    path: Path = options["project"]
    forms = options["forms"]
    cards = options["cards"]
    _check_exclusive(path, {"--card": cards, "--leave": leave, "--weights": counted})
    _check_exclusive(path, {"--form": forms, "--card": cards})
    if counted is not None:
        _check_exclusive(path, {"--form": forms, "--weights": counted})
        starts = weight_study.STARTS
        run_fits(weight_study.weights, "weights", options, starts, counted=counted)
        return
    settings = {"forms": forms, "cards": cards, "leave": leave or validation.TESTS}
    run_fits(validation.validate, "validated", options, validation.STARTS, **settings)


def _check_exclusive(path: Path, options: Mapping[str, object]) -> None:
    """Check that at most one of the options is given."""
    names = [name for name, value in options.items() if value]
    if len(names) > 1:
        raise InputError(path, ", ".join(names), "give one of them")


@group(
    "study",
    "bubblefit study mesh project.toml --card out/project/material.toml",
    "bubblefit study nu12 project.toml --card out/project/material.toml",
)
def study_command() -> None:
    """Vary the mesh, the increments or nu12 in the analyses of a project."""


#: PROJECT, --card and the options of every study of a card.
card_options = common.with_checks(
    common.PROJECT,
    click.option(
        "--card",
        required=True,
        help="The material card's file, or the name of a card of the project.",
    ),
    click.option(
        "--test",
        "--case",
        "tests",
        multiple=True,
        help="A test by its name, or a kind of tests; several [all].",
    ),
    common.out_option("out/NAME-STUDY"),
    common.DATA,
    solver_choice,
    common.resume_option(),
    common.OVERWRITE,
    common.AS_JSON,
)


def run_with_card(
    name: str, study: Callable[..., Any], options: dict[str, Any], **settings: Any
) -> None:
    """Run a study of analyses with one material card: `run_study` with the card of --card."""
    project = common.read_with_solver(options, need_data=False)
    progress = common.LiveLine("increments", options["as_json"])
    run_study(study, name, project, options, progress, card=options["card"], **settings)


@command(
    "mesh",
    "bubblefit study mesh project.toml --card out/project/material.toml",
    "bubblefit study mesh project.toml --card material.toml --what increments --levels 3",
)
@card_options
@click.option(
    "--what",
    "refined",
    type=click.Choice(["elements", "increments"]),
    default="elements",
    show_default=True,
    help="What is refined.",
)
@click.option(
    "--levels",
    type=click.IntRange(2, 8),
    default=4,
    show_default=True,
    help="Number of levels.",
)
@click.option(
    "--factor",
    type=click.IntRange(2, 10),
    default=2,
    show_default=True,
    help="Between levels: edges, or increments, are divided by it.",
)
@click.option(
    "--coarser",
    type=click.IntRange(min=0),
    help="Levels coarser than the project's own [1 of elements, 0 of increments].",
)
def study_mesh(refined: Refined, **options: Any) -> None:
    """Run PROJECT.toml with a card on finer and finer meshes (or increments).

    Reports the quantities of interest and the cost of each level, the observed order of
    convergence and Richardson's limit. A level whose analysis fails is named and left out; when
    fewer than two end well the exit code is 4.
    """
    from ..runs.refinement import refine

    settings = {name: options[name] for name in ("levels", "factor", "coarser")}
    name = "increments" if refined == "increments" else "mesh"
    run_with_card(name, refine, options, what=refined, **settings)


@command(
    "nu12",
    "bubblefit study nu12 project.toml --card material.toml",
    "bubblefit study nu12 project.toml --card material.toml --nu12 0.1 --nu12 0.4",
)
@card_options
@click.option(
    "--nu12",
    "values",
    type=float,
    multiple=True,
    help="A value to run; may be given more than once [0.05 0.15 0.25 0.35 0.45].",
)
def study_nu12(values: tuple[float, ...], **options: Any) -> None:
    """Run PROJECT.toml with a card whose Poisson's ratio is varied at unchanged moduli.

    Reports every response relative to that at the card's own nu12 and relative to the mean of the
    values. A value whose analysis fails is named and left out; when the card's own fails, or all
    others do, the exit code is 4.
    """
    from ..runs.refinement import NU12, vary_nu12

    run_with_card("nu12", vary_nu12, options, values=values or NU12)


for subcommand in (study_mesh, study_nu12):
    study_command.add_command(subcommand)
