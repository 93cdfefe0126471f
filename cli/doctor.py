"""`bubblefit doctor`: which solvers are here, and do they carry the law?"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from ..errors import InputError
from ..solvers.bars import diagnose
from ..solvers.base import Diagnosis
from ..solvers.registry import command_line, solver_names
from .examples import examples
from .exits import exits

UNUSABLE = 4


def _programs(command: Callable[..., Any]) -> Callable[..., Any]:
    """An option a solver that has a program, to look at that one."""
    for one in reversed(command_line()):
        if one.look:
            command = click.option(f"--{one.name}", metavar=one.metavar, help=one.look)(command)
    return command


@click.command(
    "doctor",
    epilog=examples(
        "bubblefit doctor",
        "bubblefit doctor --ccx /opt/ccx/bin/ccx --json",
    ),
)
@_programs
@click.option("--solver", metavar="NAME", help="A solver, such as a plug-in, that has to work.")
@click.option("--json", "as_json", is_flag=True, help="Print the findings on stdout as JSON.")
@exits
def command(solver: str | None, as_json: bool, **programs: str | None) -> None:
    """List every solver found and prove each with bars whose end stresses are published.

    Exit code 0 when the embedded solver works and so does every other one that was named (--ccx,
    BUBBLEFIT_CCX, --marc, BUBBLEFIT_MARC, --solver) or built (make calculix); 4 otherwise. A ccx
    or Marc that merely lies on the PATH, or a plug-in that is installed, is reported, but does not
    count.
    """
    if solver is not None and solver not in (names := solver_names()):
        raise InputError(None, "--solver", f"{solver!r} is not one of: {', '.join(names)}")
    found = diagnose(**programs)
    good = all(one.usable for one in found if one.expected)
    if solver is not None:
        good = good and any(one.usable for one in found if one.name == solver)
    if as_json:
        solvers = [{**asdict(one), "path": _text(one.path)} for one in found]
        click.echo(json.dumps({"ok": good, "solvers": solvers}, indent=1))
    else:
        for one in found:
            click.echo(_line(one))
            if one.advice:
                click.echo(f"{'':10}  {one.advice}")
        if not any(one.name == "calculix" and one.usable for one in found):
            click.echo("Fits work without CalculiX; it is the reference to check them against.")
    if not good:
        sys.exit(UNUSABLE)


def _line(one: Diagnosis) -> str:
    state = "ok" if one.usable else "NOT USABLE"
    where = f"{one.path} ({one.origin})" if one.path else one.origin
    words = [f"{one.name:10}  {state}", f"version {one.version}" if one.version else "", where]
    words.append(one.remark)
    if one.difference is not None:
        words.append(f"bars within {100 * one.difference:.4f} % of Marc")
    return "  ".join(word for word in words if word)


def _text(path: Path | None) -> str | None:
    return None if path is None else str(path)
