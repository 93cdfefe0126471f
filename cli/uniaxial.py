"""`bubblefit uniaxial PROJECT.toml`: fit a material to warp, fill and bias strip tests."""

from __future__ import annotations

import functools
import time
from typing import Any

import click

from ..projects.uniaxial import read_uniaxial
from ..studies.fingerprint import fingerprint
from ..studies.results import write_result
from ..studies.uniaxial_figures import report_uniaxial
from ..studies.uniaxial_results import assess_uniaxial, uniaxial_summary, write_uniaxial_numbers
from ..studies.uniaxial_setup import uniaxial_problem, uniaxial_setup
from .fitting import run_study, study_options, tell, with_options


@click.command("uniaxial")
@study_options
def command(**options: Any) -> None:
    """Fit the moduli of PROJECT.toml to its strip tests, from many starts.

    Writes result.json, material.toml, history.csv, loads.csv, figures, report.html and bias.vtu
    into the output folder.
    """
    begun = time.perf_counter()
    project = with_options(read_uniaxial(options["project"], options["data"]), options)
    setup = uniaxial_setup(project)
    build = functools.partial(uniaxial_problem, project)
    mark = fingerprint(project, setup.problem)
    folder, records = run_study(project, setup.problem, build, mark, options)
    found = assess_uniaxial(project, setup, records, time.perf_counter() - begun)
    write_uniaxial_numbers(project, setup, found, folder)
    report_uniaxial(project, setup, found, folder)
    write_result(found.result, folder)
    words = uniaxial_summary(found, folder.path)
    tell(found.result, words, options["fail_above"], options["as_json"])
