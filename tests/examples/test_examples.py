"""Examples as they are written: pipelines in a clean folder, files for queues, the notebook.

Left out: `pip install` (it would fetch bubblefit), and what needs a container engine or makes users
(FROM, RUN, VOLUME, USER, WORKDIR).
"""

import asyncio
import json
import os
import re
import runpy
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest
import yaml
from bubblefit.cli.fits import fit_command
from jupyter_client import AsyncKernelManager
from nbclient import NotebookClient

from ..support import needs
from ..support.commands import write_program
from ..support.paths import EXAMPLES, ROOT

BATCH = EXAMPLES / "batch"


PYPROJECT = ROOT / "pyproject.toml"


@pytest.fixture(scope="module")
def environment(tmp_path_factory):
    """No terminal's, no home; `bubblefit` on the PATH is this one."""
    folder = tmp_path_factory.mktemp("bin")
    code = "from bubblefit.cli.main import main; main(prog_name='bubblefit')"
    write_program(folder / "bubblefit", f'#!/bin/sh\nexec "{sys.executable}" -c "{code}" "$@"\n')
    names = ("PYTHONPATH", "PYTHONPYCACHEPREFIX", "TMPDIR")
    kept = {k: v for k, v in os.environ.items() if k in names}
    cache = os.environ.get("BUBBLEFIT_CACHE") or str(Path.home() / ".cache" / "bubblefit")
    path = f"{folder}:{Path(sys.executable).parent}:/usr/bin:/bin"
    home = {"HOME": "/proc/none", "LC_ALL": "C", "BUBBLEFIT_CACHE": cache}
    return {**kept, **home, "PATH": path}


def options_of(words):
    """What `bubblefit fit` makes of the words; click refuses what it does not know."""
    assert words[0] == "fit"
    return fit_command.make_context("fit", words[1:]).params


CLUSTER = EXAMPLES / "cluster"


def test_queued_jobs_are_workers_that_hold_a_licence():
    jobqueue = needs.library("dask_jobqueue")
    example = runpy.run_path(str(CLUSTER / "queue_fit.py"))
    more = {
        "job_extra_directives": example["MORE"],
        "scheduler_options": {"dashboard_address": ":0"},
    }
    for name, mark in {"SLURMCluster": "#SBATCH", "PBSCluster": "#PBS"}.items():
        with getattr(jobqueue, name)(**example["JOB"], **more) as cluster:
            job_script = cluster.job_script()
            assert cluster.scheduler_address in job_script
        assert f"{mark} -L marc:1\n" in job_script and "--nthreads 1 " in job_script
        assert "12:00:00" in job_script


@pytest.mark.parametrize("going_on", [False, True])
def test_array_of_jobs_gives_each_job_its_seed(tmp_path, going_on):
    write_program(tmp_path / "bubblefit", '#!/bin/sh\nprintf "%s\\n" "$@"\n')
    out = tmp_path / "an out"
    if going_on:
        (out / "seed-7").mkdir(parents=True)
        (out / "seed-7" / "run.json").touch()
    environment = {"PATH": f"{tmp_path}:{os.environ['PATH']}", "SLURM_ARRAY_TASK_ID": "7"}
    job_script = [CLUSTER / "slurm.sh", "my project.toml", out]
    said = subprocess.run(job_script, env=environment, check=True, capture_output=True, text=True)
    options = options_of(said.stdout.splitlines())
    assert options["project"] == Path("my project.toml")
    assert (options["seed"], options["starts"], options["jobs"]) == (7, 5, 1)
    assert (options["out"], options["resume"]) == (out / "seed-7", going_on)
    assert "#SBATCH --licenses=marc:1\n" in (CLUSTER / "slurm.sh").read_text()


