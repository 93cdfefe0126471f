"""The command `check`, whose help imports nothing of what it runs."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import click

from ..errors import InputError, Problems
from . import options as common
from .terminal import command, complain, show, written_to

if TYPE_CHECKING:
    from ..project.project import Project


@command(
    "check",
    "bubblefit check project.toml",
    "bubblefit check project.toml --test bubble --trust preload",
)
@common.PROJECT
@common.TESTS
@common.out_option("out/NAME-check")
@common.DATA
@common.TRUST
@click.option("--json", "as_json", is_flag=True, help="Print check.json on stdout.")
@common.QUIET
def check_command(**options: Any) -> None:
    """Check the data of PROJECT.toml, as every fit does before it begins.

    Finds common faults of measured data: wrong units, flipped or swapped axes, coordinates of
    the deformed sheet, rejected points at zero, frames repeated or out of order, a frame that is
    turned, tilted or off the centre, preload, rows after failure. Writes pictures and tables into
    the output folder. Exit code 2 where a fit would not begin.
    """
    from ..project.project import read_readable_tests

    problems = Problems()
    project: Project | None = None
    with problems.collected():
        data = common.data_folders(options["data"])
        project = read_readable_tests(options["project"], data, problems)
    unread = list(problems.errors)
    sound = False
    if project is not None and (project.tests or not unread):
        with problems.collected():
            sound = _check_tests(project, options)
    # What the tests together lack may be in one that could not be read.
    errors = [e for e in problems.errors if e in unread or not unread or e.field not in OF_ALL]
    for error in errors[:-1]:
        complain(error)
    if errors:
        raise errors[-1]
    if not sound:
        sys.exit(InputError.exit_code)


#: Fields of errors about all tests of a project.
OF_ALL = ("law.strain_range", "--test", "")


def _check_tests(project: Project, options: Mapping[str, Any]) -> bool:
    """Check the tests that could be read, print what is doubtful; return whether a fit begins."""
    from ..runs.check import check

    folder = common.folder_of(options, "check")
    with common.LiveLine("steps", common.quiet(options)) as progress:
        checks = check(
            project, options["tests"] or None, options["trust"], out=folder, progress=progress
        )
    show(checks.result, [*checks.lines(), written_to(folder)], options["as_json"])
    return checks.sound
