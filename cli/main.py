"""Entry point of the `bubblefit` command, which imports each subcommand only when it is called."""

import os
import sys
from typing import Any

import click

from ..interrupts import begin
from ..lazy_modules import import_quickly
from ..notes import without_warnings
from ..version import __version__
from . import terminal

#: Module of each command, which defines NAME_command, and its line in the help.
COMMANDS = {
    "fit": ("fits", "Fit a material to all tests of a fabric together."),
    "bubble": ("fits", "Fit a material to bubble inflation tests only."),
    "uniaxial": ("fits", "Fit a material to warp, fill and bias strip tests only."),
    "biaxial": ("data", "Evaluate designers' linear constants from biaxial tests."),
    "cycles": ("data", "Evaluate load cycles: permanent strain, stiffness, energy lost."),
    "check": ("check", "Check the data before a fit."),
    "estimate": ("fits", "Estimate moduli by virtual work, without a fit."),
    "bend": ("predict", "Inflate and bend cylinders with material cards."),
    "validate": ("studies", "Cross-validate a fit: predict each test from the others."),
    "profile": ("studies", "Compute profile-likelihood intervals of moduli and parameters."),
    "bootstrap": ("studies", "Bootstrap the data: percentile bands of the moduli."),
    "plan": ("studies", "Rank further tests by the predicted uncertainty of the moduli."),
    "compare": ("studies", "Compare forms of the moduli by cross-validation."),
    "report": (
        "tools",
        "Write the page of an output folder again, as PDF, or of two side by side.",
    ),
    "simulate": ("predict", "Run forward analyses with a material card."),
    "gauge": ("data", "Follow a virtual strain gauge through the DIC frames of a strip test."),
    "dic": ("data", "Test the camera: fit a sphere to the points of its frames."),
    "study": ("studies", "Vary the mesh, the increments or nu12 in an analysis."),
    "export": ("export", "Write a material card for Marc, CalculiX, Abaqus, LS-DYNA or a table."),
    "init": ("start", "Write a commented project: an example, or one for your own tests."),
    "docs": ("start", "Read the documents of this version."),
    "schema": ("start", "Print the JSON Schema of the project file, for editors."),
    "verify": ("verify", "Compare with published numbers and closed forms."),
    "cache": ("tools", "Show or prune the cache of solver runs."),
    "doctor": ("tools", "List the solvers found, and test that they can run the law."),
}

#: Modules of commands that solve, with scipy.
SOLVING = ("fits", "predict", "studies")


class LazyGroup(terminal.Suggesting):
    """Import a command only when it is called, and print usage errors in one line."""

    def main(self, *args: Any, **kwargs: Any) -> Any:
        """Run as click does; where the locale is ASCII, start Python anew in its UTF-8 mode."""
        if not (args or kwargs) and sys.getfilesystemencoding() == "ascii":  # umlauts in paths
            in_utf8 = [sys.executable, "-X", "utf8", *sys.orig_argv[1:]]
            os.execv(sys.executable, in_utf8)  # noqa: S606
        terminal.check_stdout()
        return super().main(*args, **kwargs)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return a command when its imports are done; until then Ctrl-C ends the program at once.

        An import that KeyboardInterrupt ends may swallow it, so that the command would go on.
        """
        name, command, arguments = super().resolve_command(ctx, args)
        is_solving = name in COMMANDS and COMMANDS[name][0] in SOLVING
        if is_solving and not {"-h", "--help"} & {*arguments}:
            import_quickly("scipy.sparse.linalg")
        begin()
        return name, command, arguments

    def make_context(
        self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any
    ) -> click.Context:
        """Return the context of a command, and keep the typed command line in it."""
        typed = ["bubblefit", *args]  # before parsing, which removes the arguments from the list
        with terminal.in_one_line():
            context = super().make_context(info_name, args, parent, **extra)
        context.meta[terminal.COMMAND_LINE] = typed
        return context

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command, which prints the notes that Python gets as warnings."""
        with terminal.in_one_line(), without_warnings():
            return super().invoke(ctx)

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of the commands, in the order of the help."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        """Import the module of a command and return the command; None where there is none."""
        if name not in COMMANDS:
            return None
        module = import_quickly(f"bubblefit.cli.{COMMANDS[name][0]}")
        return terminal.with_common_options(getattr(module, f"{name}_command"))

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of commands with a line on each, without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, text) for name, (_, text) in COMMANDS.items()])


@click.group(
    "bubblefit",
    cls=LazyGroup,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog=terminal.examples(
        "bubblefit init mine", "bubblefit fit mine/project.toml", "bubblefit fit --help"
    ),
)
@click.version_option(__version__, prog_name="bubblefit")
@click.option("--verbose", is_flag=True, help=terminal.VERBOSE)
def main(verbose: bool) -> None:
    """Identify the material law of a coated fabric from tests.

    Exit codes: 0 success, 1 fit worse than --fail-above, 2 bad input, 3 no feasible start found,
    4 the solver failed, 130 interrupted, 141 nobody reads the output.
    """
    terminal.listen(verbose)
