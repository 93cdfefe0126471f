"""`bubblefit bubble PROJECT.toml`: fit a material to a bubble inflation test."""

from __future__ import annotations

import functools
import time
from typing import Any

import click

from ..projects.bubble import read_project
from ..studies.bubble_figures import report
from ..studies.bubble_results import assess, summary, write_numbers
from ..studies.bubble_setup import bubble_problem, bubble_setup
from ..studies.fingerprint import fingerprint
from ..studies.results import write_result
from .fitting import run_study, study_options, tell, with_options


@click.command("bubble")
@study_options
def command(**options: Any) -> None:
    """Fit the moduli of PROJECT.toml to its bubble inflation test, from many starts.

    Writes result.json, material.toml, history.csv, surfaces.csv, figures, report.html and
    bubble.vtu into the output folder.
    """
    begun = time.perf_counter()
    project = with_options(read_project(options["project"], options["data"]), options)
    setup = bubble_setup(project)
    build = functools.partial(bubble_problem, project, setup.fields)
    mark = fingerprint(project, setup.problem)
    folder, records = run_study(project, setup.problem, build, mark, options)
    found = assess(project, setup, records, time.perf_counter() - begun)
    write_numbers(project, setup, found, folder)
    report(project, setup, found, folder)
    write_result(found.result, folder)
    tell(found.result, summary(found, folder.path), options["fail_above"], options["as_json"])
