"""The steps of examples/batch as they are written, in a clean folder, with the command of here.

Left out: `pip install` (it would fetch bubblefit), and what needs a container engine or makes users
(FROM, RUN, VOLUME, USER, WORKDIR).
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from ..places import EXAMPLES, ROOT

BATCH = EXAMPLES / "batch"


@pytest.fixture(scope="module")
def environment(tmp_path_factory):
    """No terminal's, no home; `bubblefit` on the PATH is this one."""
    folder = tmp_path_factory.mktemp("bin")
    command = folder / "bubblefit"
    code = "from bubblefit.cli.main import main; main(prog_name='bubblefit')"
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -c "{code}" "$@"\n')
    command.chmod(0o755)
    kept = {k: v for k, v in os.environ.items() if k in ("PYTHONPATH", "TMPDIR")}
    cache = os.environ.get("BUBBLEFIT_CACHE") or str(Path.home() / ".cache" / "bubblefit")
    path = f"{folder}:{Path(sys.executable).parent}:/usr/bin:/bin"
    return {**kept, "PATH": path, "HOME": "/proc/none", "LC_ALL": "C", "CACHE": cache}


def run(steps: list[str], folder: Path, environment: dict[str, str], declared: dict[str, str]):
    """Each step by a shell as CI does, and it has to end well; the cache is that of the tests."""
    assert declared.keys() == {"BUBBLEFIT_CACHE"}
    given = {**environment, "BUBBLEFIT_CACHE": environment["CACHE"]}
    shutil.copy(BATCH / "project.toml", folder)
    for step in steps:
        done = subprocess.run(
            ["/bin/sh", "-e", "-c", step], cwd=folder, env=given, stdin=subprocess.DEVNULL,
            capture_output=True, text=True,
        )  # fmt: skip
        assert done.returncode == 0, (step, done.stderr)


def installs(step: str) -> bool:
    return step == "python -m pip install bubblefit"


def check(folder: Path) -> None:
    """What every pipeline leaves."""
    assert json.loads((folder / "check.json").read_text())
    assert json.loads((folder / "result.json").read_text())["objective"] < 1e-3
    events = [json.loads(line) for line in (folder / "events.jsonl").read_text().splitlines()]
    assert events[0]["event"] == "begin" and events[-1]["exit_code"] == 0
    assert (folder / "out" / "report.html").is_file()
    assert "E1" in (folder / "moduli.csv").read_text()


def job_of_github() -> dict[str, Any]:
    job: dict[str, Any] = yaml.safe_load((BATCH / "github.yml").read_text())["jobs"]["fit"]
    return job


def test_github_runs_its_steps(tmp_path, environment):
    job = job_of_github()
    steps = [step["run"] for step in job["steps"] if "run" in step]
    assert installs(steps[0]) and len(steps) == 4
    run(steps[1:], tmp_path, environment, job["env"])
    check(tmp_path)
    (upload,) = [step for step in job["steps"] if "upload" in step.get("uses", "")]
    for name in upload["with"]["path"].split():
        assert (tmp_path / name).exists()


def test_gitlab_says_the_same(environment):
    job = yaml.safe_load((BATCH / "gitlab-ci.yml").read_text())["fit"]
    theirs = [step["run"] for step in job_of_github()["steps"] if "run" in step]

    def plain(step):
        return " ".join(step.replace("\\\n", " ").split())

    assert [plain(s) for s in (*job["before_script"], *job["script"])] == list(map(plain, theirs))
    assert job["variables"].keys() == {"BUBBLEFIT_CACHE"}
    assert job["artifacts"]["paths"] == ["out", "result.json", "events.jsonl", "moduli.csv"]


def test_the_image_starts_the_command(tmp_path, environment):
    text = (BATCH / "Containerfile").read_text()
    words = dict(re.findall(r"^(ENTRYPOINT|CMD|USER|ENV|FROM) (.*)$", text, flags=re.M))
    assert words["USER"] == "fabric" and words["FROM"].endswith("-slim")
    given = dict(part.split("=") for part in words["ENV"].split())
    assert given.pop("BUBBLEFIT_CACHE") == "/cache"
    entry, usual = json.loads(words["ENTRYPOINT"]), json.loads(words["CMD"])
    done = subprocess.run([*entry, *usual], env={**environment, **given}, capture_output=True)
    assert done.returncode == 0 and b"Usage: bubblefit" in done.stdout
    # The command that its head says, less the engine's own part.
    head = " ".join(line[1:] for line in text.splitlines() if line.startswith("#"))
    command = re.search(r"bubblefit \\ +(fit .*?1e-3)", head)
    assert command is not None
    shutil.copy(BATCH / "project.toml", tmp_path)
    arguments = command[1].replace("/out/fit", str(tmp_path / "fit")).split()
    done = subprocess.run(
        [*entry, *arguments], cwd=tmp_path, capture_output=True, text=True,
        env={**environment, **given, "BUBBLEFIT_CACHE": environment["CACHE"]},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "fit" / "material.toml").is_file()


def test_blanks_umlauts_no_home_and_a_read_only_project(tmp_path, environment):
    folder, out = tmp_path / "nur lesen ü", tmp_path / "aus ß"
    folder.mkdir()
    shutil.copy(BATCH / "project.toml", folder / "Prüfung 1.toml")
    for path in (*folder.iterdir(), folder):
        path.chmod(0o555 if path.is_dir() else 0o444)
    # Root heeds what may be written only without this capability.
    drop = ["setpriv", "--bounding-set=-dac_override"] if os.geteuid() == 0 else []
    given = {**environment, "BUBBLEFIT_CACHE": environment["CACHE"]}
    arguments = ["fit", folder / "Prüfung 1.toml", "--starts", "1", "--jobs", "1", "--out", out]
    command = [*drop, sys.executable, "-m", "bubblefit", *arguments, "--json"]
    done = subprocess.run(
        command, cwd=tmp_path, env=given, stdin=subprocess.DEVNULL, capture_output=True
    )
    folder.chmod(0o755)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["objective"] < 1e-3 and not done.stderr
    assert (out / "material.toml").is_file() and len(list(folder.iterdir())) == 1


def test_the_documents_name_what_there_is():
    said = (ROOT / "docs" / "how-to" / "batch.md").read_text()
    for name in ("--events", "--json", "--fail-above", "BUBBLEFIT_CACHE", "TMPDIR"):
        assert name in said
