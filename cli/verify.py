"""`bubblefit verify`: published and closed-form numbers beside ours."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path

import click

from ..runs.verification import SUBJECTS, numbers
from ..runs.verification.number import Number
from .examples import examples
from .exits import WORSE, exits

COLUMNS = f"{'':58}{'ours':>12}  {'theirs':>12}       {'off':>10}  {'allowed':>9}  source"


@click.command(
    "verify",
    epilog=examples(
        "bubblefit verify",
        "bubblefit verify --subject bars --subject hencky",
    ),
)
@click.option("--subject", "subjects", multiple=True, metavar="NAME",
              help=f"Only this one: {', '.join(SUBJECTS)}.  [all]")  # fmt: skip
@click.option("--data", type=Path, metavar="FOLDER",
              help="Measured strips (valmex7318_load_gauge.csv), for Table 3.1's R^2.")  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print the numbers on stdout as JSON.")
@exits
def command(subjects: Sequence[str], data: Path | None, as_json: bool) -> None:
    """Compute what others have published or a closed form gives, and compare. A few minutes.

    Exit code 1 when a number is further off than its model, mesh or figure allows. CalculiX takes
    part where `bubblefit doctor` finds a usable one.
    """
    found: list[tuple[str, Number]] = []
    for subject, some in numbers(subjects or SUBJECTS, data):
        if not (as_json or found):
            click.echo(COLUMNS)
        found += [(subject, one) for one in some]
        if as_json:
            continue
        for one in some:
            click.echo(_line(one))
        if not some:
            click.echo(f"{subject}: not here (bubblefit doctor says why), nothing compared")
    missed = [one for _, one in found if not one.met]
    if as_json:
        rows = [{"subject": subject, **one.row} for subject, one in found]
        click.echo(json.dumps({"ok": not missed, "numbers": rows}, indent=1))
    else:
        click.echo(_summary(len(found), missed))
    if missed:
        sys.exit(WORSE)


def _line(one: Number) -> str:
    factor, unit = (1.0, one.unit) if one.absolute else (100.0, "%")
    return (
        f"{one.what:58}{one.ours:12.6g}  {one.theirs:12.6g} {one.unit:5}"
        f"{factor * one.deviation:+10.4f} {unit:2}{factor * one.allowed:8.4g}  {one.source}"
        f"{'' if one.met else '   MISSED'}"
    )


def _summary(count: int, missed: Sequence[Number]) -> str:
    if not missed:
        return f"all {count} numbers are met"
    return f"{len(missed)} of {count} missed: {'; '.join(one.what for one in missed)}"