def test_workflows_run_commands_with_valid_options():
    text = (CLUSTER / "Snakefile").read_text()
    shell = text[text.index("    shell:") :]
    words = "".join(re.findall(r'"(.*)"', shell))
    filled = words.replace("{input:q}", "project.toml").replace("{wildcards.seed}", "3")
    options = options_of(shlex.split(filled)[1:])
    assert (options["seed"], options["jobs"], options["out"]) == (3, 1, Path("out/seed-3"))
    assert options["overwrite"] and "marc=1" in text


NOTEBOOK = EXAMPLES / "notebook" / "first-fit.ipynb"
#: Numbers of starts, samples and quads in notebooks, and fewer of them: no test looks at results.
FEWER = {
    "fit(project, starts=2": "fit(project, starts=1",
    '"specimens", 60': '"specimens", 10',
    "elements=108": "elements=48",
}


@pytest.fixture(scope="module")
def kernel():
    """A kernel that all notebooks share, as each would need seconds to import and compile."""
    manager = AsyncKernelManager(kernel_name="python3")
    yield manager
    asyncio.run(manager.shutdown_kernel(now=True))


def executed(path, kernel):
    """Return the notebook after a run in its folder, where nothing of another one is known."""
    notebook = nbformat.read(path, as_version=4)
    notebook.cells.insert(0, nbformat.v4.new_code_cell(f"%reset -f\n%cd -q {path.parent}"))
    for cell in notebook.cells:
        for number, smaller in FEWER.items():
            cell.source = cell.source.replace(number, smaller)
    before = {own.name for own in path.parent.iterdir()}
    NotebookClient(notebook, timeout=300, km=kernel).execute()
    assert {own.name for own in path.parent.iterdir()} == before
    return notebook


@pytest.mark.slow
def test_notebook_runs(kernel):
    notebook = executed(NOTEBOOK, kernel)
    said = "".join(
        str(output.get("text") or output.get("data", {}).get("text/plain"))
        for cell in notebook.cells
        for output in cell.get("outputs", ())
    )
    assert "start 1: converged" in said and "'300 kPa': 39.8" in said
    for name in ("read_project", "fit", "read_card", "simulate"):
        assert f"bf.{name}(" in NOTEBOOK.read_text()


GALLERY = sorted((EXAMPLES / "gallery").glob("*.ipynb"))


@pytest.mark.slow
@pytest.mark.parametrize("path", GALLERY, ids=lambda path: path.stem)
def test_gallery_runs(path, kernel):
    """Run without an error, with the drawings that are stored, and leave nothing behind."""
    stored = [len(drawings(cell)) for cell in nbformat.read(path, as_version=4).cells]
    assert [len(drawings(cell)) for cell in executed(path, kernel).cells[1:]] == stored


def test_gallery_is_eight_short_notebooks_with_pictures():
    listed = (EXAMPLES / "gallery" / "README.md").read_text()
    assert len(GALLERY) == 8
    for path in GALLERY:
        notebook = nbformat.read(path, as_version=4)
        assert len(notebook.cells) <= 25 and f"]({path.name})" in listed
        assert sum(len(drawings(cell)) for cell in notebook.cells) >= 2
        assert not [o for cell in notebook.cells for o in cell.get("outputs", ()) if "ename" in o]


def drawings(cell):
    """The drawings that a cell gave."""
    given = (output.get("data", {}) for output in cell.get("outputs", ()))
    return [data["image/svg+xml"] for data in given if "image/svg+xml" in data]


def steps_of_github():
    job = yaml.safe_load((BATCH / "github.yml").read_text())["jobs"]["fit"]
    return job, [step["run"] for step in job["steps"] if "run" in step]


