"""The wheel: everything the commands need, nothing else, and it works outside the repository."""

import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())


def test_every_package_is_listed():
    found = {
        ".".join(("bubblefit", *init.parent.relative_to(ROOT).parts))
        for init in ROOT.glob("**/__init__.py")
        if not {".venv", "build", "tests", "out"} & set(init.relative_to(ROOT).parts)
    }
    assert found == set(PROJECT["tool"]["setuptools"]["packages"])


def test_make_and_ci_agree():
    run = (ROOT / ".ci" / "run").read_text()
    assert "make lint" in run and "make test" in run
    makefile = (ROOT / "Makefile").read_text()
    for target in ("demo:", "test:", "lint:", "bench:"):
        assert f"\n{target}" in makefile


@pytest.mark.slow
def test_the_wheel_works_in_an_empty_environment(tmp_path):
    # A copy, so that building leaves nothing in the repository.
    tracked = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    source = tmp_path / "source"
    for name in filter(None, tracked.stdout.split("\0")):
        if (ROOT / name).exists():
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            (source / name).write_bytes((ROOT / name).read_bytes())
    build = [sys.executable, "-m", "build", "--wheel", "--outdir", str(tmp_path / "dist")]
    subprocess.run([*build, str(source)], check=True, capture_output=True)
    (wheel,) = (tmp_path / "dist").glob("*.whl")
    names = set(zipfile.ZipFile(wheel).namelist())
    for needed in (
        "bubblefit/templates/report/report.html.j2",
        "bubblefit/examples/bubble-known-solution/project.toml",
        "bubblefit/examples/bubble-valmex7318/test3-cubic.toml",
        "bubblefit/solvers/membrane/kernel.py",
        "bubblefit/py.typed",
    ):
        assert needed in names
    assert not [n for n in names if n.startswith(("bubblefit/tests", "bubblefit/benchmarks"))]
    assert all(n.startswith(("bubblefit/", "bubblefit-")) for n in names)
    # Empty but for the dependencies, which a link to this environment's packages provides.
    home = tmp_path / "venv"
    subprocess.run([sys.executable, "-m", "venv", str(home)], check=True)
    python = home / "bin" / "python"
    pip = [str(python), "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", str(wheel)]
    subprocess.run(pip, check=True)
    where = "import site; print(site.getsitepackages()[0])"
    ours = subprocess.run([sys.executable, "-c", where], capture_output=True, text=True)
    theirs = subprocess.run([python, "-c", where], capture_output=True, text=True)
    # A .pth line is only a path: the editable install's own .pth in there is not read.
    (Path(theirs.stdout.strip()) / "dependencies.pth").write_text(ours.stdout)
    command = home / "bin" / "bubblefit"
    place = subprocess.run(
        [python, "-c", "import bubblefit; print(bubblefit.__file__)"],
        cwd=tmp_path, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert place.stdout.startswith(str(home))
    subprocess.run([command, "init", "mine"], cwd=tmp_path, check=True)
    project = tmp_path / "mine" / "project.toml"
    project.write_text(project.read_text().replace("elements = 800", "elements = 48"))
    subprocess.run([command, "bubble", project, "--starts", "1"], cwd=tmp_path, check=True)
    assert (tmp_path / "out" / "mine" / "report.html").exists()
