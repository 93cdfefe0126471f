"""The wheel: everything the commands need, nothing else, and it works outside the repository."""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from email.message import Message
from pathlib import Path
from types import SimpleNamespace

import pytest

from . import needs
from .places import PUBLISHED, ROOT
from .scripts import script

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
#: Folders of the repository that are no part of the package.
OUTSIDE = {"tests", "benchmarks", "docs", "examples", "out", "build", "dist"}
#: Every folder that is a package, found without setuptools.
PACKAGES = {
    ".".join(("bubblefit", *folder.parts))
    for folder in (f.parent.relative_to(ROOT) for f in ROOT.rglob("__init__.py"))
    if not {*folder.parts} & OUTSIDE and not any(p.startswith(".") for p in folder.parts)
}


def pip(python: Path | str, *arguments: Path | str) -> None:
    subprocess.run([python, "-m", "pip", "--quiet", *arguments], check=True)


def site_packages(python: Path | str) -> Path:
    ask = [python, "-c", "import sysconfig; print(sysconfig.get_paths()['purelib'])"]
    return Path(subprocess.run(ask, capture_output=True, text=True, check=True).stdout.strip())


def shipped() -> set[str]:
    """What a wheel of this working tree has to hold, found without setuptools."""
    wanted = {"bubblefit/py.typed", "bubblefit/solvers/calculix/law.c"}
    for package in PACKAGES:
        folder = ROOT.joinpath(*package.split(".")[1:])
        files = [f for f in folder.glob("*.py") if f != ROOT / "setup.py"]
        wanted |= {f"bubblefit/{f.relative_to(ROOT).as_posix()}" for f in files}
    documents = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
    wanted |= {f"bubblefit/{path.relative_to(ROOT).as_posix()}" for path in documents}
    pages = script("docs/make_api.py").PAGES  # made when the wheel is built
    wanted |= {f"bubblefit/docs/reference/api/{name}.md" for name in pages}
    for folder in ("examples", "templates", "runs/verification/published"):
        for file in (ROOT / folder).rglob("*"):
            inside = file.relative_to(ROOT)
            if file.is_file() and not any(p.startswith((".", "out")) for p in inside.parts):
                wanted.add(f"bubblefit/{inside.as_posix()}")
    return wanted


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """Built from a copy of the working tree, so that nothing is left in the repository."""
    place = tmp_path_factory.mktemp("wheel")
    source = place / "source"
    unwanted = shutil.ignore_patterns(".*", "__pycache__", "*.egg-info", "out", "build", "dist")
    shutil.copytree(ROOT, source, ignore=unwanted)
    # Litter as users leave it.
    for name in ("out/demo/result.json", "examples/bubble-known-solution/out/result.json"):
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        (source / name).write_text("{}")
    (source / ".venv" / "lib").mkdir(parents=True)
    (source / ".venv" / "lib" / "junk.py").write_text("")
    # No build isolation: no network is needed, and the sandbox would be the same setuptools.
    options = ("--no-deps", "--no-index", "--no-build-isolation", "--wheel-dir", place)
    pip(sys.executable, "wheel", *options, source)
    (built,) = place.glob("*.whl")
    return built


def test_every_folder_with_modules_is_a_package():
    # Without __init__.py an editable install works and the wheel lacks the folder.
    bare = {
        module.parent.relative_to(ROOT).as_posix()
        for module in ROOT.rglob("*.py")
        if not any(p in OUTSIDE or p[0] == "." for p in module.relative_to(ROOT).parts)
        and not (module.parent / "__init__.py").exists()
        and not module.is_relative_to(ROOT / "examples")
    }
    assert not bare


def test_versions_agree():
    import bubblefit

    assert bubblefit.__version__ == PROJECT["project"]["version"]
    assert f"## {bubblefit.__version__}" in (ROOT / "CHANGELOG.md").read_text()