def test_github_workflow_runs_its_steps(tmp_path, environment):
    """Each step by a shell as CI does, and it has to end well; the cache is that of the tests."""
    job, (install, *steps) = steps_of_github()
    assert install == "python -m pip install bubblefit" and len(steps) == 3
    assert job["env"].keys() == {"BUBBLEFIT_CACHE"}
    shutil.copy(BATCH / "project.toml", tmp_path)
    for step in steps:
        done = subprocess.run(
            ["/bin/sh", "-e", "-c", step], cwd=tmp_path, env=environment,
            stdin=subprocess.DEVNULL, capture_output=True, text=True,
        )  # fmt: skip
        assert done.returncode == 0, (step, done.stderr)
    assert json.loads((tmp_path / "check.json").read_text())
    assert json.loads((tmp_path / "result.json").read_text())["objective"] < 1e-3
    events = [json.loads(line) for line in (tmp_path / "events.jsonl").read_text().splitlines()]
    assert events[0]["event"] == "begin" and events[-1]["exit_code"] == 0
    assert (tmp_path / "out" / "report.html").is_file()
    assert "E1" in (tmp_path / "moduli.csv").read_text()
    (upload,) = [step for step in job["steps"] if "upload" in step.get("uses", "")]
    for name in upload["with"]["path"].split():
        assert (tmp_path / name).exists()


def test_gitlab_pipeline_equals_github_workflow():
    job = yaml.safe_load((BATCH / "gitlab-ci.yml").read_text())["fit"]
    ours = [*job["before_script"], *job["script"]]
    plain = [[" ".join(s.replace("\\\n", " ").split()) for s in one]
             for one in (ours, steps_of_github()[1])]  # fmt: skip
    assert plain[0] == plain[1]
    assert job["variables"].keys() == {"BUBBLEFIT_CACHE"}
    assert job["artifacts"]["paths"] == ["out", "result.json", "events.jsonl", "moduli.csv"]


def test_pipeline_runs_with_blanks_umlauts_no_home_and_read_only_project(tmp_path, environment):
    folder, out = tmp_path / "nur lesen ü", tmp_path / "aus ß"
    folder.mkdir()
    shutil.copy(BATCH / "project.toml", folder / "Prüfung 1.toml")
    for path in (*folder.iterdir(), folder):
        path.chmod(0o555 if path.is_dir() else 0o444)
    # Root heeds what may be written only without this capability.
    drop = ["setpriv", "--bounding-set=-dac_override"] if os.geteuid() == 0 else []
    arguments = ["fit", folder / "Prüfung 1.toml", "--starts", "1", "--jobs", "1", "--out", out]
    done = subprocess.run(
        [*drop, sys.executable, "-m", "bubblefit", *arguments, "--json"], cwd=tmp_path,
        env=environment, stdin=subprocess.DEVNULL, capture_output=True,
    )  # fmt: skip
    folder.chmod(0o755)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["objective"] < 1e-3 and not done.stderr
    assert (out / "material.toml").is_file() and len(list(folder.iterdir())) == 1


def test_workflows_of_three_platforms_name_existing_tests():
    job = yaml.safe_load((BATCH / "platforms.yml").read_text())["jobs"]["quick"]
    assert job["strategy"]["matrix"]["os"] == ["ubuntu-latest", "macos-latest", "windows-latest"]
    steps = [step["run"] for step in job["steps"] if "run" in step]
    extra = re.search(r"\[(\w+)\]", steps[0])[1]
    assert f"\n{extra} = [" in PYPROJECT.read_text()
    paths = [word for word in steps[1].split() if word.startswith("tests/")]
    assert len(paths) == 7 and all((ROOT / path).exists() for path in paths)


def test_wheels_are_built_on_three_platforms_for_the_declared_versions_of_python():
    job = yaml.safe_load((BATCH / "wheels.yml").read_text())["jobs"]["wheel"]
    matrix = job["strategy"]["matrix"]
    assert matrix["os"] == ["ubuntu-latest", "macos-latest", "windows-latest"]
    declared = re.findall(r'"Programming Language :: Python :: (3\.\d+)"', PYPROJECT.read_text())
    assert matrix["python"] == declared and len(declared) > 1
    (trial,) = (step["run"] for step in job["steps"] if "bubblefit init" in step.get("run", ""))
    typed = [line.split() for line in trial.splitlines() if line.startswith("bubblefit ")]
    assert [words[1] for words in typed] == ["verify", "init", "fit"]
