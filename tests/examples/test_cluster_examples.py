"""Files for queues and workflows: what they submit is what the queue and the command take."""

from __future__ import annotations

import os
import re
import runpy
import shlex
import subprocess
from pathlib import Path
from typing import Any

import pytest
from bubblefit.cli.fits import fit_command as command

from .. import needs
from ..places import ROOT

HERE = ROOT / "examples" / "cluster"


def options_of(words: list[str]) -> dict[str, Any]:
    """What `bubblefit fit` makes of the words; click refuses what it does not know."""
    assert words[:2] == ["bubblefit", "fit"]
    return command.make_context("fit", words[2:]).params


def test_jobs_of_a_queue_are_workers_that_hold_a_licence():
    jobqueue: Any = needs.library("dask_jobqueue")
    example = runpy.run_path(str(HERE / "queue_fit.py"))
    more = {
        "job_extra_directives": example["MORE"],
        "scheduler_options": {"dashboard_address": ":0"},
    }
    for name, mark in {"SLURMCluster": "#SBATCH", "PBSCluster": "#PBS"}.items():
        with getattr(jobqueue, name)(**example["JOB"], **more) as cluster:
            script = cluster.job_script()
            assert cluster.scheduler_address in script
        assert f"{mark} -L marc:1\n" in script and "--nthreads 1 " in script
        assert "12:00:00" in script


@pytest.mark.parametrize("going_on", [False, True])
def test_an_array_of_jobs_is_a_seed_each(tmp_path, going_on):
    program = tmp_path / "bubblefit"
    program.write_text('#!/bin/sh\nprintf "%s\\n" bubblefit "$@"\n')
    program.chmod(0o755)
    out = tmp_path / "an out"
    if going_on:
        (out / "seed-7").mkdir(parents=True)
        (out / "seed-7" / "run.json").touch()
    environment = {"PATH": f"{tmp_path}:{os.environ['PATH']}", "SLURM_ARRAY_TASK_ID": "7"}
    script = [HERE / "slurm.sh", "my project.toml", out]
    said = subprocess.run(script, env=environment, check=True, capture_output=True, text=True)
    options = options_of(said.stdout.splitlines())
    assert options["project"] == Path("my project.toml")
    assert (options["seed"], options["starts"], options["jobs"]) == (7, 5, 1)
    assert (options["out"], options["resume"]) == (out / "seed-7", going_on)
    assert "#SBATCH --licenses=marc:1\n" in (HERE / "slurm.sh").read_text()


def test_a_workflow_runs_what_the_command_takes():
    text = (HERE / "Snakefile").read_text()
    shell = text[text.index("    shell:") :]
    words = "".join(re.findall(r'"(.*)"', shell))
    filled = words.replace("{input:q}", "project.toml").replace("{wildcards.seed}", "3")
    options = options_of(shlex.split(filled))
    assert (options["seed"], options["jobs"], options["out"]) == (3, 1, Path("out/seed-3"))
    assert options["overwrite"] and "marc=1" in text