#: Libraries that take a tenth of a second or more to import, or are not there on every machine.
HEAVY = {"numba", "scipy.optimize", "scipy.stats", "matplotlib", "pandas", "pydantic"} | {
    "gmsh", "nlopt", "dask", "h5py", "jinja2"
}  # fmt: skip


@pytest.mark.parametrize(
    ("module", "absent"),
    [
        ("cli.main", HEAVY),
        ("cli.fits", {"gmsh", "scipy.stats", "dask", "h5py"}),
        ("project.project", HEAVY - {"numba", "nlopt", "pydantic", "jinja2"}),
    ],
)
def test_start_up_loads_only_what_it_needs(module, absent):
    # gmsh needs X and GL libraries; the others make `bubblefit --help` slow.
    code = f"import sys, bubblefit.{module}; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not absent & set(done.stdout.split())


def test_make_and_ci_agree():
    run = (ROOT / ".ci" / "run").read_text()
    assert "make lint" in run and "make test" in run
    makefile = (ROOT / "Makefile").read_text()
    for target in ("demo", "test", "lint", "bench", "calculix", "clean"):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE)


def test_links_of_the_documents_lead_somewhere():
    documents = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *ROOT.glob("examples/*/*.md")]
    for document in documents:
        for target in re.findall(r"\]\(([^)#:]+)\)", document.read_text()):
            assert (document.parent / target).exists(), f"{document.name} -> {target}"


def test_documents_that_speak_of_the_thesis_link_to_it():
    for document in (ROOT / "docs").glob("*/*.md"):
        text = re.sub(r"```.*?```|^    .*?$", "", document.read_text(), flags=re.DOTALL | re.M)
        if re.search(r"\bthe thesis\b", text, re.IGNORECASE):
            assert re.search(r"he thesis\]\([./]*references\.md", text), document


def test_every_key_of_the_project_file_is_documented():
    from bubblefit.project.schema import project_file
    from bubblefit.solvers.registry import solver_sections

    text = (ROOT / "docs" / "reference" / "project-file.md").read_text()

    def sections(annotation):
        if hasattr(annotation, "model_fields"):
            yield annotation
        for inside in getattr(annotation, "__args__", ()):
            yield from sections(inside)

    def keys(model):
        for name, field in model.model_fields.items():
            yield name
            for section in sections(field.annotation):
                yield from keys(section)

    models = (project_file(), *solver_sections().values())
    names = {key for model in models for key in keys(model)}
    missing = {key for key in names if not re.search(rf"\b{key}\b", text)}
    assert not missing


