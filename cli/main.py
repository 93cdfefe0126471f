"""The `bubblefit` command: one file a subcommand, imported only when called."""

from __future__ import annotations

import importlib
from typing import Any

import click

from .. import __version__
from .events import with_events
from .examples import examples
from .logs import listen, with_verbose
from .options import COMMAND_LINE
from .usage import Suggesting, in_one_line

COMMANDS = {
    "fit": ("fit", "Fit a material to all tests of a fabric together."),
    "bubble": ("bubble", "Fit a material to bubble inflation tests only."),
    "uniaxial": ("uniaxial", "Fit a material to warp, fill and bias strip tests only."),
    "biaxial": ("biaxial", "Constants that a designer types in, from biaxial tests."),
    "check": ("check", "Look at the data before anything is fitted."),
    "bend": ("bend", "Inflate and bend cylinders with material cards."),
    "validate": ("validate", "Does a fit foretell the test that it was not given?"),
    "profile": ("profile", "Between what does a modulus lie? Its profile likelihood."),
    "bootstrap": ("bootstrap", "How far do moduli scatter if the data are drawn again?"),
    "plan": ("plan", "Which test next? Predicted uncertainty of tests that could be made."),
    "compare": ("compare", "Which form of the moduli do the strip tests support?"),
    "report": ("report", "The page of an output folder again, as PDF, or two side by side."),
    "simulate": ("simulate", "One forward analysis with a material card."),
    "gauge": ("gauge", "A virtual strain gauge through the DIC frames of a strip test."),
    "dic": ("dic", "Is the camera right? A sphere through the points of its frames."),
    "study": ("study", "What refinement, or nu12, changes in an analysis."),
    "export": ("export", "A material card for Marc, CalculiX, Abaqus, LS-DYNA or a table."),
    "init": ("init", "Write a commented project: an example, or for your own tests."),
    "docs": ("docs", "The documents of this version, page by page."),
    "schema": ("schema", "The JSON Schema of the project file, for editors."),
    "verify": ("verify", "Published and closed-form numbers beside this program's."),
    "cache": ("cache", "Runs of other programs that are kept: how many, where; fewer."),
    "doctor": ("doctor", "Which solvers are here, and do they carry the law?"),
}


class LazyGroup(Suggesting):
    """Imports a subcommand only when it runs: `bubblefit --help` stays quick.

    What cannot be understood is one line, also below it.
    """

    def make_context(
        self,
        info_name: str | None,
        args: list[str],
        parent: click.Context | None = None,
        **extra: Any,
    ) -> click.Context:
        given = ["bubblefit", *args]  # parsing eats them
        with in_one_line():
            context = super().make_context(info_name, args, parent, **extra)
        context.meta[COMMAND_LINE] = given
        return context

    def invoke(self, ctx: click.Context) -> Any:
        with in_one_line():
            return super().invoke(ctx)

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        if name not in COMMANDS:
            return None
        module = importlib.import_module(f".{COMMANDS[name][0]}", __package__)
        return with_events(with_verbose(module.command))

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, text) for name, (_, text) in COMMANDS.items()])


@click.group(
    "bubblefit",
    cls=LazyGroup,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog=examples(
        "bubblefit init mine",
        "bubblefit fit mine/project.toml",
        "bubblefit fit --help",
    ),
)
@click.version_option(__version__, prog_name="bubblefit")
@click.option(
    "--verbose", is_flag=True, help="Tell each analysis, solver files and times, on stderr."
)
def main(verbose: bool) -> None:
    """Test data in, validated material card of a coated fabric out.

    Exit codes: 0 fine, 1 fit worse than --fail-above, 2 bad input, 3 no feasible start found,
    4 the solver failed, 130 interrupted.
    """
    listen(verbose)
