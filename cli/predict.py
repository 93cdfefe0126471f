"""Commands that run tests with given material cards: `bubblefit bend` and `simulate`."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import InputError, SolverFailure
from ..storage.reading import missing_file_reason
from . import options as common
from .options import command_line, data_folders, with_solver
from .solver_options import solver_choice
from .terminal import FILE, WORSE, Decorator, command, group, resumable, show, written_to

if TYPE_CHECKING:
    from ..materials.card import MaterialCard
    from ..project.project import Project
    from ..runs.predictions import Predictions

CYLINDER = "cylinder"
#: Name in messages of `simulate bend`, which has no project file.
NO_FILE = Path("simulate bend")
#: Options of `simulate bend` that are keys of a [[cylinder]] section.
SHAPE = (
    "length",
    "span",
    "support_diameter",
    "seam_width",
    "element_size",
    "symmetry",
    "deflection",
    "frames",
)


#: Options of every series of predictions; the command receives them by name.
prediction_options = common.with_checks(
    common.out_option(),
    click.option(
        "--samples",
        type=click.IntRange(min=0),
        metavar="N",
        help="Spread by N laws drawn from the card's certainty; 0: none.  [few directions]",
    ),
    common.JOBS,
    common.SCHEDULER,
    solver_choice,
    common.fail_above_option("Exit 1 when an RMS error exceeds E of the largest measured load."),
    common.resume_option("Keep the runs that the output folder holds."),
    common.OVERWRITE,
    common.AS_JSON,
    common.QUIET,
)


def run_predictions(
    project: Project,
    folder: Path,
    options: Mapping[str, Any],
    tests: Sequence[str] | None,
    cards: Sequence[str] | Mapping[str, MaterialCard],
) -> None:
    """Predict tests with material cards, write the output folder and print the outcome.

    Parameters
    ----------
    project : Project
        The project.
    folder : Path
        Output folder.
    options : mapping
        Values of `prediction_options`.
    tests : sequence of str or None
        Names or kinds of tests; None for all.
    cards : sequence of str, or mapping of str to MaterialCard
        Cards by name or file, or as they are; empty for those of the project.
    """
    from ..runs.predictions import measured_tests, predict

    common.reserved_folder(folder)
    project = with_solver(project, options["solver_given"])
    if options["fail_above"] is not None and not measured_tests(project, tests):
        problem = "no test has measured loads to compare with; leave it out"
        raise InputError(project.path, "--fail-above", problem)
    with resumable(folder), common.LiveLine("runs", common.quiet(options)) as progress:
        predictions = predict(
            project,
            tests,
            cards,
            samples=options["samples"],
            jobs=options["jobs"],
            scheduler=options["scheduler"],
            out=folder,
            resume=options["resume"],
            overwrite=options["overwrite"],
            progress=progress,
            command_line=command_line(),
        )
    predictions.report(folder)
    show(predictions.result, [*predictions.lines(), written_to(folder)], options["as_json"])
    runs = predictions.predicted_runs
    failed = predictions.failed()
    if failed:
        run = runs[failed[0]]
        words = f"{len(failed)} of {len(runs)} runs failed ({run.title}: {run.record.failure})"
        click.echo(f"bubblefit: {words}; --resume tries again", err=True)
    if options["fail_above"] is not None:
        excess = _excess(predictions, options["fail_above"])
        if excess:
            click.echo(f"bubblefit: {excess} (--fail-above)", err=True)
            sys.exit(WORSE)
    if failed:
        sys.exit(SolverFailure.exit_code)


def _excess(predictions: Predictions, limit: float) -> str:
    """Return in words which error is above the limit of --fail-above, "" if none is."""
    worst = predictions.worst
    silent = predictions.silent()
    if worst is not None and not worst <= limit:
        return f"an RMS error of {worst:.4g} of the largest load is above {limit:g}"
    if silent:
        return f"{predictions.predicted_runs[silent[0]].title} gave nothing to compare"
    return ""


@command(
    "bend",
    "bubblefit bend fabric.toml",
    "bubblefit bend fabric.toml --card out/fabric/material.toml --samples 0",
    'bubblefit bend fabric.toml --test "150 mm, 140 kPa" --resume',
)
@common.PROJECT
@common.DATA
@click.option(
    "--test", "--case", "tests", multiple=True, help="A cylinder by its name; several [all]."
)
@click.option(
    "--card",
    "cards",
    multiple=True,
    help="A card by its name, or a card's file; several [all, else the one just fitted].",
)
@prediction_options
def bend_command(**options: Any) -> None:
    """Inflate and bend every cylinder of PROJECT.toml with every material card.

    Without a card in the project or by --card, the card that `bubblefit fit` wrote is taken.
    Writes result.json, load_deflection.csv, runs.csv, figures, the bent beams for ParaView and
    report.html into the output folder. A run that fails is named and left out, everything else is
    written, the exit code is 4, and --resume tries it again.
    """
    from ..project.project import read_project
    from ..project.schema import usual_folder

    project = read_project(options["project"], data_folders(options["data"]))
    folder = options["out"]
    if folder is None:
        # Beside the folder of the project's fits, where it has any.
        if all(test.kind == CYLINDER for test in project.tests.values()):
            folder = usual_folder(options["project"])
        else:
            folder = common.folder_of(options, "bend")
    tests = options["tests"] or [CYLINDER]
    run_predictions(project, folder, options, tests, options["cards"])


@group(
    "simulate",
    "bubblefit simulate bubble project.toml --card out/project/material.toml",
    "bubblefit simulate bend --diameter 150 --pressure 140 --card material.toml",
)
def simulate_command() -> None:
    """Run forward analyses with material cards, one or several side by side."""


def card_options(requires_card: bool) -> Decorator:
    """Return a decorator that adds PROJECT, cards and the options of a simulation."""
    words = "A material card's file, or a card of the project; several side by side."
    return common.with_checks(
        common.PROJECT,
        click.option("--card", "cards", multiple=True, required=requires_card, help=words),
        common.TESTS,
        common.out_option("out/NAME-simulated"),
        common.DATA,
        solver_choice,
        click.option(
            "--within-range", is_flag=True, help="End each curve where the card's valid range ends."
        ),
        common.resume_option(),
        common.OVERWRITE,
        common.AS_JSON,
    )


def run_simulation(command: str, options: dict[str, Any], kind: str | None) -> None:
    """Run tests of a project with material cards, write the output folder and print the result.

    Parameters
    ----------
    command : str
        Name of the command, for the record.
    options : dict
        Values of the options of `card_options`.
    kind : str or None
        Kind of the tests that are run, unless --test names some; None for all.
    """
    from ..project.project import chosen_cards
    from ..runs.simulation import simulate_cards

    project = common.read_with_solver(options, need_data=False)
    tests = project.chosen(options["tests"] or kind)
    cards = chosen_cards(project, options["cards"])
    folder = common.result_folder(options, "simulated")
    with resumable(folder), common.LiveLine("increments", options["as_json"]) as progress:
        simulation_run = simulate_cards(
            project,
            tests,
            cards,
            folder,
            within_range=options["within_range"],
            progress=progress,
            command=command,
            resume=options["resume"],
        )
    lines = [*simulation_run.lines, written_to(folder)]
    show(simulation_run.numbers, lines, options["as_json"])


def simulation(name: str, text: str, kind: str | None, *lines: str) -> click.Command:
    """Return a command of `bubblefit simulate` that runs tests with material cards.

    Parameters
    ----------
    name : str
        Name of the command.
    text : str
        Help of the command.
    kind : str or None
        Kind of the tests; None for any.
    *lines : str
        Examples that stand below the help.
    """

    def run(**options: Any) -> None:
        run_simulation(f"simulate {name}", options, kind)

    run.__doc__ = text
    return command(name, *lines)(card_options(kind in ("bubble", "strips"))(run))


FAILS = (
    "Measurements are drawn beside them where they are there. A card whose analysis fails is named "
    "and left out there; when nothing ends well the exit code is 4."
)
simulate_test = simulation(
    "test",
    f"Run the tests of PROJECT.toml with one or several material cards.\n\n{FAILS}",
    None,
    "bubblefit simulate test project.toml --card out/project/material.toml",
    "bubblefit simulate test project.toml --test bubble --card one.toml --card two.toml",
)
simulate_deck = simulation(
    "deck",
    "Run the input decks of PROJECT.toml, and compare them with what was measured.\n\n"
    "With --card parameters.toml of a fit without a law at its values, without it at the start "
    "values; with a law by --card material.toml, and the parameters.toml beside it if there is one."
    f" {FAILS}",
    "deck",
    "bubblefit simulate deck project.toml",
    "bubblefit simulate deck project.toml --card out/project/parameters.toml",
)
simulate_bubble = simulation(
    "bubble",
    "Inflate the bubbles of PROJECT.toml with one or several material cards.",
    "bubble",
    "bubblefit simulate bubble project.toml --card material.toml",
    "bubblefit simulate bubble project.toml --card material.toml --within-range",
)
simulate_uniaxial = simulation(
    "uniaxial",
    f"Pull the strips of PROJECT.toml with one or several cards.\n\n{FAILS}",
    "strips",
    "bubblefit simulate uniaxial project.toml --card material.toml",
    "bubblefit simulate uniaxial project.toml --card a.toml --card b.toml --out out/both",
)


@command(
    "bend",
    "bubblefit simulate bend --diameter 150 --pressure 140 --card material.toml",
    "bubblefit simulate bend --diameter 200 --pressure 70 --card material.toml --places 50,100",
)
@click.option("--diameter", type=float, required=True, metavar="MM", help="Before inflation.")
@click.option("--pressure", type=float, required=True, metavar="KPA", help="Gauge pressure.")
@click.option(
    "--card",
    "cards",
    type=FILE,
    multiple=True,
    required=True,
    help="A material card; several are drawn in one figure.",
)
@click.option("--length", type=float, metavar="MM", help="Before inflation [3000].")
@click.option("--span", type=float, metavar="MM", help="Between the supports [2000].")
@click.option("--support-diameter", type=float, metavar="MM", help="[100]")
@click.option(
    "--collar",
    type=(float, float),
    metavar="MM MM",
    help="Inner diameter and length [240 145; above 200 mm of diameter 295 147].",
)
@click.option("--seam-width", type=float, metavar="MM", help="0 for none [40].")
@click.option("--element-size", type=float, metavar="MM", help="[25]")
@click.option(
    "--symmetry", type=click.Choice(["quarter", "full"]), help="What is meshed [quarter]."
)
@click.option("--deflection", type=float, metavar="MM", help="Of the collar [240].")
@click.option("--frames", type=int, metavar="N", help="Equal steps of it [60].")
@click.option(
    "--places", metavar="MM,MM,...", help="Where loads are listed [1/4, 1/2 and 1 diameter]."
)
@click.option(
    "--measured",
    type=FILE,
    multiple=True,
    help="Measured loads, columns deflection and load with their units; several.",
)
@prediction_options
def simulate_bend(diameter: float, pressure: float, **options: Any) -> None:
    """Inflate a cylinder and bend it with the materials of one or several cards.

    Writes what `bubblefit bend` writes; a project file (`bubblefit init --example bend`) takes
    several cylinders and sensors in volts.
    """
    from ..project.project import named_cards

    name = f"{diameter:g} mm, {pressure:g} kPa"
    section = {"name": name, "diameter": diameter, "pressure": pressure}
    section |= {key: options[key] for key in SHAPE if options[key] is not None}
    if options["collar"] is not None:
        section["collar"] = dict(zip(("inner_diameter", "length"), options["collar"], strict=True))
    if options["places"] is not None:
        section["places"] = common.numbers(options["places"], "--places")
    for path in options["measured"]:
        if not path.is_file():
            raise InputError(None, "--measured", missing_file_reason(path))
    if options["measured"]:
        section["measured"] = {"files": [str(path) for path in options["measured"]]}
    named = named_cards(options["cards"], {})
    project = _project(section, named)
    folder = options["out"] or Path("out") / f"bend-{diameter:g}mm-{pressure:g}kPa"
    run_predictions(project, folder, options, None, named)


def _project(section: dict[str, Any], cards: Mapping[str, MaterialCard]) -> Project:
    """Return a project of one cylinder with the thickness of the first card.

    Every card is run with its own thickness. Errors name the option instead of a key.
    """
    from ..project.project import project_of

    thickness = next(iter(cards.values())).thickness
    fabric = {"name": "Inflated cylinder in bending", "thickness": thickness}
    try:
        return project_of({"fabric": fabric, CYLINDER: [section]}, NO_FILE)
    except InputError as error:
        if error.path != NO_FILE:
            raise
        key = re.split(r"[.\[]", error.field.removeprefix(f"{CYLINDER}[0]."))[0]
        key = "card" if key == "fabric" else key
        raise InputError(None, f"--{key.replace('_', '-')}", error.problem) from None


for subcommand in (
    simulate_test,
    simulate_bubble,
    simulate_uniaxial,
    simulate_deck,
    simulate_bend,
):
    simulate_command.add_command(subcommand)
simulate_command.add_command(simulate_uniaxial, "strips")