@pytest.mark.slow
def test_the_wheel_holds_the_package_and_nothing_else(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    assert {n for n in names if not re.match(r"bubblefit-[^/]+\.dist-info/", n)} == shipped()
    (licence,) = [n for n in names if n.endswith("LICENSE")]
    assert "MIT License" in zipfile.ZipFile(wheel).read(licence).decode()


@pytest.mark.slow
def test_the_wheel_works_in_an_empty_environment(wheel, tmp_path):
    home = tmp_path / "venv"
    subprocess.run([sys.executable, "-m", "venv", home], check=True)
    python, command = home / "bin" / "python", home / "bin" / "bubblefit"
    pip(python, "install", "--no-deps", "--no-index", wheel)
    # Empty but for the dependencies, borrowed from this environment. A .pth line is only a
    # path: the editable install of bubblefit that hangs on a .pth over there is not read.
    (site_packages(python) / "borrowed.pth").write_text(f"{site_packages(sys.executable)}\n")

    def run(*arguments):
        done = subprocess.run(arguments, cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout

    assert run(python, "-c", "import bubblefit; print(bubblefit.__file__)").startswith(str(home))
    assert PROJECT["project"]["version"] in run(command, "--version")
    run(command, "init", "mine")
    run(command, "init", "measured", "--example", "measured")
    assert (tmp_path / "measured" / "test3-cubic.toml").exists()
    project = tmp_path / "mine" / "project.toml"
    text = project.read_text()
    assert "elements = 800" in text
    project.write_text(text.replace("elements = 800", "elements = 48"))
    run(command, "bubble", project, "--starts", "1", "--jobs", "1")
    assert (tmp_path / "out" / "mine" / "report.html").exists()


@pytest.fixture(scope="module")
def licences():
    return script(".ci/licences.py")


def installed(name: str, licence: str, *requires: str) -> SimpleNamespace:
    about = Message()
    about["License-Expression"] = licence
    return SimpleNamespace(version="1", metadata=about, requires=requires, name=name)


def found(licences, monkeypatch, tmp_path, direct, **there) -> list[str]:
    def distribution(name):
        if name not in there:
            raise licences.PackageNotFoundError(name)
        return there[name]

    monkeypatch.setattr(licences, "distribution", distribution)
    project = {"dependencies": direct, "optional-dependencies": {"dev": ["absent>=1"]}}
    return licences.problems(project, tmp_path)


def test_ours_are_in_order(licences):
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert licences.problems(project, ROOT) == []


def test_what_is_wrong_is_a_line(licences, monkeypatch, tmp_path):
    there = {"a": installed("a", "MIT", "b>=1", 'c>=1; extra == "x"'), "b": installed("b", "AGPL")}
    (line,) = found(licences, monkeypatch, tmp_path, ["a>=1"], **there)
    assert line == "b 1: licence 'AGPL' is none of those in .ci/licences.py"
    there["b"] = installed("b", "BSD-3-Clause")
    assert found(licences, monkeypatch, tmp_path, ["a>=1"], **there) == []
    for text in ("a", "a<2", "a; python_version > '3'"):
        (line,) = found(licences, monkeypatch, tmp_path, [text], **there)
        assert "has no lower bound" in line
    there["a"] = installed("a", "")
    (line,) = found(licences, monkeypatch, tmp_path, ["a>=1"], **there)
    assert "'nothing'" in line


def test_a_file_of_somebody_elses_has_to_be_named(licences, monkeypatch, tmp_path):
    path = tmp_path / "templates" / "plot.js"
    path.parent.mkdir()
    path.write_text("/*! plot.js v1 Copyright (c) Somebody */")
    (line,) = found(licences, monkeypatch, tmp_path, [])
    assert line == "templates/plot.js: is somebody else's file; name it in VENDORED"
    monkeypatch.setitem(licences.VENDORED, "templates/plot.js", "MIT")
    assert found(licences, monkeypatch, tmp_path, []) == []


def test_lint_runs_it():
    lint = Path(ROOT / "Makefile").read_text().split("\nlint:")[1].split("\n\n")[0]
    assert ".ci/licences.py" in lint


SCRIPT = ROOT / ".ci" / "run"


@pytest.fixture
def house(tmp_path):
    """A copy of the script, with a `make` that writes down what it is asked for."""
    (tmp_path / ".ci").mkdir()
    shutil.copy(SCRIPT, tmp_path / ".ci" / "run")
    make = tmp_path / "bin" / "make"
    make.parent.mkdir()
    make.write_text('#!/bin/sh\necho "CI=$CI $*"\n[ "$1" != "$FAULT" ]\n')
    make.chmod(0o755)
    return tmp_path


def run(house: Path, fault: str = "") -> tuple[int, list[str]]:
    """Exit code, and what was made."""
    environment = {name: value for name, value in os.environ.items() if name != "CI"}
    path = f"{house / 'bin'}:{os.environ['PATH']}"
    done = subprocess.run(
        [house / ".ci" / "run"], env={**environment, "PATH": path, "FAULT": fault},
        capture_output=True, text=True,
    )  # fmt: skip
    return done.returncode, done.stdout.splitlines()


def test_it_lints_and_tests_with_ci_set(house):
    code, made = run(house)
    assert code == 0
    assert made == ["CI=1 lint", "CI=1 test", "CI=1 mutants CHANGED=1 MINUTES=3"]


@pytest.mark.parametrize("target", ["lint", "test"])
def test_it_ends_with_the_first_failure(house, target):
    code, made = run(house, target)
    assert code != 0 and made[-1] == f"CI=1 {target}"


def test_mutants_fail_nothing(house):
    code, made = run(house, "mutants")
    assert code == 0 and made[-1] == "mutants: not tried to the end"


def gfortran(folder: Path) -> subprocess.CompletedProcess[str]:
    script = ROOT / ".ci" / "gfortran"
    return subprocess.run(
        ["/bin/sh", script], env={"PATH": str(folder)}, capture_output=True, text=True
    )


def test_gfortran_is_there_or_is_installed_or_named(tmp_path):
    for name in ("dirname", "id", "env"):
        (tmp_path / name).symlink_to(shutil.which(name) or name)
    without = gfortran(tmp_path)
    assert without.returncode == 1
    assert "apt-get install gfortran" in without.stderr
    apt = tmp_path / "apt-get"
    apt.write_text(f'#!/bin/sh\necho "$@" >> {tmp_path}/asked\n')
    apt.chmod(0o755)
    if os.geteuid() == 0:
        assert gfortran(tmp_path).returncode == 0
        assert " gfortran " in (tmp_path / "asked").read_text()
        (tmp_path / "asked").unlink()
    (tmp_path / "gfortran").symlink_to(shutil.which("true") or "true")
    with_it = gfortran(tmp_path)
    assert with_it.returncode == 0 and not with_it.stderr
    assert not (tmp_path / "asked").exists()


#: What leaves a test out, or lets it fail.
WORDS = {"skip", "skipif", "skipIf", "skipUnless", "SkipTest", "importorskip", "xfail"}


def left_out(path: Path) -> list[str]:
    """file:line of every name in WORDS that the code of a file uses."""
    found = []
    for node in ast.walk(ast.parse(path.read_text())):
        imported = [alias.name for alias in getattr(node, "names", []) if hasattr(alias, "name")]
        for name in [getattr(node, "attr", ""), *imported]:
            if name in WORDS:
                found.append(f"{path.relative_to(ROOT)}:{getattr(node, 'lineno', 0)} {name}")
    return found


def test_nothing_else_leaves_a_test_out():
    files = sorted((ROOT / "tests").rglob("*.py"))
    assert len(files) > 150
    found = [line for path in files for line in left_out(path)]
    own = ["tests/needs.py", "tests/test_packaging.py"]  # that place, and the check of it below
    assert [line.split(":")[0] for line in found] == own, found


@pytest.fixture
def bare(monkeypatch, tmp_path):
    """A machine without any program, and without measured data."""
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("BUBBLEFIT_CACHE", str(tmp_path))
    for name in ("CC", "BUBBLEFIT_CCX"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(needs, "SHARED", tmp_path / "shared" / "data")


WANTS = {
    "install gfortran": needs.fortran, "install gcc": needs.c_compiler, "ccx": needs.calculix,
    "no measured data": needs.measured_data,
    "no_such_library cannot be loaded": lambda: needs.library("no_such_library"),
}  # fmt: skip


@pytest.mark.parametrize("words", WANTS)
def test_what_is_missing_skips_here_and_fails_in_ci(words, bare, monkeypatch):
    monkeypatch.delenv("CI", raising=False)
    with pytest.raises(pytest.skip.Exception, match=words):
        WANTS[words]()
    monkeypatch.setenv("CI", "1")
    with pytest.raises(pytest.fail.Exception, match=words):
        WANTS[words]()


def test_every_table_has_a_source_and_says_its_units():
    described = (PUBLISHED / "README.md").read_text()
    tables = sorted(PUBLISHED.glob("*.csv"))
    assert len(tables) == 4
    for table in tables:
        assert f"| `{table.name}` |" in described
        assert table.read_text().startswith("# ")


def test_they_are_those_of_the_data_folder(shared_data):
    there = {path.name: path.read_bytes() for path in (shared_data / "benchmarks").glob("*.csv")}
    assert {path.name: path.read_bytes() for path in PUBLISHED.glob("*.csv")} == there
