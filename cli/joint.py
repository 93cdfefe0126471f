"""`bubblefit joint PROJECT.toml`: fit a material to a bubble and to strips together."""

from __future__ import annotations

import functools
import time
from pathlib import Path
from typing import Any

import click

from ..projects.joint import read_joint
from ..studies.fingerprint import fingerprint
from ..studies.joint_figures import report_joint
from ..studies.joint_results import assess_joint, joint_summary, write_joint_numbers
from ..studies.joint_setup import joint_problem, joint_setup
from ..studies.results import write_result
from .fitting import run_study, study_options, tell, with_options


@click.command("joint")
@click.option(
    "--strip-data", type=click.Path(path_type=Path), help="Folder of the measured load curves."
)
@study_options
def command(strip_data: Path | None, **options: Any) -> None:
    """Fit the moduli of PROJECT.toml to its bubble and strip tests together.

    Writes result.json, material.toml, history.csv, loads.csv, figures, report.html, bias.vtu and
    bubble.vtu into the output folder; says what each data set pins down.
    """
    begun = time.perf_counter()
    read = read_joint(options["project"], options["data"], strip_data)
    project = with_options(read, options)
    setup = joint_setup(project)
    build = functools.partial(joint_problem, project, setup.bubble.fields)
    mark = fingerprint(project, setup.problem)
    folder, records = run_study(project, setup.problem, build, mark, options)
    found = assess_joint(project, setup, records, time.perf_counter() - begun)
    write_joint_numbers(project, setup, found, folder)
    report_joint(project, setup, found, folder)
    write_result(found.result, folder)
    words = joint_summary(found, folder.path)
    tell(found.result, words, options["fail_above"], options["as_json"])
