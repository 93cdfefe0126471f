"""The command `verify`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from .options import OVERWRITE, out_option, reserved_folder
from .terminal import WORSE, command, show, written_to

if TYPE_CHECKING:
    from ..runs.verification import Number

COLUMNS = f"{'':58}{'ours':>12}  {'theirs':>12}       {'off':>10}  {'allowed':>9}  source"


class SubjectOption(click.Option):
    """The option --subject, whose help names the subjects."""

    def get_help_record(self, ctx: click.Context) -> tuple[str, str] | None:
        from ..runs.verification import SUBJECTS

        self.help = f"One of: {', '.join(SUBJECTS)}.  [all]"
        return super().get_help_record(ctx)


@command("verify", "bubblefit verify", "bubblefit verify --subject bars --subject hencky")
@click.option(
    "--subject",
    "subjects",
    multiple=True,
    metavar="NAME",
    cls=SubjectOption,
)
@click.option(
    "--data",
    type=Path,
    metavar="FOLDER",
    help="Measured strips (valmex7318_load_gauge.csv), for Table 3.1's R^2.",
)
@out_option("out/verified")
@OVERWRITE
@click.option("--json", "as_json", is_flag=True, help="Print the numbers on stdout as JSON.")
def verify_command(
    subjects: Sequence[str],
    data: Path | None,
    out: Path | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Compare with published numbers and closed forms. Takes a few minutes.

    Exit code 1 when a number is further off than its model, mesh or figure allows. CalculiX takes
    part where `bubblefit doctor` finds a usable one.
    """
    from ..runs.folder import check_unused
    from ..runs.verification.verify import verify

    folder = out or Path("out/verified")
    check_unused(folder, resume=False, overwrite=overwrite)
    reserved_folder(folder)
    heads = iter([COLUMNS])

    def print_numbers(subject: str, numbers: Sequence[Number]) -> None:
        if as_json:
            return
        for head in heads:  # once
            click.echo(head)
        if not numbers:
            click.echo(f"{subject}: not here (bubblefit doctor says why), nothing compared")
        for number in numbers:
            click.echo(_number_line(number))

    verification = verify(subjects or None, data=data, saw=print_numbers)
    verification.report(folder, overwrite=overwrite)
    show(verification.result, [*verification.verdict.lines, written_to(folder)], as_json)
    if verification.missed:
        sys.exit(WORSE)


def _number_line(number: Number) -> str:
    """Return the line of the terminal about a number that is compared."""
    factor = 1.0 if number.absolute else 100.0
    unit = number.unit if number.absolute else "%"
    return (
        f"{number.quantity:58}{number.ours:12.6g}  {number.theirs:12.6g} {number.unit:5}"
        f"{factor * number.deviation:+10.4f} {unit:2}{factor * number.allowed:8.4g}"
        f"  {number.source}{'' if number.met else '   MISSED'}"
    )
