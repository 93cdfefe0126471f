"""The main path without POSIX, as on Windows; the wheel, which works outside the repository."""

import ast
import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import bubblefit
import pytest
from bubblefit import compilation
from bubblefit.experiments.registry import kind_names
from bubblefit.project.schema import project_file as project_model
from bubblefit.runs import folder
from bubblefit.solvers.process import run_process
from bubblefit.solvers.registry import solver_sections
from bubblefit.storage import folders

from .builders.projects import known_bubble, write_two_camera_exports
from .support.commands import output_of
from .support.paths import NOT_THE_PRODUCT, PUBLISHED, ROOT, load_script

#: Put before a program, and before every interpreter that it starts. The code for this
#: system, platformdirs and numpy need some of these names: they are imported first. SIGKILL stays,
#: by which subprocess and psutil end a process on this system.
WITHOUT = """
import multiprocessing, numpy, os, platformdirs, psutil, signal, sys
for name in ("fcntl", "grp", "pwd", "resource", "termios"):
    sys.modules[name] = None
for name in (
    "chown", "fork", "forkpty", "fchmod", "getpgid", "getpgrp", "getuid", "geteuid", "killpg",
    "mkfifo", "register_at_fork", "sched_getaffinity", "setpgid", "setsid", "uname", "wait",
    "O_CLOEXEC", "O_NOFOLLOW", "O_NONBLOCK",
):
    if hasattr(os, name):
        delattr(os, name)
for name in ("alarm", "pthread_kill", "pthread_sigmask", "setitimer", "sigwait", "SIGALRM",
             "SIGCHLD", "SIGHUP", "SIGPIPE", "SIGQUIT", "SIGUSR1", "SIGUSR2"):
    if hasattr(signal, name):
        delattr(signal, name)
if multiprocessing.get_start_method(allow_none=True) is None:
    multiprocessing.set_start_method("spawn")
"""
FIT = """
import multiprocessing, sys
from pathlib import Path
import bubblefit as bf
from bubblefit.solvers import scratch
assert not hasattr(__import__("os"), "fork")
scratch.MEMORY = Path(sys.argv[2], "no such folder")
if __name__ == "__main__":
    project = bf.read_project(sys.argv[1])
    fit = bf.fit(project, starts=2, jobs=2, out=sys.argv[2])
    assert not multiprocessing.active_children()
    print(fit.objective, len(fit.starts()))
"""
PROGRAM = """
import sys
from pathlib import Path
from bubblefit.solvers import licences, process, scratch
folder = Path(sys.argv[1])
locks = licences.LicenceSettings(licences=1, licence_folder=str(folder / "locks"))
with scratch.run_folder("t", folder, False, "t", "log") as place:
    assert scratch.sweep([folder]) == [] and place.exists()
    words = [sys.executable, "-c", "import time; print('begun', flush=True); time.sleep(60)"]
    ended = process.run_process(words, place, place / "log", timeout=5.0)
    assert ended.timed_out and ended.seconds < 30, ended
    assert process.log_tail(place / "log") == "begun"
assert not place.exists()
"""


def without(program, folder, *arguments):
    site = folder / "site"
    site.mkdir()
    (site / "sitecustomize.py").write_text(WITHOUT)
    (site / "program.py").write_text(program)
    paths = [str(site), *filter(None, sys.path)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    command = (sys.executable, site / "program.py", *arguments)
    return output_of(*command, cwd=folder, env=environment, timeout=300)


def test_a_bubble_is_fitted_by_two_spawned_processes(tmp_path):
    project = known_bubble(tmp_path)
    printed = without(FIT, tmp_path, project, tmp_path / "out").splitlines()[-1].split()
    assert float(printed[0]) >= 0.0 and int(printed[1]) == 2
    assert (tmp_path / "out" / "history.csv").stat().st_size > 0


def test_a_program_is_run_ended_in_time_and_its_folder_removed(tmp_path):
    without(PROGRAM, tmp_path, tmp_path)


def test_what_a_program_started_is_killed_where_there_are_no_groups(tmp_path, monkeypatch):
    monkeypatch.setattr("bubblefit.solvers.process.GROUPS", False)
    shell_text = f'{sys.executable} -c \'import time; time.sleep(3); open("late", "w")\' & sleep 60'
    ended = run_process(["/bin/sh", "-c", shell_text], tmp_path, tmp_path / "log", timeout=0.5)
    assert ended.timed_out
    subprocess.run([sys.executable, "-c", "import time; time.sleep(4)"], check=True)
    assert not (tmp_path / "late").exists()


#: Compiles one kernel that calls another file's functions, and prints what it computes.
KERNEL = """
import numpy as np
from bubblefit.materials.law import HypoelasticLaw
law = HypoelasticLaw.linear(400.0, 250.0, 12.0)
print(law.increment(np.zeros(3), np.array([0.01, 0.0, 0.0]), np.zeros(3))[0])
"""


def run(cache, package=None):
    # Not optimised: what takes long is to compile.
    environment = {**os.environ, "BUBBLEFIT_CACHE": str(cache), "NUMBA_OPT": "0"}
    if package is not None:
        environment["PYTHONPATH"] = str(package)
    return output_of(sys.executable, "-c", KERNEL, env=environment)


def test_where_the_cache_is(monkeypatch):
    named = {"BUBBLEFIT_CACHE": "", "XDG_CACHE_HOME": "bubblefit", "HOME": ".cache/bubblefit"}
    for name in named:
        monkeypatch.setenv(name, f"/{name}")
    for name, below in named.items():
        assert folders.cache_folder() == Path(f"/{name}", below)
        monkeypatch.delenv(name)


def _compiles(file):
    functions = (n for n in ast.walk(ast.parse(file.read_text())) if isinstance(n, ast.FunctionDef))
    decorators = (d for function in functions for d in function.decorator_list)
    return any("compiled" in ast.unparse(decorator) for decorator in decorators)


def test_every_file_with_compiled_functions_is_among_the_kernels():
    outside = {"tests", "benchmarks", "build", "out"}
    sources = (file.relative_to(folders.ROOT) for file in folders.ROOT.rglob("*.py"))
    ours = [f for f in sources if f.parts[0] not in outside and not f.parts[0].startswith(".")]
    with_kernels = {file.as_posix() for file in ours if _compiles(folders.ROOT / file)}
    assert len(with_kernels) > 5
    assert with_kernels == set(compilation.KERNELS)
    assert len(compilation.KERNELS) == len(with_kernels)


def test_an_edit_reaches_code_compiled_from_another_file_without_a_cache_too(tmp_path):
    package = tmp_path / "copy" / "bubblefit"
    shutil.copytree(
        folders.ROOT,
        package,
        ignore=shutil.ignore_patterns(".*", "out", "tests", "build", "*.egg-info", "__pycache__"),
    )
    before = run(tmp_path / "cache", package.parent)
    assert list((tmp_path / "cache").glob("kernels-*/*.nbi"))
    law = package / "materials" / "pieces.py"
    text = law.read_text()
    edited = text.replace(
        "first + pieces[component, k, 4]", "first + 2.0 * pieces[component, k, 4]"
    )
    assert edited != text
    law.write_text(edited)
    after = run(tmp_path / "cache", package.parent)
    assert after != before
    (tmp_path / "file").write_text("in the way of a cache")
    assert run(tmp_path / "file" / "cache", package.parent) == after


PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
#: Every folder that is a package, found without setuptools.
PACKAGES = {
    ".".join(("bubblefit", *folder.parts))
    for folder in (f.parent.relative_to(ROOT) for f in ROOT.rglob("__init__.py"))
    if not {*folder.parts} & NOT_THE_PRODUCT and not any(p.startswith(".") for p in folder.parts)
}


def site_packages(python):
    code = "import sysconfig; print(sysconfig.get_paths()['purelib'])"
    return Path(output_of(python, "-c", code).strip())


def shipped():
    wanted = {"bubblefit/py.typed", "bubblefit/solvers/calculix/law.c"}
    for package in PACKAGES:
        folder = ROOT.joinpath(*package.split(".")[1:])
        files = [f for f in folder.glob("*.py") if f != ROOT / "setup.py"]
        wanted |= {f"bubblefit/{f.relative_to(ROOT).as_posix()}" for f in files}
    documents = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
    wanted |= {f"bubblefit/{path.relative_to(ROOT).as_posix()}" for path in documents}
    pages = load_script("docs/make_api.py").PAGES  # made when the wheel is built
    wanted |= {f"bubblefit/docs/reference/api/{name}.md" for name in pages}
    for folder in ("examples", "templates", "runs/verification/published"):
        for file in (ROOT / folder).rglob("*"):
            inside = file.relative_to(ROOT)
            if file.is_file() and not any(p.startswith((".", "out")) for p in inside.parts):
                wanted.add(f"bubblefit/{inside.as_posix()}")
    return wanted


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
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
    output_of(sys.executable, "-m", "pip", "--quiet", "wheel", *options, source)
    (built,) = place.glob("*.whl")
    return built


def test_what_builds_the_package_can_fit():
    said = PROJECT["build-system"]["requires"], PROJECT["project"]["dependencies"]
    builds, runs = ({re.split("[>=]", one)[0] for one in names} for names in said)
    assert set(folder.PACKAGES) <= builds <= {*runs, "setuptools"}


def test_versions_agree():
    assert bubblefit.__version__ == PROJECT["project"]["version"]
    assert f"## {bubblefit.__version__}" in (ROOT / "CHANGELOG.md").read_text()


#: Libraries that take a tenth of a second or more to import, or are not there on every machine.
HEAVY = {"numba", "scipy.optimize", "scipy.stats", "matplotlib", "pandas", "pydantic"} | {
    "gmsh", "nlopt", "dask", "h5py", "jinja2"
}  # fmt: skip
KNOWN = "examples/bubble-known-solution/project.toml"


@pytest.mark.parametrize(
    ("code", "absent"),
    [
        ("from bubblefit.cli.main import main; main(['--help'], standalone_mode=False)", HEAVY),
        ("import bubblefit.cli.fits", {"gmsh", "scipy.stats", "dask", "h5py"}),
        ("import bubblefit.project.project", HEAVY - {"numba", "nlopt", "pydantic", "jinja2"}),
        ("import bubblefit", {*HEAVY, "scipy", "click"}),
        ("import bubblefit; [getattr(bubblefit, name) for name in bubblefit.__all__]",
         {"click", "bubblefit.cli"}),
        (f"import bubblefit as b; b.read_project(b.__path__[0] + '/{KNOWN}')",
         {"matplotlib", "gmsh", "click", "numba", "meshio", "h5py", "pandas", "scipy.sparse",
          "scipy.spatial", "scipy.linalg"}),
    ],
)  # fmt: skip
def test_start_up_loads_only_what_it_needs(code, absent):
    # gmsh needs X and GL libraries; the others make `bubblefit --help` slow.
    done = output_of(sys.executable, "-c", f"import sys; {code}; print(*sys.modules)")
    loaded = set(done.splitlines()[-1].split())
    assert not absent & loaded
    if code == "import bubblefit":
        assert len([name for name in loaded if name.split(".")[0] == "bubblefit"]) < 15


def test_documents_that_speak_of_the_thesis_link_to_it():
    for document in (ROOT / "docs").glob("*/*.md"):
        text = re.sub(r"```.*?```|^    .*?$", "", document.read_text(), flags=re.DOTALL | re.M)
        if re.search(r"\bthe thesis\b", text, re.IGNORECASE):
            assert re.search(r"he thesis\]\([./]*references\.md", text), document


def test_every_key_of_the_project_file_is_documented():
    text = (ROOT / "docs" / "reference" / "project-file.md").read_text()

    def keys(annotation):
        for name, field in getattr(annotation, "model_fields", {}).items():
            yield name
            yield from keys(field.annotation)
        for inside in getattr(annotation, "__args__", ()):
            yield from keys(inside)

    models = project_model(frozenset(kind_names())), *solver_sections().values()
    names = {key for model in models for key in keys(model)}
    missing = {key for key in names if not re.search(rf"\b{key}\b", text)}
    assert len(names) > 100 and not missing


@pytest.mark.slow
def test_the_wheel_holds_the_package_and_nothing_else(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    made = r"bubblefit-[^/]+\.dist-info/|bubblefit/kernels-\w+/[^/]+\.nb[ci]$"
    assert {n for n in names if not re.match(made, n)} == shipped()
    (licence,) = [n for n in names if n.endswith("LICENSE")]
    assert "MIT License" in zipfile.ZipFile(wheel).read(licence).decode()


@pytest.mark.slow
def test_the_wheel_works_in_an_empty_environment(wheel, tmp_path, monkeypatch):
    home = tmp_path / "venv"
    output_of(sys.executable, "-m", "venv", "--without-pip", home)
    python, command = home / "bin" / "python", home / "bin" / "bubblefit"
    pip = (sys.executable, "-m", "pip", "--python", python, "install", "--no-deps", "--no-index")
    output_of(*pip, wheel)
    # Empty but for the dependencies, borrowed from this environment. A .pth line is only a
    # path: the editable install of bubblefit that hangs on a .pth over there is not read.
    (site_packages(python) / "borrowed.pth").write_text(f"{site_packages(sys.executable)}\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("PYTHONPATH", raising=False)
    place = output_of(python, "-c", "import bubblefit; print(bubblefit.__file__)")
    assert place.startswith(str(home))
    assert PROJECT["project"]["version"] in output_of(command, "--version")
    output_of(command, "init", "measured", "--example", "measured")
    assert (tmp_path / "measured" / "test3-cubic.toml").exists()
    # A first fit compiles nothing: the kernels came with the package.
    monkeypatch.setenv("BUBBLEFIT_CACHE", str(tmp_path / "cache"))
    example = "bf.__path__[0] + '/examples/biaxial-computed/project.toml'"
    output_of(python, "-c", f"import bubblefit as bf; bf.fit(bf.read_project({example}), starts=1)")
    (came,) = home.glob("lib/python*/site-packages/bubblefit/kernels-*")
    (used,) = tmp_path.glob("cache/kernels-*")
    contents = [{file.name: file.read_bytes() for file in one.iterdir()} for one in (came, used)]
    assert contents[0] == contents[1] and len(contents[0]) > 40
    # Scripts of a user, checked by the types of what is installed; one is run: fit, chart, export.
    shutil.copytree(ROOT / "tests" / "typed", typed := tmp_path / "typed")
    check = ("-m", "mypy", "--strict", "--cache-dir", tmp_path / "types")
    output_of(sys.executable, *check, "--python-executable", python, typed)
    write_two_camera_exports(tmp_path)
    output_of(python, typed / "two_cameras.py")
    assert (tmp_path / "moduli.png").exists() and list((tmp_path / "card").glob("*.inp"))
    assert (tmp_path / "out" / "history.csv").exists()


def test_every_published_table_has_a_source_and_says_its_units(shared_data):
    described = (PUBLISHED / "README.md").read_text()
    tables = {path.name: path.read_bytes() for path in PUBLISHED.glob("*.csv")}
    assert len(tables) == 4
    for name, content in tables.items():
        assert f"| `{name}` |" in described and content.startswith(b"# ")
    there = {path.name: path.read_bytes() for path in (shared_data / "benchmarks").glob("*.csv")}
    assert tables == there
